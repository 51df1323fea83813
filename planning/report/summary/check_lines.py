"""What a plan says of its check from pixels and of its cost, for a person."""

from planning.model.document.check_records import ReconstructionRecord
from planning.model.document.plan_document import CostRecord
from planning.model.plan import RigPlan
from planning.model.words import count_words, error_words, labelled, percent


def unchecked(plan: RigPlan) -> str:
    """Return that a plan wasn't checked, and why; nothing of one that was."""
    if plan.document.reconstruction is not None:
        return ""
    why = "the run was cut" if plan.document.truncated else "--no-check"
    return f"NOT CHECKED ({why})"


def check_lines(plan: RigPlan) -> list[str]:
    """Return the verdict, errors, completeness, and how far the prediction held."""
    check = plan.document.reconstruction
    if check is None:
        return ["", f"{unchecked(plan)}: no reconstruction from pixels was made"]
    rms, p95, bias = check.accuracy_rms_m, check.accuracy_p95_m, check.accuracy_bias_m
    if rms is None or p95 is None or bias is None:
        return ["", "CHECK    FAILED: no point was measured in the rendered pixels"]
    limits = plan.requirements.check
    near = ", ".join(
        f"{percent(c.fraction)} within {1e3 * c.threshold_m:.1f} mm"
        for c in check.completeness
    )
    verdict = "passed" if check.passed else "FAILED"
    missing = percent(check.predicted_missing or 0.0, decimals=2)
    lines = [
        f"{verdict}: reconstructed from rendered pixels, "
        f"{check.n_merged} points of {check.n_points}",
        error_words(rms, p95, bias, limits),
        f"of the target predicted measured: {near}; "
        f"{missing} missing ({100 * limits.max_predicted_missing:g} %)",
    ]
    return ["", *labelled("CHECK", lines + _agreement(check))]


def _agreement(check: ReconstructionRecord) -> list[str]:
    """How often measured is what was predicted; plans from before don't say."""
    if check.confusion is None:
        return []
    floors, limits = check.confusion.surface.floors, check.confusion.surface.limits
    alike, without = percent(floors.agreement), percent(floors.trivial_agreement)
    return [
        f"of the whole surface {alike} is measured, or not, as predicted at physical "
        f"limits (without a prediction: {without}); {percent(limits.unexpected)} is "
        f"measured beyond the plan's limits"
    ]


def cost_lines(cost: CostRecord) -> list[str]:
    """Return eq. (8) with its terms, for a person; nothing where C is unknown."""
    if cost.C is None or cost.C_before is None:
        return []
    per_pixel = " + ".join(f"{1e6 * (t or 0.0):.2f}" for t in (cost.t1, cost.t2))
    once = " + ".join(f"{t or 0.0:.1f}" for t in (cost.t3, cost.t4, cost.t5))
    n = cost.n_cameras_before
    lines = [
        f"eq. (8): {1e-6 * cost.pixels:.1f} Mpx x ({per_pixel}) us + "
        f"{once} s = {cost.C:.1f} s of processor time",
        f"with the {count_words(n, 'camera')} of a greedy cover, before D was "
        f"minimised: {cost.C_before:.1f} s",
    ]
    return labelled("COST", lines)
