"""What a plan's document and its summary say of rings."""

from dataclasses import replace

import numpy as np

from planning.model.document.device_records import (
    ProjectorRecord,
    RingSharesRecord,
    RingsRecord,
)
from planning.model.plan import RigPlan
from planning.report.claims import Claims, Devices
from planning.rings.ring_stage import RingStage
from planning.scene.measured import lit_samples, measured_by
from planning.scene.scene import Scene

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


def lost_to_rings_m2(
    scene: Scene, devices: Devices, stage: RingStage | None, claims: Claims
) -> float:
    """Return the target area that even rings measure and those of the plan don't."""
    even = evenly_ringed(devices, stage).projectors
    target = claims.target_samples
    unmeasured = np.flatnonzero(~claims.measured_by.any(axis=1))
    rows = lit_samples(scene, even, target.take(unmeasured))
    lost = int(measured_by(scene, devices.cameras, rows).any(axis=1).sum())
    return target.samples.weight * lost


def rings_lines(plan: RigPlan) -> list[str]:
    """Return the summary's lines on rings; none for plans that don't speak of them."""
    records = plan.document.projectors
    lines: list[str] = []
    for record in records:
        if record.ring_shares is None:
            return []
        lines.append(_line(record, record.ring_shares))
    lines += [note for record in records for note in _notes(record)]
    lost = plan.coverage.lost_to_rings_m2
    if lost > 0.0:
        share = 100.0 * lost / plan.coverage.target.area_m2
        lines.append(f"{share:.2f} % of the target is measured by even rings only")
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


def _notes(record: ProjectorRecord) -> list[str]:
    name, rings = record.id, record.rings
    if rings is None:
        return []
    notes: list[str] = []
    if rings.kept_even:
        notes.append(f"{name}: rings stay even, others would lose measured samples")
    if rings.over_tolerance > _STRAY:
        notes.append(
            f"{name}: between rings {100 * rings.over_tolerance:.1f} % of the "
            f"target strays more than {_MM * rings.error_tolerance_m:g} mm from a "
            f"straight line: {_remedy(rings)}"
        )
    creases = rings.creases
    if creases.length_m > 0.0:
        notes.append(
            f"{name}: {_MM * creases.length_m:.0f} mm of creases are lit; between "
            f"rings they are cut by up to {_MM * creases.max_error_m:.2f} mm"
        )
    return notes


def _remedy(rings: RingsRecord) -> str:
    if rings.limits_cross <= _STRAY and rings.spacing == "uniform":
        return 'write spacing = "curvature" under [rings]'
    return (
        "finer rings can't be told apart; a longer focal length, more views, or a "
        "second sequence with shifted radii would help"
    )
