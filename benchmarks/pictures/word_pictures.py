"""A picture for each word of docs/glossary.md: what the audit finds at each face."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.report.drawing.panel import INK, Panel, font
from planning.report.drawing.picture_view import BACKGROUND, SUPERSAMPLING, Colour
from planning.report.drawing.shader import Shader
from planning.report.page.per_face import centroids
from planning.verify.audit.predicates.audit_devices import audit_cameras
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import (
    LIGHT_CAUSES,
    LIT,
    MEASURED,
    SEEN,
    SIGHT_CAUSES,
    Steps,
    sight_steps,
)
from planning.verify.audit.predicates.recompute import (
    Recomputed,
    reachable_by,
    recompute,
)

from .drawing import (
    BLUE,
    CLAY,
    FRONT,
    LIGHT,
    ORANGE,
    PINK,
    SIDE,
    SIZE,
    finished,
    view_of,
)
from .job import Job

_BROWN, _PURPLE, _LILAC = (170, 125, 70), (120, 0, 80), (190, 160, 225)
_SKY, _TEAL = (120, 190, 235), (70, 160, 120)
# Parts of causes, what they mean, and their colour.
_FAILING: tuple[tuple[str, str, Colour], ...] = (
    ("occlusion", "something stands in between", PINK),
    ("tangent", "along the direction in which it bends most", _PURPLE),
    ("incidence", "at too large an angle", _BROWN),
    ("range", "too near or too far", _LILAC),
    ("beam", "outside the image", BLUE),
    ("field", "outside the image", BLUE),
)
_BEHIND = (1.0, 0.4, 0.2)
_ROW_PX, _TEXT_PX = 26, 15.0

_Mask = NDArray[np.bool_]
_Sides = tuple[tuple[float, ...], ...]
_Device = PlannedProjector | PlannedCamera
_Classes = Sequence[tuple[str, Colour, _Mask]]


def lit(job: Job) -> Image.Image:
    """One projector: which limit is the first that keeps a face from being lit."""
    projector = job.plan.projectors[0]
    steps = _found(job).light[0]
    return _sheet(
        job, _limits(job, projector, steps, LIGHT_CAUSES, ("lit", LIGHT)), projector
    )


def seen(job: Job) -> Image.Image:
    """One camera, likewise; light doesn't count."""
    camera = job.plan.cameras[1]
    return _sheet(
        job, _limits(job, camera, _sight(job), SIGHT_CAUSES, ("seen", _SKY)), camera
    )


def measured(job: Job) -> Image.Image:
    """The pair of both: lit, seen, and well enough triangulated."""
    light, sight = _found(job).light[0] == LIT, _sight(job) == SEEN
    good = _found(job).pairs[0, 1] == MEASURED
    classes = (
        ("measured by P1 and C2", _TEAL, good),
        (
            "lit and seen, but the triangle isn't good enough",
            PINK,
            light & sight & ~good,
        ),
        ("lit alone", LIGHT, light & ~sight),
        ("seen alone", _SKY, sight & ~light),
        ("neither", CLAY, ~light & ~sight),
    )
    return _sheet(job, classes, job.plan.projectors[0], job.plan.cameras[1])


def reachable(job: Job) -> Image.Image:
    """Devices before the face alone: what they light, and what others there could."""
    rig = job.folder / "before.toml"
    rig.write_text('base = "face-booth"\n[workspace]\nhalf_angle_deg = 60\n')
    booth = Job(job.folder / "before", "--rig", str(rig), "--no-check")
    found, shadow = _found(booth), Shadow.of(booth.plan, threads=1)
    could = reachable_by(booth.plan, found, shadow, 0).projectors
    elsewhere = "not lit, but reachable: one of the candidate poses lights it"
    classes = (
        ("lit by a projector of the plan", LIGHT, found.lit),
        (elsewhere, _BROWN, could & ~found.lit),
        ("not reachable: no candidate pose lights it", _PURPLE, ~could),
    )
    return _sheet(booth, classes, *booth.plan.projectors, sides=(FRONT, _BEHIND))


def assigned(job: Job) -> Image.Image:
    """Each lit face and the one projector that it is assigned to."""
    primary = _found(job).primary
    classes = [
        (f"assigned to {projector.id}", colour, primary == k)
        for k, (projector, colour) in enumerate(
            zip(job.plan.projectors, (LIGHT, _TEAL, _LILAC), strict=True)
        )
    ]
    return _sheet(job, [*classes, ("not lit", CLAY, primary < 0)], *job.plan.projectors)


@cache
def _found(job: Job) -> Recomputed:
    """What every device and pair does at the centroid of every face."""
    return recompute(job.plan, centroids(job.plan), Shadow.of(job.plan, threads=1))


def _sight(job: Job) -> Steps:
    camera, shadow = audit_cameras(job.plan)[1], Shadow.of(job.plan, threads=1)
    limits = job.plan.requirements.camera
    return sight_steps(camera, _found(job).samples, limits, shadow)


def _limits(
    job: Job,
    device: _Device,
    steps: Steps,
    causes: Sequence[str],
    good: tuple[str, Colour],
) -> _Classes:
    """The classes of one device: good, turned away, and the first limit that fails."""
    ray = job.mesh.face_centroids - device.world_from_device[:3, 3]
    away = np.einsum("ij,ij->i", job.mesh.face_normals, ray) >= 0.0
    first = np.array([*causes, "none"])[steps]
    failing = [
        (text, colour, (np.char.find(first, cause) >= 0) & ~away)
        for cause, text, colour in _FAILING
    ]
    fine = (f"{good[0]} by {device.id}", good[1], first == "none")
    return [("turned away", CLAY, away), *failing, fine][::-1]


def _sheet(
    job: Job, classes: _Classes, *devices: _Device, sides: _Sides = (FRONT, SIDE)
) -> Image.Image:
    """Two views of the object, with arrows from the devices, above the legend."""
    colours = np.zeros((len(job.mesh.faces), 3))
    for _, colour, where in classes:
        colours[where] = colour
    views = [_view(job, colours, side, devices) for side in sides]
    shown = [(text, colour) for text, colour, where in classes if where.any()]
    size = (2 * SIZE[0], SIZE[1] + _ROW_PX * len(shown) + 10)
    sheet = Image.new("RGB", size, BACKGROUND)
    for k, view in enumerate(views):
        sheet.paste(view, (k * SIZE[0], 0))
    draw = ImageDraw.Draw(sheet)
    face = font(_TEXT_PX / SUPERSAMPLING)
    for k, (text, colour) in enumerate(shown):
        top = SIZE[1] + _ROW_PX * k
        draw.rectangle((24, top + 3, 42, top + 19), fill=colour)
        draw.text((52, top + 2), text, INK, font=face)
    return sheet


def _view(
    job: Job,
    colours: NDArray[np.float64],
    side: tuple[float, ...],
    devices: Sequence[_Device],
) -> Image.Image:
    centre, reach = job.mesh.centre, job.mesh.reach
    arrows = []
    for device in devices:
        way = device.world_from_device[:3, 3] - centre
        way /= np.linalg.norm(way)
        arrows.append(centre + np.outer([1.7 * reach, 1.1 * reach], way))
    view = view_of(np.vstack([job.mesh.vertices, *arrows]), side, SIZE)
    panel = Panel(Shader(job.caster, colours).shade(view), view, job.caster)
    for device, arrow in zip(devices, arrows, strict=True):
        colour = ORANGE if isinstance(device, PlannedProjector) else BLUE
        panel.polyline(arrow, colour, width=3.0)
        panel.dot(arrow[0], colour, radius=5.0)
        panel.label(arrow[0], device.id, colour, size=15.0)
    return finished(panel)
