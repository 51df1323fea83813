"""Plans side by side: what is asked, stands, is proved, measured and checked."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planning.model.document.certificates import ContinuousProof, NeededCount
from planning.model.document.family_records import FamilyCount, MemberBound
from planning.model.plan import RigPlan
from planning.model.words import share_words
from planning.report.summary.check_lines import missing_words
from planning.report.summary.devices.station_lines import STATIONS, device_counts
from planning.report.summary.family_lines import members_words
from planning.report.summary.shortfall import missing

_NONE = "-"
# Poses are written to 0.01 mm; a turn by as much over a metre.
_SAME = 2e-5
# What else may be asked, by its key in the plan's `request`.
_REQUEST = {
    "max_projectors": "projectors, at most",
    "max_cameras": "cameras, at most",
    "max_heads": "heads, at most",
    "min_reachable": "reachable, asked",
    "region_coverage": "of each region, asked",
    "accuracy_of": "sigma, asked of",
    "up": "up",
    "ring_axis": "ring axis, asked",
    "robust": "drawn rigs that meet it, asked",
    "views": "views, asked",
    "survive": "losses, asked",
    "joint": "sought jointly",
    "cameras_by": "cameras by",
}


@dataclass(frozen=True)
class Row:
    """One figure of two plans, in words; `differs` says whether they are two."""

    what: str
    first: str
    second: str

    @property
    def differs(self) -> bool:
        """Whether the words aren't the same."""
        return self.first != self.second


def compared(first: RigPlan, second: RigPlan) -> list[Row]:
    """Return what two plans say of the same, row by row.

    What is asked seldom has a row only where it differs.
    """
    rows: list[Row] = []
    for part in (_asked, _asked_else, _devices, _coverage, _check):
        sides = dict(part(first)), dict(part(second))
        for name in dict.fromkeys((*sides[0], *sides[1])):
            row = Row(name, *(side.get(name) or _NONE for side in sides))
            if row.differs or (row.first != _NONE and part is not _asked_else):
                rows.append(row)
    shared = str(_same_places(first, second))
    return [*rows, Row("devices at the same place", shared, shared)]


def comparison_lines(rows: Sequence[Row], names: tuple[str, str]) -> list[str]:
    """Return a table; what differs is marked."""
    table = [("", "", *names)]
    table += [("*" if r.differs else "", r.what, r.first, r.second) for r in rows]
    widths = [max(len(line[k]) for line in table) for k in range(4)]
    padded = (
        [word.ljust(wide) for word, wide in zip(line, widths, strict=True)]
        for line in table
    )
    return ["  ".join(line).rstrip() for line in padded]


def _asked(plan: RigPlan) -> Iterator[tuple[str, str]]:
    document, asked = plan.document, plan.requirements
    record = document.own_mesh
    if document.family is not None:
        yield "members", members_words(plan)
    yield "mesh", Path(record.path or "the mesh").name
    x, y, z = 1e3 * np.diff(plan.surface.mesh.bounds, axis=0)[0]
    yield "its size [mm]", f"{x:.1f} x {y:.1f} x {z:.1f}"
    yield "its file", (record.sha256 or _NONE)[:12]
    yield "rig", document.rig.name
    yield "target", asked.target
    yield "pattern", asked.pattern
    if not plan.cameras_alone:
        yield "lit, asked", _words(asked.dominant_coverage)
    yield "measured, asked", _words(asked.coverage)
    limit = asked.triangulation.max_sigma_m
    yield "sigma, asked [mm]", _NONE if limit is None else _exact(1e3 * limit)
    yield "requirements missed", str(len(list(missing(plan))))


def _asked_else(plan: RigPlan) -> Iterator[tuple[str, str]]:
    request = plan.document.request
    yield "light", plan.document.rig.light
    if request is not None:
        for key, name in _REQUEST.items():
            yield name, _words(getattr(request, key))


def _words(value: str | float | bool | None) -> str:
    if value is None:
        return _NONE
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{_exact(100 * value)} %" if isinstance(value, float) else str(value)


def _exact(asked: float) -> str:
    # Two that differ must not look alike, and 57 is no 56.99999999999999.
    return f"{asked:.10g}"


def _devices(plan: RigPlan) -> Iterator[tuple[str, str]]:
    told, document = plan.document.stations, plan.document
    lamps, eyes = device_counts(plan)
    yield "projectors", str(lamps)
    yield "cameras", str(eyes)
    if told is not None:
        yield f"{STATIONS[told.kind]}s", str(len(told.stations))
        if told.count is not None:
            yield f"{STATIONS[told.kind]}s, at least", str(told.count.lower_bound)
        return
    if document.evaluation is not None:
        return
    if (family := document.family) is not None:
        # The certificates are of its worst member alone.
        yield from _bounds(
            "projectors", family.projectors, family.projectors.over_poses
        )
        yield from _bounds("cameras", family.cameras, family.cameras.over_poses)
        return
    proofs = document.certificates
    for kind, proof in (("projectors", proofs.projectors), ("cameras", proofs.cameras)):
        if proof is not None:
            yield from _bounds(kind, proof.needed, proof.continuous)


def _bounds(
    kind: str,
    candidates: NeededCount | FamilyCount,
    everywhere: ContinuousProof | MemberBound | None,
) -> Iterator[tuple[str, str]]:
    yield f"{kind}, at least: candidates", str(candidates.lower_bound)
    if everywhere is not None:
        yield f"{kind}, at least: all poses", str(everywhere.lower_bound)


def _coverage(plan: RigPlan) -> Iterator[tuple[str, str]]:
    areas, sigma = plan.coverage.target, plan.coverage.sigma
    asked = plan.requirements
    yield "target [cm²]", f"{1e4 * areas.area_m2:.2f}"
    if not plan.cameras_alone:
        yield (
            "lit of what can be",
            share_words(
                areas.lit_m2, areas.reachable_by_projectors_m2, asked.dominant_coverage
            ),
        )
    yield (
        "measured of what can be",
        share_words(areas.measured_m2, areas.reachable_by_cameras_m2, asked.coverage),
    )
    yield "measured of the target", share_words(areas.measured_m2, areas.area_m2)
    if sigma is not None:
        yield "sigma, median [mm]", _mm(sigma.median_m)
        yield "sigma, 95 % within [mm]", _mm(sigma.p95_m)


def _check(plan: RigPlan) -> Iterator[tuple[str, str]]:
    check, cost = plan.document.reconstruction, plan.document.cost
    if check is None:
        yield "check from pixels", "none"
    else:
        yield "check from pixels", "passed" if check.passed else "failed"
        yield "its rms [mm]", _mm(check.accuracy_rms_m)
        yield "its p95 [mm]", _mm(check.accuracy_p95_m)
        yield (
            "predicted but missing",
            missing_words(check, plan.requirements),
        )
    yield "frames", str(cost.n_frames)
    if cost.frame_s is not None:
        yield "seconds of a scan", f"{cost.n_frames * cost.frame_s:.2f}"
    told = plan.document.stations
    if told is not None and told.move_s is not None:
        yield "seconds of moves", f"{told.move_s:.1f}"


def _same_places(first: RigPlan, second: RigPlan) -> int:
    """How many devices of one kind both have at one pose."""
    shared = 0
    for a, b in (
        (first.projectors, second.projectors),
        (first.cameras, second.cameras),
    ):
        left = [device.world_from_device for device in b]
        for device in a:
            near = (
                k
                for k, pose in enumerate(left)
                if np.abs(pose - device.world_from_device).max() <= _SAME
            )
            if (k := next(near, None)) is not None:
                left.pop(k)
                shared += 1
    return shared


def _mm(metres: float | None) -> str:
    return _NONE if metres is None else f"{1e3 * metres:.3f}"
