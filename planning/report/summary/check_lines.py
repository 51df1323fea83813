"""What a plan says of its check from pixels, for a person."""

from collections.abc import Mapping
from typing import Any

from planning.model.plan import RigPlan


def check_lines(plan: RigPlan) -> str:
    """Return the verdict, errors, completeness, and how far the prediction held."""
    check = plan.to_document()["reconstruction"]
    if check is None:
        why = "the run was cut" if plan.to_document()["truncated"] else "--no-check"
        return f"\nNOT CHECKED ({why}): no reconstruction from pixels was made"
    if check["n_merged"] == 0:
        return "\nCHECK    FAILED: no point was measured in the rendered pixels"
    limits = plan.requirements.check
    whole = [
        f"{100 * c['fraction']:.1f} % within {1e3 * c['threshold_m']:.1f} mm"
        for c in check["completeness"]
    ]
    verdict = "passed" if check["passed"] else "FAILED"
    return (
        f"\nCHECK    {verdict}: reconstructed from rendered pixels, "
        f"{check['n_merged']} points of {check['n_points']}\n"
        f"         rms {1e3 * check['accuracy_rms_m']:.3f} mm (limit "
        f"{1e3 * limits.max_rms_m:g}), p95 {1e3 * check['accuracy_p95_m']:.3f} "
        f"({1e3 * limits.max_p95_m:g}), bias {1e3 * check['accuracy_bias_m']:+.3f} "
        f"({1e3 * limits.max_bias_m:g})\n"
        f"         of the target predicted measured: {', '.join(whole)}; "
        f"{100 * check['predicted_missing']:.2f} % missing "
        f"({100 * limits.max_predicted_missing:g} %){_agreement(check)}"
    )


def _agreement(check: Mapping[str, Any]) -> str:
    """How often measured is what was predicted; plans from before don't say."""
    confusion = check.get("confusion")
    if confusion is None:
        return ""
    floors, limits = (confusion["surface"][by] for by in ("floors", "limits"))
    alike, without = floors["agreement"], floors["trivial_agreement"]
    return (
        f"\n         of the whole surface {100 * alike:.1f} % is measured, or not, as "
        f"predicted at physical limits (without a prediction: {100 * without:.1f} %); "
        f"{100 * limits['unexpected']:.1f} % is measured beyond the plan's limits"
    )
