"""Surfaces of equal code in a projector's light, through points of the scene."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector
from planning.scene.samples import SampleArrays


@dataclass(frozen=True, eq=False)
class CodeSurfaces(SampleArrays):
    """One projector's surfaces of equal code at n samples.

    Attributes:
        normals: m, their unit normals in the world, shape (n, 3).
        spacing: h, distance of neighbouring edges along m in [m], shape (n,).
    """

    normals: NDArray[np.float64]
    spacing: NDArray[np.float64]


class Pattern(Protocol):
    """What one projector shows; a class for each `PlannedProjector.pattern`."""

    def __init__(self, projector: PlannedProjector) -> None: ...

    def inside(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which columns of the world, (3, n), the pattern reaches, (n,)."""
        ...

    def surfaces(self, points: NDArray[np.float64]) -> CodeSurfaces:
        """Return the surfaces of equal code through points (n, 3)."""
        ...

    def with_border(self) -> PlannedProjector:
        """Return the projector with all that it lights beyond the last edge, too."""
        ...

    def everywhere(self) -> PlannedProjector:
        """Return the projector with a pattern as wide as any light it may send."""
        ...
