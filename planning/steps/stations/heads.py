"""A plan of sensor heads, from the candidates to what is written."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planning.cameras.stations.heads.fewest_heads import FoundHeads, fewest_heads
from planning.cameras.stations.heads.head_poses import HeadSource, PlacedHead, widened
from planning.cameras.stations.heads.head_stage import least_by_light, stages_of
from planning.cameras.stations.heads.tour import shortest_way
from planning.cameras.stations.heads.wider_heads import wider_heads
from planning.model.document.station_records import (
    Placement,
    StationCount,
    Stationed,
    StationsRecord,
)
from planning.model.errors import InfeasibleLimitsError
from planning.model.progress import Stopwatch
from planning.model.words import count_words
from planning.proofs import projector_bound
from planning.report.assemble import Draft
from planning.report.partial_plan import PartialPlan, PlanRequest, Prepared
from planning.steps.best_kept import Search
from planning.steps.prepare import prepared
from planning.steps.stages import short_of


def heads_sought(request: PlanRequest, clock: Stopwatch) -> Search[PartialPlan, Draft]:
    """Give the fewest heads, or stations of one; one more where fresh samples ask.

    Raises:
        InfeasibleLimitsError: If no head measures anything.
    """
    head, most = request.rig.head, request.wishes.max_heads
    assert head is not None
    assert most is not None
    ready = prepared(request, clock)
    space = ready.scene.requirements.workspace
    ready = replace(ready, scene=ready.scene.within(widened(space, head)))
    source = HeadSource(
        *(ready.scene, head, space, ready.templates, ready.cameras),
        carried=request.rig.stations is not None,
    )
    found = _fewest(ready, source, most, clock)
    partial = _placed(ready, source, found, None, clock)
    yield partial, False
    with clock.stage("bounds", "bounds over all poses of the workspace"):
        effort = projector_bound.PROVE if request.prove else projector_bound.DEFAULT
        everywhere = least_by_light(ready.scene, found.heads, ready.templates, effort)
    partial = partial.told(count=_count(found, everywhere))
    while True:
        draft = yield partial, True
        assert draft is not None
        short, count = any(short_of(draft)), _count(found, everywhere)
        if not short and (count.needed is None or count.needed > count.count):
            yield partial.told(count=_confirmed(count)), True
        if not short or len(found.chosen) >= most:
            return
        more = found.with_one_more(source)
        if more is None:
            return
        found, asked = more, count_words(len(more.chosen), "head")
        clock.say(f"  fresh samples fall short: {asked}")
        partial = _placed(ready, source, found, everywhere, clock)


def _fewest(
    ready: Prepared, source: HeadSource, most: int, clock: Stopwatch
) -> FoundHeads:
    with clock.stage("heads", "heads: candidates and cover"):
        found = fewest_heads(source, ready.request.rig.n_projector_poses, most)
        if not found.cover.sets.measured.any():
            raise InfeasibleLimitsError(
                f"no head of {len(found.heads)} poses measures any part of the target; "
                f"widen placement.standoff_play_mm, or the limits of the rig"
            )
        clock.say(
            f"  {len(found.chosen)} of {len(found.heads)} candidates; at least "
            f"{found.lower_bound} are needed"
        )
    return found


def _placed(
    ready: Prepared,
    source: HeadSource,
    found: FoundHeads,
    everywhere: int | None,
    clock: Stopwatch,
) -> PartialPlan:
    """Devices of the heads chosen, in the order in which they measure."""
    with clock.stage("heads", "heads: moved to the widest margins"):
        taken = wider_heads(source, found.cover, found.fresh, found.taken)
    heads, way = _in_order(taken, carried=source.carried)
    letter = "S" if source.carried else "H"
    names = [f"{letter}{k + 1}" for k in range(len(heads))]
    placements = tuple(
        Placement(name, one.world_from_head, len(one.projectors), len(one.cameras))
        for name, one in zip(names, heads, strict=True)
    )
    planned = [
        one.named("" if source.head.cross else name)
        for name, one in zip(names, heads, strict=True)
    ]
    reference = [one.named(f"reference {k}") for k, one in enumerate(found.heads)]
    with clock.stage("heads", "heads: what their devices light and measure"):
        lights, views = stages_of(ready.scene, planned, reference)
    record = StationsRecord(
        kind="stations" if source.carried else "heads",
        head=source.head.name,
        cross=source.head.cross,
        stations=(),
        n_reference=len(planned) + len(reference),
        count=_count(found, everywhere),
    )
    stations = ready.request.rig.stations
    if way is not None and stations is not None:
        record = record.changed(way_m=way, move_s=stations.move_s(way, len(heads)))
    return PartialPlan(
        ready,
        lights,
        lights.projectors,
        views,
        views.cameras,
        axes=None,
        stationed=Stationed(placements, record),
    )


def _count(found: FoundHeads, everywhere: int | None) -> StationCount:
    """How many there are, and what is proved of them and `everywhere`."""
    lit, measured = found.cover.asked
    return StationCount(
        count=len(found.chosen),
        needed=found.needed,
        lower_bound=found.lower_bound,
        n_candidates=len(found.heads),
        n_samples=len(found.cover.sets.target),
        lit=lit,
        measured=measured,
        proof=found.proof,
        everywhere=everywhere,
        greedy=found.greedy,
    )


def _confirmed(count: StationCount) -> StationCount:
    """The count of heads that were moved until fresh samples meet all that is asked."""
    n = count.count
    return count.changed(needed=n, lower_bound=min(count.lower_bound, n))


def _in_order(
    heads: Sequence[PlacedHead], *, carried: bool
) -> tuple[list[PlacedHead], float | None]:
    """Heads in the order of the shortest way between them, if one head is carried."""
    if not carried:
        return list(heads), None
    order, way = shortest_way(np.stack([h.world_from_head[:3, 3] for h in heads]))
    return [heads[k] for k in order], way
