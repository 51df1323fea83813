"""Light that bounces once between surfaces, and how far it moves measured points.

What a point x gets from the rest of the object, as a share rho of what falls there is
given back, is the mean over directions drawn by their cosine to x's normal::

    I = rho mean(E(y) s(y)),    s = 1 where the frame is bright, -1 where it is dark

with y what the direction meets and E the projector's light there. As good as the same
on both sides of an edge, it moves the zero of the frame's level, by which the edge is
found: with direct light E(x) and a blur of s_b pixels towards the dark side by::

    sqrt(2) s_b erfinv(I / E(x))
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import erfinv

from geometry.arrays import lengths
from geometry.rays.proximity import closest_points
from geometry.rays.rays import RayCaster, equal_parts
from planning.model.document.check_records import InterreflectionRecord
from planning.verify.reconstruction.arrays import Array, Indices, Mask
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

from .merge import Merged

# What a matt object gives back unless somebody says: sprayed white, or light skin.
ALBEDO = 0.8
CELL_M = 0.01
# Points of a cell that are asked, and directions from each: few, and where these leave
# open whether light moves it, many others.
_POINTS, _FEW, _MANY = 40, 16, 128
# Spirals of as many directions each, apart from each other; and how they turn.
_SPIRALS, _GOLDEN = 4, 0.5 * (np.sqrt(5.0) - 1.0)
_SEED = 23
# Standard deviations of what random directions leave open.
_SURELY = 2.0
# Rays start this share of the object's radius off the surface.
_OFF_SURFACE = 1e-5
# Beyond this share of the direct light an edge is lost rather than moved.
_MOST = 0.9
# Rays that are followed at once.
_AT_ONCE = 1 << 20


@dataclass(frozen=True, eq=False)
class Interreflection:
    """What one bounce of light does to a cloud, by cells of the world's grid.

    Attributes:
        albedo: Share of the light that the object is taken to give back.
        places: Middle of the measured points of each cell [m], shape (n, 3).
        bias: Mean displacement there along the normal [m], outside positive, (n,).
        sigma: Root mean square of the points' noise there [m], shape (n,).
        error: Standard deviation of `bias`, since few paths are followed [m], (n,).
    """

    albedo: float
    places: Array
    bias: Array
    sigma: Array
    error: Array

    @property
    def is_open(self) -> Mask:
        """Cells whose bias may be more than their sigma, shape (n,)."""
        return np.abs(self.bias) + _SURELY * self.error > self.sigma

    @property
    def biased(self) -> Mask:
        """Cells whose bias is surely more than their sigma, shape (n,)."""
        return np.abs(self.bias) - _SURELY * self.error > self.sigma

    def record(self) -> InterreflectionRecord:
        """Return the `interreflection` part of a plan's reconstruction."""
        none = InterreflectionRecord(
            albedo=self.albedo, cell_m=CELL_M, n_cells=len(self.bias), biased=0.0
        )
        if not self.biased.any():
            return none
        worst = int(np.argmax(np.where(self.biased, np.abs(self.bias), -1.0)))
        return none.model_copy(
            update={
                "biased": float(self.biased.mean()),
                "worst_m": float(self.bias[worst]),
                "worst_sigma_m": float(self.sigma[worst]),
                "worst_at": tuple(self.places[worst].tolist()),
            }
        )


def interreflection(
    plan: Scanner, merged: Merged, *, albedo: float = ALBEDO
) -> Interreflection:
    """Return what one bounce would do to a merged cloud.

    Deterministic. Some points of each cell are asked, and some directions of each.
    """
    cloud = merged.cloud
    able = np.isfinite(merged.sigma) & np.isfinite(cloud.blur_px)
    rng = np.random.default_rng(_SEED)
    able = rng.permutation(np.flatnonzero(able))
    grid = np.floor(cloud.points[able] / CELL_M).astype(np.int64)
    # Cells are told by one number: rows take several times as long to sort.
    x, y, z = (grid - grid.min(axis=0, initial=0)).T
    number = (x * (1 + y.max(initial=0)) + y) * (1 + z.max(initial=0)) + z
    _, cell = np.unique(number, return_inverse=True)
    asked, cell = able[kept := _first(cell, _POINTS)], cell[kept]
    some, noise = cloud.take(asked), merged.sigma[asked]
    moved, doubt = shifts(plan, some, albedo, rng, _FEW)
    cells, first = _by_cells(albedo, some, noise, cell, moved, doubt)
    again = np.isin(cell, cells[first.is_open])
    moved[again], doubt[again] = shifts(plan, some.take(again), albedo, rng, _MANY)
    return _by_cells(albedo, some, noise, cell, moved, doubt)[1]


def _by_cells(
    albedo: float, cloud: Cloud, noise: Array, cell: Indices, moved: Array, doubt: Array
) -> tuple[Indices, Interreflection]:
    """Return which cells have points that are known to move, and how far they do."""
    known = np.isfinite(moved)
    cells, of, count = np.unique(cell[known], return_inverse=True, return_counts=True)

    def mean(values: Array) -> Array:
        return np.bincount(of, values[known], len(cells)) / count

    places = np.stack([mean(column) for column in cloud.points.T], axis=1)
    error = np.sqrt(mean(doubt**2) / count)
    sigma = np.sqrt(mean(noise**2))
    return cells, Interreflection(albedo, places, mean(moved), sigma, error)


def _first(groups: Indices, most: int) -> Indices:
    """Indices of the first few items of each group."""
    order = np.argsort(groups, kind="stable")
    ordered = groups[order]
    begins = np.searchsorted(ordered, ordered)
    return order[np.arange(len(order)) - begins < most]


def shifts(
    plan: Scanner,
    cloud: Cloud,
    albedo: float,
    rng: np.random.Generator,
    n_directions: int = _FEW,
) -> tuple[Array, Array]:
    """Return displacements of points along the normal [m]; NaN: in the dark, (n,).

    And their standard deviation, since few directions are followed of each.
    """
    mesh, caster = plan.mesh, RayCaster(plan.mesh, threads=1)
    near = closest_points(mesh, cloud.points)
    normals = mesh.face_normals[near.faces]
    on = cloud.points - near.distances[:, None] * normals
    moved, doubt = np.full((2, len(cloud)), np.nan)
    for p, projector in enumerate(plan.projectors):
        of = np.flatnonzero(cloud.projector == p)
        for part in equal_parts(len(of), max(1, _AT_ONCE // n_directions)):
            rows = of[part]
            x, n = on[rows], normals[rows]
            bit = projector.pattern.flipping_bit[cloud.ring[rows]]
            direct = np.clip(projector.incidence_cosine(x, n), 0.0, None)
            direct = direct * _falloff(projector, x)
            rays = _cosine_directions(n, n_directions, rng)
            begin = np.repeat(x + _OFF_SURFACE * mesh.radius * n, n_directions, axis=0)
            faces, distances = caster.first_hits(begin, rays)
            hit = np.flatnonzero(faces >= 0)
            y = begin[hit] + distances[hit, None] * rays[hit]
            signed = np.zeros(len(begin))
            there, bits = mesh.face_normals[faces[hit]], np.repeat(bit, n_directions)
            signed[hit] = _signed_light(projector, caster, y, there, bits[hit])
            every = albedo * signed.reshape(len(rows), _SPIRALS, -1).mean(axis=2)
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.where(direct > 0.0, every.mean(axis=1) / direct, np.nan)
                vague = every.std(axis=1, ddof=1) / (np.sqrt(_SPIRALS) * direct)
            share = np.where(np.abs(share) < _MOST, share, np.nan)
            some = cloud.take(rows)
            moved[rows] = moved_by(some, n, share)
            doubt[rows] = np.abs(moved_by(some, n, np.minimum(vague, _MOST)))
    return moved, doubt


def moved_by(cloud: Cloud, normals: Array, share: Array) -> Array:
    """Return how far light of a share of the direct one moves points [m], (n,).

    Args:
        cloud: The points.
        normals: Of the surface there, shape (n, 3); outside is positive.
        share: Light of other surfaces while the edge's frame is shown, less that while
            its inverse is, over the direct light, shape (n,).
    """
    # `shift` is for an edge that moves towards its bright side.
    towards_dark = np.sqrt(2.0) * cloud.blur_px * erfinv(share)
    return -towards_dark * np.einsum("ij,ij->i", normals, cloud.shift)


def _signed_light(
    projector: ProjectorCalibration,
    caster: RayCaster,
    points: Array,
    normals: Array,
    bits: Indices,
) -> Array:
    """Light at points in frames of bits: negative where they are dark, shape (n,)."""
    pattern, light = projector.pattern, np.zeros(len(points))
    cosine = projector.incidence_cosine(points, normals)
    pixels, _ = projector.panel(points)
    rho = projector.ring_coordinate(points)
    drawn = (cosine > 0.0) & projector.in_panel(pixels) & (rho < pattern.outer_radius)
    rows = np.flatnonzero(drawn)
    start, beams, reach = projector.aim(points[rows])
    clear = ~caster.occluded(start, beams, reach * (1.0 - 2e-5))
    rows = rows[clear]
    code = pattern.codes[np.searchsorted(pattern.radii, rho[rows])]
    sign = np.where((code >> bits[rows]) & 1, 1.0, -1.0)
    light[rows] = sign * cosine[rows] * _falloff(projector, points[rows])
    return light


def _falloff(projector: ProjectorCalibration, points: Array) -> Array:
    """Light across its beam, 1 at a metre's depth; the same everywhere if parallel."""
    depth = (points - projector.centre) @ projector.axis
    return projector.light.shrink(np.maximum(depth, 1e-9)) ** 2


def _cosine_directions(normals: Array, n_each: int, rng: np.random.Generator) -> Array:
    """Directions drawn by their cosine to each normal, (n * n_each, 3).

    On spirals of the sphere (Fibonacci's), each turned and moved at random.
    """
    per = n_each // _SPIRALS
    moved, turned = rng.random((2, len(normals), _SPIRALS, 1))
    k = np.arange(per)
    z = 1.0 - 2.0 * (k + moved) / per
    phi = 2.0 * np.pi * (k * _GOLDEN + turned)
    r = np.sqrt(1.0 - z**2)
    ball = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1).reshape(-1, 3)
    # A point of the unit sphere about the normal's tip is Lambert's law.
    along = np.repeat(normals, n_each, axis=0) + 0.999999 * ball
    return along / lengths(along)[:, None]
