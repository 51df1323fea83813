"""Claims about the least or largest value of something over samples."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from planning.verify.audit.estimates import POINT
from planning.verify.audit.ledger import Ledger, as_number

# An extreme over other samples may lie so much farther out, as a share of itself.
_BEYOND = 0.1
# Samples that lie beyond it by less aren't counted against it.
_CLOSE = 0.05
_DEVIATIONS = 3.0


def audit_extreme(
    key: str,
    claimed: object,
    values: NDArray[np.float64],
    weights: NDArray[np.float64],
    ledger: Ledger,
    *,
    largest: bool,
    unit: str,
    closer: Callable[[float], NDArray[np.float64]] | None = None,
) -> None:
    """Check an extreme of positive values over samples that aren't the plan's.

    Two honest sets may differ in their very extreme. But not more than 1 % (and three
    standard errors) of what is sampled may lie beyond the one claimed by over 5 %, and
    some sample must come within 10 % of it.

    Args:
        key: Of the claim.
        claimed: The extreme, any JSON value.
        values: At the audit's samples, shape (n,), n >= 1.
        weights: What each sample stands for, shape (n,).
        ledger: Takes a false claim.
        largest: Whether it is the largest value; else the least.
        unit: Of the values, for the sentence.
        closer: Looks for values near one or beyond it that the samples may have
            missed; asked only where none of them comes near the claim.
    """
    value = as_number(claimed)
    extreme = float(values.max() if largest else values.min())
    if value is None:
        ledger.fail(key, f"{claimed!r} is claimed, recomputed {extreme:.6g} {unit}")
        return
    if not _near(value, extreme, largest) and closer is not None:
        least = value / (1.0 + _BEYOND) if largest else value / (1.0 - _BEYOND)
        more = np.append(closer(least), extreme)
        extreme = float(more.max() if largest else more.min())
    ledger.holds(
        _near(value, extreme, largest),
        key,
        f"claimed {value:.6g} {unit}, recomputed {extreme:.6g} {unit}, "
        f"tolerance {_BEYOND * extreme:.2g} {unit}",
    )
    if largest:
        beyond = values > (1.0 + _CLOSE) * value
    else:
        beyond = values < (1.0 - _CLOSE) * value
    share = float(weights[beyond].sum() / weights.sum())
    n = float(weights.sum() ** 2 / np.sum(weights**2))
    allowed = POINT + _DEVIATIONS * float(np.sqrt(share * n + 1.0) / (n + 2.0))
    ledger.holds(
        share <= allowed,
        key,
        f"claimed {value:.6g} {unit}, but {100 * share:.3g} % of what is lit is "
        f"{'larger' if largest else 'smaller'} (up to {extreme:.6g} {unit}), "
        f"{100 * allowed:.2g} % may be",
    )


def _near(value: float, extreme: float, largest: bool) -> bool:
    """Whether some sample comes within 10 % of a claim."""
    if largest:
        return value <= (1.0 + _BEYOND) * extreme
    return value >= (1.0 - _BEYOND) * extreme
