"""Creases of the surface and chords between rings: what rings leave out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.document.device_records import CreasesRecord
from planning.model.surface import Surface
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import samples_on
from planning.verify.audit.estimates import POINT
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.audit_optics import dot, in_frame
from planning.verify.audit.predicates.predicates import LIT, light_steps

from .ring_grid import AZIMUTHS, RingGrid, audit_extreme

_SHARPEST_FACET = np.radians(40.0)
# Moved so far towards its face's centroid, a point is off the edge.
_ASIDE = 0.02


@dataclass(frozen=True, eq=False)
class AuditCreases:
    """Middles of pieces of the edges at which two faces turn by more than 40 degrees.

    Attributes:
        points: In the world [m], shape (n, 3).
        faces: The faces on both sides, shape (n, 2).
        lengths: Of the pieces, at most half a mean edge [m], shape (n,).
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    lengths: NDArray[np.float64]


def creases_of(surface: Surface) -> AuditCreases:
    """Return the creases of a surface, each sharp edge in pieces of equal length."""
    mesh = surface.mesh
    sides = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    ends, edge, count = np.unique(
        sides, axis=0, return_inverse=True, return_counts=True
    )
    order = np.argsort(edge.ravel(), kind="stable")
    first = (np.cumsum(count) - count)[count == 2]
    faces = np.column_stack([order[first] // 3, order[first + 1] // 3])
    one, other = (mesh.face_normals[face] for face in faces.T)
    sharp = dot(one, other) < np.cos(_SHARPEST_FACET)
    ends, faces = mesh.vertices[ends[count == 2][sharp]], faces[sharp]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    n = np.maximum(1, np.ceil(length / (0.5 * mesh.mean_edge)).astype(np.int64))
    which = np.repeat(np.arange(len(n)), n)
    piece = np.arange(len(which)) - np.repeat(np.cumsum(n) - n, n)
    share = ((piece + 0.5) / n[which])[:, None]
    points = (1.0 - share) * ends[which, 0] + share * ends[which, 1]
    return AuditCreases(points, faces[which], (length / n)[which])


def audit_creases(
    key: str,
    claims: CreasesRecord,
    case: AuditCase,
    projector: AuditProjector,
    creases: AuditCreases,
    findings: AuditFindings,
) -> None:
    """Check the length of creases lit on both sides, and their largest error J h / 4.

    Along the beam a face of normal n rises by (n.m) / (n.L) across the rings; J is the
    jump of this slope, h the distance of the rings.
    """
    surface, limits = case.plan.surface, case.plan.requirements.projector
    along, _ = projector.light.to_points(creases.points)
    m = projector.ring_gradient(creases.points)
    m /= np.linalg.norm(m, axis=1)[:, None]
    lit = np.ones(len(creases.points), dtype=bool)
    slopes: list[NDArray[np.float64]] = []
    for faces in creases.faces.T:
        normals = surface.mesh.face_normals[faces]
        inward = surface.mesh.face_centroids[faces] - creases.points
        points = creases.points + _ASIDE * inward
        beside = samples_on(surface, points, faces, np.ones(len(faces), dtype=bool))
        lit &= light_steps(projector, beside, limits, case.shadow) == LIT
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes.append(dot(normals, m) / dot(normals, along))
    lengths = creases.lengths[lit]
    total = float(lengths.sum())
    slack = POINT * total + 2.0 * float(creases.lengths.max(initial=0.0))
    findings.number(f"{key}.length_m", claims.length_m, total, slack, "m")
    if total > 0.0:
        jump = np.abs(slopes[0] - slopes[1])[lit]
        error = 0.25 * jump * projector.ring_spacing(creases.points[lit])
        name = f"{key}.max_error_m"
        claimed = claims.max_error_m
        audit_extreme(name, claimed, error, lengths, findings, largest=True)


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
    on the target, or anywhere if none of them is on it. `docs/method/rings.md`.

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
