"""Three views of a rig for the wall: outlines, names and dimensions in millimetres.

Ordinate dimensions: along the left and the lower edge of each view stands how far every
device is from the object's centre, with a line from it to its number.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import numbered
from geometry.poses import horizontal_axes
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.plan import RigPlan
from planning.report.drawing.figures import device_figures
from planning.report.drawing.panel import round_length
from planning.report.summary.devices.device_lines import axis_name
from planning.scene.placed_bodies import kind_of

from .markup import element
from .outline import outlines

# Of a view: its side, what numbers take of it, and the height of a number [user units].
_SIDE, _MARGIN, _TEXT = 420.0, 76.0, 11.0
# Room about all that is drawn, for names.
_INSET = 16.0
# Numbers stand at least so far apart.
_APART = 13.0


@dataclass(frozen=True, eq=False)
class _View:
    """One of the three views; right and up are directions of the world."""

    title: str
    right: Array
    up: Array

    def flat(self, points: Array) -> Array:
        """Return points (n, 3) across the line of sight [mm], (n, 2)."""
        return 1e3 * np.stack([points @ self.right, points @ self.up], axis=1)


def wall_sheet(plan: RigPlan) -> str:
    """Return the three views and what the numbers are, as SVG in a section."""
    up = np.array(plan.requirements.workspace.up)
    first, second = horizontal_axes(up)
    views = (
        _View(f"Front, seen along {axis_name(second)}", first, up),
        _View(f"Side, seen along {axis_name(-first)}", second, up),
        _View(f"Top, seen along {axis_name(-up)}", first, second),
    )
    centre = np.array(plan.requirements.workspace.centre)
    mesh, shapes = plan.surface.mesh, _shapes(plan)
    # One scale for all three: a length is the same on each.
    widest = max(float(np.ptp(_bounds(view, shapes), axis=0).max()) for view in views)
    per_mm = (_SIDE - _MARGIN - 2.0 * _INSET) / widest
    drawings = "".join(
        element("figure", _drawn(view, mesh, shapes, centre, per_mm)) for view in views
    )
    x, y, z = 1e3 * centre + 0.0
    size = " x ".join(f"{side:.1f}" for side in 1e3 * np.ptp(mesh.bounds, 0))
    note = (
        f"Numbers are millimetres from the object's centre, which is at {x:.1f}, "
        f"{y:.1f}, {z:.1f} in the axes of the mesh file; the object is {size} mm along "
        f"x, y and z. All three views have one scale; the bar tells it."
    )
    return drawings + element("p", escape(note), class_="small")


def _bounds(view: _View, shapes: Sequence[tuple[str, str, Array]]) -> Array:
    """Least and largest places of all shapes in a view [mm], (2, 2)."""
    flat = view.flat(np.concatenate([points for _, _, points in shapes]))
    return np.array([flat.min(axis=0), flat.max(axis=0)])


def _shapes(plan: RigPlan) -> list[tuple[str, str, Array]]:
    """Class, name and outline's points of the object and every device [m]."""
    shapes = [("object", "", plan.surface.mesh.vertices)]
    size = 0.05 * max(plan.requirements.workspace.projector_radius_m)
    for figure in device_figures(plan, body_m=size):
        device: PlannedProjector | PlannedCamera = figure.device
        points = np.concatenate([*figure.body, device.world_from_device[None, :3, 3]])
        shapes.append((kind_of(device), device.id, points))
    return shapes


def _drawn(
    view: _View,
    mesh: TriangleMesh,
    shapes: Sequence[tuple[str, str, Array]],
    centre: Array,
    per_mm: float,
) -> str:
    middle = np.array([0.5 * (_SIDE + _MARGIN), 0.5 * (_SIDE - _MARGIN)])
    about = _bounds(view, shapes).mean(axis=0)

    def placed(points: Array) -> Array:
        return middle + per_mm * (view.flat(points) - about) * [1.0, -1.0]

    edge = _SIDE - _MARGIN
    (x, y), parts = placed(centre[None])[0], list[str]()
    for ends in ((_MARGIN, y, _SIDE, y), (x, 0.0, x, edge)):
        parts.append(_line("axis", *ends))
    used, faces = numbered(mesh.faces, len(mesh.vertices))
    sides = numbered(mesh.edges.ends, len(mesh.vertices))[1]
    curves = outlines(placed(mesh.vertices[used]), faces, sides)
    told = " ".join(f"M{_points(curve)}Z" for curve in curves)
    parts.append(f'<path class="object" fill-rule="evenodd" d="{told}"/>')
    spots: dict[str, Array] = {}
    for kind, name, points in shapes[1:]:
        outline = _points(_hull(placed(points)))
        parts.append(f'<polygon class="{kind}" points="{outline}"/>')
        # The last point is where the device's origin is.
        spots[name] = points[-1]
    at = {name: placed(spot[None])[0] for name, spot in spots.items()}
    for name, (a, b) in at.items():
        parts.append(f'<circle class="origin" cx="{a:.1f}" cy="{b:.1f}" r="2"/>')
        aside = a > _SIDE - 2.0 * _INSET
        parts.append(_text("name end" if aside else "name", a, b - 5.0, name))
    flat = {name: view.flat((spot - centre)[None])[0] for name, spot in spots.items()}
    parts += _ordinates(at, flat, 0)
    parts += _ordinates(at, flat, 1)
    parts.append(_scale_bar(per_mm))
    size = f"0 0 {_SIDE:.0f} {_SIDE:.0f}"
    told = ", ".join(f"{n} {p[0]:.0f} across {p[1]:.0f} up" for n, p in flat.items())
    label = escape(f"{view.title}: {told}, in mm")
    drawing = f'<svg viewBox="{size}" role="img" aria-label="{label}">'
    drawing += "".join(parts) + "</svg>"
    return element("figcaption", escape(view.title)) + drawing


def _ordinates(at: dict[str, Array], flat: dict[str, Array], axis: int) -> list[str]:
    """Lines from devices to the lower (0) or left (1) edge, and their numbers there."""
    names = sorted(at, key=lambda name: (at[name][axis], name))
    low, high = (_MARGIN, _SIDE) if axis == 0 else (0.0, _SIDE - _MARGIN)
    places = _spread([float(at[name][axis]) for name in names], low, high)
    parts: list[str] = []
    edge = _SIDE - _MARGIN if axis == 0 else _MARGIN
    for name, place in zip(names, places, strict=True):
        a, b = at[name].tolist()
        number = f"{name} {flat[name][axis] + 0.0:+.0f}"
        if axis == 0:
            corners = ((a, b), (a, edge), (place, edge + 10.0))
            parts.append(_text("down", place, edge + 13.0, number))
        else:
            corners = ((a, b), (edge, b), (edge - 10.0, place))
            parts.append(_text("left", edge - 13.0, place + 0.35 * _TEXT, number))
        told = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
        parts.append(f'<polyline class="leader" points="{told}"/>')
    return parts


def _spread(places: Sequence[float], low: float, high: float) -> list[float]:
    """Move sorted places apart, within ends as far as there is room."""
    gap = min(_APART, (high - low) / max(len(places), 1))
    spread: list[float] = []
    for place in places:
        spread.append(max(place, spread[-1] + gap if spread else low + 0.5 * gap))
    limit = high - 0.5 * gap
    for k in range(len(spread) - 1, -1, -1):
        spread[k] = min(spread[k], limit)
        limit = spread[k] - gap
    return spread


def _scale_bar(per_mm: float) -> str:
    length = round_length(0.14 * _SIDE / per_mm)
    left, y = 6.0, _SIDE - 6.0
    bar = _line("bar", left, y, left + length * per_mm, y)
    return bar + _text("scale", left, y - 4.0, f"{length:g} mm")


def _points(flat: Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in flat)


def _hull(flat: Array) -> Array:
    """The convex outline of points (n, 2); of those on a line the points."""
    try:
        return flat[ConvexHull(flat).vertices]
    except QhullError:
        return flat


def _line(kind: str, *ends: float) -> str:
    x1, y1, x2, y2 = (f"{value:.1f}" for value in ends)
    return f'<line class="{kind}" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>'


def _text(kind: str, x: float, y: float, words: str) -> str:
    turn = f' transform="rotate(90 {x:.1f} {y:.1f})"' if kind == "down" else ""
    place = f'x="{x:.1f}" y="{y:.1f}" font-size="{_TEXT}"'
    return f'<text class="{kind}" {place}{turn}>{escape(words)}</text>'
