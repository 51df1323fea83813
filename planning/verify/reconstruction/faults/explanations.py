"""Changes of one device or the object, fitted to the edges and scored.

A change is scored by the mismatch it leaves, a mean over the pairs of devices of the
mean over each pair's sound edges; without outliers, and whichever pair has most edges.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import DeviceCalibration

from .corrections import Correction, Moves, far_poses, turns_aside
from .fits import fit
from .supposed import Evidence, Places, Role, Supposed, mismatches, places

# A pair's mismatch is the mean of this share of its edges, the rest are outliers.
SOUND_SHARE = 0.85
# No mismatch counts for more, and an edge that misses the object for as much [m].
CAP_M = 5e-3
# While starts are compared, which may be far off [m].
_FAR_CAP_M = 5e-2
# Beyond so many times what is fine, other places than those nearby are looked at.
_FAR_TIMES = 4.0
_ROLES: tuple[Role, Role] = ("cameras", "projectors")
_DEVICE_MOVES: tuple[Moves, ...] = ("zoom",), ("turn",), ("shift",), ("turn", "shift")
_OBJECT_MOVES: tuple[Moves, ...] = (
    ("zoom",),
    ("turn", "shift"),
    ("turn", "shift", "zoom"),
)
_FAR_MOVES: Moves = ("afar", "turn", "shift")
# A change and its parameters.
Start = tuple[Correction, Array]
# Starts are compared on every fourth edge, the best few are fitted.
_THIN = 4
_FITTED_FAR = 12


@dataclass(frozen=True, eq=False)
class State:
    """How the edges lie, were everything as it is supposed.

    Up to a mismatch of `fine_m` [m] nothing is wrong.
    """

    evidence: Evidence
    supposed: Supposed
    fine_m: float

    @cached_property
    def mismatch(self) -> Array:
        """Of each edge [m], shape (n,)."""
        return mismatches(self.evidence, self.supposed, self._places)

    @cached_property
    def _places(self) -> Places:
        return places(self.evidence, self.supposed)

    def misfit(self, chosen: Mask | None = None) -> float:
        """Return the mismatch [m], mean over the pairs of some of the edges."""
        return float(np.mean([*self._misfits(chosen).values()]))

    def _misfits(self, chosen: Mask | None = None) -> dict[tuple[int, int], float]:
        some = np.arange(len(self.evidence)) if chosen is None else chosen
        size = capped(self.mismatch[some], CAP_M)
        devices = self.evidence.projector[some], self.evidence.camera[some]
        pairs = sorted({*zip(*(one.tolist() for one in devices), strict=True)})
        return {
            (p, c): _sound(size[(devices[0] == p) & (devices[1] == c)])
            for p, c in pairs
        }

    def explanations(self) -> list["Explanation"]:
        """Fit every change to the edges that it bears on."""
        off = self._off()
        changes = [
            Correction(role, two, ("swap",))
            for role in _ROLES
            for two in combinations(off[role], 2)
        ]
        every = {role: len(np.unique(self.evidence.index(role))) for role in _ROLES}
        if all(len(off[role]) == every[role] for role in _ROLES):
            changes += [Correction("objects", (0,), moves) for moves in _OBJECT_MOVES]
        tried = [self._fitted(one, np.zeros(one.n_parameters)) for one in changes]
        several = all(len(off[role]) > 1 for role in _ROLES)
        if several and any(e.remaining_m <= self.fine_m for e in tried):
            # No change of one device would do as well.
            return tried
        devices: list[tuple[Role, int]] = [(r, k) for r in _ROLES for k in off[r]]
        for role, index in devices:
            tried += self._nearby(role, index)
        best = min(tried, key=lambda e: e.remaining_m)
        for role, index in devices:
            concerned = self.evidence.index(role) == index
            same = [e for e in tried if np.array_equal(e.concerned, concerned)]
            least = min(e.after.misfit(concerned) for e in (best, *same))
            if least > _FAR_TIMES * self.fine_m:
                tried.append(self._afar(role, index))
        return tried

    def _off(self) -> dict[Role, list[int]]:
        """Devices whose edges are off their rings with all partners, else with some."""
        misfits = self._misfits()
        off: dict[Role, list[int]] = {}
        for enough in (min, max):
            for axis, role in enumerate(reversed(_ROLES)):
                off[role] = [
                    k
                    for k in sorted({pair[axis] for pair in misfits})
                    if enough(m for pair, m in misfits.items() if pair[axis] == k)
                    > self.fine_m
                ]
            if any(off.values()):
                break
        return off

    def _nearby(self, role: Role, index: int) -> list["Explanation"]:
        """Fit the changes of one device that begin where it should stand."""
        zoom, aim, place, pose = (
            Correction(role, (index,), moves) for moves in _DEVICE_MOVES
        )
        device: DeviceCalibration = getattr(self.supposed, role)[index]
        aside = turns_aside(device.world_from_device)
        _, turn = self._nearest([(aim, x) for x in aside])[0]
        return [
            self._fitted(zoom, np.zeros(1)),
            self._fitted(aim, turn),
            self._fitted(place, np.zeros(3)),
            self._fitted(pose, np.append(turn, np.zeros(3))),
        ]

    def _afar(self, role: Role, index: int) -> "Explanation":
        """Fit a device's pose from all about the object."""
        device: DeviceCalibration = getattr(self.supposed, role)[index]
        middle, begin = self.supposed.objects[0].centre, np.zeros(6)
        starts = [
            (Correction(role, (index,), _FAR_MOVES, pose), begin)
            for pose in far_poses(device.world_from_device, middle)
        ]
        fitted = [
            (one, fit(lambda x, one=one: self._changed(one, x, _THIN), begin))
            for one, begin in self._nearest(starts)[:_FITTED_FAR]
        ]
        return self._fitted(*self._nearest(fitted)[0])

    def _nearest(self, starts: list[Start]) -> list[Start]:
        """Return changes and their parameters, those that leave least first."""
        return sorted(
            starts,
            key=lambda one: capped(self._changed(*one, _THIN), _FAR_CAP_M).mean(),
        )

    def _changed(self, correction: Correction, x: Array, step: int = 1) -> Array:
        """Mismatch [m] of every so many edges that a change bears on, after it."""
        chosen = np.flatnonzero(correction.concerns(self.evidence))[::step]
        after, some = correction.apply(self.supposed, x), self.evidence.take(chosen)
        if correction.role == "projectors":
            points, normals = self._places
            return mismatches(some, after, (points[chosen], normals[chosen]))
        return mismatches(some, after, places(some, after))

    def _fitted(self, correction: Correction, start: Array) -> "Explanation":
        x = start
        if len(x):
            x = fit(lambda x: self._changed(correction, x), start)
        after = State(self.evidence, correction.apply(self.supposed, x), self.fine_m)
        return Explanation(correction, self, after)


@dataclass(frozen=True, eq=False)
class Explanation:
    """A fitted change, and how the edges lie before and after it."""

    correction: Correction
    before: State
    after: State

    @cached_property
    def remaining_m(self) -> float:
        """Mismatch that it leaves, mean over the pairs of devices [m]."""
        return self.after.misfit()

    @cached_property
    def concerned(self) -> Mask:
        """Edges that it bears on, shape (n,)."""
        return self.correction.concerns(self.before.evidence)


def capped(mismatch: Array, cap: float) -> Array:
    """Return absolute mismatches, none above a cap; where there is none, the cap."""
    return np.minimum(np.where(np.isfinite(mismatch), np.abs(mismatch), cap), cap)


def _sound(size: Array) -> float:
    """Return the mean of the smaller ones."""
    return float(np.sort(size)[: int(np.ceil(SOUND_SHARE * len(size)))].mean())
