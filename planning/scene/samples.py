"""Samples of the surface with what the limits ask of each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples


@dataclass(frozen=True, eq=False)
class Target:
    """Samples with the steep direction of the face that each lies on.

    Attributes:
        samples: Where, with normals.
        steep: Unit T1, zero where arbitrary, shape (n, 3).
    """

    samples: SurfaceSamples
    steep: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.samples)

    def take(self, chosen: NDArray[np.int64] | NDArray[np.bool_]) -> "Target":
        """Return some of the samples."""
        return Target(self.samples.take(chosen), self.steep[chosen])
