"""Numbers that callers hand over, checked before anything is computed from them."""

import operator

import numpy as np
from numpy.typing import ArrayLike, NDArray

# A required weight is lowered by this share, against rounding.
WEIGHT_SLACK = 1e-12
# Sums within this and its inverse neither vanish nor overflow.
_LEAST_TOTAL = 1e-250


def real_numbers(name: str, numbers: ArrayLike) -> NDArray[np.float64]:
    """Return a copy in float64, or raise ValueError if they aren't real numbers."""
    try:
        values = np.array(numbers)
        if values.dtype.kind in "biuf":
            return values.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError(f"{name} must be real numbers")


def whole_numbers(name: str, numbers: ArrayLike) -> NDArray[np.int64]:
    """Return a copy in int64, or raise ValueError beyond whole numbers of 52 bits."""
    values = (
        real_numbers(name, numbers) if np.size(numbers) else np.empty(np.shape(numbers))
    )
    if not np.all((np.abs(values) <= 2.0**52) & (values == np.rint(values))):
        raise ValueError(f"{name} must be whole numbers")
    return values.astype(np.int64)


def whole_number(name: str, numbers: object, *, least: int) -> int:
    """Return an integer, or raise ValueError if it isn't one, or below the least."""
    try:
        value = operator.index(numbers)  # type: ignore[arg-type]
    except TypeError:
        raise ValueError(f"{name} must be a whole number, got {numbers!r}") from None
    if value < least:
        raise ValueError(f"{name} must be at least {least}, got {numbers}")
    return value


def allowed_sets(
    name: str, numbers: object, *, least: int, fixed: NDArray[np.int64]
) -> int:
    """Return how many sets are allowed, or raise ValueError if more are fixed."""
    allowed = whole_number(name, numbers, least=least)
    if not allowed >= fixed.size:
        raise ValueError(f"{name} is {allowed}, but {fixed.size} sets are fixed")
    return allowed


def set_names(name: str, numbers: ArrayLike, n: int) -> NDArray[np.int64]:
    """Return the sets that are named, increasing, each once.

    Raises:
        ValueError: If they aren't whole numbers from 0 to n - 1; a mask isn't.
    """
    if np.asarray(numbers).dtype == bool:
        raise ValueError(f"{name} must name sets by number, not by a mask")
    names = np.unique(whole_numbers(name, numbers))
    if not np.all((names >= 0) & (names < n)):
        raise ValueError(f"{name} must name sets from 0 to {n - 1}")
    return names


def check_weights(weights: NDArray[np.float64]) -> None:
    """Raise ValueError if a weight or their sum is negative, tiny or not finite."""
    if not np.all((weights >= 0.0) & np.isfinite(weights)):
        raise ValueError("weights must be finite and at least 0")
    with np.errstate(over="ignore"):
        total = float(weights.sum())
    if not (total == 0.0 or _LEAST_TOTAL <= total <= 1.0 / _LEAST_TOTAL):
        raise ValueError(
            f"weights must have a finite sum, 0 or from {_LEAST_TOTAL:g} to "
            f"{1.0 / _LEAST_TOTAL:g}, got {total:g}"
        )


def whole_weights(
    weights: NDArray[np.float64], *, bits: int
) -> tuple[int, NDArray[np.float64], NDArray[np.bool_]]:
    """Return weights as whole numbers of a power of two, of a sum below 2^bits or so.

    Returns:
        The exponent by which they were scaled, the whole numbers, and which of them
        were rounded.
    """
    total = float(weights.sum())
    exponent = bits - 1 - int(np.floor(np.log2(total))) if total > 0 else 0
    scaled = np.ldexp(weights, exponent)
    whole = np.rint(scaled)
    return exponent, whole, whole != scaled
