"""`reconstruction` of a plan file: what the check from pixels found."""

from .part import Part


class CompletenessRecord(Part):
    """Share of the target predicted measured that has a point within a distance."""

    threshold_m: float
    fraction: float


class ConfusionRecord(Part):
    """Shares of an area: predicted or not, measured or not."""

    both: float
    missing: float
    unexpected: float
    neither: float
    beside: float
    agreement: float
    trivial_agreement: float


class ConfusionPair(Part):
    """By the limits of the plan, and at the physical floors."""

    limits: ConfusionRecord
    floors: ConfusionRecord


class ConfusionRecords(Part):
    """On the target, and on the whole surface."""

    target: ConfusionPair
    surface: ConfusionPair


class SurfaceShare(Part):
    """What a part of the surface got; None where nothing of it was sampled.

    Attributes:
        id: Of a region; absent for others.
    """

    id: int | None = None
    predicted: float | None
    measured: float | None
    predicted_missing: float | None
    n_points: int
    rms_m: float | None
    p95_m: float | None
    bias_m: float | None


class ReconstructionRecord(Part):
    """Errors, completeness and verdict.

    Attributes:
        left_out_fraction: Share of the ring edges found in images that gave no point,
            or a point that merging took for a step between surfaces.
        beyond_1mm_fraction: Share of the merged points that are off by more.
    """

    n_points: int
    n_merged: int
    redundant_fraction: float
    accuracy_rms_m: float | None
    accuracy_p95_m: float | None
    accuracy_bias_m: float | None
    accuracy_max_m: float | None = None
    left_out_fraction: float | None = None
    beyond_1mm_fraction: float | None = None
    completeness: tuple[CompletenessRecord, ...]
    predicted_missing: float | None
    pixel_noise: float | None
    ambient: float | None
    confusion: ConfusionRecords | None = None
    by_region: tuple[SurfaceShare, ...] = ()
    dominant: SurfaceShare | None = None
    whole_surface: SurfaceShare | None = None
    passed: bool
    failures: tuple[str, ...]
