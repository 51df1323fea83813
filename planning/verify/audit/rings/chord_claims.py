"""How far the surface strays from a straight line between two rings."""

import numpy as np
from numpy.typing import NDArray

from planning.verify.audit.predicates.audit_optics import in_frame

from .crease_claims import AuditCreases
from .ring_grid import AZIMUTHS, RingGrid

# Rows of the grid in an even gap, as long as a chord; and from its middle to an end.
ROWS = 4
_REACH = ROWS // 2


def strays(
    grid: RingGrid, creases: AuditCreases, max_incidence: float, tolerance_m: float
) -> float:
    """Return the share of chords between rings that err by more than a tolerance.

    A chord joins two points of the surface one even gap apart; it errs by (h / even
    gap)^2 of that, h the gap of the rings at its middle. It counts if both ends and the
    middle are lit, neither half rises faster than tan(theta_max) and no crease is near:
    on the target, or anywhere if none of them is on it. `docs/rings.md`.

    Args:
        grid: Of `ROWS` rows an even gap.
        creases: Of the surface.
        max_incidence: theta_max [rad].
        tolerance_m: Largest error along the beam.
    """
    c, z, lit = grid.coordinates, grid.heights(), grid.flags(grid.lit)
    with np.errstate(invalid="ignore"):
        s, t = grid.projector.light.run(c[:, None], z)
        rise = np.abs(t[_REACH:] - t[:-_REACH]) / (s[_REACH:] - s[:-_REACH])
    flat = rise <= np.tan(max_incidence)
    counted = lit[:-ROWS] & lit[_REACH:-_REACH] & lit[ROWS:]
    counted &= flat[:-_REACH] & flat[_REACH:] & ~_creased(grid, creases)[_REACH:-_REACH]
    on_target = counted & grid.flags(grid.samples.in_target)[_REACH:-_REACH]
    counted = on_target if on_target.any() else counted
    middles = c[_REACH:-_REACH]
    ends = z[:-ROWS], z[_REACH:-_REACH], z[ROWS:]
    errors = grid.projector.light.chord_error(middles[:, None], ends)
    shrunk = (grid.projector.ring_gap(middles) / (ROWS * c[0])) ** 2
    over = (errors * shrunk[:, None])[counted] > tolerance_m
    return float(over.mean()) if len(over) else 0.0


def _creased(grid: RingGrid, creases: AuditCreases) -> NDArray[np.bool_]:
    """Cells with a crease within three rows and a column, (n_c, AZIMUTHS).

    Near the axis a piece of crease is seen under a wider angle, and so more columns.
    """
    near = np.zeros((len(grid.coordinates), AZIMUTHS), dtype=bool)
    ring = in_frame(grid.projector.world_from_ring, creases.points)
    step = 2.0 * np.pi / AZIMUTHS
    row = np.searchsorted(grid.coordinates, grid.projector.light.coordinate(ring))
    column = (np.arctan2(ring[:, 1], ring[:, 0]) % (2.0 * np.pi) // step).astype(int)
    angle = np.arctan2(0.5 * creases.lengths, np.hypot(ring[:, 0], ring[:, 1]))
    width = 1 + (angle // step).astype(int)
    for aside in range(-width.max(initial=0), width.max(initial=0) + 1):
        wide = width >= abs(aside)
        for down in range(-_REACH - 1, _REACH + 2):
            chosen = wide & (row + down >= 0) & (row + down < len(near))
            near[row[chosen] + down, (column[chosen] + aside) % AZIMUTHS] = True
    return near
