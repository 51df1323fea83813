"""A plan of devices before a turntable, from their places to what is written."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import transform
from planning.cameras.stations.heads.head_poses import PlacedHead
from planning.cameras.stations.heads.head_stage import stages_of
from planning.cameras.stations.turntable.fewest_steps import (
    StepSearch,
    pairs_of_counts,
)
from planning.cameras.stations.turntable.standing_steps import Steps
from planning.cameras.stations.turntable.table_lattice import (
    TableLattice,
    about_axis,
    off_axis_m,
)
from planning.cameras.stations.turntable.table_room import TableRoom, room_of
from planning.cameras.stations.turntable.table_sets import TableSets
from planning.model.devices.device_poses import moved_to
from planning.model.document.station_records import (
    Placement,
    StationCount,
    Stationed,
    StationsRecord,
    TradeRow,
)
from planning.model.errors import InfeasibleLimitsError
from planning.model.progress import Stopwatch
from planning.model.words import count_words
from planning.report.assemble import Draft
from planning.report.partial_plan import PartialPlan, PlanRequest, Prepared
from planning.scene.draws import DRAWS
from planning.scene.placed_bodies import Obstruction
from planning.scene.scene import Scene
from planning.steps.best_kept import Search
from planning.steps.prepare import prepared
from planning.steps.stages import short_of

# Numbers of either device that steps are looked for, at most.
_MOST_LAMPS, _MOST_EYES = 2, 3
# Shares that are asked of samples beyond what is required, until fresh ones confirm it.
_SPARE = (0.01, 0.02, 0.04)


@dataclass(frozen=True, eq=False)
class _Traded:
    """The fewest steps for each number of devices looked at so far."""

    rows: tuple[TradeRow, ...]
    found: dict[tuple[int, int], Steps]


def steps_sought(request: PlanRequest, clock: Stopwatch) -> Search[PartialPlan, Draft]:
    """Give the fewest devices, or steps, and one look further where it falls short.

    With a number of cameras given, as few steps as that many devices allow; else as few
    devices as measure enough at all.

    Raises:
        InfeasibleLimitsError: If the devices allowed measure too little at any angle,
            or the part can't be turned.
    """
    ready = prepared(request, clock)
    table = request.rig.turntable
    assert table is not None
    space = ready.scene.requirements.workspace
    table = table.moved(space.origin_m)
    scene = ready.scene.within(about_axis(space, table))
    lattice = TableLattice.about(table, space, ready.templates, ready.cameras)
    with clock.stage("turntable", "turntable: what pairs measure at every angle"):
        target = scene.target_samples(DRAWS.cameras)
        room = room_of(scene, lattice, target.samples.points)
        room.sweep.check(room.still, space)
        scene = room.scene
        sets = TableSets.of(scene, lattice, target)
    search = StepSearch.of(scene, sets, room)
    most = min(table.max_steps or lattice.n_angles, lattice.n_angles)
    partial, first, traded = None, None, _Traded((), {})
    for traded in _trades(search, request, most, clock):
        if partial is None and traded.found:
            first = next(iter(traded.found))
            partial = _placed(ready, search, traded, first, clock)
            yield partial, False
    if partial is None or first is None:
        raise InfeasibleLimitsError(_too_little(request, traded, room, most))
    taken, found = first, traded.found
    if request.wishes.max_cameras is not None:
        taken = min(found, key=lambda pair: (len(found[pair].angles), sum(pair)))
    if taken == first:
        partial = partial.told(steps=traded.rows)
    else:
        partial = _placed(ready, search, traded, taken, clock)
    draft = yield partial, True
    for spare in _SPARE:
        assert draft is not None
        if not any(short_of(draft)):
            return
        clock.say("  fresh samples fall short: more is asked of the others")
        asked = StepSearch.of(_asking_more(scene, spare), sets, room)
        steps, _ = asked.fewest(*taken, most)
        if steps is not None:
            partial = _placed(ready, search, traded, taken, clock, steps)
            draft = yield partial, True


def _too_little(
    request: PlanRequest, traded: _Traded, room: TableRoom, most: int
) -> str:
    """Say that the devices allowed don't do, how far that is known, and what may."""
    lamps, eyes = _counts(request)
    devices = f"{count_words(lamps, 'projector')} and {count_words(eyes, 'camera')}"
    angles = count_words(most, "angle")
    refuted = all(row.lower_bound > most for row in traded.rows)
    lattice, far = room.lattice, ""
    beside = off_axis_m(lattice.table, lattice.space)
    if beside > lattice.space.object_radius_m:
        far = f"; the axis runs {1e3 * beside:.0f} mm beside the middle of the part"
    if refuted:
        said = f"{devices} measure too little of the part at {angles} of the table"
    else:
        said = f"no places of {devices} were found that measure enough at {angles}"
    still = ", ".join(repr(solid.name) for solid in room.still)
    moved = f", or move what stands still: {still}" if still else ""
    return f"{said}{far}; allow more devices or steps, or another axis{moved}"


def _counts(request: PlanRequest) -> tuple[int, int]:
    """Numbers of projectors and cameras that steps are looked for, at most."""
    wishes, there = request.wishes, request.rig.models
    stock = [
        sum(model.table.count or np.inf for model in there(kind))
        for kind in ("projector", "camera")
    ]
    return (
        int(min(wishes.max_projectors, _MOST_LAMPS, stock[0])),
        int(min(wishes.max_cameras or _MOST_EYES, _MOST_EYES, stock[1])),
    )


def _trades(
    search: StepSearch, request: PlanRequest, most: int, clock: Stopwatch
) -> Iterator[_Traded]:
    """Give the fewest steps of each number of devices, one number after another."""
    rows: list[TradeRow] = []
    found: dict[tuple[int, int], Steps] = {}
    for pair in pairs_of_counts(*_counts(request)):
        with clock.stage("turntable", "turntable: the fewest devices and steps"):
            steps, least = search.fewest(*pair, most)
        rows.append(
            _no_worse(
                TradeRow(
                    projectors=pair[0],
                    cameras=pair[1],
                    steps=None if steps is None else len(steps.angles),
                    lower_bound=least,
                ),
                rows,
            )
        )
        if steps is not None:
            found[pair] = steps
            clock.say(
                f"  {count_words(pair[0], 'projector')} and "
                f"{count_words(pair[1], 'camera')}: "
                f"{count_words(len(steps.angles), 'step')}, at least {least}"
            )
        yield _Traded(tuple(rows), dict(found))


def _no_worse(row: TradeRow, before: Sequence[TradeRow]) -> TradeRow:
    """What so many devices need: no more steps than fewer, since some may be left out.

    Such a number isn't refuted of any of them.
    """
    fewer = [
        other
        for other in before
        if other.projectors <= row.projectors and other.cameras <= row.cameras
    ]
    known = [other.steps for other in fewer if other.steps is not None]
    if not known or (row.steps is not None and row.steps <= min(known)):
        return row
    least = min(other.lower_bound for other in (row, *fewer))
    return row.changed(steps=min(known), lower_bound=least)


def _asking_more(scene: Scene, spare: float) -> Scene:
    required = scene.requirements
    shares = {
        name: min(1.0, getattr(required, name) + spare)
        for name in ("coverage", "dominant_coverage", "region_coverage")
        if getattr(required, name)
    }
    return replace(scene, requirements=replace(required, **shares))


def _placed(
    ready: Prepared,
    search: StepSearch,
    traded: _Traded,
    taken: tuple[int, int],
    clock: Stopwatch,
    steps: Steps | None = None,
) -> PartialPlan:
    """The devices at every step, as the part sees them.

    Steps are those found to be the fewest for the devices taken, or others.
    """
    needed = traded.found[taken]
    steps = steps or needed
    lattice = search.sets.lattice
    room = _room(lattice, steps)
    planned: list[PlacedHead] = []
    placements: list[Placement] = []
    for k, place in enumerate(steps.angles.tolist()):
        angle = lattice.angle(place)
        back = lattice.table.turn(-angle)
        planned.append(_turned(room, back).named(f"T{k + 1}"))
        counts = len(room.projectors), len(room.cameras)
        placements.append(Placement(f"T{k + 1}", back, *counts, angle))
    required = search.scene.requirements
    scene = replace(
        search.scene,
        requirements=replace(
            required,
            max_projectors=len(placements) * len(room.projectors),
            max_cameras=len(placements) * len(room.cameras),
        ),
    )
    scene = scene.with_obstructions(
        (*scene.obstructions, *_seen_still(search.room, placements))
    )
    with clock.stage("turntable", "turntable: what the devices light and measure"):
        lights, views = stages_of(scene, planned, [_everything(lattice)])
    record = StationsRecord(
        kind="turntable",
        stations=(),
        count=_count(search, steps, needed),
        point_m=lattice.table.point_m,
        axis=lattice.table.axis,
        move_s=lattice.table.move_s(len(placements)),
        steps=traded.rows,
    )
    return PartialPlan(
        replace(ready, scene=scene),
        lights,
        lights.projectors,
        views,
        views.cameras,
        axes=None,
        stationed=Stationed(tuple(placements), record),
    )


def _room(lattice: TableLattice, steps: Steps) -> PlacedHead:
    """The devices as they stand in the room, which the part sees so at angle 0."""
    return PlacedHead(
        np.eye(4),
        tuple(lattice.placed(lattice.projectors[e], i) for e, i in steps.lamps),
        tuple(lattice.placed(lattice.cameras[f], k) for f, k in steps.eyes),
    )


def _turned(room: PlacedHead, back: Array) -> PlacedHead:
    """Devices as the part sees them when the table has turned."""
    return PlacedHead(
        back,
        tuple(moved_to(p, back @ p.world_from_device) for p in room.projectors),
        tuple(moved_to(c, back @ c.world_from_device) for c in room.cameras),
    )


def _seen_still(
    room: TableRoom, placements: Sequence[Placement]
) -> Iterator[Obstruction]:
    """What stands still as the part sees it at each step."""
    for solid, step in product(room.still, placements):
        back = step.world_from_station
        mesh = TriangleMesh(transform(back, solid.mesh.vertices), solid.mesh.faces)
        name = f"{solid.name} ({step.id})"
        yield replace(solid, name=name, mesh=mesh, station=step.id)


def _everything(lattice: TableLattice) -> PlacedHead:
    """Every place of the lattice, as the set that what can be reached refers to."""
    places = range(lattice.n_places)
    return PlacedHead(
        np.eye(4),
        tuple(lattice.placed(p, k) for p in lattice.projectors for k in places),
        tuple(lattice.placed(c, k) for c in lattice.cameras for k in places),
    )


def _count(search: StepSearch, steps: Steps, needed: Steps) -> StationCount:
    asked, n = search.cover.asked, len(steps.angles)
    return StationCount(
        count=n,
        needed=len(needed.angles),
        lower_bound=needed.lower_bound,
        n_candidates=search.sets.lattice.n_places,
        n_samples=len(search.sets.target),
        lit=asked[0],
        measured=asked[1],
        proof=needed.proof,
    )
