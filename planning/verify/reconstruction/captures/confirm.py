"""Pairs of devices whose points something else confirms: the mesh, or another pair.

Images that were mixed up among cameras or projectors can decode without a fault, and
every point is wrong. No cloud is made of what nothing confirms.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import closest_points
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.calibration import CameraCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import (
    CAUSES,
    Decoded,
    PairIndex,
    Pairs,
)
from planning.verify.reconstruction.scanner import Scanner

_MM = 1e3
# Points of a pair that are looked at, and the fewest that say anything.
_LOOKED_AT = 2000
_FEWEST = 30
# Two pairs saw one spot if their edges lie this near in an image [px].
_SAME_SPOT_PX = 0.5
# Points are looked for this far beside an edge of their own ring [px].
_BESIDE_PX = 30.0
_RING_APART_PX = 1000.0
# Of one spot two pairs may differ by this many times the limit of the mean error: half
# a pixel beside the spot lies nearer or farther on slanted surface.
_APART = 3.0
# Points this many times the limit from the mesh are stray; a pair whose share of them
# is larger has seen a dent, or something is wrong with its images.
_STRAY = 10.0
_FEW_STRAYS = 0.005
_FEWEST_STRAYS = 10
_OTHER_OBJECT = (
    "the pairs agree with each other, but not with the mesh of the plan: the object "
    "differs from it, or stands elsewhere"
)


@dataclass(frozen=True, eq=False)
class Confirmed:
    """Pairs with the points that something confirms.

    Attributes:
        pairs: What each pair gave, without the others.
        reasons: Of each pair that lost points, in words.
        remark: What the pairs together say of the object; None: nothing.
    """

    pairs: Pairs
    reasons: dict[PairIndex, str]
    remark: str | None = None


def confirm(pairs: Pairs, plan: Scanner) -> Confirmed:
    """Leave out the pairs that neither the mesh nor a confirmed pair confirms.

    The mesh confirms a pair whose median distance from it keeps the limit. A pair that
    is off, though every confirmed pair that saw the same spots agrees with it, has seen
    a dent. If the mesh confirms none, but all pairs agree with each other, the object
    isn't the mesh; two pairs at least, of other cameras and other projectors. Where a
    confirmed pair has many points far from the mesh, these too need another pair.
    """
    limit = plan.limits.check.max_rms_m
    clouds = {key: pair.cloud for key, pair in pairs if len(pair.cloud)}
    errors = {
        key: _distances(plan.mesh, cloud.thinned(_LOOKED_AT))
        for key, cloud in clouds.items()
    }
    medians = {key: float(np.median(error)) for key, error in errors.items()}
    good = {key for key, median in medians.items() if median <= limit}
    off = medians.keys() - good
    witnesses = _Witnesses(clouds, plan.cameras, _APART * limit)
    if not good and witnesses.agree_all():
        return Confirmed(pairs, {}, _OTHER_OBJECT)
    kept: Pairs = []
    reasons: dict[PairIndex, str] = {}
    for key, pair in pairs:
        unconfirmed = np.zeros(len(pair.cloud), dtype=bool)
        if key in off and not witnesses.confirm(key, good):
            unconfirmed[:] = True
            reasons[key] = (
                f"left out: its points lie {_MM * medians[key]:.3g} mm off the mesh "
                f"(median), and no other pair confirms them: images of other devices, "
                f"or exchanged, or poses that aren't those of the plan or the "
                f"calibration"
            )
        if key in good and np.mean(errors[key] > _STRAY * limit) > _FEW_STRAYS:
            far = _distances(plan.mesh, pair.cloud) > _STRAY * limit
            strays = pair.cloud.take(far)
            if not witnesses.saw(strays, key, good):
                unconfirmed = far
                reasons[key] = (
                    f"{len(strays)} of its {len(pair.cloud)} points are left out: far "
                    f"off the mesh, and no other pair confirms them"
                )
        kept.append((key, _without(pair, unconfirmed) if key in reasons else pair))
    return Confirmed(kept, reasons)


def _distances(mesh: TriangleMesh, cloud: Cloud) -> Array:
    """From the mesh [m], shape (n,)."""
    return np.abs(closest_points(mesh, cloud.points).distances)


def _without(pair: Decoded, unconfirmed: Mask) -> Decoded:
    """Return a pair without some of its points, those counted as unconfirmed."""
    why = pair.rejected | {"unconfirmed": int(np.count_nonzero(unconfirmed))}
    outcomes = pair.outcomes.copy()
    outcomes[np.flatnonzero(outcomes < 0)[unconfirmed]] = CAUSES.index("unconfirmed")
    cloud = pair.cloud.take(~unconfirmed)
    return replace(pair, cloud=cloud, rejected=why, outcomes=outcomes)


@dataclass(frozen=True, eq=False)
class _Witnesses:
    """Clouds of pairs, held against each other where they show the same spots."""

    clouds: dict[PairIndex, Cloud]
    cameras: Sequence[CameraCalibration]
    tolerance_m: float

    @cached_property
    def agree(self) -> dict[frozenset[PairIndex], bool]:
        """Whether each two pairs that saw the same spots agree on them."""
        agree: dict[frozenset[PairIndex], bool] = {}
        for one, other in combinations(sorted(self.clouds), 2):
            differences = np.concatenate(
                [
                    self._differences(a, self.clouds[a], b)
                    for a, b in ((one, other), (other, one))
                ]
            )
            if len(differences) >= _FEWEST:
                median = float(np.median(differences))
                agree[frozenset((one, other))] = median <= self.tolerance_m
        return agree

    def agree_all(self) -> bool:
        """Whether several cameras and projectors agree, each pair with some other."""
        keys = sorted(self.clouds)
        if len({p for p, _ in keys}) < 2 or len({c for _, c in keys}) < 2:
            return False
        links = np.array(
            [[frozenset((a, b)) in self.agree for b in keys] for a in keys]
        )
        connected = connected_components(links, directed=False)[0] == 1
        return connected and all(self.agree.values())

    def confirm(self, key: PairIndex, good: set[PairIndex]) -> bool:
        """Whether a pair agrees with every confirmed one that saw the same spots."""
        both = [frozenset((key, other)) for other in good]
        verdicts = [self.agree[one] for one in both if one in self.agree]
        return bool(verdicts) and all(verdicts)

    def saw(self, strays: Cloud, key: PairIndex, good: set[PairIndex]) -> bool:
        """Whether other confirmed pairs measured stray points of a pair alike."""
        differences = np.concatenate(
            [
                np.zeros(0),
                *(self._differences(key, strays, k) for k in sorted(good - {key})),
            ]
        )
        enough = len(differences) >= _FEWEST_STRAYS
        return enough and bool(np.median(differences) <= self.tolerance_m)

    def _differences(self, key: PairIndex, seen: Cloud, other: PairIndex) -> Array:
        """How far points of a pair are from another's, as its camera sees them [m].

        Where the other's show on an edge, the difference of distance. On an edge of the
        same ring of one projector that is no news, since both lie on its surface: there
        counts how far beside the edge they show.
        """
        cloud, camera = self.clouds[other], self.cameras[key[1]]
        same = key[0] == other[0]
        pixels = camera.project(cloud.points)
        shown = np.flatnonzero(np.isfinite(pixels[:, 0]))
        if len(shown) == 0:
            return np.zeros(0)
        # A third coordinate keeps rings of one projector apart.
        apart = _RING_APART_PX * same
        tree = KDTree(np.column_stack([pixels[shown], apart * cloud.ring[shown]]))
        beside, nearest = tree.query(
            np.column_stack([seen.pixels, apart * seen.ring]),
            distance_upper_bound=_BESIDE_PX if same else _SAME_SPOT_PX,
        )
        hit = np.isfinite(beside)
        beside, others = np.asarray(beside)[hit], shown[np.asarray(nearest)[hit]]
        reach, further = (
            np.sqrt(np.sum((points - camera.centre) ** 2, axis=1))
            for points in (seen.points[hit], cloud.points[others])
        )
        deep = np.where(beside <= _SAME_SPOT_PX, np.abs(reach - further), 0.0)
        return np.maximum(deep, beside * reach / camera.focal_px) if same else deep
