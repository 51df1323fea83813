"""Changes of one device or the object, fitted to the edges and scored.

A change is scored by the mismatch it leaves, a mean over the pairs of devices of the
mean over each pair's sound edges; without outliers, and whichever pair has most edges.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planning.verify.reconstruction.arrays import Array, Indices, Mask

from .corrections import (
    Correction,
    far_poses,
    of_device,
    of_object,
    standing_at,
    swapped,
    turns_aside,
)
from .fits import fit
from .supposed import Evidence, Role, Supposed, mismatches, places

# A pair's mismatch is the mean of this share of its edges, the rest are outliers.
SOUND_SHARE = 0.85
# No mismatch counts for more, and an edge that misses the object for as much [m].
CAP_M = 5e-3
# While starts are compared, which may be far off [m].
_FAR_CAP_M = 5e-2
# Beyond so many times what is fine, other places than those nearby are looked at.
_FAR_TIMES = 4.0
_ROLES: tuple[Role, Role] = ("cameras", "projectors")
# Starts are compared on every fourth edge, the best few are fitted.
_THIN = 4
_FITTED_FAR = 12

Look = Callable[[Supposed], Array]


@dataclass(frozen=True, eq=False)
class Explanation:
    """A fitted change.

    Attributes:
        correction: What is changed.
        before: How everything was supposed to stand without it.
        after: How everything is supposed to stand with it.
        mismatch: Of each edge after it [m], shape (n,).
        remaining_m: Mismatch that is left, mean over the pairs of devices [m].
        rows: Edges that it bears on, shape (n,).
    """

    correction: Correction
    before: Supposed
    after: Supposed
    mismatch: Array
    remaining_m: float
    rows: Mask


@dataclass(frozen=True, eq=False)
class State:
    """The edges, and how they lie before the next change."""

    evidence: Evidence
    supposed: Supposed
    mismatch: Array
    fine_m: float

    def misfit(self, mismatch: Array | None = None, rows: Mask | None = None) -> float:
        """Return the mismatch [m], mean over the pairs of some of the edges."""
        error = self.mismatch if mismatch is None else mismatch
        chosen = np.ones(len(error), dtype=bool) if rows is None else rows
        keys = (self.evidence.projector << 16 | self.evidence.camera)[chosen]
        size = capped(error[chosen], CAP_M)
        return float(np.mean([_sound(size[keys == key]) for key in np.unique(keys)]))

    def explanations(self) -> list[Explanation]:
        """Fit every change to the edges that it bears on."""
        off = self._off()
        swaps = [
            self._fitted(swapped(role, *two))
            for role in _ROLES
            for two in combinations(off[role], 2)
        ]
        tried = swaps
        if all(len(off[role]) == self._n_measured(role) for role in _ROLES):
            tried += [self._fitted(of_object(k)) for k in ("scale", "moved", "similar")]
        several = all(len(off[role]) > 1 for role in _ROLES)
        if several and any(e.remaining_m <= self.fine_m for e in tried):
            # No change of one device would do as well.
            return tried
        devices: list[tuple[Role, int]] = [
            (role, index) for role in _ROLES for index in off[role]
        ]
        for role, index in devices:
            tried += self._nearby(role, index)
        best = min(tried, key=lambda e: e.remaining_m)
        for role, index in devices:
            concerned = self.evidence.index(role) == index
            does = [best, *(e for e in tried if np.array_equal(e.rows, concerned))]
            least = min(self.misfit(e.mismatch, concerned) for e in does)
            if least > _FAR_TIMES * self.fine_m:
                tried.append(self._afar(role, index))
        return tried

    def _n_measured(self, role: Role) -> int:
        return len(np.unique(self.evidence.index(role)))

    def _off(self) -> dict[Role, list[int]]:
        """Devices whose edges are off their rings with all partners, else with some."""
        pairs = {
            (p, c): self.misfit(
                rows=(self.evidence.projector == p) & (self.evidence.camera == c)
            )
            for p, c in self.evidence.pairs()
        }
        for enough in (min, max):
            off: dict[Role, list[int]] = {}
            for axis, role in enumerate(reversed(_ROLES)):
                every = sorted({pair[axis] for pair in pairs})
                off[role] = [
                    k
                    for k in every
                    if enough(m for pair, m in pairs.items() if pair[axis] == k)
                    > self.fine_m
                ]
            if any(off.values()):
                return off
        return {role: [] for role in _ROLES}

    def _nearby(self, role: Role, index: int) -> list[Explanation]:
        """Fit the changes of one device that begin where it should stand."""
        reach = self._reach(role, index)
        aim = of_device(role, index, "aim", reach)
        pose = getattr(self.supposed, role)[index].world_from_device
        aside = turns_aside(pose)
        turn = aside[self._nearest([aim] * len(aside), aside)[0]]
        starts = {"aim": turn, "pose": np.concatenate([turn, np.zeros(3)])}
        return [
            self._fitted(of_device(role, index, kind, reach), starts.get(kind))
            for kind in ("focal", "aim", "place", "pose")
        ]

    def _afar(self, role: Role, index: int) -> Explanation:
        """Fit a device's pose from all about the object."""
        reach = self._reach(role, index)
        pose = getattr(self.supposed, role)[index].world_from_device
        poses = far_poses(pose, self.supposed.body.centre)
        changes = [standing_at(role, index, pose, reach) for pose in poses]
        start = np.zeros(6)
        best = self._nearest(changes, [start] * len(changes))[:_FITTED_FAR]
        tried = [changes[k] for k in best]
        rows = np.flatnonzero(tried[0].concerns(self.evidence))[::_THIN]
        look = self._looking(tried[0], rows)
        starts = [
            fit(lambda x, one=one: look(one.apply(self.supposed, x)), start)
            for one in tried
        ]
        k = self._nearest(tried, starts)[0]
        return self._fitted(tried[k], starts[k])

    def _reach(self, role: Role, index: int) -> float:
        device = getattr(self.supposed, role)[index]
        return float(np.linalg.norm(device.centre - self.supposed.body.centre))

    def _nearest(self, changes: list[Correction], starts: list[Array]) -> list[int]:
        """Return which changes leave least at their starts, the best first."""
        rows = np.flatnonzero(changes[0].concerns(self.evidence))[::_THIN]
        look = self._looking(changes[0], rows)
        left = [
            capped(look(c.apply(self.supposed, x)), _FAR_CAP_M).mean()
            for c, x in zip(changes, starts, strict=True)
        ]
        return np.argsort(left, kind="stable").tolist()

    def _looking(self, correction: Correction, rows: Indices) -> Look:
        """Return what tells the mismatch of some edges, however all stands."""
        few = self.evidence.take(rows)
        if correction.role == "projectors":
            at = places(few, self.supposed)
            return lambda supposed: mismatches(few, supposed, at)
        return lambda supposed: mismatches(few, supposed, places(few, supposed))

    def _fitted(
        self, correction: Correction, start: Array | None = None
    ) -> Explanation:
        rows = correction.concerns(self.evidence)
        look = self._looking(correction, np.flatnonzero(rows))
        x = np.zeros(correction.n_parameters) if start is None else start
        if len(x):
            x = fit(lambda x: look(correction.apply(self.supposed, x)), x)
        after = correction.apply(self.supposed, x)
        mismatch = self.mismatch.copy()
        mismatch[rows] = look(after)
        error = self.misfit(mismatch)
        return Explanation(correction, self.supposed, after, mismatch, error, rows)


def capped(mismatch: Array, cap: float) -> Array:
    """Return absolute mismatches, none above a cap; where there is none, the cap."""
    return np.minimum(np.where(np.isfinite(mismatch), np.abs(mismatch), cap), cap)


def _sound(size: Array) -> float:
    """Return the mean of the smaller ones."""
    return float(np.sort(size)[: int(np.ceil(SOUND_SHARE * len(size)))].mean())
