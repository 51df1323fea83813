"""Pictures of light and views: what is lit, seen, open, in shadow; cells; rings."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from geometry.poses import inverse, transform
from geometry.rays.rays import RayCaster
from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedProjector
from planning.report.drawing.panel import Panel

from .drawing import (
    ABOVE,
    BLUE,
    CLAY,
    DARK,
    FRONT,
    LIGHT,
    ORANGE,
    PINK,
    SIDE,
    SIZE,
    beside_each_other,
    by,
    drawn,
    finished,
    pictured,
    ramp,
    shaded,
    view_of,
)
from .job import Job


def misses(job: Job) -> Image.Image:
    """What two projectors don't light: what a missed requirement looks like."""
    lit = np.any([lit_by(job, p) for p in job.plan.projectors[:2]], axis=0)
    target = job.plan.surface.target_faces("dominant")
    colours = by(lit & target, (120, 190, 235), CLAY)
    colours[target & ~lit] = (120, 0, 80)
    return beside_each_other(*(drawn(job, colours, side) for side in (FRONT, SIDE)))


def outside(job: Job) -> Image.Image:
    """How freely each face sees out: the share of rays from it that meet nothing."""
    colours = ramp(2.5 * _freedom(job) - 1.5, (120, 60, 40), (250, 240, 200))
    return beside_each_other(*(drawn(job, colours, side) for side in (FRONT, SIDE)))


def shadows(job: Job) -> Image.Image:
    """P1's light: lit, facing away, or in shadow."""
    projector = job.plan.projectors[0]
    ray = job.mesh.face_centroids - projector.world_from_device[:3, 3]
    facing = np.einsum("ij,ij->i", job.mesh.face_normals, ray) < 0.0
    colours = by(facing, LIGHT, CLAY)
    colours[facing & ~lit_by(job, projector)] = PINK
    return beside_each_other(*(drawn(job, colours, side) for side in (FRONT, SIDE)))


def candidates(job: Job) -> Image.Image:
    """Candidate poses of projectors about the object, and those that were taken."""
    surface, plan = job.plan.surface, job.plan
    places = surface.reference_projectors[:, :3, 3]
    view = view_of(places, ABOVE, (640, 560))
    panel = Panel(shaded(job.caster, CLAY).shade(view), view, job.caster)
    for place in places:
        panel.dot(place, (185, 185, 190), radius=2.0)
    for projector in plan.projectors:
        place = projector.world_from_device[:3, 3]
        ends = np.stack([place, job.mesh.centre])
        panel.polyline(ends, ORANGE, width=1.5)
        panel.dot(place, ORANGE, radius=5.0)
        panel.label(place, projector.id, ORANGE, size=15.0)
    panel.scale_bar(size=13.0)
    return finished(panel)


def rings(job: Job) -> Image.Image:
    """A frame of P1's code, and its rings where they fall on the object."""
    assert job.plan
    (finest,) = (job.folder / "patterns" / "P1").glob("*bit0.png")
    frame = Image.open(finest).convert("RGB").resize((640, 480))
    projector = job.plan.projectors[0]
    local = transform(inverse(projector.world_from_ring), job.mesh.face_centroids)
    radius = np.hypot(local[:, 0], local[:, 1]) / local[:, 2]
    ring = np.searchsorted(projector.ring_radii, radius)
    colours = by(ring % 2 == 0, LIGHT, (150, 110, 60))
    colours[~lit_by(job, projector)] = CLAY
    return beside_each_other(frame, drawn(job, colours, FRONT))


def covers(job: Job) -> Image.Image:
    """By how many of forty candidate projectors each face could be lit."""
    places = job.plan.surface.reference_projectors[:, :3, 3]
    chosen = places[:: max(len(places) // 40, 1)]
    count = sum(lit_from(job, place).astype(float) for place in chosen)
    share = (count - count.min()) / np.ptp(count)
    colours = ramp(share, (60, 40, 90), (250, 230, 120))
    return beside_each_other(*(drawn(job, colours, side) for side in (FRONT, SIDE)))


def cells(job: Job) -> Image.Image:
    """Cells of directions: six faces of a cube, each cut at equal angles."""
    ball = sphere(0.1, subdivisions=6)
    colours = ramp(_cell_of(ball.face_centroids, 8) % 7 / 6.0, BLUE, (235, 235, 240))
    return pictured(RayCaster(ball), colours, ball.vertices, FRONT, SIZE)


def openness(job: Job) -> Image.Image:
    """Where a point beside the nose is open: the directions that meet nothing."""
    mesh = job.mesh
    beside_nose = np.abs(mesh.face_centroids - mesh.centre) < [0.03, 1.0, 0.03]
    front = beside_nose.all(axis=1) & (mesh.face_normals[:, 1] < -0.2)
    spot = int(np.argmin(np.where(front, _freedom(job), np.inf)))
    ball = sphere(0.1, subdivisions=5)
    rays = ball.face_centroids / np.linalg.norm(ball.face_centroids, axis=1)[:, None]
    start = np.repeat(mesh.face_centroids[spot][None], len(rays), axis=0)
    shut = blocked(job, start + 1e-4 * mesh.face_normals[spot], rays, np.inf)
    colours = by(~shut, LIGHT, DARK)
    marked = by(np.arange(len(mesh.faces)) == spot, PINK, CLAY)
    near = np.linalg.norm(mesh.face_centroids - mesh.face_centroids[spot], axis=1)
    marked[near < 3e-3] = PINK
    ball_view = pictured(RayCaster(ball), colours, ball.vertices, FRONT, SIZE)
    return beside_each_other(drawn(job, marked, FRONT), ball_view)


def lit_by(job: Job, projector: PlannedProjector) -> NDArray[np.bool_]:
    """Whether a projector lights each face within 60 degrees, unshadowed."""
    return lit_from(job, projector.world_from_device[:3, 3])


def lit_from(job: Job, place: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether light from a place meets each face within 60 degrees, unshadowed."""
    ray = place - job.mesh.face_centroids
    length = np.linalg.norm(ray, axis=1)
    facing = np.einsum("ij,ij->i", job.mesh.face_normals, ray) > 0.5 * length
    return facing & ~blocked(job, job.mesh.face_centroids, ray / length[:, None], 9.0)


def blocked(
    job: Job, starts: NDArray[np.float64], rays: NDArray[np.float64], reach: float
) -> NDArray[np.bool_]:
    """Whether the object is in the way of rays from places or from its faces, (n,)."""
    reach = min(reach, 4.0 * job.mesh.reach + 10.0)
    rays = rays / np.linalg.norm(rays, axis=1)[:, None]
    lifted = starts + 1e-5 * rays
    if len(starts) == len(job.mesh.faces):
        lifted = lifted + 1e-5 * job.mesh.face_normals
    return job.caster.occluded(lifted, rays, np.full(len(rays), reach))


def _freedom(job: Job) -> NDArray[np.float64]:
    """The share of rays, spread as light would be, that leave each face unhindered."""
    mesh, rng = job.mesh, np.random.default_rng(0)
    free = np.zeros(len(mesh.faces))
    for _ in range(32):
        ray = rng.normal(size=mesh.face_normals.shape)
        ray = mesh.face_normals + ray / np.linalg.norm(ray, axis=1)[:, None]
        free += ~blocked(job, mesh.face_centroids, ray, np.inf)
    return free / 32.0


def _cell_of(points: NDArray[np.float64], n: int) -> NDArray[np.int64]:
    """Cell of each direction on a cube cut at n equal angles an edge."""
    axis = np.argmax(np.abs(points), axis=1)
    main_part = np.take_along_axis(points, axis[:, None], axis=1)
    sides = np.stack([(axis + 1) % 3, (axis + 2) % 3], axis=1)
    angles = np.arctan(np.take_along_axis(points, sides, axis=1) / main_part)
    cell = np.clip(np.floor((angles / (np.pi / 4) + 1.0) * n / 2), 0, n - 1).astype(int)
    face = 2 * axis + (main_part[:, 0] > 0)
    return (face * n + cell[:, 0]) * n + cell[:, 1]
