"""First failing limit of many projectors, were nothing in between: the quick way.

What `lighting.first_failure_in_the_open` says of one projector, for hundreds that are
offered: samples are held column by column, because rows of three are too short for
numpy's loops, and only what a stage depends on is computed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector
from planning.model.requirements import ProjectorLimits

from .lighting import LIT
from .samples import Target


@dataclass(frozen=True, eq=False)
class SampleColumns:
    """Samples, a coordinate at a time.

    Attributes:
        points: In [m], shape (3, n).
        normals: Unit normals, same shape.
        steep: Unit T1, zero where arbitrary, same shape.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    steep: NDArray[np.float64]

    @classmethod
    def of(cls, target: Target) -> "SampleColumns":
        """Return the columns of samples."""
        samples = target.samples
        rows = samples.points, samples.normals, target.steep
        return cls(*(np.ascontiguousarray(own.T) for own in rows))


def open_stages(
    projector: PlannedProjector, samples: SampleColumns, limits: ProjectorLimits
) -> NDArray[np.int8]:
    """Return the index in `lighting.CAUSES` of the first limit that fails, or `LIT`.

    Args:
        projector: Pose, optics and rings.
        samples: The samples.
        limits: Margins of eq. (2).

    Returns:
        Shape (n,).
    """
    local, offsets = _seen_from(projector.world_from_device, samples.points)
    if projector.light == "parallel":
        along, distances = projector.world_from_device[:3, 2], local[2]
        incidence, tangent = -(along @ samples.normals), np.abs(along @ samples.steep)
    else:
        distances = np.sqrt(_dots(offsets, offsets))
        apart = np.where(distances > 0.0, distances, 1.0)
        incidence = _dots(samples.normals, offsets) / -apart
        tangent = np.abs(_dots(samples.steep, offsets)) / apart
    low, high = projector.device.range_m
    tests = (
        _in_rings(projector, samples.points) & projector.device.in_field(local.T),
        (distances >= low) & (distances <= high),
        incidence >= np.cos(limits.max_incidence),
        tangent <= np.cos(limits.min_tangent_angle),
    )
    stage = np.full(distances.size, LIT, dtype=np.int8)
    for index in range(len(tests) - 1, -1, -1):
        np.copyto(stage, np.int8(index), where=~tests[index])
    return stage


def _seen_from(
    world_from_own: NDArray[np.float64], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points (3, n) in a frame, and relative to its origin in the world."""
    offsets = points - world_from_own[:3, 3:]
    return world_from_own[:3, :3].T @ offsets, offsets


def _dots(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the scalar products of columns (3, n), shape (n,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _in_rings(
    projector: PlannedProjector, points: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return which points lie within the outermost ring, shape (n,)."""
    (x, y, z), _ = _seen_from(projector.world_from_ring, points)
    outer = projector.ring_radii[-1]
    if projector.light == "parallel":
        return x * x + y * y <= outer * outer
    return (x * x + y * y <= (outer * z) ** 2) & (z > 0.0)
