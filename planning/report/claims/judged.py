"""What becomes of fresh samples under the devices of a plan, and under any others."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.scene.lighting import lit_stages
from planning.scene.limits import pair_limits, projector_limits
from planning.scene.limits.projector_limits import LIT
from planning.scene.limits.view_pair_limits import VIEW_CAUSES
from planning.scene.measuring.measured import LitSamples, furthest_failure, measured_by
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .reach import furthest_lit, measured_by_any

_Mask = NDArray[np.bool_]
_CAUSES = tuple(
    dict.fromkeys(projector_limits.CAUSES + pair_limits.CAUSES + VIEW_CAUSES)
)


@dataclass(frozen=True, eq=False)
class Devices:
    """The devices of a plan and the reference sets that reachability refers to."""

    projectors: tuple[PlannedProjector, ...]
    cameras: tuple[PlannedCamera, ...]
    reference_projectors: tuple[PlannedProjector, ...]
    reference_cameras: tuple[PlannedCamera, ...]


@dataclass(frozen=True, eq=False)
class Judged:
    """What becomes of n samples.

    Attributes:
        first: First limit that each projector violates, or `LIT`, (n, n_projectors).
        furthest: Of those that aren't lit, how far they come over the reference set.
        by_cameras: Which are measured, or lit and could be, shape (n,).
    """

    target: Target
    first: NDArray[np.int8]
    measured_by: _Mask
    furthest: NDArray[np.int8]
    by_cameras: _Mask

    @classmethod
    def of(cls, scene: Scene, devices: Devices, target: Target) -> "Judged":
        """Judge samples; devices of the plan stand in each other's way."""
        planned = scene.among((*devices.projectors, *devices.cameras))
        first = lit_stages(planned, devices.projectors, target)
        bright = np.any(first == LIT, axis=1)
        samples = LitSamples.of(devices.projectors, target, first == LIT)
        measured = measured_by(planned, devices.cameras, samples)
        furthest = furthest_lit(
            scene, devices.reference_projectors, target.take(~bright)
        )
        able = np.array(measured.any(axis=1))
        others = np.flatnonzero(bright & ~able)
        lit = LitSamples.of(
            devices.projectors, target.take(others), first[others] == LIT
        )
        # Another camera needn't stand among those that were chosen.
        among = scene.among(devices.projectors)
        able[others] = measured_by_any(
            among, devices.reference_cameras, lit, devices.reference_projectors
        )
        return cls(target, first, measured, furthest, able)

    @cached_property
    def lit(self) -> _Mask:
        """Which any projector lights, shape (n,)."""
        return np.any(self.first == LIT, axis=1)

    @cached_property
    def measured(self) -> _Mask:
        """Which any camera measures, shape (n,)."""
        return np.any(self.measured_by, axis=1)

    @cached_property
    def by_projectors(self) -> _Mask:
        """Which are lit, or could be, shape (n,)."""
        reached = self.lit.copy()
        reached[~self.lit] = self.furthest == LIT
        return reached

    def unmeasured(self, devices: Devices) -> LitSamples:
        """Those that are lit all the same."""
        chosen = np.flatnonzero(self.lit & ~self.measured)
        lit = self.first[chosen] == LIT
        return LitSamples.of(devices.projectors, self.target.take(chosen), lit)

    def causes(self, scene: Scene, devices: Devices) -> NDArray[np.str_]:
        """Return by which limit each sample isn't measured, "" where it is; (n,).

        The furthest limit of any projector where it is dark, else of any pair.
        """
        planned = scene.among((*devices.projectors, *devices.cameras))
        names = np.full(len(self.target), "", dtype=f"U{max(map(len, _CAUSES))}")
        dark = self.first[~self.lit].max(axis=1)
        names[~self.lit] = np.array(projector_limits.CAUSES)[dark]
        pairs = furthest_failure(planned, devices.cameras, self.unmeasured(devices))
        names[self.lit & ~self.measured] = np.array(pair_limits.CAUSES)[pairs]
        return names

    def area(self, *masks: _Mask) -> float:
        """Of samples that hold in one of several disjoint masks [m²]."""
        return self.target.samples.weight * sum(int(mask.sum()) for mask in masks)


def by_cause(names: NDArray[np.str_], weight: float) -> dict[str, float]:
    """Return the area of each cause, in their order, for samples of one weight."""
    found, counts = np.unique(names[names != ""], return_counts=True)
    areas = dict(zip(found.tolist(), (weight * counts).tolist(), strict=True))
    return {cause: areas[cause] for cause in _CAUSES if cause in areas}
