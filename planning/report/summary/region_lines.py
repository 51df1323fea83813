"""Dominant regions for a person: where they lie, what of them is lit and measured."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from geometry.mesh.mesh import TriangleMesh
from planning.model.document.coverage_records import RegionCoverage, RegionRecord
from planning.model.plan import RigPlan
from planning.model.words import area_words, count_words, labelled, percent
from planning.scene.limits.limit import causes
from planning.scene.limits.projector_limits import PROJECTOR_LIMITS

from .cause_words import areas_line, beside_these, rounded_down

_AXES = "xyz"
# Directions are named by axes that have at least this part of their length.
_TOLD = 0.4
# Nearer to the middle than this part of the object's width is no side.
_MIDDLE = 0.1
# What is lower than this part of its width has no thirds.
_FLAT = 1e-3


def region_words(plan: RigPlan, region: RegionRecord) -> str:
    """Return which region it is: number, size, where it lies and where it faces."""
    return (
        f"region {region.id} ({area_words(region.area_m2)}{region_place(plan, region)})"
    )


def region_lines(plan: RigPlan) -> list[str]:
    """Return how many regions meet the floor, and the worst; none of older plans."""
    n = len(list(_large(plan)))
    if not n:
        return labelled("REGIONS", list(_small_lines(plan)))
    asked = plan.requirements.region_coverage
    met = n - sum(areas.floor == "missed" for _, areas in _large(plan))
    floor = (
        f"{met} of {n} meet the floor, {percent(asked)} of what can be "
        f"{'' if plan.cameras_alone else 'lit and of what can be '}measured"
        if asked
        else f"{count_words(n, 'region')} of at least "
        f"{percent(plan.requirements.region_share)} of the target, no floor"
    )
    region, areas = min(_large(plan), key=lambda pair: min(_shares(pair[1])))
    worst = f"worst: {region_words(plan, region)}, {_deed(plan, areas)}"
    return labelled("REGIONS", [floor, worst, *_small_lines(plan)])


def worst_region(plan: RigPlan) -> str | None:
    """Say of which large region least is lit or measured; None of older plans."""
    large = list(_large(plan))
    if not large:
        return None
    region, areas = min(large, key=lambda pair: min(_shares(pair[1])))
    where = ",".join(region_place(plan, region).split(",")[:3])
    area = area_words(region.area_m2)
    return f"region {region.id} ({area}{where}) {_deed(plan, areas)}"


def _small_lines(plan: RigPlan) -> Iterator[str]:
    """Yield what is said of regions too small for a floor, where some are below it."""
    required, large = plan.requirements, {region.id for region in plan.large_regions}
    small = [region for region in plan.document.regions if region.id not in large]
    below = [
        (region, areas)
        for region in small
        if (areas := region.coverage) is not None
        and areas.samples
        and min(_shares(areas)) < required.region_coverage
    ]
    if not below:
        return
    region, areas = max(below, key=lambda pair: pair[0].area_m2)
    yield (
        f"{len(below)} of {count_words(len(small), 'region')} under "
        f"{percent(required.region_share)} of the target, for which there is no "
        f"floor, would miss it; the largest: {region_words(plan, region)}, "
        f"{_deed(plan, areas)}{''.join(f'; {change}' for change in areas.relaxations)}"
    )


def region_table(plan: RigPlan) -> list[str]:
    """Return every region in a line: size, cone, shares, by which devices, where."""
    large = {region.id for region in plan.large_regions}
    asked = plan.requirements.region_coverage
    lines = [
        "lit is the share of what projectors can reach (of the area), measured that of "
        "what cameras can reach (of what is lit)",
        "region      cm²  cone [deg]  reachable     lit  measurable  measured  "
        f"{'floor':<7} {'by':<24}where, and where it faces",
    ]
    for region in plan.document.regions:
        head = f"{region.id:>6} {1e4 * region.area_m2:8.2f} "
        head += f"{np.degrees(region.cone_angle):11.0f}  "
        areas = region.coverage
        if areas is None or not areas.samples:
            lines.append(
                f"{head}not sampled{region_place(plan, region).replace(',', '', 1)}"
            )
            continue
        lit, measured = _shares(areas)
        reach = percent(areas.reachable_by_projectors_m2 / region.area_m2)
        able = (
            percent(areas.reachable_by_cameras_m2 / areas.lit_m2)
            if areas.lit_m2
            else "-"
        )
        shone = "-" if plan.cameras_alone else percent(lit, asked=asked)
        reach = "-" if plan.cameras_alone else reach
        done = percent(measured, asked=asked) if areas.reachable_by_cameras_m2 else "-"
        floor = areas.floor or ("none" if region.id in large else "small")
        by = " ".join((*region.lit_by, *areas.measured_by)) or "none"
        lines.append(
            f"{head}{reach:>9} {shone:>7}  {able:>10}  {done:>8}  "
            f"{floor:<7} {by:<23}{region_place(plan, region).replace(',', '', 1)}"
        )
    return lines


def floor_shortfalls(plan: RigPlan) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Yield of each region that misses its floor figures, why, and remedies."""
    missed = [(r, areas) for r, areas in _large(plan) if areas.floor == "missed"]
    accepted = min((min(_shares(areas)) for _, areas in missed), default=0.0)
    for region, areas in missed:
        lit, _ = _shares(areas)
        asked = plan.requirements.region_coverage
        unlit = lit < asked
        kind = "projectors" if unlit else "cameras"
        of_light = causes(PROJECTOR_LIMITS)
        why = {
            cause: area
            for cause, area in areas.uncovered_by_cause.items()
            if (cause in of_light) == unlit or cause == "blocked_by_obstacle"
        }
        yield (
            f"region {region.id} {_deed(plan, areas)}, {100 * asked:g} % asked",
            f"{region_words(plan, region)} is {_deed(plan, areas)}, {percent(asked)} "
            f"is required of each region (--region-coverage). Of it: "
            f"{areas_line(why)}.",
            (*_remedies(plan, areas, kind), _accepting(accepted)),
        )


def _remedies(plan: RigPlan, areas: RegionCoverage, kind: str) -> Iterator[str]:
    if plan.document.evaluation is not None:
        yield beside_these(plan.document, kind)
    else:
        allowed = getattr(plan.requirements, f"max_{kind}")
        proof = getattr(plan.document.certificates, kind)
        if allowed is not None and proof.needed.count > allowed:
            yield (
                f"--max-{kind} {proof.needed.count} "
                f"(at least {proof.needed.lower_bound} {proof.candidates.status} over "
                f"the candidates)"
            )
    yield from (f"with these {kind} {change}" for change in areas.relaxations)


def _accepting(share: float) -> str:
    accepted = rounded_down(share) if share > 0.0 else "0"
    return f"--region-coverage {accepted} accepts this plan"


def _large(plan: RigPlan) -> Iterator[tuple[RegionRecord, RegionCoverage]]:
    """Yield the regions that a floor is for, with their areas; none of older plans."""
    for region in plan.large_regions:
        if region.coverage is not None:
            yield region, region.coverage


def _shares(areas: RegionCoverage) -> tuple[float, float]:
    """Lit and measured, of what can be; of nothing all is."""
    lit, measured = (
        part / whole if whole > 0.0 else 1.0
        for part, whole in (
            (areas.lit_m2, areas.reachable_by_projectors_m2),
            (areas.measured_m2, areas.reachable_by_cameras_m2),
        )
    )
    return lit, measured


def _deed(plan: RigPlan, areas: RegionCoverage) -> str:
    asked = plan.requirements.region_coverage
    lit, measured = (percent(share, asked=asked) for share in _shares(areas))
    if plan.cameras_alone:
        if not areas.reachable_by_cameras_m2:
            return "out of reach of every pair of cameras"
        return f"measured {measured} of what can be"
    if not areas.reachable_by_projectors_m2:
        return "out of reach of every projector"
    if not areas.reachable_by_cameras_m2:
        return f"lit {lit} of what can be and measured nowhere"
    return f"lit {lit} and measured {measured} of what can be"


def region_place(plan: RigPlan, region: RegionRecord) -> str:
    """Height and side on the object, by `up` and the axes of the mesh, after ", "."""
    if region.centre_m is None:
        return ""
    up = np.array(plan.requirements.workspace.up)
    mesh, place = plan.surface.mesh, np.array(region.centre_m)
    height = float(place @ up)
    low, high, width = _extent(mesh, tuple(up.tolist()))
    across = (place - mesh.centre) - ((place - mesh.centre) @ up) * up
    beside = np.linalg.norm(across) > _MIDDLE * width
    side = f"towards {_direction(across, up)}" if beside else "about the middle"
    facing = f"facing {_direction(region.mean_normal, up)}"
    if high - low <= _FLAT * width:
        return f", {side}, {facing}"
    third = ("bottom", "middle", "top")[min(int(3 * (height - low) / (high - low)), 2)]
    above = f"{1e3 * (height - low):.0f} mm above the lowest point"
    return f", {third} third, {side}, {above}, {facing}"


@lru_cache(maxsize=1)
def _extent(mesh: TriangleMesh, up: tuple[float, ...]) -> tuple[float, float, float]:
    """Lowest and highest point of a mesh along up, and its width across [m]."""
    heights = mesh.vertices @ np.array(up)
    across = mesh.vertices - heights[:, None] * np.array(up)
    return float(heights.min()), float(heights.max()), float(np.ptp(across, 0).max())


def _direction(vector: ArrayLike, up: ArrayLike) -> str:
    """The axes that a direction goes along, the most first; up and down by name."""
    if not (length := np.linalg.norm(vector)):
        return "all round"
    along = np.asarray(vector) / length
    named = [
        k for k in np.argsort(-np.abs(along), kind="stable") if abs(along[k]) >= _TOLD
    ]
    rise = np.asarray(up)
    return " ".join(
        ("up" if along[k] * rise[k] > 0.0 else "down")
        if rise[k]
        else f"{'+' if along[k] > 0.0 else '-'}{_AXES[k]}"
        for k in named
    )
