"""What a plan file says of rings: their spacing, axes and shares."""

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from .part import Interval, Part, Pose, Size

AxisTaken = Literal["centred", "free"]
RingAxis = Literal["centred", "free", "auto"]
# No projector shows more, and rays to as many would fill the memory of who audits them.
_Rings = Annotated[int, Field(ge=0, le=10_000)]


def are_radii(radii: tuple[float, ...]) -> tuple[float, ...]:
    """Return ring radii.

    Raises:
        ValueError: If they aren't 2 or more, rising from 0.
    """
    if len(radii) < 2 or not _rise(radii):
        raise ValueError("must be 2 or more, rising from 0")
    return radii


def _left_out(radii: tuple[float, ...]) -> tuple[float, ...]:
    if not _rise(radii):
        raise ValueError("must rise from 0")
    return radii


def _rise(radii: tuple[float, ...]) -> bool:
    return bool(np.all(np.diff(radii, prepend=0.0) > 0.0))


class CreasesRecord(Part):
    """Creases that a projector lights: their length and what rings cut off them."""

    length_m: Size
    max_error_m: Size


class RingsRecord(Part):
    """How the rings of a projector are spaced; gaps h and errors in [m].

    Attributes:
        spacing: `kept`: as of the plan that the projector is from.
        kept_even: Whether they stay even since others would lose measured samples.
        n_even: How many evenly spaced rings there were; of kept ones, as many.
        gap_m: Least and largest gap on the object; None: no ring lands on it.
        over_tolerance: Share of chords between rings that err by more than the accuracy
            that was asked for, or than the check's 95th percentile.
        left_out: Radii of rings that would light nothing of the object, and so aren't
            projected; `rig.rings.margin_m` is how far aside it may stand.
    """

    spacing: Literal["uniform", "curvature", "kept"]
    kept_even: bool
    n_even: _Rings
    gap_m: Interval | None
    over_tolerance: Size
    creases: CreasesRecord
    left_out: Annotated[tuple[float, ...], AfterValidator(_left_out)] = ()


class OtherRings(Part):
    """A projector of the plan with other, evenly spaced rings."""

    id: str
    world_from_ring: Pose
    ring_radii: Annotated[tuple[float, ...], AfterValidator(are_radii)]


class OtherAxes(Part):
    """What the plan's devices would measure of the target with other ring axes."""

    axis: AxisTaken
    projectors: tuple[OtherRings, ...]
    measured_m2: float


class RingAxes(Part):
    """Where ring axes stand: as asked, as taken, and what was weighed against it.

    Attributes:
        asked: By the user, or by the rig.
        taken: `centred` in the middle of what each projector lights, or `free`.
        other: None: no other axes were looked at.
    """

    asked: RingAxis
    taken: AxisTaken
    other: OtherAxes | None = None


class RingSharesRecord(Part):
    """What becomes of each ring: shares of its azimuth, one number a ring."""

    on_object: tuple[float, ...]
    on_target: tuple[float, ...]
    measured: tuple[float, ...]
