"""`rig.png`: the planned rig in one picture, drawn without OpenGL.

On the left all devices from a three-quarter view; on the right the same from above,
with distances, and the object close up, coloured by what the plan measures.
"""

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from geometry.rays.rays import RayCaster
from planning.model.plan import RigPlan
from planning.model.words import count_words
from planning.report.summary.devices.device_lines import devices_words
from planning.report.summary.devices.station_lines import STATIONS
from planning.scene.placed_bodies import kind_of

from .error_bar import draw_error_bar
from .face_colours import status_colours
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
from .region_numbers import direction_of_unseen, region_spots
from .shader import Shader

_DEVICES: dict[str, Colour] = {"projector": (200, 80, 0), "camera": (0, 90, 160)}
_MIN_SIZE = (800, 500)
# Room for a caption above an object, and for a scale bar below it.
_CAPTION = 40
_LONGEST = 24


def draw_rig(
    plan: RigPlan,
    *,
    face_status: NDArray[np.int8],
    size: tuple[int, int] = (1600, 1000),
) -> Image.Image:
    """Return a picture of a rig: devices, their distances, and what they measure.

    Every panel is orthographic and carries its own scale bar and the file's axes. Lines
    behind the object are faint. Zones are drawn lightly, as far as devices may stand;
    a square marks a device that stands already.

    Args:
        plan: The plan; only its devices, workspace and surface are drawn.
        face_status: What becomes of each face, from `face_status`, shape (n_f,).
        size: Width and height in [px], at least 800 x 500.

    Raises:
        ValueError: If the picture is too small or the status doesn't fit the faces.
    """
    if not (size[0] >= _MIN_SIZE[0] and size[1] >= _MIN_SIZE[1]):
        raise ValueError(f"a picture of a rig needs at least 800 x 500 px, got {size}")
    mesh = plan.surface.mesh
    colours, legend = status_colours(face_status, len(mesh.faces))
    if plan.cameras_alone:
        legend = [(text.replace("lit but ", ""), colour) for text, colour in legend]
    shader = Shader(RayCaster(mesh), colours)
    figures = device_figures(
        plan, body_m=0.09 * max(plan.requirements.workspace.projector_radius_m)
    )
    fine = (size[0] * SUPERSAMPLING, size[1] * SUPERSAMPLING)
    split, head, foot = round(0.57 * fine[0]), round(0.065 * fine[1]), fine[1]
    middle = head + round(0.53 * (foot - head))
    picture = Image.new("RGB", fine, BACKGROUND)
    for left, top, right, bottom in (
        (0, head, split, foot),
        (split, head, fine[0], middle),
        (split, middle, fine[0], foot),
    ):
        extent = (right - left, bottom - top)
        panel = (
            _close_up(plan, figures, shader, extent, legend)
            if top == middle
            else _devices_panel(plan, figures, shader, extent, from_above=left > 0)
        )
        picture.paste(panel, (left, top))
        ends = [(left, bottom), (left, top), (right, top)][left == 0 :]
        ImageDraw.Draw(picture).line(ends, fill=(205, 205, 210), width=SUPERSAMPLING)
    _draw_title(ImageDraw.Draw(picture), plan, (fine[0], head))
    return picture.resize(size, Image.Resampling.BOX)


def _devices_panel(
    plan: RigPlan,
    figures: Sequence[DeviceFigure],
    shader: Shader,
    size: tuple[int, int],
    *,
    from_above: bool,
) -> Image.Image:
    """The object, zones and devices, in a view that holds all; above with distances."""
    centre, up = plan.surface.mesh.centre, np.array(plan.requirements.workspace.up)
    direction, heading = up, "From above; distances to the object's centre"
    if not from_above:
        direction = best_direction(_positions(figures), centre, up)
        heading = "All devices, to scale; x, y, z are the axes of the mesh file"
    zones, solids = zone_figures(plan), obstacle_figures(plan, zone_reach(plan))
    bodies = [line for figure in figures for line in figure.body]
    near = [shown.near for shown in (*zones, *solids)]
    everything = np.concatenate([shader.points, *bodies, *near])
    view = fitted(everything, direction, up, size, margin_px=0.085 * min(size))
    panel = Panel(shader.shade(view), view, shader.caster)
    panel.keep_clear(shader.points)
    draw_zones(panel, zones)
    draw_obstacles(panel, solids, direction)
    for figure in figures:
        _mark_device(panel, figure)
    panel.heading(heading)
    panel.scale_bar(size=14.0)
    panel.axes(size=15.0)
    for figure in figures:
        device, text = figure.device, figure.device.id
        position = device.world_from_device[:3, 3]
        if device.existing:
            text += f"  {_shortened(device.existing)}"
        if from_above:
            text += f"  {1e3 * np.linalg.norm(position - centre):.0f} mm"
        colour = _DEVICES[kind_of(device)]
        panel.label(position, text, colour, size=14.0 if from_above else 17.0)
    return panel.image


def _positions(figures: Sequence[DeviceFigure]) -> NDArray[np.float64]:
    return np.array([figure.device.world_from_device[:3, 3] for figure in figures])


def draw_zones(panel: Panel, zones: Sequence[ZoneFigure]) -> None:
    """Draw the edges of zones, faint where the object hides them."""
    for zone in zones:
        for edge in zone.edges:
            panel.polyline(edge, ZONES[zone.kind], width=1.0, alpha=150)


def _mark_device(panel: Panel, figure: DeviceFigure) -> None:
    device, colour = figure.device, _DEVICES[kind_of(figure.device)]
    for line in figure.beam:
        panel.polyline(line, colour, width=1.0, alpha=100)
    for line in figure.body:
        panel.polyline(line, colour, width=2.0)
    position = device.world_from_device[:3, 3]
    panel.dot(position, colour, radius=3.0)
    if device.existing:
        panel.frame(position, colour, radius=8.0)
    panel.keep_clear(np.concatenate(figure.body))


def _close_up(
    plan: RigPlan,
    figures: Sequence[DeviceFigure],
    shader: Shader,
    size: tuple[int, int],
    legend: Sequence[tuple[str, Colour]],
) -> Image.Image:
    picture = Image.new("RGB", size, BACKGROUND)
    shown = {figure.kind for figure in zone_figures(plan)}
    rows = [
        *legend,
        *(
            (f"{kind}s", colour)
            for kind, colour in _DEVICES.items()
            if getattr(plan, f"{kind}s")
        ),
        *((kind, colour) for kind, colour in ZONES.items() if kind in shown),
    ]
    if obstacle_figures(plan, zone_reach(plan)):
        rows.append(("obstacle", OBSTACLE))
    foot = (-(-len(rows) // 2) * 21 + 8) * SUPERSAMPLING
    mesh, up = plan.surface.mesh, np.array(plan.requirements.workspace.up)
    directions = close_directions(_positions(figures), mesh.centre, up)
    spots = [region_spots(plan, shader.caster, back) for back in directions]
    if (back := direction_of_unseen(plan, chain(*spots))) is not None:
        directions.append(back)
        spots.append(region_spots(plan, shader.caster, back))
    part = (size[0] // len(directions), size[1] - foot)
    for k, direction in enumerate(directions):
        aside = 0.11 * min(part)
        margins = aside, max(aside, _CAPTION * SUPERSAMPLING)
        view = fitted(shader.points, direction, up, part, margin_px=margins)
        panel = Panel(shader.shade(view), view)
        panel.axes(size=12.0)
        panel.scale_bar(size=13.0)
        if k == 0:
            panel.heading("The object and its regions")
        for number, points in spots[k].items():
            panel.mark(points, str(number), size=12.0)
        picture.paste(panel.image, (k * part[0], 0))
    _draw_legend(ImageDraw.Draw(picture), rows, (size[0], size[1] - foot))
    return picture


def _draw_legend(
    draw: ImageDraw.ImageDraw,
    rows: Sequence[tuple[str, Colour]],
    origin: tuple[int, int],
) -> None:
    """Text beside a square of its colour, in two columns from a top [fine px]."""
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
    headline = _headline(plan)
    pad, middle = 16 * SUPERSAMPLING, size[1] // 2
    draw.text((pad, middle), headline, INK, font=font(24.0), anchor="lm")
    extent = 1e3 * np.ptp(plan.surface.mesh.bounds, axis=0)
    name = Path(plan.document.own_mesh.path or "").name
    # Pillow measures one line at a time.
    name = _shortened(" ".join(name.split()))
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
    left += draw.textlength(detail, font=font(16.0)) + 3 * pad
    right = size[0] - 4 * pad - draw.textlength(claim, font=font(16.0))
    inset = 0.12 * size[1]
    draw_error_bar(draw, plan.coverage.sigma, (left, inset, right, size[1] - inset))


def _headline(plan: RigPlan) -> str:
    """Return how many devices there are, and at how many stations."""
    told, devices = plan.document.stations, devices_words(plan, ", ")
    if told is None:
        return devices
    stations = count_words(len(told.stations), STATIONS[told.kind])
    return f"{stations}: {devices}"


def _shortened(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 3]}..."
