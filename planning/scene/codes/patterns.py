"""What projectors show: which of their light carries a code, and its surfaces."""

import math
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from geometry.devices import ParallelModel
from geometry.poses import inverse, transform
from planning.model.devices.planned import PlannedProjector
from planning.model.light.dense_code import DenseCode
from planning.scene.lights import light_of

from .surfaces import Coded, CodedPixels, CodeSurfaces, PanelLight, PanelRays

# Wider than any ring that is drawn, as a tangent or in [m].
_WIDEST = 1e3


class Pattern(Protocol):
    """What a projector shows."""

    def __init__(self, projector: PlannedProjector) -> None: ...

    @property
    def outermost(self) -> float:
        """Largest tangent (diverging) or radius in [m] (parallel); inf: no ring."""
        ...

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which columns of the world, (3, n), light with a code reaches, (n,).

        Whatever the device's own field is.
        """
        ...

    def surfaces(self, points: NDArray[np.float64]) -> Coded:
        """Return the surfaces of equal code through points (n, 3)."""
        ...

    def everywhere(self) -> PlannedProjector:
        """Return the projector with a pattern as wide as any light it may send."""
        ...

    def with_border(self) -> PlannedProjector:
        """Return the projector with all that it lights beyond its code, too."""
        ...


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
        return CodeSurfaces(
            *panel_light(self.projector, points),
            np.full(len(points), self.projector.exposure_s or 0.0),
            normals=m,
            spacing=gaps * surface.stretch,
            levers=PanelRays.of(self.projector, points).levers(m),
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


class DensePattern:
    """Every pixel of the panel with a code of its own."""

    def __init__(self, projector: PlannedProjector) -> None:
        self.projector, self._code = projector, projector.code or DenseCode()

    @property
    def outermost(self) -> float:
        """No ring ends what is coded."""
        return math.inf

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return that all columns (3, n) are: what the device lights is coded."""
        return np.ones(points.shape[1], dtype=bool)

    def surfaces(self, points: NDArray[np.float64]) -> CodedPixels:
        """Return the coded pixels at points (n, 3)."""
        projector = self.projector
        light = PanelLight(
            *panel_light(projector, points),
            np.full(len(points), projector.exposure_s or 0.0),
        )
        beams = light_of(projector.device).directions(
            projector.world_from_device, points
        )
        return CodedPixels(self._code, beams, PanelRays.of(projector, points), light)

    def everywhere(self) -> PlannedProjector:
        """Return the projector: its pattern is as wide as its light."""
        return self.projector

    def with_border(self) -> PlannedProjector:
        """Return the projector: nothing is lit beyond the coded pixels."""
        return self.projector


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


# A class for each `PlannedProjector.pattern`.
PATTERNS: dict[str, type[Pattern]] = {"rings": RingPattern, "dense": DensePattern}


def pattern_of(projector: PlannedProjector) -> Pattern:
    """Return what a projector shows."""
    return PATTERNS[projector.pattern](projector)


def inside_rings(projector: PlannedProjector, points: NDArray[np.float64]) -> bool:
    """Return whether all points (n, 3) are inside the largest ring."""
    pattern = RingPattern(projector)
    return bool(np.all(pattern.coordinate(points) <= pattern.outermost))
