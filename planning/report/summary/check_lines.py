"""What a plan says of its check from pixels, for a person."""

from planning.model.document.check_records import ReconstructionRecord
from planning.model.plan import RigPlan


def check_lines(plan: RigPlan) -> str:
    """Return the verdict, errors, completeness, and how far the prediction held."""
    check = plan.document.reconstruction
    if check is None:
        why = "the run was cut" if plan.document.truncated else "--no-check"
        return f"\nNOT CHECKED ({why}): no reconstruction from pixels was made"
    rms, p95, bias = check.accuracy_rms_m, check.accuracy_p95_m, check.accuracy_bias_m
    if rms is None or p95 is None or bias is None:
        return "\nCHECK    FAILED: no point was measured in the rendered pixels"
    limits = plan.requirements.check
    whole = [
        f"{100 * c.fraction:.1f} % within {1e3 * c.threshold_m:.1f} mm"
        for c in check.completeness
    ]
    verdict = "passed" if check.passed else "FAILED"
    return (
        f"\nCHECK    {verdict}: reconstructed from rendered pixels, "
        f"{check.n_merged} points of {check.n_points}\n"
        f"         rms {1e3 * rms:.3f} mm (limit "
        f"{1e3 * limits.max_rms_m:g}), p95 {1e3 * p95:.3f} "
        f"({1e3 * limits.max_p95_m:g}), bias {1e3 * bias:+.3f} "
        f"({1e3 * limits.max_bias_m:g})\n"
        f"         of the target predicted measured: {', '.join(whole)}; "
        f"{100 * (check.predicted_missing or 0.0):.2f} % missing "
        f"({100 * limits.max_predicted_missing:g} %){_agreement(check)}"
    )


def _agreement(check: ReconstructionRecord) -> str:
    """How often measured is what was predicted; plans from before don't say."""
    if check.confusion is None:
        return ""
    floors, limits = check.confusion.surface.floors, check.confusion.surface.limits
    alike, without = floors.agreement, floors.trivial_agreement
    return (
        f"\n         of the whole surface {100 * alike:.1f} % is measured, or not, as "
        f"predicted at physical limits (without a prediction: {100 * without:.1f} %); "
        f"{100 * limits.unexpected:.1f} % is measured beyond the plan's limits"
    )
