"""A projector's light on a polar grid about its ring axis, and extremes over it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import AuditSamples, samples_on
from planning.verify.audit.estimates import POINT
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.audit_optics import in_frame
from planning.verify.audit.predicates.predicates import LIT, light_steps

# Columns: azimuths half a step, one and a half and so on from the ring frame's x.
AZIMUTHS = 360


@dataclass(frozen=True, eq=False)
class RingGrid:
    """First hits of a grid of rays, a row for each ring coordinate.

    Attributes:
        projector: Whose light it is.
        coordinates: Of the rows: tangent, or radius in [m], shape (n_c,).
        rays: Place of each ray that leaves the device and meets the object, (k,).
        samples: Where, shape (k,) each.
        lit: Whether every limit of *lit* holds there, shape (k,).
    """

    projector: AuditProjector
    coordinates: NDArray[np.float64]
    rays: NDArray[np.int64]
    samples: AuditSamples
    lit: NDArray[np.bool_]

    def flags(self, chosen: NDArray[np.bool_] | bool) -> NDArray[np.bool_]:
        """Return a flag of hits at their places in the grid, (n_c, AZIMUTHS)."""
        grid = np.zeros((len(self.coordinates), AZIMUTHS), dtype=bool)
        grid.ravel()[self.rays] = chosen
        return grid

    def heights(self) -> NDArray[np.float64]:
        """Return z of the hits in the ring frame in [m], NaN without one."""
        grid = np.full((len(self.coordinates), AZIMUTHS), np.nan)
        frame = self.projector.world_from_ring
        grid.ravel()[self.rays] = in_frame(frame, self.samples.points)[:, 2]
        return grid


def cast_rings(
    case: AuditCase, projector: AuditProjector, coordinates: NDArray[np.float64]
) -> RingGrid:
    """Cast a ray for each ring coordinate (n_c,) and azimuth."""
    turn = (np.arange(AZIMUTHS) + 0.5) * (2.0 * np.pi / AZIMUTHS)
    circle = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(AZIMUTHS)])
    spokes = (coordinates[:, None, None] * circle).reshape(-1, 3)
    origins, along = projector.light.emitted(projector.world_from_ring, spokes)
    faces, distance = case.shadow.caster.first_hits(origins, along)
    rays = np.flatnonzero(faces >= 0)
    points = origins[rays] + distance[rays, None] * along[rays]
    leaves = projector.light.leaves(points)
    rays, points = rays[leaves], points[leaves]
    surface, limits = case.plan.surface, case.plan.requirements
    within = surface.target_faces(limits.target)
    samples = samples_on(surface, points, faces[rays], within[faces[rays]])
    lit = light_steps(projector, samples, limits.projector, case.shadow) == LIT
    return RingGrid(projector, coordinates, rays, samples, lit)


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
