"""Pairs of devices that contradict others, and what their points are worth.

Images that were mixed up among cameras or projectors can decode without a fault, and
every point is wrong. What the majority contradicts is left out; what is doubtful loses
certainty, not its points.
"""

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import closest_points
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import (
    CAUSES,
    Decoded,
    PairIndex,
    Pairs,
)
from planning.verify.reconstruction.scanner import Scanner

from .agreement import AGREE_PX, SIGMAS, Agreement, upper_px

_MM = 1e3
# Beyond this residual images are of other devices, or poses of another rig [px]; below
# it a calibration is off.
_FOREIGN_PX = 1.5
# Points of a pair that are held against the mesh.
_LOOKED_AT = 2000
# Points this many times the limit of the mean error from the mesh are stray; a pair
# whose share of them is larger has seen a dent, or something is wrong with its images.
_STRAY = 10.0
_FEW_STRAYS = 0.005
_FEWEST_SEEN = 10
_OTHER_OBJECT = (
    "the points don't lie on the mesh of the plan: the object differs from it, or "
    "stands elsewhere"
)
_FOREIGN = (
    "images of other devices, or exchanged, or of an object that moved in between, or "
    "poses that aren't those of the plan or the calibration"
)
_INACCURATE = "a pose or optics aren't quite those of the plan or the calibration"


@dataclass(frozen=True, eq=False)
class Confirmed:
    """Pairs with the points that are kept.

    Attributes:
        pairs: What each pair gave, without the others; sigma counts what is doubtful.
        reasons: Of each pair that lost points or certainty, in words.
        remark: What the pairs together say of the object; None: nothing.
    """

    pairs: Pairs
    reasons: dict[PairIndex, str]
    remark: str | None = None


@dataclass(frozen=True, eq=False)
class _Verdict:
    """What is wrong with some points of a pair.

    Attributes:
        words: What is said of it.
        points: Which of them, shape (n,).
        doubt_px: How far their edges may be off [px]; None: they are left out.
        gives_way: Whether doubted points go where a pair that nobody doubts has one.
    """

    words: str
    points: Mask
    doubt_px: float | None = None
    gives_way: bool = True


def confirm(pairs: Pairs, plan: Scanner) -> Confirmed:
    """Leave out the pairs that the others contradict, and doubt those that are off.

    The pairs that are believed are what remains when those that differ from more than
    they agree with have gone, the one farthest from the mesh first. Of the others those
    that differ by over `_FOREIGN_PX` are left out; the rest keep their points, and that
    difference counts as noise of their edges, but those are left out that have points
    nobody doubts within tau. So does `AGREE_PX` where neither the mesh nor another pair
    says anything, unless points lie farther away than the object is large. Many points
    of a pair on the mesh that are far from it need another pair.
    """
    clouds = {
        key: pair.cloud.of_devices(*key) for key, pair in pairs if len(pair.cloud)
    }
    judge = _Judge(plan, Agreement(plan, clouds))
    verdicts = {key: verdict for key in clouds if (verdict := judge.verdict(key))}
    sure = [cloud for key, cloud in clouds.items() if key not in verdicts]
    near = _Near(sure, plan.limits.check.tau_m)
    kept = [
        (key, _after(pair, verdicts[key], near) if key in verdicts else pair)
        for key, pair in pairs
    ]
    off = [not judge.on_mesh(key) for key, pair in kept if len(pair.cloud)]
    return Confirmed(
        kept,
        {key: verdict.words for key, verdict in verdicts.items()},
        _OTHER_OBJECT if off and all(off) else None,
    )


@dataclass(frozen=True, eq=False)
class _Judge:
    """Which pairs are believed, and why the others aren't."""

    plan: Scanner
    agreement: Agreement

    @cached_property
    def error_m(self) -> dict[PairIndex, Array]:
        """How far some points of each pair are from the mesh, beyond noise [m]."""
        return {
            key: _distances(self.plan.mesh, cloud.thinned(_LOOKED_AT))
            for key, cloud in self.agreement.clouds.items()
        }

    @cached_property
    def median_m(self) -> dict[PairIndex, float]:
        """Median distance of each pair from the mesh [m]."""
        return {key: float(np.median(error)) for key, error in self.error_m.items()}

    def on_mesh(self, key: PairIndex) -> bool:
        """Return whether a pair's median distance from the mesh keeps the limit."""
        return self.median_m[key] <= self.plan.limits.check.max_rms_m

    @cached_property
    def believed(self) -> set[PairIndex]:
        """The pairs that agree wherever two of them measured the same spots."""
        every = self.agreement.clouds.keys()
        believed = set(every)

        def differs(key: PairIndex) -> tuple[int, float]:
            away = [px > AGREE_PX for px in self._residuals(key, believed).values()]
            return 2 * sum(away) - len(away), self.median_m[key]

        while differ := {k for k in believed if self._worst_px(k, believed) > AGREE_PX}:
            believed.remove(max(differ, key=differs))
        for key in sorted(every - believed):
            if 0.0 <= self._worst_px(key, believed) <= AGREE_PX:
                believed.add(key)
        return believed

    def verdict(self, key: PairIndex) -> _Verdict | None:
        """Return what is wrong with a pair; None: nothing."""
        against = self._residuals(key, self.believed)
        if key in self.believed:
            if self.on_mesh(key):
                return self._strays(key)
            if against:
                return self._undecided(key)
        everywhere = np.ones(len(self.agreement.clouds[key]), dtype=bool)
        if not against:
            # Nobody who is believed saw its spots: whoever contradicts it, then.
            against = self._contradictions(key)
        if against:
            other = max(against, key=lambda one: against[one])
            px, name = against[other], self.plan.name(other)
        else:
            px = self._seen_px(everywhere, key, self.believed)
            name = "other pairs"
        if px is None:
            return self._alone(key, everywhere)
        where = f"where {name} measured the same spots, edges are {px:.2g} px off"
        if px > _FOREIGN_PX:
            return _Verdict(f"left out: {where}: {_FOREIGN}", everywhere)
        if px > AGREE_PX:
            words = f"doubtful: {where}, which its sigma counts: {_INACCURATE}"
            return _Verdict(words, everywhere, px)
        return None

    def _undecided(self, key: PairIndex) -> _Verdict | None:
        """Return the doubt of a pair off the mesh whose word stands against another's.

        As many agree with the other, or most that saw its spots contradict it.
        """
        agree = self._support(key)
        rivals = self._contradictions(key)
        if len(rivals) <= agree:
            rivals = {k: px for k, px in rivals.items() if self._support(k) >= agree}
        if not rivals:
            return None
        other = max(rivals, key=lambda one: rivals[one])
        words = (
            f"doubtful: where {self.plan.name(other)} measured the same spots, edges "
            f"are {rivals[other]:.2g} px off, which its sigma counts: no majority "
            f"tells which of them is right"
        )
        everywhere = np.ones(len(self.agreement.clouds[key]), dtype=bool)
        return _Verdict(words, everywhere, rivals[other], gives_way=False)

    def _contradictions(self, key: PairIndex) -> dict[PairIndex, float]:
        """Return the pairs that differ from one, and by how much [px]."""
        every = self._residuals(key, self.agreement.clouds.keys())
        return {other: px for other, px in every.items() if px > AGREE_PX}

    def _support(self, key: PairIndex) -> int:
        """Return how many pairs agree with one."""
        every = self._residuals(key, self.agreement.clouds.keys())
        return len(every) - len(self._contradictions(key))

    def _residuals(
        self, key: PairIndex, among: Set[PairIndex]
    ) -> dict[PairIndex, float]:
        both = {other: frozenset((key, other)) for other in sorted(among - {key})}
        known = self.agreement.residuals
        return {other: known[two] for other, two in both.items() if two in known}

    def _worst_px(self, key: PairIndex, among: Set[PairIndex]) -> float:
        """Return the largest residual of a pair, -1 without any."""
        return max(self._residuals(key, among).values(), default=-1.0)

    def _seen_px(
        self, some: Mask, of: PairIndex, others: Set[PairIndex]
    ) -> float | None:
        """Return the residual of points that others must have seen; None: too few."""
        seen = self.agreement.evidence(some, of, others)
        return upper_px(seen) if len(seen) >= _FEWEST_SEEN else None

    def _alone(self, key: PairIndex, everywhere: Mask) -> _Verdict:
        low, high = self.plan.mesh.bounds
        far = self.median_m[key] > 0.5 * float(np.linalg.norm(high - low))
        where = (
            f"its points lie {_MM * self.median_m[key]:.3g} mm off the mesh (median), "
            f"and no other pair confirms them"
        )
        if far:
            return _Verdict(f"left out: {where}: {_FOREIGN}", everywhere)
        return _Verdict(
            f"doubtful: {where}; its sigma counts that", everywhere, AGREE_PX
        )

    def _strays(self, key: PairIndex) -> _Verdict | None:
        stray_m = _STRAY * self.plan.limits.check.max_rms_m
        if not np.mean(self.error_m[key] > stray_m) > _FEW_STRAYS:
            return None
        cloud = self.agreement.clouds[key]
        stray = _distances(self.plan.mesh, cloud) > stray_m
        others = {k for k in self.believed if self.on_mesh(k)}
        seen_px = self._seen_px(stray, key, others)
        if seen_px is None:
            why, px = (
                "doubtful: far off the mesh, and no other pair confirms them",
                AGREE_PX,
            )
        elif seen_px > AGREE_PX:
            why, px = (
                "left out: far off the mesh, and other pairs contradict them",
                None,
            )
        else:
            return None
        count = int(np.count_nonzero(stray))
        return _Verdict(f"{count} of its {len(cloud)} points are {why}", stray, px)


def _distances(mesh: TriangleMesh, cloud: Cloud) -> Array:
    """From the mesh [m], beyond what noise explains, shape (n,)."""
    near = closest_points(mesh, cloud.points)
    noise = cloud.per_pixel(mesh.face_normals[near.faces]) * cloud.noise_px
    return np.maximum(np.abs(near.distances) - SIGMAS * noise, 0.0)


@dataclass(frozen=True, eq=False)
class _Near:
    """Points that nobody doubts, and how near to them others aren't needed [m]."""

    clouds: Sequence[Cloud]
    reach_m: float

    def covers(self, cloud: Cloud) -> Mask:
        """Return which points have one of them near that was seen from their side."""
        covered = np.zeros(len(cloud), dtype=bool)
        for sure in self.clouds:
            away, nearest = KDTree(sure.points).query(
                cloud.points, distance_upper_bound=self.reach_m
            )
            hit = np.flatnonzero(np.isfinite(away))
            rays = sure.rays[np.asarray(nearest)[hit]]
            covered[hit] |= np.einsum("ij,ij->i", rays, cloud.rays[hit]) > 0.0
        return covered


def _after(pair: Decoded, verdict: _Verdict, near: _Near) -> Decoded:
    """Return a pair without some of its points, and with less certain ones."""
    gone = verdict.points
    if verdict.doubt_px is not None:
        doubted = np.where(verdict.points, verdict.doubt_px, 0.0)
        noise_px = np.hypot(pair.cloud.noise_px, doubted)
        pair = replace(pair, cloud=replace(pair.cloud, noise_px=noise_px))
        gone = verdict.points & verdict.gives_way & near.covers(pair.cloud)
    why = pair.rejected | {"unconfirmed": int(np.count_nonzero(gone))}
    outcomes = pair.outcomes.copy()
    outcomes[np.flatnonzero(outcomes < 0)[gone]] = CAUSES.index("unconfirmed")
    return replace(pair, cloud=pair.cloud.take(~gone), rejected=why, outcomes=outcomes)
