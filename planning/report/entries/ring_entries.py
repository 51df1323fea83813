"""What a plan's document and its summary say of rings."""

from dataclasses import replace

import numpy as np

from planning.model.document.device_records import (
    ProjectorRecord,
    RingSharesRecord,
    RingsRecord,
)
from planning.model.plan import RigPlan
from planning.report.claims import Devices
from planning.rings.ring_stage import RingStage, tolerance_m

# As many of the chords between rings may err by more than was asked.
_STRAY = 0.01
_MM = 1e3


def evenly_ringed(devices: Devices, stage: RingStage | None) -> Devices:
    """Return the devices with evenly spaced rings, as for cameras not yet known."""
    if stage is None:
        return devices
    projectors = tuple(
        replace(projector, ring_radii=radii)
        for projector, radii in zip(devices.projectors, stage.even_radii, strict=True)
    )
    return replace(devices, projectors=projectors)


def rings_lines(plan: RigPlan) -> list[str]:
    """Return the summary's lines on rings; none for plans that don't speak of them."""
    records = plan.document.projectors
    lines: list[str] = []
    for record in records:
        if record.ring_shares is None:
            return []
        lines.append(_line(record, record.ring_shares))
    tolerance = tolerance_m(plan.requirements)
    lines += [note for record in records for note in _notes(record, tolerance)]
    return [f"{'RINGS' if k == 0 else '':<9}{line}" for k, line in enumerate(lines)]


def _line(record: ProjectorRecord, shares: RingSharesRecord) -> str:
    rings, gap = record.rings, ""
    if rings is not None and rings.gap_m is not None:
        low, high = (_MM * value for value in rings.gap_m)
        gap = f", {low:.1f} to {high:.1f} mm apart on the object"
    words = ", ".join(
        f"{100 * np.mean(values):.0f} % ({100 * min(values):.0f} %) {name}"
        for name, values in (
            ("on the object", shares.on_object),
            ("on the target", shares.on_target),
            ("measured", shares.measured),
        )
    )
    missing = sum(share == 0.0 for share in shares.on_object)
    return (
        f"{record.id:<4} {len(record.ring_radii)} rings{gap}, {missing} of them miss "
        f"it; mean (least) share of a ring: {words}"
    )


def _notes(record: ProjectorRecord, tolerance_m: float) -> list[str]:
    name, rings = record.id, record.rings
    if rings is None:
        return []
    notes: list[str] = []
    if rings.kept_even:
        notes.append(f"{name}: rings stay even, others would lose measured samples")
    if rings.over_tolerance > _STRAY:
        notes.append(
            f"{name}: between rings {100 * rings.over_tolerance:.1f} % of the "
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
    return (
        "finer rings can't be told apart; a longer focal length, more views, or a "
        "second sequence with shifted radii would help"
    )
