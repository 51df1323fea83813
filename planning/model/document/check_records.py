"""`reconstruction` of a plan file: what the check from pixels found."""

from planning.model.words import percent

from .part import Count, Part, Size, Vector3


class CompletenessRecord(Part):
    """Share of the target predicted measured that has a point within a distance."""

    threshold_m: Size
    fraction: Size


class ConfusionRecord(Part):
    """Shares of an area: predicted or not, measured or not."""

    both: Size
    missing: Size
    unexpected: Size
    neither: Size
    beside: Size
    agreement: Size
    trivial_agreement: Size


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
    predicted: Size | None
    measured: Size | None
    predicted_missing: Size | None
    n_points: Count
    rms_m: Size | None
    p95_m: Size | None
    bias_m: float | None


class InterreflectionRecord(Part):
    """What light that bounces once between surfaces does to the measured points.

    Attributes:
        albedo: Share of the light that the object is taken to give back.
        cell_m: Side of the cells of the world's grid that points are taken together in.
        n_cells: Cells with measured points.
        biased: Share of them whose points are moved by more than their sigma.
        worst_m: Of these the largest displacement along the normal; None: there is
            none.
        worst_sigma_m: Sigma of the noise there.
        worst_at: Where that is.
    """

    albedo: Size
    cell_m: Size
    n_cells: Count
    biased: Size
    worst_m: float | None = None
    worst_sigma_m: Size | None = None
    worst_at: Vector3 | None = None

    def warning(self) -> str:
        """Return a sentence where some cell is biased, else nothing."""
        if self.worst_m is None or self.worst_at is None:
            return ""
        place = ", ".join(f"{1e3 * x:.0f}" for x in self.worst_at)
        sigma = 1e3 * (self.worst_sigma_m or 0.0)
        return (
            f"light that bounces between surfaces moves {percent(self.biased)} of "
            f"{1e3 * self.cell_m:.0f} mm cells by more than their noise, if the object "
            f"gives back {percent(self.albedo, decimals=0)} of it: worst by "
            f"{1e3 * self.worst_m:+.3f} mm (sigma {sigma:.3f}) "
            f"at ({place}) mm"
        )


class ReconstructionRecord(Part):
    """Errors, completeness and verdict.

    Attributes:
        left_out_fraction: Share of the ring edges found in images that gave no point,
            or a point that merging took for a step between surfaces.
        beyond_1mm_fraction: Share of the merged points that are off by more.
        plan: Digest of the plan that was checked (`RigPlan.digest`).
        asked: As of `coverage`.
    """

    n_points: Count
    n_merged: Count
    redundant_fraction: Size
    accuracy_rms_m: Size | None
    accuracy_p95_m: Size | None
    accuracy_bias_m: float | None
    accuracy_max_m: Size | None = None
    left_out_fraction: Size | None = None
    beyond_1mm_fraction: Size | None = None
    completeness: tuple[CompletenessRecord, ...]
    predicted_missing: Size | None
    pixel_noise: Size | None
    ambient: Size | None
    confusion: ConfusionRecords | None = None
    by_region: tuple[SurfaceShare, ...] = ()
    dominant: SurfaceShare | None = None
    whole_surface: SurfaceShare | None = None
    interreflection: InterreflectionRecord | None = None
    passed: bool
    failures: tuple[str, ...]
    plan: str | None = None
    asked: str | None = None
