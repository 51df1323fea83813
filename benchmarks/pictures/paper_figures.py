"""Figures 1 and 3 of the paper, drawn from the README's plan."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from planning.model.devices.planned import PlannedProjector
from planning.report.drawing.panel import Panel
from planning.report.drawing.shader import Shader

from .drawing import (
    BLUE,
    CLAY,
    GREEN,
    LIGHT,
    ORANGE,
    PINK,
    beside_each_other,
    by,
    finished,
    shaded,
    view_of,
)
from .job import Colours, Job
from .light_pictures import lit_from

_WIDE, _TALL = (560, 560), 560
# Grey levels of an image that light raises at least.
_LIT = 10.0
_AROUND = 720
_ARROW = 0.045


def false_projection(job: Job) -> Image.Image:
    """Fig. 1: of P1's rings the one of which about half lands, where it does.

    And where P1's light runs along the tangent or grazes: what eq. (2) forbids.
    """
    projector = job.plan.projectors[0]
    place, limits = projector.world_from_device[:3, 3], job.plan.requirements.projector
    rays = _rays(projector)
    hits = [_landed(job, place, ring) for ring in rays]
    share = np.array([np.isfinite(reach).mean() for reach in hits])
    ring = int(np.argmin(np.abs(share - 0.5)))
    depth = float(np.linalg.norm(job.mesh.centre - place))
    reach = np.where(np.isfinite(hits[ring]), hits[ring], depth)
    points = place + reach[:, None] * rays[ring]
    seen = _aside(job, projector, 0.6)
    view = view_of(np.concatenate([points, job.mesh.vertices]), seen, _WIDE)
    panel = Panel(shaded(job.caster, CLAY).shade(view), view, job.caster)
    for k, landed in enumerate(np.isfinite(hits[ring])):
        piece = points[[k, (k + 1) % _AROUND]]
        if np.ptp(reach[[k, (k + 1) % _AROUND]]) < 5e-3:
            panel.polyline(piece, BLUE if landed else PINK, width=2.5)
    back = _towards(place, job)
    _arrow(panel, job.mesh.centre + 0.15 * back, back, "L", ORANGE)
    panel.heading(
        f"(a) ring {ring + 1} of {len(rays)} of P1: {share[ring]:.0%} lands (blue)"
    )
    panel.scale_bar(size=13.0)
    return beside_each_other(finished(panel), _tangents(job, projector, limits))


def _tangents(job: Job, projector: PlannedProjector, limits: object) -> Image.Image:
    """Target that P1's light meets squarely, grazes, or runs along the tangent of."""
    mesh, surface = job.mesh, job.plan.surface
    light = mesh.face_centroids - projector.world_from_device[:3, 3]
    light = light / np.linalg.norm(light, axis=1)[:, None]
    facing = -np.einsum("ij,ij->i", mesh.face_normals, light)
    along = np.abs(np.einsum("ij,ij->i", surface.steep, light))
    lit = lit_from(job, projector.world_from_device[:3, 3])
    target = surface.target_faces("dominant")
    tangent = along > np.cos(limits.min_tangent_angle)  # type: ignore[attr-defined]
    colours = by(target, (150, 140, 132), CLAY)
    colours[target & lit & ~tangent] = LIGHT
    colours[target & (facing > 0.0) & ~lit] = ORANGE
    colours[target & (facing > 0.0) & tangent] = PINK
    view = view_of(mesh.vertices, _aside(job, projector, 0.6), _WIDE)
    panel = Panel(Shader(job.caster, colours).shade(view), view, job.caster)
    visible = mesh.face_normals @ view.to_viewer > 0.3
    for case, name in ((target & lit & ~tangent, "P"), (target & tangent, "Q")):
        chosen = np.flatnonzero(case & visible & (facing > 0.0))
        centre = np.median(mesh.face_centroids[chosen], axis=0)
        gaps = np.linalg.norm(mesh.face_centroids[chosen] - centre, axis=1)
        face = chosen[np.argmin(gaps)]
        start = mesh.face_centroids[face] + 2e-3 * mesh.face_normals[face]
        panel.dot(start, (0, 0, 0), radius=3.0)
        panel.label(start, name, (0, 0, 0), size=14.0)
        for way, label, colour in (
            (mesh.face_normals[face], "N", BLUE),
            (surface.steep[face], "T1", GREEN),
            (light[face], "L", ORANGE),
        ):
            # Light arrives; the others leave.
            come = label == "L"
            _arrow(panel, start, -way if come else way, label, colour)
    panel.heading("(b) target: lit; grazed or in shadow (orange); L along T1 (pink)")
    panel.scale_bar(size=13.0)
    return finished(panel)


def overlap(job: Job) -> Image.Image:
    """Fig. 3: the light of two projectors in one image; whose light falls where.

    Of the camera and the two that show most of all three: one, the other, both.
    """
    projectors = [projector.id for projector in job.plan.projectors]
    views = [
        _frames(job, camera.id, pair)
        for camera in job.plan.cameras
        for pair in combinations(projectors, 2)
    ]
    one, other, dark = max(views, key=lambda view: np.prod(_parts(*view)))
    both = np.clip(one + other - dark, 0.0, None)
    grey = np.clip(255.0 * both / np.quantile(both, 0.995), 0.0, 255.0)
    lit = one - dark > _LIT, other - dark > _LIT
    colours = by(lit[0].ravel() & ~lit[1].ravel(), BLUE, (60, 60, 66))
    colours[(lit[1] & ~lit[0]).ravel()] = ORANGE
    colours[(lit[0] & lit[1]).ravel()] = LIGHT
    rows, columns = np.nonzero(lit[0] | lit[1])
    box = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
    pictures = [
        Image.fromarray(pixels.astype(np.uint8)).convert("RGB").crop(box)
        for pixels in (grey, colours.reshape(*one.shape, 3))
    ]
    wide = round(_TALL * pictures[0].width / pictures[0].height)
    return beside_each_other(*(p.resize((wide, _TALL)) for p in pictures))


def _frames(
    job: Job, camera: str, pair: tuple[str, str]
) -> tuple[Colours, Colours, Colours]:
    """White frames of two projectors and a black one, as a camera sees them, (h, w)."""
    first, second = (job.captures / camera / projector for projector in pair)
    names = (first / "00-white.png", second / "00-white.png", first / "01-black.png")
    one, other, dark = (np.asarray(Image.open(n), dtype=float) for n in names)
    return one, other, dark


def _parts(one: Colours, other: Colours, dark: Colours) -> tuple[float, float, float]:
    """Shares of the pixels that one projector lights, the other, both."""
    lit = one - dark > _LIT, other - dark > _LIT
    return tuple(
        float(np.mean(part))
        for part in (lit[0] & ~lit[1], lit[1] & ~lit[0], lit[0] & lit[1])
    )


def _rays(projector: PlannedProjector) -> NDArray[np.float64]:
    """Unit directions of each ring's edge about the axis, (n_rings, _AROUND, 3)."""
    turn = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(_AROUND)], axis=1)
    cone = projector.ring_radii[:, None, None] * circle + [0.0, 0.0, 1.0]
    cone /= np.linalg.norm(cone, axis=2, keepdims=True)
    return cone @ projector.world_from_ring[:3, :3].T


def _landed(job: Job, place: Colours, rays: Colours) -> Colours:
    """How far along each ray the object is met [m]; inf where it isn't, (n,)."""
    faces, distances = job.caster.first_hits(np.tile(place, (len(rays), 1)), rays)
    return np.where(faces >= 0, distances, np.inf)


def _towards(place: Colours, job: Job) -> Colours:
    way = place - job.mesh.centre
    return way / np.linalg.norm(way)


def _aside(job: Job, projector: PlannedProjector, turn: float) -> tuple[float, ...]:
    """A direction to look from, turned away from the projector's about upwards."""
    x, y, z = _towards(projector.world_from_device[:3, 3], job).tolist()
    c, s = np.cos(turn), np.sin(turn)
    return c * x - s * y, s * x + c * y, z + 0.15


def _arrow(
    panel: Panel, start: Colours, way: Colours, name: str, colour: tuple[int, int, int]
) -> None:
    end = start + _ARROW * way / np.linalg.norm(way)
    panel.polyline(np.stack([start, end]), colour, width=2.5)
    panel.dot(end, colour, radius=3.5)
    panel.label(end, name, colour, size=14.0)
