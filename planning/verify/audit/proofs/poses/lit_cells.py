"""Which samples a projector anywhere in a cell of poses may light: a superset."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Mask
from planning.model.requirements import ProjectorLimits, Workspace
from planning.verify.audit.audit_samples import AuditSamples

from .admissible_cells import may_stand
from .skies import Skies
from .sphere_cells import Cells, Seen, of_parallel, seen_from

_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class LitCells:
    """Cells of projectors: field of view, beam, rings and bodies are left out.

    Attributes:
        space: Where they may stand.
        samples: What they may light.
        limits: Of light that arrives.
        range_m: Least and largest length of its way, of any model [m].
        skies: Directions from which nothing is lit; None: it isn't asked.
        aside: Of parallel light, how far a device may be off its direction [rad].
    """

    space: Workspace
    samples: AuditSamples
    limits: ProjectorLimits
    range_m: tuple[float, float]
    skies: Skies | None
    aside: float | None = None

    def serve(self, cells: Cells, may: Mask) -> Mask:
        """Return which samples poses of each cell may light, of those that may be."""
        stand = may_stand(self.space, cells, self.aside or 0.0)
        points = self.samples.points - np.array(self.space.centre)
        vectors = self.samples.normals, self.samples.steep
        if self.aside is None:
            seen = seen_from(cells, points, vectors)
        else:
            seen = of_parallel(cells, vectors)
        served = may & stand[:, None] & self._in_limits(seen)
        if self.skies is not None:
            from_centre = points if self.aside is None else None
            self.skies.leave_open(served, cells, seen.psi, from_centre)
        return served

    def _in_limits(self, seen: Seen) -> Mask:
        incidence, tangent = (np.arccos(np.clip(c, -1.0, 1.0)) for c in seen.along)
        tangent = np.minimum(tangent, np.pi - tangent)
        near, far = self.range_m
        return (
            (incidence - seen.psi <= self.limits.max_incidence + _ROUNDING)
            & (tangent + seen.psi >= self.limits.min_tangent_angle - _ROUNDING)
            & (seen.nearest <= far + _ROUNDING)
            & (seen.farthest >= near - _ROUNDING)
        )
