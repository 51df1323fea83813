"""Devices of both kinds moved together: with one left out, or to where margins are.

Poses close around all devices are offered at once, from less and less far, and are
exchanged (`exchange`) for those that stand: rays decide on every one of them. First for
what is lacking, then for slack. Samples that are fresh confirm elsewhere.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import TypeVar

import numpy as np

from planning.projectors.candidate_set import CandidateSource
from planning.proofs.quotas import Quotas
from planning.report.partial_plan import PartialPlan
from planning.scene.bodies.clearance import with_clearance
from planning.scene.placed_bodies import movable
from planning.scene.samples import Target

from .completed import Cameras, Costs, Projectors
from .exchange import Exchange
from .offer import JointOffer, devices_of, with_axes
from .tables import JointTables

_D = TypeVar("_D")
# Poses around each device.
_AROUND = 24
# How far out poses are offered, in spacings of the candidates.
_SCALES = (1.0, 0.5, 0.25, 0.125)
# Devices that are left out at first: those without which least is lacking. Of these
# sets those are moved that lack least after exchanges, and little of all samples.
_TRIED, _PURSUED, _LACKING = 4, 2, 0.08
# Of what must be lit and measured, kept to spare so that fresh samples agree.
_SPARE = 0.01


def one_device_fewer(
    partial: PartialPlan, offer: JointOffer, costs: Costs
) -> tuple[Projectors, Cameras] | None:
    """Return devices that do with one of those of a plan left out, if any were found.

    Each is left out in turn, the others are exchanged for candidates, and those that
    then lack least are moved.
    """
    lit, measured = _spared(offer.lit), _spared(offer.measured)
    asked = lit.total + measured.total
    starts = sorted(
        _left_out(partial, offer, costs, lit, measured),
        key=lambda one: (one.score, costs.both(*_of(one))),
    )
    for start in starts[:_PURSUED]:
        if start.score[0] > _LACKING * asked:
            break
        moved = _moved(partial, offer.tables.target, start)
        if moved.score[0] == 0:
            return _of(moved)
    return None


def wider_slack(
    partial: PartialPlan, offer: JointOffer
) -> tuple[Projectors, Cameras] | None:
    """Return as many devices whose slack at the required share is larger."""
    target = offer.tables.target
    tables = JointTables.of(partial.scene, target, partial.projectors, partial.cameras)
    start = Exchange(
        tables,
        _spared(offer.lit).as_far_as(np.any(tables.lit, axis=1)),
        _spared(offer.measured).as_far_as(np.any(tables.pairs, axis=(1, 2))),
        [*range(len(partial.projectors))],
        [*range(len(partial.cameras))],
    )
    moved = _moved(partial, target, start, wide=True)
    return _of(moved) if moved.score < start.score else None


def _left_out(
    partial: PartialPlan,
    offer: JointOffer,
    costs: Costs,
    lit: Quotas,
    measured: Quotas,
) -> Iterator[Exchange]:
    """Yield what is left without each device of a plan, after exchanges."""
    tables = JointTables.of(
        partial.scene,
        offer.tables.target,
        (*partial.projectors, *offer.tables.projectors),
        (*partial.cameras, *offer.tables.cameras),
    )
    lights = [*range(len(partial.projectors))]
    views = [*range(len(partial.cameras))]
    left = [([q for q in lights if q != p], views) for p in lights if len(lights) > 1]
    left += [(lights, [d for d in views if d != c]) for c in views if len(views) > 1]
    starts = [Exchange(tables, lit, measured, *devices) for devices in left]
    starts.sort(key=lambda one: (one.score, costs.both(*_of(one))))
    for start in starts[:_TRIED]:
        start.run()
        yield start


def _moved(
    partial: PartialPlan, target: Target, start: Exchange, *, wide: bool = False
) -> Exchange:
    """Exchange devices for poses around them, until nothing lacks or all is tried."""
    found = start
    for scale in _SCALES:
        if found.score[0] == 0 and not wide:
            break
        projectors, cameras = _of(found)
        lights, views = _around(partial, projectors, cameras, scale)
        tables = JointTables.of(
            partial.scene, target, (*projectors, *lights), (*cameras, *views)
        )
        found = Exchange(
            tables,
            found.lit,
            found.measured,
            [*range(len(projectors))],
            [*range(len(cameras))],
        )
        found.run()
    return found


def _around(
    partial: PartialPlan, projectors: Projectors, cameras: Cameras, scale: float
) -> tuple[Projectors, Cameras]:
    """Return poses around devices, so many spacings of their candidates away."""
    ready, scene = partial.ready, partial.scene
    rig = ready.request.rig
    source = CandidateSource(scene, ready.templates)
    every = rig.n_projector_poses * len(ready.templates)
    near = _some(source.around(projectors, every, scale), len(projectors))
    lights = with_axes(partial, near)
    every = rig.n_camera_poses * len(ready.cameras)
    offer = scene.candidates(ready.cameras)
    views = with_clearance(scene, offer.around(movable(cameras), every, scale))
    return lights, _some(views, len(cameras))


def _some(poses: tuple[_D, ...], n_devices: int) -> tuple[_D, ...]:
    """Return as many poses for each device as tables have room for, evenly taken."""
    most = min(len(poses), _AROUND * n_devices)
    return tuple(poses[k * len(poses) // most] for k in range(most))


def _of(found: Exchange) -> tuple[Projectors, Cameras]:
    return devices_of(found.tables, found.projectors, found.cameras)


def _spared(quotas: Quotas) -> Quotas:
    return replace(quotas, total=int((1.0 + _SPARE) * quotas.total))
