"""`ranges`: the body that was estimated from ranges, `docs/use/ranges.md`."""

from typing import Any

from .part import Part, Vector3


class RangePoint(Part):
    """A point of the object, as estimated from its lines of the file."""

    point: str
    lines: tuple[int, ...]
    position_m: Vector3
    covariance_m2: tuple[Vector3, Vector3, Vector3]
    chi_square: float
    n_free: int
    residual_m: float


class RefusedPoint(Part):
    """A point that wasn't used, and why."""

    point: str
    lines: tuple[int, ...]
    reason: str


class EstimatedSphere(Part):
    """The least-squares sphere; covariance of centre and radius."""

    centre_m: Vector3
    radius_m: float
    covariance_m2: tuple[tuple[float, ...], ...]
    shape_sigma_m: float
    chi_square: float


class RangesRecord(Part):
    """What is known of a body by its ranges alone, and what was kept free for it."""

    path: str
    sha256: str
    significance: float
    observations: tuple[dict[str, Any], ...]
    points: tuple[RangePoint, ...]
    refused: tuple[RefusedPoint, ...]
    sphere: EstimatedSphere
    position_sigma_m: float
    guard_m: float
    guard_rad: float
    stated: dict[str, Any]
