"""`rig.png`: the planned rig in one picture, drawn without OpenGL.

On the left all devices from a three-quarter view; on the right the same from above,
with distances, and the object close up, coloured by what the plan measures.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from geometry.rays.rays import RayCaster
from planning.model.files import write_atomically
from planning.model.plan import RigPlan
from planning.model.words import count_words

from .face_colours import face_colours
from .figures import (
    ZONES,
    DeviceFigure,
    ZoneFigure,
    best_direction,
    close_directions,
    device_figures,
    zone_figures,
    zone_reach,
)
from .obstacle_figures import OBSTACLE, draw_obstacles, obstacle_figures
from .panel import INK, PALE, Panel, font
from .picture_view import BACKGROUND, SUPERSAMPLING, Colour, fitted
from .shader import Shader

_DEVICES: dict[str, Colour] = {"projector": (200, 80, 0), "camera": (0, 90, 160)}
_MIN_SIZE = (800, 500)
_LONGEST = 24


def save_rig_picture(
    plan: RigPlan,
    path: str | Path,
    *,
    size: tuple[int, int] = (1600, 1000),
    face_status: NDArray[np.int8] | None = None,
) -> None:
    """Write the picture of a rig as a PNG, the same bytes for the same plan.

    Args:
        plan: The plan.
        path: Where the file goes; its folder must exist.
        size: Width and height in [px].
        face_status: As for `draw_rig`.

    Raises:
        ValueError: If the size or the status can't be drawn.
        OSError: If the file can't be written.
    """
    picture = draw_rig(plan, size=size, face_status=face_status)
    write_atomically(Path(path), lambda file: picture.save(file, format="PNG"))


def draw_rig(
    plan: RigPlan,
    *,
    size: tuple[int, int] = (1600, 1000),
    face_status: NDArray[np.int8] | None = None,
) -> Image.Image:
    """Return a picture of a rig: devices, their distances, and what they measure.

    Every panel is orthographic and carries its own scale bar and the file's axes. Lines
    behind the object are faint. Zones are drawn lightly, as far as devices may stand;
    a square marks a device that stands already.

    Args:
        plan: The plan; only its devices, workspace and surface are drawn.
        size: Width and height in [px], at least 800 x 500.
        face_status: What becomes of each face, shape (n_f,): 0 outside the target,
            1 measured, 2 target, lit but not measured, 3 target, not lit. Default:
            faces are coloured by dominant region instead.

    Raises:
        ValueError: If the picture is too small or the status doesn't fit the faces.
    """
    if not (size[0] >= _MIN_SIZE[0] and size[1] >= _MIN_SIZE[1]):
        raise ValueError(f"a picture of a rig needs at least 800 x 500 px, got {size}")
    colours, legend = face_colours(plan.surface, face_status)
    mesh = plan.surface.mesh
    shader = Shader(RayCaster(mesh), colours)
    up = np.array(plan.requirements.workspace.up)
    fine = (size[0] * SUPERSAMPLING, size[1] * SUPERSAMPLING)
    split, head, foot = round(0.57 * fine[0]), round(0.065 * fine[1]), fine[1]
    middle = head + round(0.53 * (foot - head))
    width = fine[0] - split
    whole = _devices_panel(plan, shader, up, (split, foot - head), from_above=False)
    above = _devices_panel(plan, shader, up, (width, middle - head), from_above=True)
    close = _close_up(plan, shader, up, (width, foot - middle), legend)
    picture = Image.new("RGB", fine, BACKGROUND)
    picture.paste(whole, (0, head))
    picture.paste(above, (split, head))
    picture.paste(close, (split, middle))
    draw = ImageDraw.Draw(picture)
    for ends in (
        [(0, head), (fine[0], head)],
        [(split, head), (split, foot)],
        [(split, middle), (fine[0], middle)],
    ):
        draw.line(ends, fill=(205, 205, 210), width=SUPERSAMPLING)
    _draw_title(draw, plan, (fine[0], head))
    return picture.resize(size, Image.Resampling.BOX)


def _devices_panel(
    plan: RigPlan,
    shader: Shader,
    up: NDArray[np.float64],
    size: tuple[int, int],
    *,
    from_above: bool,
) -> Image.Image:
    """The object, zones and devices, in a view that holds all; above with distances."""
    figures, centre = _figures(plan), plan.surface.mesh.centre
    direction, heading = up, "From above; distances to the object's centre"
    if not from_above:
        positions = np.array([figure.position for figure in figures])
        direction = best_direction(positions, centre, up)
        heading = "All devices, to scale; x, y, z are the axes of the mesh file"
    vertices = shader.caster.mesh.corners.reshape(-1, 3)
    zones = zone_figures(plan)
    bodies = [line for figure in figures for line in figure.body]
    solids = obstacle_figures(plan, zone_reach(plan))
    near = [shown.near for shown in (*zones, *solids)]
    everything = np.concatenate([vertices, *bodies, *near])
    view = fitted(everything, direction, up, size, margin_px=0.085 * min(size))
    panel = Panel(shader.shade(view), view)
    panel.keep_clear(vertices)
    draw_zones(panel, zones, shader.caster)
    draw_obstacles(panel, solids, direction, shader.caster)
    panel.heading(heading)
    type_size = 14.0 if from_above else 17.0
    _mark_devices(
        panel, figures, shader.caster, type_size=type_size, distances=from_above
    )
    return panel.image


def _figures(plan: RigPlan) -> list[DeviceFigure]:
    reach = 0.09 * max(plan.requirements.workspace.projector_radius_m)
    return device_figures(plan, body_m=reach)


def draw_zones(panel: Panel, zones: Sequence[ZoneFigure], caster: RayCaster) -> None:
    """Draw the edges of zones, faint where the object hides them."""
    for zone in zones:
        for edge in zone.edges:
            panel.polyline(edge, ZONES[zone.kind], width=1.0, caster=caster, alpha=150)


def _mark_devices(
    panel: Panel,
    figures: Sequence[DeviceFigure],
    caster: RayCaster,
    *,
    type_size: float,
    distances: bool,
) -> None:
    for figure in figures:
        colour = _DEVICES[figure.kind]
        panel.polyline(figure.axis, colour, width=1.0, caster=caster, alpha=110)
        if figure.kind == "projector":
            for line in figure.beam:
                panel.polyline(line, colour, width=1.0, caster=caster, alpha=90)
        for line in figure.body:
            panel.polyline(line, colour, width=2.0, caster=caster)
        panel.dot(figure.position, colour, radius=3.0)
        if figure.existing:
            panel.frame(figure.position, colour, radius=8.0)
        panel.keep_clear(np.concatenate(figure.body))
    panel.scale_bar(size=14.0)
    panel.axes(size=15.0)
    for figure in figures:
        text = figure.id
        if figure.existing:
            text += f"  {_shortened(figure.existing)}"
        if distances:
            text += f"  {1e3 * figure.distance_m:.0f} mm"
        panel.label(figure.position, text, _DEVICES[figure.kind], size=type_size)


def _close_up(
    plan: RigPlan,
    shader: Shader,
    up: NDArray[np.float64],
    size: tuple[int, int],
    legend: Sequence[tuple[str, Colour]],
) -> Image.Image:
    picture = Image.new("RGB", size, BACKGROUND)
    rows = [*legend, *((f"{kind}s", colour) for kind, colour in _DEVICES.items())]
    kinds = {figure.kind for figure in zone_figures(plan)}
    rows += [(kind, colour) for kind, colour in ZONES.items() if kind in kinds]
    if plan.surface.obstacles:
        rows.append(("obstacle", OBSTACLE))
    foot = (-(-len(rows) // 2) * 21 + 8) * SUPERSAMPLING
    half = (size[0] // 2, size[1] - foot)
    corners = shader.caster.mesh.corners.reshape(-1, 3)
    positions = np.array([figure.position for figure in _figures(plan)])
    for k, direction in enumerate(
        close_directions(positions, plan.surface.mesh.centre, up)
    ):
        view = fitted(corners, direction, up, half, margin_px=0.11 * min(half))
        panel = Panel(shader.shade(view), view)
        panel.axes(size=12.0)
        if k == 0:
            panel.scale_bar(size=13.0)
            panel.heading("The object, close up")
        picture.paste(panel.image, (k * half[0], 0))
    _draw_legend(ImageDraw.Draw(picture), rows, (size[0], size[1] - foot))
    return picture


def _draw_legend(
    draw: ImageDraw.ImageDraw,
    rows: Sequence[tuple[str, Colour]],
    origin: tuple[int, int],
) -> None:
    """Write text beside a square of its colour, in two columns from a top [fine px]."""
    width, top = origin
    unit = SUPERSAMPLING
    for k, (text, colour) in enumerate(rows):
        x, y = 16 * unit + (k % 2) * (width // 2), top + (k // 2) * 21 * unit
        draw.rectangle((x, y + 3 * unit, x + 14 * unit, y + 17 * unit), fill=colour)
        spot = (x + 22 * unit, y + 10 * unit)
        draw.text(spot, text, INK, font=font(14.0), anchor="lm")


def _draw_title(
    draw: ImageDraw.ImageDraw, plan: RigPlan, size: tuple[int, int]
) -> None:
    """Write how many devices, what object and what is measured into a band."""
    projectors = count_words(len(plan.projectors), "projector")
    headline = f"{projectors}, {count_words(len(plan.cameras), 'camera')}"
    pad, middle = 16 * SUPERSAMPLING, size[1] // 2
    draw.text((pad, middle), headline, INK, font=font(24.0), anchor="lm")
    extent = 1e3 * np.ptp(plan.surface.mesh.bounds, axis=0)
    name = _shortened(Path(plan.document.meshes[0].path or "").name)
    size_mm = f"{' x '.join(f'{side:.0f}' for side in extent)} mm (x, y, z)"
    detail = f"{name}, {size_mm}" if name else size_mm
    left = pad + draw.textlength(headline, font=font(24.0)) + 1.5 * pad
    draw.text((left, middle), detail, PALE, font=font(16.0), anchor="lm")
    areas = plan.coverage.target
    # Pillow's own typeface has no superscripts.
    claim = (
        f"measured {1e4 * areas.measured_m2:.0f} of "
        f"{1e4 * areas.reachable_by_cameras_m2:.0f} reachable, "
        f"{1e4 * areas.area_m2:.0f} square cm target"
    )
    draw.text((size[0] - pad, middle), claim, INK, font=font(16.0), anchor="rm")


def _shortened(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 3]}..."
