"""Samples of the surface with what the limits ask of each."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import rows_of
from geometry.mesh.sampling import SurfaceSamples


@dataclass(frozen=True, eq=False)
class Target:
    """Samples with the steep direction of the face that each lies on.

    Attributes:
        samples: Where, with normals.
        steep: Unit T1, zero where arbitrary, shape (n, 3).
        member: Index of the mesh that each lies on, shape (n,); one mesh: 0.
    """

    samples: SurfaceSamples
    steep: NDArray[np.float64]
    member: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        if not len(self.member):
            zeros = np.zeros(len(self.samples), dtype=np.int64)
            object.__setattr__(self, "member", zeros)

    def __len__(self) -> int:
        return len(self.samples)

    def take(self, chosen: NDArray[np.int64] | NDArray[np.bool_]) -> "Target":
        """Return some of the samples."""
        return Target(
            self.samples.take(chosen),
            rows_of(self.steep, chosen),
            rows_of(self.member, chosen),
        )


@dataclass(frozen=True, eq=False)
class SampleArrays:
    """Arrays with one row a sample; other fields are said of all samples."""

    def take(self, chosen: NDArray[np.int64]) -> Self:
        """Return what is known of some of the samples."""
        return self._with([rows_of(array, chosen) for array in self._arrays()])

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return what is known of several sets of samples, one after the other.

        What is said of all samples must be the same in all parts.
        """
        arrays = zip(*(part._arrays() for part in parts), strict=True)
        return parts[0]._with([np.concatenate(same) for same in arrays])

    def _arrays(self) -> list[NDArray[Any]]:
        values = (getattr(self, name) for name in self.__dataclass_fields__)
        return [value for value in values if isinstance(value, np.ndarray)]

    def _with(self, arrays: list[NDArray[Any]]) -> Self:
        """Return the same with other arrays, which are its first fields."""
        names = [*self.__dataclass_fields__][len(arrays) :]
        return type(self)(*arrays, *(getattr(self, name) for name in names))


@dataclass(frozen=True, eq=False)
class LightOnSamples(SampleArrays):
    """One projector's light on n samples, before occlusion.

    Attributes:
        incidence_cos: -N.L, shape (n,).
        tangent_cos: |T1.L|, 0 where T1 is arbitrary, shape (n,).
        offsets: From the projector's origin to them, in the world [m], shape (n, 3).
    """

    incidence_cos: NDArray[np.float64]
    tangent_cos: NDArray[np.float64]
    offsets: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SampleColumns:
    """Samples and T1, (3, n) each: rows of three are too short for numpy's loops."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    steep: NDArray[np.float64]

    @classmethod
    def of(cls, target: Target) -> "SampleColumns":
        """Return the columns of samples."""
        samples = target.samples
        tables = samples.points, samples.normals, target.steep
        return cls(*(np.ascontiguousarray(table.T) for table in tables))


def merged(first: Target, second: Target) -> Target:
    """Return both sets of samples as one; every sample stands for the same area."""
    a, b = first.samples, second.samples
    total = len(a) * a.weight
    samples = type(a)(
        np.concatenate([a.points, b.points]),
        np.concatenate([a.normals, b.normals]),
        np.concatenate([a.faces, b.faces]),
        total / (len(a) + len(b)),
    )
    return Target(
        samples,
        np.concatenate([first.steep, second.steep]),
        np.concatenate([first.member, second.member]),
    )
