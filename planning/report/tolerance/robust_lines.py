"""What a plan says of rigs that aren't built exactly as planned."""

from planning.model.devices.calibration_errors import PERFECT
from planning.model.document.coverage_records import RobustRecord
from planning.model.plan import RigPlan
from planning.model.words import count_words, labelled, percent
from planning.report.tolerance.asked import FIGURES
from planning.report.tolerance.tolerance_lines import (
    calibration_words,
    mounting_words,
)


def robust_cost(plan: RigPlan, found: RobustRecord) -> list[str]:
    """Return how many devices of each kind the plan has beyond the one without."""
    return [
        f"{count_words(now - before, kind)} more"
        for kind, now, before in (
            ("projector", len(plan.projectors), found.n_projectors_without),
            ("camera", len(plan.cameras), found.n_cameras_without),
        )
        if now != before
    ]


def robust_lines(plan: RigPlan) -> list[str]:
    """Return how many drawn rigs meet what is asked, and what it costs."""
    found, robust = plan.document.robust, plan.requirements.robust
    if found is None or robust is None:
        return []
    required, limits = plan.requirements, plan.requirements.triangulation
    missed, missed_without = (
        "".join(f"; {n} miss {FIGURES[name]}" for name, n in counts.items())
        for counts in (found.missed_by, found.missed_by_without)
    )
    tighter = [
        f"{name} {now:.4g} instead of {before:.4g}{unit}"
        for name, now, before, unit in (
            (
                "lit",
                100 * required.dominant_coverage,
                100 * robust.dominant_coverage,
                " %",
            ),
            ("measured", 100 * required.coverage, 100 * robust.coverage, " %"),
            (
                "regions",
                100 * required.region_coverage,
                100 * robust.region_coverage,
                " %",
            ),
        )
        if now != before
    ]
    lines = [
        f"{found.n_met} of {found.n_drawn} drawn rigs meet what is asked, "
        f"{percent(robust.quantile)} must ({found.least} of them make that as good as "
        f"sure){missed}",
        f"mounted within {mounting_words(robust.mounting)}; calibration leaves "
        f"{calibration_words(limits.calibration or PERFECT)}",
    ]
    if tighter:
        lines.append(f"planned for {', '.join(tighter)}")
    if found.rounds:
        more = robust_cost(plan, found)
        lines.append(
            f"costs {' and '.join(more) or 'no device more'}; without it "
            f"{found.n_met_without} of {found.n_drawn} rigs met it{missed_without}"
        )
    return labelled("ROBUST", lines)
