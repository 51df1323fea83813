"""What projectors show: which of their light carries a code, and its surfaces."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.poses import inverse, transform
from planning.model.planned import PlannedProjector

from .lights import light_of
from .samples import SampleArrays

# Wider than any ring that is drawn, as a tangent or in [m].
_WIDEST = 1e3


@dataclass(frozen=True, eq=False)
class CodeSurfaces(SampleArrays):
    """One projector's surfaces of equal code at n samples.

    Unit normals m in the world, and h, the distance of neighbouring edges along m [m].
    """

    normals: NDArray[np.float64]
    spacing: NDArray[np.float64]


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
        return CodeSurfaces(surface.normals @ frame[:3, :3].T, gaps * surface.stretch)

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


# A class for each `PlannedProjector.pattern`.
PATTERNS: dict[str, type[RingPattern]] = {"rings": RingPattern}


def pattern_of(projector: PlannedProjector) -> RingPattern:
    """Return what a projector shows."""
    return PATTERNS[projector.pattern](projector)


def inside_rings(projector: PlannedProjector, points: NDArray[np.float64]) -> bool:
    """Return whether all points (n, 3) are inside the largest ring."""
    pattern = RingPattern(projector)
    return bool(np.all(pattern.coordinate(points) <= pattern.outermost))
