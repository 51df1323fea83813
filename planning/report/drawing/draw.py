"""`rig.png`: the planned rig in one picture, drawn without OpenGL.

On the left all devices from a three-quarter view; on the right the same from above,
with distances, and the object close up, coloured by what the plan measures.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.model.files import write_atomically
from planning.model.plan import RigPlan

from .draw_colours import MEASURED as MEASURED
from .draw_colours import NOT_LIT as NOT_LIT
from .draw_colours import NOT_MEASURED as NOT_MEASURED
from .draw_colours import OUTSIDE_TARGET as OUTSIDE_TARGET
from .draw_colours import face_colours
from .draw_colours import region_colours as region_colours
from .draw_colours import status_colours as status_colours
from .draw_devices import DeviceFigure, best_direction, close_directions, device_figures
from .draw_marks import Panel
from .draw_text import draw_heading, draw_legend, draw_title
from .draw_views import BACKGROUND, SUPERSAMPLING, Colour, Shader, fitted
from .draw_views import draw_mesh as draw_mesh
from .draw_zones import ZONES, draw_zones, seen_corners, zone_figures

_DEVICES: dict[str, Colour] = {"projector": (200, 80, 0), "camera": (0, 90, 160)}
_MIN_SIZE = (800, 500)
_LONGEST = 20


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

    def write(file: BinaryIO) -> None:
        picture.save(file, format="PNG")

    write_atomically(Path(path), write)


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
    left = _overview(plan, shader, up, (split, foot - head))
    top = _from_above(plan, shader, up, (fine[0] - split, middle - head))
    close = _close_up(plan, shader, up, (fine[0] - split, foot - middle), legend)
    picture = Image.new("RGB", fine, BACKGROUND)
    picture.paste(left, (0, head))
    picture.paste(top, (split, head))
    picture.paste(close, (split, middle))
    draw = ImageDraw.Draw(picture)
    for ends in (
        [(0, head), (fine[0], head)],
        [(split, head), (split, foot)],
        [(split, middle), (fine[0], middle)],
    ):
        draw.line(ends, fill=(205, 205, 210), width=SUPERSAMPLING)
    draw_title(draw, plan, (fine[0], head))
    return picture.resize(size, Image.Resampling.BOX)


def _overview(
    plan: RigPlan, shader: Shader, up: NDArray[np.float64], size: tuple[int, int]
) -> Image.Image:
    figures, mesh = _figures(plan), plan.surface.mesh
    positions = np.array([figure.position for figure in figures])
    direction = best_direction(positions, mesh.centre, up)
    panel = _scene(plan, figures, shader, direction, up, size)
    draw_heading(panel, "All devices, to scale; x, y, z are the axes of the mesh file")
    _mark_devices(panel, figures, shader.caster, type_size=17.0, distances=False)
    return panel.image


def _from_above(
    plan: RigPlan, shader: Shader, up: NDArray[np.float64], size: tuple[int, int]
) -> Image.Image:
    figures = _figures(plan)
    panel = _scene(plan, figures, shader, up, up, size)
    draw_heading(panel, "From above; distances to the object's centre")
    _mark_devices(panel, figures, shader.caster, type_size=14.0, distances=True)
    return panel.image


def _figures(plan: RigPlan) -> list[DeviceFigure]:
    reach = 0.09 * max(plan.requirements.workspace.projector_radius_m)
    return device_figures(plan, body_m=reach)


def _scene(
    plan: RigPlan,
    figures: Sequence[DeviceFigure],
    shader: Shader,
    direction: NDArray[np.float64],
    up: NDArray[np.float64],
    size: tuple[int, int],
) -> Panel:
    corners = _box_corners(shader.caster.mesh)
    bodies = [line for figure in figures for line in figure.body]
    zones = zone_figures(plan)
    everything = np.concatenate([corners, *bodies, *seen_corners(plan, zones)])
    view = fitted(everything, direction, up, size, margin_px=0.085 * min(size))
    panel = Panel(shader.shade(view), view)
    panel.keep_clear(corners)
    draw_zones(panel, zones, shader.caster)
    return panel


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
    columns, line = 2, 21 * SUPERSAMPLING
    foot = -(-len(rows) // columns) * line + 8 * SUPERSAMPLING
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
            draw_heading(panel, "The object, close up")
        picture.paste(panel.image, (k * half[0], 0))
    draw_legend(ImageDraw.Draw(picture), rows, (size[0], size[1] - foot), columns, line)
    return picture


def _shortened(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 3]}..."


def _box_corners(mesh: TriangleMesh) -> NDArray[np.float64]:
    pick = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3)
    return mesh.bounds[pick, np.arange(3)]
