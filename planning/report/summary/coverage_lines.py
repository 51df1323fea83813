"""What a plan lights and measures, and what one device more would, for a person."""

import math
from functools import partial

from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.document.coverage_records import CameraMarginal, ProjectorMarginal
from planning.model.document.plan_document import PlanDocument
from planning.model.plan import RigPlan
from planning.model.words import area_words, labelled, percent, share_words
from planning.report.advice.least_changes import ANY_SETTING

from .cause_words import causes_line
from .proof_lines import user_selection
from .region_lines import region_lines

# Surfaces below this are told in mm² [m²].
_SMALL_M2 = 1e-3
AREA_ROWS = {
    "area": "area_m2",
    "reachable by projectors": "reachable_by_projectors_m2",
    "lit": "lit_m2",
    "reachable by cameras": "reachable_by_cameras_m2",
    "measured": "measured_m2",
}
share_cell = partial(share_words, of_nothing="undefined")


def area_rows(plan: RigPlan) -> dict[str, str]:
    """Return which areas are told of a plan: those of light where there is any."""
    if not plan.cameras_alone:
        return AREA_ROWS
    of_light = ("reachable_by_projectors_m2", "lit_m2")
    return {label: key for label, key in AREA_ROWS.items() if key not in of_light}


def reach_asked(plan: RigPlan, key: str) -> float:
    """Return which share of all an area must be; of most nothing is asked so."""
    reach = "reachable_by_projectors_m2"
    return plan.requirements.min_reachable if key == reach else 0.0


def coverage_lines(plan: RigPlan) -> list[str]:
    """Return the table of areas, both shares, and what is left uncovered."""
    coverage, document = plan.coverage, plan.document
    target, surface = coverage.target, coverage.surface
    chosen = "your selection" if user_selection(plan) else plan.requirements.target
    columns = {f"target ({chosen})": target, "whole surface": surface}
    if chosen == "surface":
        # One surface: that it was sampled twice is no news.
        columns = {"whole surface": target}
    required = plan.requirements
    lit = share_cell(
        *(target.lit_m2, target.reachable_by_projectors_m2), required.dominant_coverage
    )
    measured = share_cell(
        *(target.measured_m2, target.reachable_by_cameras_m2), required.coverage
    )
    table = [f"{'':<25}{''.join(f'{title:>24}' for title in columns)}"]
    for label, key in area_rows(plan).items():
        least = reach_asked(plan, key)
        cells = (area_cell(getattr(a, key), a.area_m2, least) for a in columns.values())
        table.append(f"{label:<25}{''.join(f'{cell:>24}' for cell in cells)}")
    of_light = "" if plan.cameras_alone else f"lit / reachable by projectors {lit}, "
    lines = [
        f"{of_light}measured / reachable by cameras {measured}, on the target, "
        f"{coverage.samples} fresh samples",
    ]
    lines += _sigma_lines(plan)
    if causes := coverage.uncovered_by_cause:
        lines.append(f"not measured: {causes_line(causes, target.area_m2)}")
    if blocked := coverage.blocked_by_obstacle_m2:
        lines.append(_behind(blocked))
    lines += [*_lost_to_mounts(plan), *_apart(document), *_idle(document)]
    return [
        "",
        *labelled("", table),
        *labelled("COVERAGE", lines),
        *region_lines(plan),
        *schedule_lines(document),
    ]


def _sigma_lines(plan: RigPlan) -> list[str]:
    """Say how exact points will be: of noise alone, and with the calibration's part."""
    sigma, limits = plan.coverage.sigma, plan.requirements.triangulation
    if sigma is None:
        return []

    def share(median_m: float, p95_m: float) -> str:
        return f"median {1e3 * median_m:.3f} mm, 95 % within {1e3 * p95_m:.3f} mm"

    limit = limits.max_sigma_m
    at_most = "" if limit is None else f" (limit {1e3 * limit:g})"
    whole = share(sigma.median_m, sigma.p95_m)
    edges = f"predicted sigma along the normal, of {_noise_words(plan)} alone"
    if limits.calibration is None:
        return [f"{edges}: {whole}{at_most}; the rig states no [calibration]"]
    noise = share(sigma.noise_median_m or 0.0, sigma.noise_p95_m or 0.0)
    of_noise = at_most if limits.accuracy_of == "noise" else ""
    of_all = "" if limits.accuracy_of == "noise" else at_most
    terms = ", ".join(f"{k} {1e3 * v:.3f}" for k, v in sigma.terms_rms_m.items())
    return [
        f"{edges}: {noise}{of_noise}",
        f"with what the calibration leaves ({_left_words(limits.calibration)}): "
        f"{whole}{of_all}; rms by term {terms} mm",
    ]


def _noise_words(plan: RigPlan) -> str:
    """Say what noise there is but for the calibration's part, in each pattern."""
    limits = plan.requirements.triangulation
    noise = "noise of matches" if plan.cameras_alone else "edge noise"
    parts = [f"{limits.noise_px:g} px {noise}"]
    codes = [p.code for p in plan.projectors if p.code is not None]
    if not codes and limits.light is not None:
        parts.append("that of the light")
    if codes and not codes[0].shifts:
        parts.append("codes told to a pixel")
    elif codes and limits.light is not None:
        parts.append("that of the phase by the light")
    elif codes:
        parts.append(f"{math.degrees(codes[0].phase_noise):.3g} degrees of phase noise")
    if limits.drawn_edges is not None:
        parts.append("the panel's pixels")
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last


def _left_words(errors: CalibrationErrors) -> str:
    figures = (
        (math.degrees(errors.angle), "deg"),
        (1e3 * errors.position_m, "mm"),
        (1e2 * errors.focal, "% of f"),
        (errors.principal_px, "px"),
    )
    told = ", ".join(f"{value:.3g} {unit}" for value, unit in figures if value)
    return f"{told} of each device"


def _lost_to_mounts(plan: RigPlan) -> list[str]:
    """Say how much more could be reached, were mounts set to anything."""
    coverage, target = plan.coverage, plan.coverage.target
    least = plan.requirements.min_reachable
    return [
        f"{step.change} would let {kind} reach "
        f"{percent(step.reachable_share, asked=least)} of {whole}, not "
        f"{percent(share, asked=least)}"
        for kind, whole, share, steps in (
            (
                "projectors",
                "the target",
                target.reachable_by_projectors_m2 / target.area_m2,
                coverage.relaxations,
            ),
            (
                "cameras",
                "what is lit",
                target.reachable_by_cameras_m2 / max(target.lit_m2, 1e-12),
                coverage.camera_relaxations,
            ),
        )
        for step in steps
        if step.change == ANY_SETTING
    ]


def _behind(blocked: dict[str, float]) -> str:
    """Say what each obstacle costs, the dearest first."""
    ranked = sorted(blocked.items(), key=lambda pair: -pair[1])
    phrases = [f"{name!r} {area_words(area)}" for name, area in ranked if area > 0.0]
    if not phrases:
        return (
            f"obstacles ({', '.join(blocked)}) keep nothing of it from being measured"
        )
    return f"not measured and behind an obstacle: {', '.join(phrases)}"


def _apart(document: PlanDocument) -> list[str]:
    """Say if what groups of cameras measure doesn't overlap."""
    idle = {c.id for c in document.cameras if c.seen_area_m2 == 0.0}
    groups = [g for g in document.camera_groups if not idle.issuperset(g)]
    if len(groups) < 2:
        return []
    names = ", ".join("{" + " ".join(group) + "}" for group in groups)
    return [
        f"the parts of {names} don't overlap: register them by the "
        f"calibrated poses, not by the surface"
    ]


def _idle(document: PlanDocument) -> list[str]:
    areas = (
        *((p.id, "lights", p.lit_area_m2) for p in document.projectors),
        *((c.id, "measures", c.seen_area_m2) for c in document.cameras),
    )
    return [
        f"{name} {does} none of the target" for name, does, area in areas if area == 0.0
    ]


def schedule_lines(document: PlanDocument) -> list[str]:
    """Return what may fire together, in a line; none for one projector."""
    schedule, overlaps = document.firing_schedule, document.overlaps
    if schedule is None or not overlaps:
        return []
    n = schedule.n_groups
    if n == 1:
        return ["FIRING   all projectors together: no two light a surface in common"]
    goes = ", then ".join(" + ".join(group) for group in schedule.groups)
    fewest = {
        "clique": f"fewer won't do: any two of {', '.join(schedule.clique)} light "
        "surface in common",
        "exhaustion": "fewer won't do: every way was tried",
        "none": f"at least {schedule.lower_bound} are needed",
    }[schedule.proof]
    most = max(overlaps, key=lambda overlap: overlap.target_m2)
    share = percent(most.target_m2 / document.coverage.target.area_m2)
    return [
        f"FIRING   {goes}: {n} groups, {fewest}; most shared: "
        f"{' and '.join(most.projectors)}, {share} of the target"
    ]


def area_cell(area_m2: float, whole_m2: float, asked: float = 0.0) -> str:
    """Return an area and its share of a whole, in the unit that suits the whole."""
    small = whole_m2 < _SMALL_M2
    area, unit = (1e6 * area_m2, "mm²") if small else (1e4 * area_m2, "cm²")
    return f"{area:9.1f} {unit} {percent(area_m2 / whole_m2, asked=asked):>8}"


def marginal_lines(plan: RigPlan) -> list[str]:
    """Return the covered share of the target by the number of devices."""
    rows, whole = plan.document.marginal, plan.coverage.target.area_m2
    lit = [row for row in rows if isinstance(row, ProjectorMarginal)]
    measured = [row for row in rows if isinstance(row, CameraMarginal)]
    floor = plan.requirements.region_coverage
    lines = ["what one more or fewer would change (* as planned)"]
    for deed, areas, planned in (
        (
            "projectors lit",
            {row.n_projectors: row.lit_target_m2 for row in lit},
            len(plan.projectors),
        ),
        (
            "cameras    measured",
            {row.n_cameras: row.measured_target_m2 for row in measured},
            len(plan.cameras),
        ),
    ):
        if not areas:
            continue
        cells = [
            f"{n}{'*' * (n == planned)}: {percent(area / whole)}"
            for n, area in areas.items()
        ]
        lines.append(f"{deed} of the target   {'   '.join(cells)}")
    worst = [
        f"{row.n_projectors}{'*' * (row.n_projectors == len(plan.projectors))}: "
        f"region {row.worst_region} {percent(row.worst_region_lit, asked=floor)}"
        for row in lit
        if row.worst_region is not None and row.worst_region_lit is not None
    ]
    if worst:
        lines.insert(2, f"projectors lit of the worst region   {'   '.join(worst)}")
    return ["", *labelled("MARGINAL", lines)]
