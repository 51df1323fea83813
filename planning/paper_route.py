"""The paper's route to the cameras: the largest baselines first, their number follows.

1. Seed: cameras on a ring, at the pitch of the closed forms (`ring_seeds`), about
   several axes; the seed grows while rays say that too little is measured.
2. Neighbours slide apart to the limit (10).
3. A camera whose loss the rest can bear goes, or can once they have closed the gap to
   that limit. Again from 2, until none can go.

Source: Lee and Krim, 2014, section VI; `docs/baselines.md`, *The two routes*.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel

from .camera_spread import CameraSpread
from .limit_poses import Parts, limit_poses
from .plan import PlannedCamera
from .ring_seeds import Ring, ring_seeds
from .seams import Adjacency, adjacency
from .spread_problem import SpreadLimits

_Array = NDArray[np.float64]
_Measured = NDArray[np.bool_]
Cameras = tuple[PlannedCamera, ...]

# Rings that are grown where they must, of either rank.
_SEEDS = 2
# Directions looked at for a camera that is added, over what is left.
_OVER_LEFT = 12
_TRIED = 4
# Turns about the centre by which cameras close a gap [rad].
_TURNS = np.radians([3.0, 8.0, 18.0])
_AZIMUTHS = 6
_SWEEPS = 3
# Share of a seam that may be past the limit where a camera moves to it.
_GIVEN_UP = (0.1,)
_BISECTIONS = 8
# A gap wider than this share of what is required isn't closed by turns like these.
_CLOSABLE = 0.2
# Counts beyond the final one for which cameras are wanted.
_MORE = 2
_MOST = 64


@dataclass(frozen=True, eq=False)
class Ground:
    """What the route stands on: samples, rays, and places to stand.

    Attributes:
        points: Lit samples in [m], shape (n, 3).
        normals: Unit face normals, shape (n, 3).
        measure: Which camera measures which sample, but for each other's bodies.
        together: The same with all their bodies in place; nothing where they don't fit.
        stand: Cameras in directions (k, 3) from the centre, where some may stand.
        slide: Slides cameras apart to the limit (10), losing nothing.
        device: Optics of a camera.
        ring_radius: Distance from the centre at which cameras are offered [m].
        limits: What binds a camera.
        required: Samples that must be measured.
        given: Cameras that stand already.
    """

    points: _Array
    normals: _Array
    measure: Callable[[Sequence[PlannedCamera]], _Measured]
    together: Callable[[Sequence[PlannedCamera]], _Measured]
    stand: Callable[[_Array], Cameras]
    slide: Callable[[Sequence[PlannedCamera]], CameraSpread]
    device: PinholeModel
    ring_radius: float
    limits: SpreadLimits
    required: int
    given: Cameras = ()

    @cached_property
    def adjacent(self) -> Adjacency:
        """Near samples of each."""
        return adjacency(self.points, self.normals)

    def parts(self, measured_by: _Measured) -> Parts:
        """Return the samples with what cameras measure of them."""
        return Parts(self.points, self.normals, self.adjacent, measured_by)


@dataclass(frozen=True, eq=False)
class Stand:
    """Cameras as they stand, given ones first.

    Attributes:
        cameras: The cameras.
        measured: Which measures which sample, shape (n, k).
    """

    cameras: Cameras
    measured: _Measured

    @property
    def rows(self) -> int:
        """Samples that any of them measures."""
        return int(self.measured.any(axis=1).sum())

    def without(self, camera: int) -> "Stand":
        """Return the others, as far as bodies don't count."""
        rest = [i for i in range(len(self.cameras)) if i != camera]
        return Stand(tuple(self.cameras[i] for i in rest), self.measured[:, rest])


@dataclass(frozen=True, eq=False)
class PaperRoute:
    """Where the route ended.

    Attributes:
        stand: The cameras, and what they measure.
        by_count: Cameras for 1, 2, ... of them, on the way and beyond; those of the
            final count slid apart.
        met: Whether they measure what is required.
        best_without_one: Most samples that one camera fewer was found to measure.
    """

    stand: Stand
    by_count: dict[int, Cameras]
    met: bool
    best_without_one: int


def paper_route(ground: Ground) -> PaperRoute:
    """Plan cameras by the largest baselines alone.

    Args:
        ground: Samples, rays and limits.

    Returns:
        Cameras that measure the required samples; as many as could be found where
        nothing more helps.
    """
    by_count: dict[int, Cameras] = {}
    stand, best_without_one = _best_start(ground, by_count)
    while len(stand.cameras) > len(ground.given):
        slid = ground.slide(stand.cameras)
        stand = Stand(slid.cameras, slid.measured_by)
        by_count[len(stand.cameras)] = stand.cameras
        fewer = _one_fewer(ground, stand, most=1)
        best_without_one = max(best_without_one, 0 if fewer is None else fewer.rows)
        if fewer is None or fewer.rows < ground.required:
            break
        stand, best_without_one = _fewest(ground, fewer, by_count)
        stand = _swept(ground, stand)
    _fill(ground, stand, by_count)
    by_count.pop(0, None)
    met = stand.rows >= ground.required
    return PaperRoute(stand, by_count, met, best_without_one)


def _best_start(ground: Ground, by_count: dict[int, Cameras]) -> tuple[Stand, int]:
    """What is left of the best ring, when none can go; and what one fewer measured.

    The ring that measures most isn't always the one that can spare a camera.
    """
    seeds = _seeds(ground)
    most = min(seeds, key=lambda seed: _rank(ground, seed))
    spare = min(seeds, key=lambda seed: _rank_by_spare(ground, seed))
    found, trail = _fewest(ground, most, by_count), {}
    if spare is not most:
        other = _fewest(ground, spare, trail)
        if _rank(ground, other[0])[:2] < _rank(ground, found[0])[:2]:
            by_count.update(trail)
            found = other
    return _swept(ground, found[0]), found[1]


def _fewest(
    ground: Ground, stand: Stand, by_count: dict[int, Cameras]
) -> tuple[Stand, int]:
    """Let cameras go as long as one can; and what was measured without one more."""
    while True:
        by_count[len(stand.cameras)] = stand.cameras
        fewer = _one_fewer(ground, stand)
        if fewer is None or fewer.rows < ground.required:
            return stand, 0 if fewer is None else fewer.rows
        stand = fewer


def _seeds(ground: Ground) -> list[Stand]:
    """Rings that promise most, grown and thinned."""
    return [
        _thinned(ground, _grown(ground, _bearing(ground, ring)))
        for ring in _rings(ground)
    ]


def _rings(ground: Ground) -> list[Stand]:
    """The most promising rings; at least the given cameras, where there is none."""
    space = ground.limits.workspace
    rings = list(
        ring_seeds(
            ground.points,
            space,
            ground.device,
            ground.ring_radius,
            ground.limits.max_incidence,
        )
    )
    given = Stand(ground.given, ground.measure(ground.given))
    stands = [given, *_stood(ground, rings, given)]
    thinned = [_thinned(ground, stand) for stand in stands]
    best: dict[int, None] = {}
    for rank in (_rank, _rank_by_spare):
        ranks = [rank(ground, stand) for stand in thinned]
        best |= dict.fromkeys(sorted(range(len(ranks)), key=ranks.__getitem__)[:_SEEDS])
    return [thinned[i] for i in best]


def _stood(ground: Ground, rings: Sequence[Ring], given: Stand) -> list[Stand]:
    """Rings with what their cameras measure, all looked at in one go."""
    groups = [ground.stand(ring.directions) for ring in rings]
    every = [camera for group in groups for camera in group]
    if not every:
        return []
    measured = ground.measure(every)
    ends = np.cumsum([len(group) for group in groups])
    return [
        Stand(
            (*given.cameras, *group),
            np.concatenate(
                [given.measured, measured[:, end - len(group) : end]], axis=1
            ),
        )
        for group, end in zip(groups, ends, strict=True)
    ]


def _rank(ground: Ground, stand: Stand) -> tuple[int, int, int]:
    """Least for what meets the requirement with fewest, then for most measured."""
    short = max(ground.required - stand.rows, 0)
    return short, len(stand.cameras), -stand.rows


def _rank_by_spare(ground: Ground, stand: Stand) -> tuple[int, int, int]:
    """The same, but last for what most is measured of with one camera fewer."""
    short, count, rows = _rank(ground, stand)
    free = _least_missed(ground, stand)
    return short, count, -stand.without(free[0]).rows if free else rows


def _bearing(ground: Ground, stand: Stand) -> Stand:
    """Those that bear each other's bodies, the one that measures most set first."""
    n_given = len(ground.given)
    together = ground.together(stand.cameras) if stand.cameras else stand.measured
    if np.array_equal(together, stand.measured):
        return stand
    kept = Stand(ground.given, ground.together(ground.given))
    order = np.argsort(-stand.measured[:, n_given:].sum(axis=0), kind="stable")
    for i in order:
        cameras = (*kept.cameras, stand.cameras[n_given + int(i)])
        trial = Stand(cameras, ground.together(cameras))
        if trial.rows > kept.rows:
            kept = trial
    return kept


def _grown(ground: Ground, stand: Stand) -> Stand:
    """Return a stand with cameras added until enough is measured, or none helps."""
    while stand.rows < ground.required and len(stand.cameras) < _MOST:
        more = _one_more(ground, stand)
        if more is None:
            break
        stand = more
    return stand


def _one_more(ground: Ground, stand: Stand) -> Stand | None:
    """Return the stand with the camera that measures most of what is left."""
    left = np.flatnonzero(~stand.measured.any(axis=1))
    offered = ground.stand(_over(ground, left))
    if not len(left) or not offered:
        return None
    gain = ground.measure(offered)[left].sum(axis=0)
    for i in np.argsort(-gain, kind="stable")[:_TRIED]:
        cameras = (*stand.cameras, offered[int(i)])
        more = Stand(cameras, ground.together(cameras))
        if gain[i] and more.rows > stand.rows:
            return more
    return None


def _over(ground: Ground, left: NDArray[np.int64]) -> _Array:
    """Directions from the centre of places square over samples that face apart."""
    chosen: list[int] = []
    normals = ground.normals[left]
    nearest = np.full(len(left), -2.0)
    middle = normals.sum(axis=0)
    while len(chosen) < min(_OVER_LEFT, len(left)):
        # First the one most like all, then always the one least like those taken.
        pick = int(np.argmin(nearest) if chosen else np.argmax(normals @ middle))
        chosen.append(pick)
        nearest = np.maximum(nearest, normals @ normals[pick])
    rows = left[chosen]
    centre = np.array(ground.limits.workspace.centre)
    places = ground.points[rows] + ground.ring_radius * ground.normals[rows] - centre
    return places / np.linalg.norm(places, axis=1, keepdims=True)


def _thinned(ground: Ground, stand: Stand) -> Stand:
    """Drop cameras as long as the rest measures enough."""
    enough = min(ground.required, stand.rows)
    while len(stand.cameras) > len(ground.given):
        fewer = stand.without(_least_missed(ground, stand)[0])
        if fewer.rows < enough:
            break
        stand = fewer
    return stand


def _least_missed(ground: Ground, stand: Stand) -> list[int]:
    """Cameras that may go, the one that measures least alone first."""
    alone = stand.measured.sum(axis=1) == 1
    sole = stand.measured[alone].sum(axis=0)
    order = [int(i) for i in np.argsort(sole, kind="stable")]
    return [i for i in order if i >= len(ground.given)]


def _one_fewer(ground: Ground, stand: Stand, most: int = 3) -> Stand | None:
    """Return the best of one camera fewer, the gap closed; None where none may go."""
    best: Stand | None = None
    for out in _least_missed(ground, stand)[:most]:
        rest = stand.without(out)
        if ground.required - rest.rows <= _CLOSABLE * ground.required:
            rest = _closed(ground, rest)
        if best is None or rest.rows > best.rows:
            best = rest
        if best.rows >= ground.required:
            break
    return best


def _closed(ground: Ground, stand: Stand) -> Stand:
    """Move cameras over the gap until enough is measured, or too little helps."""
    for sweep in range(_SWEEPS):
        short = ground.required - stand.rows
        if short <= 0:
            break
        before = stand.rows
        stand = _swept(ground, stand, to_limit=sweep == 0)
        # Less than half of what is missing won't do in what is left of the sweeps.
        if 2 * (stand.rows - before) < short:
            break
    return stand


def _swept(ground: Ground, stand: Stand, *, to_limit: bool = False) -> Stand:
    """Move one camera after the other to where all together measure most."""
    for camera in range(len(ground.given), len(stand.cameras)):
        offered = _turned(ground, stand, camera)
        if to_limit:
            offered += _to_limit(ground, stand, camera)
        stand = _moved(ground, stand, camera, offered)
    return stand


def _moved(ground: Ground, stand: Stand, camera: int, offered: Cameras) -> Stand:
    """Return the stand with a camera at the best of its poses, or as it was."""
    if not offered:
        return stand
    others = stand.without(camera).measured.any(axis=1)
    gain = ground.measure(offered)[~others].sum(axis=0)
    best = int(np.argmax(gain))
    if gain[best] <= stand.rows - int(others.sum()):
        return stand
    cameras = list(stand.cameras)
    cameras[camera] = offered[best]
    moved = Stand(tuple(cameras), ground.together(cameras))
    return moved if moved.rows > stand.rows else stand


def _turned(ground: Ground, stand: Stand, camera: int) -> Cameras:
    """Poses around one, turned about the centre."""
    centre = np.array(ground.limits.workspace.centre)
    pose = stand.cameras[camera].world_from_device
    outwards = pose[:3, 3] - centre
    outwards = outwards / np.linalg.norm(outwards)
    # Side by side a device's own x may lie along the line to the centre.
    x = pose[:3, 0] - (pose[:3, 0] @ outwards) * outwards
    x = x / np.linalg.norm(x)
    y = np.cross(outwards, x)
    azimuth = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    aside = np.cos(azimuth)[:, None] * x + np.sin(azimuth)[:, None] * y
    turned = [np.cos(t) * outwards + np.sin(t) * aside for t in _TURNS]
    return ground.stand(np.concatenate(turned))


def _to_limit(ground: Ground, stand: Stand, camera: int) -> Cameras:
    """Poses of one at d_max from its neighbours."""
    parts = ground.parts(stand.measured)
    found = limit_poses(
        stand.cameras,
        parts,
        ground.limits,
        only=camera,
        given_up=_GIVEN_UP,
        bisections=_BISECTIONS,
    )
    return tuple(found)


def _fill(ground: Ground, stand: Stand, by_count: dict[int, Cameras]) -> None:
    """Note cameras for every count up to some more than the final one."""
    fewer = stand
    while len(fewer.cameras) > max(1, len(ground.given)):
        fewer = fewer.without(_least_missed(ground, fewer)[0])
        by_count[len(fewer.cameras)] = fewer.cameras
    for _ in range(_MORE):
        more = _one_more(ground, stand)
        if more is None:
            break
        stand = more
        by_count[len(stand.cameras)] = stand.cameras
