"""What projectors show: which of their light carries a code, and its surfaces."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel
from geometry.mesh.tensors import lengths
from geometry.poses import inverse, transform
from planning.model.planned import PlannedProjector

from .lights import light_of
from .samples import SampleArrays

# Wider than any ring that is drawn, as a tangent or in [m].
_WIDEST = 1e3


@dataclass(frozen=True, eq=False)
class CodeSurfaces(SampleArrays):
    """One projector's surfaces of equal code at n samples.

    Attributes:
        normals: Unit normals m in the world, shape (n, 3).
        spacing: h, distance of neighbouring edges along m [m], shape (n,).
        levers: How far errors of the projector move them, `surface_levers`, (n, 3).
        depths: z before the projector [m], shape (n,).
        pixel_m: How wide the panel's pixels are there [m], shape (n,).
        lux_per_lm: Illuminance across the rays of a lumen in the image [1/m^2], (n,).
        exposure_s: What a frame is exposed for [s], shape (n,).
    """

    normals: NDArray[np.float64]
    spacing: NDArray[np.float64]
    levers: NDArray[np.float64]
    depths: NDArray[np.float64]
    pixel_m: NDArray[np.float64]
    lux_per_lm: NDArray[np.float64]
    exposure_s: NDArray[np.float64]


class RingPattern:
    """Rings about an axis: cones in diverging light, cylinders in parallel light."""

    def __init__(self, projector: PlannedProjector) -> None:
        self.projector, self._light = projector, light_of(projector.device)

    @property
    def outermost(self) -> float:
        """Largest tangent (diverging) or radius in [m] (parallel)."""
        return float(self.projector.ring_radii[-1])

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which columns of the world, (3, n), lie in the largest ring, (n,)."""
        frame = self.projector.world_from_ring
        local = frame[:3, :3].T @ (points - frame[:3, 3:])
        return self._light.within_ring(local, self.outermost)

    def coordinate(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return R of points (n, 3): tangent (inf behind), or radius in [m]."""
        return self._light.ring_coordinate(self._local(points))

    def surfaces(self, points: NDArray[np.float64]) -> CodeSurfaces:
        """Return the surfaces of equal code through points (n, 3)."""
        radii, frame = self.projector.ring_radii, self.projector.world_from_ring
        surface = self._light.ring_surface(self._local(points))
        index = np.searchsorted(radii, surface.coordinate)
        index = np.clip(index, 1, len(radii) - 1)
        gaps = radii[index] - radii[index - 1]
        m = surface.normals @ frame[:3, :3].T
        levers = surface_levers(self.projector, points, m)
        return CodeSurfaces(
            m,
            gaps * surface.stretch,
            levers,
            *panel_light(self.projector, points),
            np.full(len(points), self.projector.exposure_s or 0.0),
        )

    def with_border(self) -> PlannedProjector:
        """Return the projector with all that it lights beyond the last edge, too."""
        radii = self.projector.ring_radii
        border = radii[-1] + np.diff(radii, prepend=0.0)[-1]
        return replace(self.projector, ring_radii=np.append(radii, border))

    def everywhere(self) -> PlannedProjector:
        """Return the projector with a pattern as wide as any light it may send."""
        radii = np.append(self.projector.ring_radii, _WIDEST)
        return replace(self.projector, ring_radii=radii)

    def _local(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return transform(inverse(self.projector.world_from_ring), points)


def panel_light(
    projector: PlannedProjector, points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return depths z of points (n, 3), pixels there, and the light of a lumen, (n,).

    A white image is as bright all over a plane across the axis, as ANSI lumens take it:
    with n pixels of the side p(z), 1 / (n p^2) on that plane, and that over the cosine
    of the angle off the axis across the rays.
    """
    pose, device = projector.world_from_device, projector.device
    offsets = points - pose[:3, 3]
    depths = offsets @ pose[:3, 2]
    pixel_m = np.broadcast_to(device.pixel_m(depths), depths.shape)
    lux = 1.0 / (np.prod(device.resolution) * np.square(pixel_m))
    if not isinstance(device, ParallelModel):
        lux = lux * lengths(offsets) / np.maximum(depths, 1e-9)
    return depths, pixel_m, lux


def surface_levers(
    projector: PlannedProjector, points: NDArray[np.float64], m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how far errors of a projector move its surfaces along m, in [m], (n, 3).

    With Q the origin of the device: of a turn by 1 rad |(P - Q) x m|; of a focal length
    that is off by the whole, and of a principal point 1 px off along the line that
    counts most, in light from a point::

        |P - Q| |J_r^T m . (u - u_0)|,    |P - Q| |J_r^T m|

    and in parallel light, where pixels are w apart, |m_x x + m_y y| and w |(m_x, m_y)|,
    in the device's frame.
    """
    pose, device = projector.world_from_device, projector.device
    offsets = points - pose[:3, 3]
    turned = lengths(np.cross(offsets, m))
    local = transform(inverse(pose), points)
    across = m @ pose[:3, :3]
    if isinstance(device, ParallelModel):
        wider = np.einsum("ij,ij->i", across[:, :2], local[:, :2])
        shifted = device.pixel_pitch_m * np.hypot(*across[:, :2].T)
    else:
        per_px = np.einsum("ijk,ij->ik", device.ray_jacobian(local), across)
        per_px *= lengths(offsets)[:, None]
        off_centre = device.project(local) - device.camera_matrix[:2, 2]
        wider = np.einsum("ij,ij->i", per_px, off_centre)
        shifted = np.hypot(*per_px.T)
    return np.column_stack([turned, wider, shifted])


# A class for each `PlannedProjector.pattern`.
PATTERNS: dict[str, type[RingPattern]] = {"rings": RingPattern}


def pattern_of(projector: PlannedProjector) -> RingPattern:
    """Return what a projector shows."""
    return PATTERNS[projector.pattern](projector)


def inside_rings(projector: PlannedProjector, points: NDArray[np.float64]) -> bool:
    """Return whether all points (n, 3) are inside the largest ring."""
    pattern = RingPattern(projector)
    return bool(np.all(pattern.coordinate(points) <= pattern.outermost))
