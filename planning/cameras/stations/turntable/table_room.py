"""What stands about a turntable in the room: housings, and obstacles that stand still.

The part turns by places of the lattice and takes with it what is fastened to it. Light
and views of devices meet, at each angle anew, what stands still and the housings of the
others. A housing keeps off what turns at every angle of a turn, in use or not: the
table passes them all.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, product

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.poses import transform
from geometry.shapes.boxes import OrientedBox
from planning.proofs.device_stock import within_stock
from planning.scene.placed_bodies import (
    CLEARANCE_M,
    Device,
    Obstruction,
    blocked_by,
    bodies_of,
    collide,
    placed_box,
)
from planning.scene.scene import Scene
from planning.scene.workspace.admissible import broken_by_body

from .table_lattice import TableLattice
from .table_sets import Place
from .table_sweep import TableSweep


@dataclass(frozen=True, eq=False)
class TableRoom:
    """The room of a lattice.

    Attributes:
        scene: The part, and the obstacles that turn with it.
        lattice: Places of devices.
        points: Samples of the part at angle 0, (n, 3) [m].
        still: Obstacles that stand still.
    """

    scene: Scene
    lattice: TableLattice
    points: Array
    still: tuple[Obstruction, ...] = ()
    _unhidden: dict[tuple[int, int], Mask] = field(default_factory=dict)

    @property
    def is_empty(self) -> bool:
        """Whether nothing can be in the way of light and views."""
        devices = (*self.lattice.projectors, *self.lattice.cameras)
        return not self.still and all(device.body is None for device in devices)

    def begins(self, lamps: Sequence[Place], eyes: Sequence[Place]) -> Ints:
        """Return by how many places devices may be moved on to have room all.

        None, too, where there aren't as many of a model.
        """
        numbers, devices = self._placed(lamps, eyes)
        counts = self.scene.requirements.stock_of
        in_stock = all(
            within_stock(some, counts(kind))
            for kind, some in (
                ("projector", devices[: len(lamps)]),
                ("camera", devices[len(lamps) :]),
            )
        )
        clearance = self.scene.requirements.workspace.clearance_m
        apart = all(
            not collide(a, bodies_of([b]), clearance)
            for a, b in combinations(devices, 2)
        )
        if not (in_stock and apart):
            return np.empty(0, dtype=np.int64)
        free = [
            np.roll(self._standing[number], -place)
            for number, (_, place) in zip(numbers, (*lamps, *eyes), strict=True)
        ]
        return np.flatnonzero(np.all(free, axis=0))

    def clear(
        self, lamps: Sequence[Place], eyes: Sequence[Place], angles: Ints, begins: Ints
    ) -> Iterator[Mask]:
        """Yield which lines of devices to samples are clear, (n_devices, A, n).

        For each number of places that devices are moved on by, and the table likewise;
        other angles than those are False.
        """
        n, places = self.lattice.n_places, [place for _, place in (*lamps, *eyes)]
        numbers, devices = self._placed(lamps, eyes)
        # Among themselves they stand and see the same wherever they begin.
        apart = np.zeros((len(devices), n, len(self.points)), dtype=bool)
        bodies = bodies_of(devices)
        for d, angle in product(range(len(devices)), angles.tolist()):
            blocked = blocked_by(bodies, devices[d], self._turned[angle])
            apart[d, angle] = ~blocked.any(axis=1)
        for by in begins.tolist():
            past = [
                np.roll(self._past_still(number, (place + by) % n), -by, axis=0)
                for number, place in zip(numbers, places, strict=True)
            ]
            yield apart & np.stack(past)

    def _past_still(self, number: int, place: int) -> Mask:
        """Where what stands still isn't between a device and samples, (A, n)."""
        shape = self.lattice.n_places, len(self.points)
        if not self.still:
            return np.ones(shape, dtype=bool)
        if (number, place) not in self._unhidden:
            self.scene.check_cancelled()
            device = self._at(number, place)
            every = np.concatenate(self._turned)
            blocked = np.any(blocked_by(self.still, device, every), axis=1)
            self._unhidden[number, place] = ~np.reshape(blocked, shape)
        return self._unhidden[number, place]

    def _placed(
        self, lamps: Sequence[Place], eyes: Sequence[Place]
    ) -> tuple[list[int], list[Device]]:
        """Numbers of circles, and the devices on them."""
        first = len(self.lattice.projectors)
        numbers = [*(e for e, _ in lamps), *(first + f for f, _ in eyes)]
        return numbers, [
            self._at(number, place)
            for number, (_, place) in zip(numbers, (*lamps, *eyes), strict=True)
        ]

    def _at(self, number: int, place: int) -> Device:
        """The device of a circle at a place; projectors' circles come first."""
        beyond = number - len(self.lattice.projectors)
        if beyond < 0:
            return self.lattice.placed(self.lattice.projectors[number], place)
        return self.lattice.placed(self.lattice.cameras[beyond], place)

    @cached_property
    def sweep(self) -> TableSweep:
        """What turns with the table."""
        table, turning = self.lattice.table, self.scene.obstructions
        return TableSweep.of(self.scene, turning, table)

    @cached_property
    def _turned(self) -> list[Array]:
        """Samples in the room, at each angle."""
        turns = range(self.lattice.n_places)
        angles = (self.lattice.angle(k) for k in turns)
        return [transform(self.lattice.table.turn(a), self.points) for a in angles]

    @cached_property
    def _standing(self) -> list[Mask]:
        """Which places of each circle have room, (n_places,)."""
        circles = (*self.lattice.projectors, *self.lattice.cameras)
        return [
            self.lattice.room(device) & self._housed(number)
            for number, device in enumerate(circles)
        ]

    def _housed(self, number: int) -> Mask:
        """Which places of a circle have room for the housing, (n_places,)."""
        n, space = self.lattice.n_places, self.lattice.space
        every = [self._at(number, k) for k in range(n)]
        if every[0].body is None:
            return np.ones(n, dtype=bool)
        # As the part sees it, it passes all of the circle, wherever on it it stands.
        if not self.sweep.clears(_box(every[0])):
            return np.zeros(n, dtype=bool)
        return np.array(
            [
                not broken_by_body(space, _box(one))
                and not collide(one, self.still, space.clearance_m)
                for one in every
            ]
        )


def room_of(scene: Scene, lattice: TableLattice, points: Array) -> TableRoom:
    """Return the room of a scene whose obstacles may turn with the part or stand still.

    Args:
        scene: With all obstacles.
        lattice: Places of devices.
        points: Samples of the part, (n, 3) [m].
    """
    still = tuple(o for o in scene.obstructions if o.name in lattice.table.still)
    turning = tuple(o for o in scene.obstructions if o not in still)
    return TableRoom(scene.with_obstructions(turning), lattice, points, still)


def _box(device: Device) -> OrientedBox:
    assert device.body is not None
    return placed_box(device.body, device.world_from_device).grown(CLEARANCE_M)
