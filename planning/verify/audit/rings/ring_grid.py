"""What rings fall on and leave out: their light on a polar grid, creases, chords."""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.topology import face_pairs
from planning.model.document.ring_records import CreasesRecord
from planning.model.surface import Surface
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import AuditSamples, samples_on
from planning.verify.audit.estimates import POINT
from planning.verify.audit.predicates.audit_devices import AuditProjector
from planning.verify.audit.predicates.audit_optics import dot, in_frame
from planning.verify.audit.predicates.predicates import LIT, light_steps

# Columns: azimuths half a step, one and a half and so on from the ring frame's x.
AZIMUTHS = 360
# Rows of the grid in an even gap, as long as a chord; and from its middle to an end.
ROWS = 4
_REACH = ROWS // 2
# Poses are rounded after rings are spaced: room for that, as a share of the length.
_CLOSE = 0.02
_SHARPEST_FACET = np.radians(40.0)
# Moved so far towards its face's centroid, a point is off the edge.
_ASIDE = 0.02


@dataclass(frozen=True, eq=False)
class RingGrid:
    """First hits of a grid of rays, a row for each ring coordinate.

    Attributes:
        coordinates: Of the rows: tangent, or radius in [m], shape (n_c,).
        rays: Place of each ray that leaves the device and meets the object, (k,).
        samples: Where, shape (k,) each.
        lit: Whether every limit of *lit* holds there, shape (k,).
    """

    projector: AuditProjector
    coordinates: Array
    rays: Ints
    samples: AuditSamples
    lit: Mask

    def flags(self, chosen: Mask | bool) -> Mask:
        """Return a flag of hits at their places in the grid, (n_c, AZIMUTHS)."""
        grid = np.zeros((len(self.coordinates), AZIMUTHS), dtype=bool)
        grid.ravel()[self.rays] = chosen
        return grid

    def heights(self) -> Array:
        """Return z of the hits in the ring frame in [m], NaN without one."""
        grid = np.full((len(self.coordinates), AZIMUTHS), np.nan)
        frame = self.projector.world_from_ring
        grid.ravel()[self.rays] = in_frame(frame, self.samples.points)[:, 2]
        return grid


def cast_rings(
    case: AuditCase, projector: AuditProjector, coordinates: Array
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


def audit_extreme(
    key: str,
    value: float,
    values: Array,
    weights: Array,
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


@dataclass(frozen=True, eq=False)
class AuditCreases:
    """Middles of pieces of the edges at which two faces turn by more than 40 degrees.

    Attributes:
        points: In the world [m], shape (n, 3).
        faces: The faces on both sides, shape (n, 2).
        lengths: Of the pieces, at most half a mean edge [m], shape (n,).
    """

    points: Array
    faces: Ints
    lengths: Array


def creases_of(surface: Surface) -> AuditCreases:
    """Return the creases of a surface, each sharp edge in pieces of equal length."""
    mesh = surface.mesh
    faces, edge = face_pairs(mesh.edges)
    one, other = (mesh.face_normals[face] for face in faces.T)
    sharp = dot(one, other) < np.cos(_SHARPEST_FACET)
    ends, faces = mesh.vertices[mesh.edges.ends[edge[sharp]]], faces[sharp]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    n = np.maximum(1, np.ceil(length / (0.5 * mesh.mean_edge)).astype(np.int64))
    which = np.repeat(np.arange(len(n)), n)
    piece = np.arange(len(which)) - np.repeat(np.cumsum(n) - n, n)
    share = ((piece + 0.5) / n[which])[:, None]
    points = (1.0 - share) * ends[which, 0] + share * ends[which, 1]
    return AuditCreases(points, faces[which], (length / n)[which])


def audit_creases(
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
    slopes: list[Array] = []
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
    findings.numbers(claims, {"length_m": total}, slack, "m")
    if total > 0.0:
        jump = np.abs(slopes[0] - slopes[1])[lit]
        error = 0.25 * jump * projector.ring_spacing(creases.points[lit])
        name, claimed = "max_error_m", claims.max_error_m
        audit_extreme(name, claimed, error, lengths, findings, largest=True)


def strays(
    grid: RingGrid, creases: AuditCreases, max_incidence: float, tolerance_m: float
) -> tuple[float, int]:
    """Return the share of chords between rings that err by too much, and how many are.

    A chord joins two points of the surface one even gap apart; it errs by (h / even
    gap)^2 of that, h the gap of the rings at its middle. It counts if both ends and the
    middle are lit, neither half rises faster than tan(theta_max) and no crease is near:
    on the target, or anywhere if none of them is on it. `docs/method/rings.md`. The
    grid has `ROWS` rows an even gap; max_incidence is theta_max [rad].
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
    return (float(over.mean()) if len(over) else 0.0), len(over)


def _creased(grid: RingGrid, creases: AuditCreases) -> Mask:
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
