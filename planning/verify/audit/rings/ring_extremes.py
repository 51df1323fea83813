"""Claims about the least or largest length over places that plan and audit share."""

import numpy as np
from numpy.typing import NDArray

from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.estimates import POINT

# Poses are rounded after rings are spaced: room for that, as a share of the length.
_CLOSE = 0.02


def audit_extreme(
    key: str,
    value: float,
    values: NDArray[np.float64],
    weights: NDArray[np.float64],
    findings: AuditFindings,
    *,
    largest: bool,
) -> None:
    """Check an extreme of positive lengths [m] over lit places, n >= 1.

    Rounding may light another place at the very limit: so one must come within 2 % of
    the extreme claimed, and not more than 1 % may lie beyond it by more than that.
    """
    sign = 1.0 if largest else -1.0
    extreme = sign * float(np.max(sign * values))
    beyond = sign * (values - value) > _CLOSE * value
    share = float(weights[beyond].sum() / weights.sum())
    findings.holds(
        sign * (value - extreme) <= _CLOSE * extreme and share <= POINT,
        key,
        f"claimed {value:.6g} m, recomputed {extreme:.6g} m, tolerance "
        f"{_CLOSE * extreme:.2g} m; {100 * share:.3g} % of what is lit lies beyond",
    )
