"""Members of a family laid over the first one: rigid motions, no scale, no mirror."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.rays.proximity import closest_points

AlignedBy = Literal["given", "axes", "icp"]

# Points of a surface that is laid over another, and steps of ICP at most.
_POINTS, _STEPS = 2000, 100
# Gains of the mean square that aren't worth another.
_GAIN = 1e-4
# Moments of inertia that differ by less say nothing of the axes.
_ALIKE = 0.02
_DECIMALS = 12


@dataclass(frozen=True, eq=False)
class Aligned:
    """A mesh where it was moved to.

    Attributes:
        mesh: There.
        world_from_file: What moved it, shape (4, 4).
        rms_before_m: Root mean square distance of points of its surface from the first
            mesh before [m]; None: it stands as given.
        rms_m: The same after.
    """

    mesh: TriangleMesh
    world_from_file: Array
    rms_before_m: float | None = None
    rms_m: float | None = None


def aligned(meshes: Sequence[TriangleMesh], how: AlignedBy) -> tuple[Aligned, ...]:
    """Return meshes laid over the first, which stays.

    By `axes`: the mean of the surface and its principal axes of inertia, turned the way
    that comes nearest; axes that are nearly alike leave the turn as given. By `icp`:
    iterative closest points, from the better of that and as given; kept where they come
    nearer.
    """
    identity = np.eye(4)
    if how == "given":
        return tuple(Aligned(mesh, identity) for mesh in meshes)
    first, *others = meshes
    return (
        Aligned(first, identity, 0.0, 0.0),
        *(_laid_over(first, mesh, how) for mesh in others),
    )


def _laid_over(first: TriangleMesh, mesh: TriangleMesh, how: AlignedBy) -> Aligned:
    points = sample_surface(mesh, _POINTS, seed=0).points
    before = _rms(first, points)
    # Equal ones leave it as it is given.
    offered = [np.eye(4), *_by_axes(first, mesh)]
    if how == "axes":
        offered = offered[1:]
    errors = [_rms(first, _moved(points, pose)) for pose in offered]
    best = int(np.argmin(errors))
    pose, error = _rounded(offered[best]), errors[best]
    if how == "icp":
        nearer = _rounded(_by_icp(first, points, pose))
        if _rms(first, _moved(points, nearer)) < error:
            pose = nearer
    moved = replace(mesh, vertices=_moved(mesh.vertices, pose))
    return Aligned(moved, pose, before, _rms(first, _moved(points, pose)))


def _by_axes(first: TriangleMesh, mesh: TriangleMesh) -> Iterator[Array]:
    """Yield the poses that lay principal axes over each other, all right-handed."""
    (to, axes, clear), (origin, own, own_clear) = (_frame(m) for m in (first, mesh))
    turns = [np.eye(3)]
    if clear and own_clear:
        turns = []
        for x, y in product((1.0, -1.0), repeat=2):
            turn = axes @ np.diag([x, y, x * y]) @ own.T
            turns.append(turn)
    for turn in turns:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn, to - turn @ origin
        yield pose


def _frame(mesh: TriangleMesh) -> tuple[Array, Array, bool]:
    """Mean of the surface, its principal axes (columns), and whether they are clear.

    Second moments of a triangle about the origin: A/12 (sum p p' + s s'), with corners
    p and their sum s.
    """
    corners, areas = mesh.corners, mesh.face_areas
    total = float(areas.sum())
    middle = areas @ mesh.face_centroids / total
    arms = corners - middle
    whole = arms.sum(axis=1)
    second = np.einsum("f,fki,fkj->ij", areas, arms, arms)
    second = (second + np.einsum("f,fi,fj->ij", areas, whole, whole)) / (12.0 * total)
    moments, axes = np.linalg.eigh(second)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    clear = bool(np.diff(moments).min() > _ALIKE * moments.max())
    return middle, axes, clear


def _by_icp(first: TriangleMesh, points: Array, start: Array) -> Array:
    """Lay points over their closest ones on the first mesh, again and again.

    Besl and McKay, "A method for registration of 3-D shapes", PAMI 1992; trimesh's own
    loop asks another library for the closest points.
    """
    # It takes long to import, and few runs need it.

    # It takes long to import, and few runs need it.
    from trimesh.registration import procrustes

    pose, error = start, np.inf
    for _ in range(_STEPS):
        near = closest_points(first, _moved(points, pose))
        after = float(np.mean(near.distances**2))
        if after > (1.0 - _GAIN) * error:
            break
        error = after
        pose, _, _ = procrustes(points, near.points, reflection=False, scale=False)
    return np.asarray(pose)


def _rounded(pose: Array) -> Array:
    """A rotation to the last digit that is written, and not further."""
    left, _, right = np.linalg.svd(pose[:3, :3])
    exact = pose.copy()
    exact[:3, :3] = left @ right
    return np.round(exact, _DECIMALS) + 0.0


def _moved(points: Array, pose: Array) -> Array:
    return points @ pose[:3, :3].T + pose[:3, 3]


def _rms(first: TriangleMesh, points: Array) -> float:
    return float(np.sqrt(np.mean(closest_points(first, points).distances ** 2)))
