"""Where what was measured deviates from the mesh, after a best fit or as it stands."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from geometry.arrays import lengths
from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import ClosestPoints, closest_points
from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.scanner import Scanner

from .merge import Merged

Align = Literal["none", "best-fit"]

# Points that a fit looks at; the others follow.
_FITTED = 3000


@dataclass(frozen=True)
class RegionDeviation:
    """What one dominant region of the mesh, or all that is none, deviates by [m].

    Attributes:
        region: Its index; -1 for the rest.
        n_points: Points that lie nearest to it.
        mean_m: Mean signed distance, outside positive.
        rms_m: Root mean square.
        low_m: 2.5th percentile.
        high_m: 97.5th percentile.
        outside: Share of the points outside the limits; None without limits.
    """

    region: int
    n_points: int
    mean_m: float
    rms_m: float
    low_m: float
    high_m: float
    outside: float | None


@dataclass(frozen=True, eq=False)
class Deviation:
    """Signed distances of a cloud from the mesh, outside positive.

    Attributes:
        mesh_from_measured: The fit that was applied first, shape (4, 4).
        points: After it [m], shape (n, 3).
        normals: Likewise, shape (n, 3).
        distances: In [m], shape (n,).
        region: Of the nearest face, -1 for none, shape (n,).
        limits_m: Lower and upper limit; None: none were given.
    """

    mesh_from_measured: Array
    points: Array
    normals: Array
    distances: Array
    region: Indices
    limits_m: tuple[float, float] | None

    @property
    def shift_m(self) -> float:
        """How far the fit moved the middle of the points [m]."""
        turn, shift = self.mesh_from_measured[:3, :3], self.mesh_from_measured[:3, 3]
        middle = np.mean(self.points, axis=0)
        return float(np.linalg.norm((middle - shift) @ turn - middle))

    @property
    def turn_rad(self) -> float:
        """By what angle the fit turned them [rad]."""
        turn = Rotation.from_matrix(self.mesh_from_measured[:3, :3])
        return float(turn.magnitude())

    @property
    def outside(self) -> Mask:
        """Which points lie outside the limits, shape (n,)."""
        low, high = self.limits_m or (-np.inf, np.inf)
        return (self.distances < low) | (self.distances > high)

    def by_region(self) -> tuple[RegionDeviation, ...]:
        """Return a row for each region with points, what is no region last."""
        indices = sorted(np.unique(self.region).tolist(), key=lambda r: (r < 0, r))
        return tuple(self._row(index, self.region == index) for index in indices)

    def whole(self) -> RegionDeviation:
        """Return the same of all points."""
        return self._row(-1, np.ones(len(self.distances), dtype=bool))

    def _row(self, index: int, chosen: Mask) -> RegionDeviation:
        away = self.distances[chosen]
        low, high = np.percentile(away, (2.5, 97.5)).tolist()
        return RegionDeviation(
            index,
            len(away),
            float(np.mean(away)),
            float(np.sqrt(np.mean(away**2))),
            low,
            high,
            None if self.limits_m is None else float(self.outside[chosen].mean()),
        )

    def to_document(self) -> dict[str, Any]:
        """Return plain JSON values, SI."""
        return {
            "mesh_from_measured": self.mesh_from_measured.tolist(),
            "limits_m": self.limits_m and list(self.limits_m),
            **{k: v for k, v in vars(self.whole()).items() if k != "region"},
            "regions": [vars(row) for row in self.by_region()],
        }


def measure_deviation(
    merged: Merged,
    plan: Scanner,
    align: Align,
    limits_m: tuple[float, float] | None = None,
) -> Deviation:
    """Return where a cloud of one point or more deviates from a plan's mesh.

    Args:
        merged: The cloud.
        plan: With the mesh and its regions.
        align: `best-fit`: moved onto the mesh as a rigid body first, see `best_fit`.
        limits_m: What a point may deviate by, lower and upper [m].
    """
    cloud, pose = merged.cloud, np.eye(4)
    if align == "best-fit":
        pose = best_fit(plan.mesh, cloud.points, plan.limits.check.max_rms_m)
    points = cloud.points @ pose[:3, :3].T + pose[:3, 3]
    nearest = closest_points(plan.mesh, points)
    return Deviation(
        pose,
        points,
        merged.normals @ pose[:3, :3].T,
        nearest.distances,
        plan.region[nearest.faces],
        limits_m,
    )


def best_fit(mesh: TriangleMesh, points: Array, noise_m: float) -> Array:
    """Return the rigid motion (4, 4) that brings points (n, 3) [m] onto a mesh.

    It minimises the signed distances d to the mesh, first their squares, then
    ``sum 2 noise^2 (sqrt(1 + (d / noise)^2) - 1)``, in which what is missing or was
    added hardly counts. Point to plane: the derivative of d by the motion is that along
    the normal at the nearest point. Where a shape leaves a motion free, as a ball does,
    the smallest is taken.
    """
    few = points[:: -(-len(points) // _FITTED)]
    centre = few.mean(axis=0)
    # One point has no size, and any turn about it is as good: the smallest is none.
    size = max(float(np.sqrt(np.mean(np.sum((few - centre) ** 2, axis=1)))), noise_m)

    def moved(motion: Array, these: Array) -> Array:
        turn = Rotation.from_rotvec(motion[3:] / size)
        return turn.apply(these - centre) + centre + motion[:3]

    # The slopes are asked for where the distances were last.
    @lru_cache(maxsize=1)
    def nearest(motion: bytes) -> tuple[Array, ClosestPoints]:
        there = moved(np.frombuffer(motion), few)
        return there, closest_points(mesh, there)

    def distances(motion: Array) -> Array:
        return nearest(motion.tobytes())[1].distances

    def slopes(motion: Array) -> Array:
        there, foot = nearest(motion.tobytes())
        away = (there - foot.points) * np.sign(foot.distances)[:, None]
        length = lengths(away)[:, None]
        # On the surface itself only the face tells its direction.
        flat = length < 1e-9
        normals = np.where(
            flat, mesh.face_normals[foot.faces], away / np.where(flat, 1.0, length)
        )
        arms = there - centre - motion[:3]
        return np.hstack([normals, np.cross(arms, normals) / size])

    best = np.zeros(6)
    for loss, tolerance in (("linear", 1e-2), ("soft_l1", 1e-6)):
        best = least_squares(
            distances,
            best,
            # scipy's annotation knows its three names only.
            slopes,  # pyright: ignore[reportArgumentType]
            loss=loss,
            f_scale=noise_m,
            x_scale=noise_m,
            ftol=tolerance,
        ).x
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(best[3:] / size).as_matrix()
    pose[:3, 3] = moved(best, np.zeros((1, 3)))[0]
    return pose
