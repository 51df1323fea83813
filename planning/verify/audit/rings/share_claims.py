"""Claims about what becomes of each ring: `ring_shares` of a projector."""

import numpy as np
from numpy.typing import NDArray

from planning.model.document.device_records import RingSharesRecord
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.predicates import MEASURED
from planning.verify.audit.predicates.recompute import pairs_with

from .ring_grid import AZIMUTHS, RingGrid, cast_rings

# Rays of a ring are told from the next gap by taking them from just inside it.
_INSIDE = 1.0 - 1e-9
# Rays of a ring that rounding may turn at limits and outlines, and written digits.
_SLACK = 3.0 / AZIMUTHS + 1e-4


def audit_ring_shares(
    key: str,
    claims: RingSharesRecord,
    case: AuditCase,
    projector: AuditProjector,
    findings: AuditFindings,
) -> None:
    """Check the shares of every ring's azimuth against rays at the same azimuths."""
    grid = cast_rings(case, projector, _INSIDE * projector.radii)
    for name, truth in (
        ("on_object", grid.flags(True)),
        ("on_target", grid.flags(grid.samples.in_target)),
        ("measured", grid.flags(_measured(case, grid))),
    ):
        shares = truth.mean(axis=1)
        claimed = getattr(claims, name)
        findings.array(f"{key}.{name}", claimed, shares, _SLACK, "the share recomputed")


def _measured(case: AuditCase, grid: RingGrid) -> NDArray[np.bool_]:
    """Whether a camera measures each hit with this projector's light, shape (k,)."""
    measured = np.zeros(len(grid.rays), dtype=bool)
    lit = np.flatnonzero(grid.lit)
    by_it = np.ones((1, len(lit)), dtype=bool)
    limits, samples = case.plan.requirements, grid.samples.take(lit)
    for camera in case.cameras:
        pairs = pairs_with(
            camera, [grid.projector], samples, by_it, limits, case.shadow
        )
        measured[lit] |= pairs[0] == MEASURED
    return measured
