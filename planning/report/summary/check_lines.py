"""What a plan says of its check from pixels and of its cost, for a person."""

from planning.model.document.check_records import ReconstructionRecord
from planning.model.document.plan_document import PlanDocument
from planning.model.plan import RigPlan
from planning.model.requirements import CheckLimits, Requirements
from planning.model.words import count_words, labelled, percent

from .devices.station_lines import moves_words

# Sums of seconds that differ by less are the same [s].
_EXACT = 1e-6


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
    missing = missing_words(check, plan.requirements)
    lines = [
        f"{verdict}: reconstructed from rendered pixels, "
        f"{check.n_merged} points of {check.n_points}",
        error_words(rms, p95, bias, limits) + _left_out(check),
        f"of the target predicted measured: {near}; "
        f"{missing} missing ({100 * limits.max_predicted_missing:g} %)",
    ]
    bounced = check.interreflection
    if bounced and bounced.warning():
        lines.append(f"WARNING: {bounced.warning()}")
    return ["", *labelled("CHECK", lines + _agreement(check))]


def missing_words(check: ReconstructionRecord, asked: Requirements) -> str:
    """Return which share of what was predicted is missing."""
    gone, most = check.predicted_missing or 0.0, asked.check.max_predicted_missing
    return percent(gone, decimals=2, most=most)


def _left_out(check: ReconstructionRecord) -> str:
    """What errors are without; plans from before don't say."""
    left_out, beyond = check.left_out_fraction, check.beyond_1mm_fraction
    if left_out is None or beyond is None:
        return ""
    return (
        f"; {percent(left_out)} of the edges found are left out, "
        f"{percent(beyond, decimals=3)} of the points off by more than 1 mm"
    )


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


def cost_lines(document: PlanDocument) -> list[str]:
    """Return eq. (8) with its terms, for a person."""
    cost, moves = document.cost, moves_words(document)
    if cost.frame_s is None:
        scan = f"a scan is {count_words(cost.n_frames, 'frame')}{moves}"
        unknown = "frame_rate_hz of camera or projector isn't in the rig"
        return labelled("COST", [f"{scan}; {unknown}, so eq. (8) has no t1"])
    acquired = cost.n_frames * cost.frame_s
    frames = f"{cost.n_frames} frames of {1e3 * cost.frame_s:.1f} ms"
    scan = f"{frames}, {acquired:.2f} s{moves}"
    if cost.C is None or cost.t2 is None or cost.t3 is None:
        return labelled("COST", [f"a scan is {scan}"])
    lines = [
        f"a scan is {scan}; {1e-6 * cost.pixels:.1f} Mpx to points "
        f"{cost.pixels * cost.t2:.2f} s, merged {cost.t3:.2f} s",
        f"eq. (8), with planning of {cost.t4:.1f} + {cost.t5:.1f} s: "
        f"C = {cost.C:.1f} s",
    ]
    left_out = sum(len(p.rings.left_out) for p in document.projectors if p.rings)
    for other, what, how in (
        (
            cost.C_before,
            f"with the {count_words(cost.n_cameras_before, 'camera')} of a greedy "
            f"cover",
            "minimising D",
        ),
        (
            cost.C_all_rings if left_out else None,
            f"with the {count_words(left_out, 'ring')} that would miss the object",
            "leaving them out",
        ),
    ):
        if other is not None:
            saved = other - cost.C
            won = f"saved {saved:.2f} s" if saved > _EXACT else "saved nothing"
            lines.append(f"{other:.1f} s {what}: {how} {won}")
    return labelled("COST", lines)


def error_words(rms_m: float, p95_m: float, bias_m: float, limits: CheckLimits) -> str:
    """Return the errors of points from the surface in mm, each with its limit."""
    return (
        f"rms {1e3 * rms_m:.3f} mm (limit {1e3 * limits.max_rms_m:g}), "
        f"p95 {1e3 * p95_m:.3f} ({1e3 * limits.max_p95_m:g}), "
        f"bias {1e3 * bias_m:+.3f} ({1e3 * limits.max_bias_m:g})"
    )
