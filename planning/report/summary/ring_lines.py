"""What a plan says of its rings, and of estimated ranges, for a person."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planning.model.devices.planned import PlannedProjector
from planning.model.document.device_records import ProjectorRecord
from planning.model.document.plan_document import PlanDocument
from planning.model.document.ring_records import (
    OtherRings,
    RingSharesRecord,
    RingsRecord,
)
from planning.model.light.dense_code import DenseCode
from planning.model.plan import RigPlan
from planning.model.words import labelled, percent
from planning.rings.acquisition import n_frames
from planning.rings.ring_stage import tolerance_m

# As many of the chords between rings may err by more than was asked.
_STRAY = 0.01
_MM = 1e3


def code_lines(plan: RigPlan) -> list[str]:
    """Return the summary's lines on dense codes; none where rings are shown."""
    lines = [
        f"{p.id:<4} {p.code.n_frames(p.device.resolution)} frames: {_code_words(p)}"
        for p in plan.projectors
        if p.code is not None
    ]
    return ["", *labelled("CODES", lines)] if lines else []


def _code_words(projector: PlannedProjector) -> str:
    """Which frames tell its pixels."""
    code, resolution = projector.code or DenseCode(), projector.device.resolution
    bits = " + ".join(str(code.bits(n)) for n in resolution)
    stripes = f"{bits} bits of Gray code down to {code.finest_px} px, each inverted"
    if not code.shifts:
        return f"{stripes}; white and black"
    return (
        f"{stripes}; white and black; {code.shifts} + {code.shifts} sinusoids of "
        f"{code.period_px} px"
    )


def ring_lines(plan: RigPlan) -> list[str]:
    """Return the summary's lines on rings; none for plans that don't speak of them."""
    records = plan.document.projectors
    lines: list[str] = []
    for record in records:
        if record.ring_shares is None:
            return []
        lines.append(_line(record, record.ring_shares))
    lines += _axes_lines(plan)
    tolerance = tolerance_m(plan.requirements)
    lines += [note for record in records for note in _notes(record, tolerance)]
    return ["", *labelled("RINGS", lines)] if lines else []


def _line(record: ProjectorRecord, shares: RingSharesRecord) -> str:
    rings, gap = record.rings, ""
    if rings is not None and rings.gap_m is not None:
        low, high = (_MM * value for value in rings.gap_m)
        gap = f", {low:.1f} to {high:.1f} mm apart on the object"
    words = ", ".join(
        f"{_whole(float(np.mean(values)))} ({_whole(min(values))}) {name}"
        for name, values in (
            ("on the object", shares.on_object),
            ("on the target", shares.on_target),
            ("measured", shares.measured),
        )
    )
    whole = sum(share == 1.0 for share in shares.on_object)
    missing = sum(share == 0.0 for share in shares.on_object)
    return (
        f"{record.id:<4} {len(record.ring_radii)} rings{gap}, {whole} wholly on it, "
        f"{missing} miss it; mean (least) share of a ring: {words}"
    )


def _axes_lines(plan: RigPlan) -> list[str]:
    """Where ring axes stand, and what the others would have measured."""
    axes, areas = plan.document.ring_axes, plan.coverage.target
    if axes is None or not areas.lit_m2 > 0.0:
        return []
    share = percent(areas.measured_m2 / areas.lit_m2)
    line = (
        f"{axes.taken} axes: {_rings_words(plan, plan.document.projectors)}, {share} "
        f"of the lit target measured"
    )
    if axes.other is not None:
        line += (
            f"; evenly spaced {axes.other.axis} ones would measure "
            f"{percent(axes.other.measured_m2 / areas.lit_m2)} with "
            f"{_rings_words(plan, axes.other.projectors)}"
        )
    return [line]


def _rings_words(
    plan: RigPlan, projectors: Sequence[ProjectorRecord | OtherRings]
) -> str:
    shown = [
        replace(planned, ring_radii=np.array(other.ring_radii))
        for planned, other in zip(plan.projectors, projectors, strict=True)
    ]
    n_rings = sum(len(one.ring_radii) for one in shown)
    return f"{n_rings} rings in {n_frames(shown, len(plan.cameras))} frames"


def _notes(record: ProjectorRecord, tolerance_m: float) -> list[str]:
    name, rings = record.id, record.rings
    if rings is None:
        return []
    notes: list[str] = []
    if rings.kept_even:
        notes.append(f"{name}: rings stay even, others would lose measured samples")
    if rings.over_tolerance > _STRAY:
        notes.append(
            f"{name}: between rings {percent(rings.over_tolerance)} of the "
            f"target strays more than {_MM * tolerance_m:g} mm from a straight line: "
            f"{_remedy(rings)}"
        )
    creases = rings.creases
    if creases.length_m > 0.0:
        notes.append(
            f"{name}: {_MM * creases.length_m:.0f} mm of creases are lit; between "
            f"rings they are cut by up to {_MM * creases.max_error_m:.2f} mm"
        )
    return notes


def _remedy(rings: RingsRecord) -> str:
    if rings.spacing == "uniform" and not rings.kept_even:
        return 'write spacing = "curvature" under [rings]'
    if rings.spacing == "kept":
        return "its rings are as they were; its pose in a CSV file lets them change"
    return (
        "finer rings can't be told apart; a longer focal length, more views, or a "
        "second sequence with shifted radii would help"
    )


def _whole(share: float) -> str:
    return percent(share, decimals=0)


def range_lines(document: PlanDocument) -> list[str]:
    """Return what a plan says of estimated ranges, for a person; nothing of a mesh."""
    ranges = document.ranges
    if ranges is None:
        return []
    ball = ranges.sphere
    x, y, z = (1e3 * value for value in ball.centre_m)
    radius_sigma = 1e3 * ball.covariance_m2[3][3] ** 0.5
    covered = [row.covered_at_2_sigma for row in document.baselines]
    lines = [
        f"{len(ranges.points)} points: sphere of radius "
        f"{1e3 * ball.radius_m:.1f} +- {radius_sigma:.1f} mm about ({x:.1f}, "
        f"{y:.1f}, {z:.1f}) mm; they stray from it by "
        f"{1e3 * ball.shape_sigma_m:.1f} mm",
        f"kept free of every limit: two sigma of where the surface is, "
        f"{1e3 * ranges.guard_m:.1f} mm or {np.degrees(ranges.guard_rad):.2f} deg",
        f"{covered.count(True)} of {len(covered)} rows of neighbouring "
        f"cameras lie within d_max - 2 sigma",
    ]
    lines += [
        f"point {one.point} (line {', '.join(map(str, one.lines))}) "
        f"refused: {one.reason}"
        for one in ranges.refused
    ]
    return ["", *labelled("RANGES", lines)]
