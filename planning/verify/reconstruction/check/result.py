"""What the simulated reconstruction gives."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planning.model.document.check_records import (
    CompletenessRecord,
    ReconstructionRecord,
)
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.decode.decode import Decoded, PairIndex
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.scanner import Scanner

from .accuracy import Accuracy, Completeness, share_of
from .comparison import Comparison
from .interreflection import Interreflection
from .merge import Merged
from .refined_rig import RefinedRig


@dataclass(frozen=True)
class PairCount:
    """What one pair of devices, named by their ids, gave; see `Decoded`."""

    projector: str
    camera: str
    lit_pixels: int
    n_edges: int
    n_points: int
    rejected: dict[str, int]

    @classmethod
    def of(cls, plan: Scanner, pair: PairIndex, decoded: Decoded) -> "PairCount":
        """Count what a pair of a rig gave."""
        return cls(
            plan.projectors[pair[0]].id,
            plan.cameras[pair[1]].id,
            decoded.lit_pixels,
            decoded.n_edges,
            len(decoded.cloud),
            decoded.rejected,
        )


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """What the rig measured of the object, judged against the plan's limits.

    Attributes:
        everything: All points, before redundancy was removed.
        merged: The cloud that stays, with normals and standard deviations.
        accuracy: Of the merged cloud, its outside; None if it is empty.
        completeness: Of the target.
        pairs: What each pair gave.
        photometry: The simulated light and sensor; None: the images were taken.
        failures: One sentence for each limit that isn't kept.
        seconds: Processor time of `render`, `decode` and `merge` over all pairs [s].
        comparison: With a plan's prediction; None if none was given.
        remarks: What was left out of images, limits being kept or not.
        refined: The rig that an adjustment made; None if it wasn't asked for.
        inside_fraction: Share of the merged points that lie on the inside of an open
            mesh; they don't count into the accuracy.
        interreflection: What one bounce of light would do; None: nobody asked.
    """

    everything: Cloud
    merged: Merged
    accuracy: Accuracy | None
    completeness: Completeness
    pairs: tuple[PairCount, ...]
    photometry: Photometry | None
    failures: tuple[str, ...]
    seconds: dict[str, float]
    comparison: Comparison | None = None
    remarks: tuple[str, ...] = ()
    refined: RefinedRig | None = None
    inside_fraction: float = 0.0
    interreflection: Interreflection | None = None

    @property
    def passed(self) -> bool:
        """Whether every limit is kept."""
        return not self.failures

    @property
    def n_points(self) -> int:
        """Points before redundancy was removed."""
        return len(self.everything)

    @property
    def n_merged(self) -> int:
        """Points that stay."""
        return len(self.merged.cloud)

    @property
    def redundant_fraction(self) -> float:
        """Share of the points that merging removed, redundant or false."""
        return 1.0 - self.n_merged / self.n_points if self.n_points else 0.0

    @property
    def step_fraction(self) -> float:
        """Share of the points that were left out as edges between surfaces."""
        return share_of(self.merged.steps)

    @property
    def left_out_fraction(self) -> float:
        """Share of the edges found that gave no point, or a false one at a step."""
        n_edges = sum(pair.n_edges for pair in self.pairs)
        n_right = self.n_points - int(np.count_nonzero(self.merged.steps))
        return 1.0 - n_right / n_edges if n_edges else 0.0

    @property
    def merging(self) -> str:
        """What merging did, in words."""
        shared = share_of(self.merged.shared)
        redundant = self.redundant_fraction - self.step_fraction
        where = "in the light of two projectors"
        if np.any(self.everything.ring < 0):
            where = "where others measured, too"
        return (
            f"{self.n_merged} points of {self.n_points}, {shared:.1%} of them {where}; "
            f"{redundant:.1%} redundant, "
            f"{self.step_fraction:.1%} false at steps"
            + f"; {self.inside_fraction:.1%} on the inside of the open mesh, not judged"
            * (self.inside_fraction > 0.0)
        )

    def record(self) -> ReconstructionRecord:
        """Return the `reconstruction` part of a plan."""
        accuracy, complete, light = self.accuracy, self.completeness, self.photometry
        compared = {} if self.comparison is None else vars(self.comparison)
        return ReconstructionRecord(
            n_points=self.n_points,
            n_merged=self.n_merged,
            redundant_fraction=self.redundant_fraction,
            accuracy_rms_m=None if accuracy is None else accuracy.rms_m,
            accuracy_p95_m=None if accuracy is None else accuracy.p95_m,
            accuracy_bias_m=None if accuracy is None else accuracy.bias_m,
            accuracy_max_m=None if accuracy is None else accuracy.max_m,
            left_out_fraction=self.left_out_fraction,
            beyond_1mm_fraction=None if accuracy is None else accuracy.beyond(1e-3),
            completeness=tuple(
                CompletenessRecord(threshold_m=threshold, fraction=fraction)
                for threshold, fraction in zip(
                    complete.thresholds_m, complete.fractions, strict=True
                )
            ),
            predicted_missing=complete.predicted_missing,
            pixel_noise=light and light.pixel_noise,
            ambient=light and light.ambient,
            **compared,
            interreflection=self.interreflection and self.interreflection.record(),
            passed=self.passed,
            failures=self.failures,
        )

    def to_document(self) -> dict[str, Any]:
        """Return the record as plain JSON values."""
        return self.record().to_document()
