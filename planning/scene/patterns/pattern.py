"""Which patterns there are."""

import numpy as np
from numpy.typing import NDArray

from planning.model.planned import PlannedProjector

from .code_surfaces import CodeSurfaces, Pattern
from .ring_pattern import RingPattern

PATTERNS: dict[str, type[Pattern]] = {"rings": RingPattern}


def pattern_of(projector: PlannedProjector) -> Pattern:
    """Return what a projector shows."""
    return PATTERNS[projector.pattern](projector)


def code_surfaces(
    projector: PlannedProjector, points: NDArray[np.float64]
) -> CodeSurfaces:
    """Return a projector's surfaces of equal code through points (n, 3)."""
    return pattern_of(projector).surfaces(points)
