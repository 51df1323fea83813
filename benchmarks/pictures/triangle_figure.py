"""Figure 4 of the paper from a row of `baselines`: every symbol of (9) and (10)."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from planning.model.devices.planned import PlannedCamera
from planning.model.document.device_records import BaselineRow
from planning.report.drawing.panel import INK, Panel, font
from planning.report.drawing.picture_view import (
    BACKGROUND,
    SUPERSAMPLING,
    Colour,
    fitted,
)

from .drawing import BLUE, CLAY, GREEN, ORANGE, PINK, beside_each_other, finished
from .job import Job

_Array = NDArray[np.float64]
_SIZE, _CLOSE, _LIST = (700, 720), (360, 300), (360, 440)
_GREY = (130, 130, 136)


class Triangle:
    """The points of a row, all in the plane O1, E, O2 onto which they are dropped.

    O1, O2 and E lie in it; the feet B and F of the optical axes and O, the foot of O2
    on camera 1's axis, need not.
    """

    def __init__(
        self, row: BaselineRow, first: PlannedCamera, second: PlannedCamera
    ) -> None:
        self.row, self.E = row, np.array(row.E)
        self.O1, self.O2 = (c.world_from_device[:3, 3] for c in (first, second))
        axis1, axis2 = (c.world_from_device[:3, 2] for c in (first, second))
        normal = np.cross(self.O1 - self.E, self.O2 - self.E)
        self.normal = normal / np.linalg.norm(normal)
        self.B = self._dropped(self.O1 + row.standoff1 * axis1)
        self.F = self._dropped(self.O2 + row.standoff2 * axis2)
        foot = self.O1 + ((self.O2 - self.O1) @ axis1) * axis1
        self.O = self._dropped(foot)
        self.A = self.B + row.C1 * self._from_seam(self.B)
        self.G = self.F + row.C2 * self._from_seam(self.F)
        self.ends = (
            self.B - row.C1 * self._from_seam(self.B),
            self.F - row.C2 * self._from_seam(self.F),
        )
        self.limit = self.E + row.D2 * self.turned(row.phi_max)

    def _dropped(self, point: _Array) -> _Array:
        return point - ((point - self.E) @ self.normal) * self.normal

    def _from_seam(self, foot: _Array) -> _Array:
        way = foot - self.E
        return way / np.linalg.norm(way)

    def turned(self, angle: float) -> _Array:
        """Return the direction from E to O1, turned by an angle towards O2."""
        along = (self.O1 - self.E) / np.linalg.norm(self.O1 - self.E)
        return np.cos(angle) * along + np.sin(angle) * np.cross(self.normal, along)

    def arc(self, angle: float, radius: float) -> _Array:
        """Return points on an arc about E, from the direction of O1 on, (n, 3)."""
        turns = np.linspace(0.0, angle, 40)
        return np.stack([self.E + radius * self.turned(turn) for turn in turns])

    def slice(self, corners: _Array) -> list[_Array]:
        """Return where the plane cuts faces, corners (n, 3, 3), a segment each."""
        height = (corners - self.E) @ self.normal
        cut = np.flatnonzero((height.min(axis=1) < 0.0) & (height.max(axis=1) >= 0.0))
        segments = []
        for face, level in zip(corners[cut], height[cut], strict=True):
            ends = []
            for a, b in ((0, 1), (1, 2), (2, 0)):
                if (level[a] < 0.0) != (level[b] < 0.0):
                    share = level[a] / (level[a] - level[b])
                    ends.append(face[a] + share * (face[b] - face[a]))
            segments.append(np.stack(ends))
        return segments


def triangle(job: Job) -> Image.Image:
    """Fig. 4: the row whose plane cuts most of the object, of those with a d_max."""
    cameras = {camera.id: camera for camera in job.plan.cameras}
    every = [
        Triangle(row, *(cameras[name] for name in row.cameras))
        for row in job.plan.document.baselines
        if row.d_max is not None
    ]
    shown = max(every, key=lambda one: len(one.slice(job.mesh.corners)))
    segments = shown.slice(job.mesh.corners)
    points = _points(shown)
    near = np.vstack([*segments, *(points[name] for name in "EBF")])
    whole, close = (
        finished(_drawn(shown, segments, points, outline, size))
        for outline, size in (
            (np.vstack([*segments, *points.values(), shown.limit]), _SIZE),
            (near, _CLOSE),
        )
    )
    return beside_each_other(whole, _above(close, _listed(shown.row)))


def _above(upper: Image.Image, lower: Image.Image) -> Image.Image:
    size = (max(upper.width, lower.width), upper.height + lower.height)
    sheet = Image.new("RGB", size, BACKGROUND)
    sheet.paste(upper, (0, 0))
    sheet.paste(lower, (0, upper.height))
    return sheet


def _drawn(
    shown: Triangle,
    segments: list[_Array],
    points: dict[str, _Array],
    outline: _Array,
    size: tuple[int, int],
) -> Panel:
    """What of the triangle lies within the view that holds an outline."""
    away = 0.5 * (shown.O1 + shown.O2) - shown.E
    fine = (SUPERSAMPLING * size[0], SUPERSAMPLING * size[1])
    # Seen so that camera 1 is on the left.
    view = fitted(outline, -shown.normal, away, fine, margin_px=90.0)
    panel = Panel(Image.new("RGB", fine, BACKGROUND), view)
    for segment in segments:
        panel.polyline(segment, CLAY, width=3.0)

    def label(point: _Array, text: str, colour: Colour) -> None:
        within = view.project(point)
        if np.all((within >= 0.0) & (within <= fine)):
            panel.label(point, text, colour, size=15.0)

    E, O1, O2 = shown.E, shown.O1, shown.O2
    for ends, colour, width in (
        ((O1, shown.B), _GREY, 1.0),
        ((O2, shown.F), _GREY, 1.0),
        ((O1, shown.O), _GREY, 1.0),
        ((shown.A, shown.ends[0]), ORANGE, 3.0),
        ((shown.G, shown.ends[1]), ORANGE, 3.0),
        ((O1, E), BLUE, 2.0),
        ((O2, E), BLUE, 2.0),
        ((O1, O2), GREEN, 3.0),
        ((shown.O, O2), GREEN, 1.5),
        ((E, shown.limit), PINK, 1.0),
        ((O1, shown.limit), PINK, 1.0),
    ):
        panel.polyline(np.stack(ends), colour, width=width)
    panel.polyline(shown.arc(shown.row.phi, 0.16), BLUE, width=2.0)
    panel.polyline(shown.arc(shown.row.phi_max, 0.22), PINK, width=2.0)
    for name, point in points.items():
        panel.dot(point, INK, radius=3.5)
        label(point, name, INK)
    for name, ends, colour in (
        ("D1", (O1, E), BLUE),
        ("D2", (O2, E), BLUE),
        ("d", (O1, O2), GREEN),
        ("d'", (shown.O, O2), GREEN),
        ("d''", (shown.O, O1), _GREY),
        ("C1", (shown.A, shown.B), ORANGE),
        ("C2", (shown.F, shown.G), ORANGE),
        ("d_max", (O1, shown.limit), PINK),
    ):
        label(0.5 * (ends[0] + ends[1]), name, colour)
    label(shown.arc(0.5 * shown.row.phi, 0.16)[-1], "phi", BLUE)
    label(shown.arc(shown.row.phi_max, 0.22)[-1], "phi_max", PINK)
    panel.scale_bar(size=13.0)
    return panel


def _points(shown: Triangle) -> dict[str, _Array]:
    names = ("O1", "O2", "O", "E", "B", "F", "A", "G")
    return {name: getattr(shown, name) for name in names}


def _listed(row: BaselineRow) -> Image.Image:
    """The figures of a row, and that (9) and (10) hold between them."""
    mm = {
        name: 1e3 * value
        for name, value in (
            ("D1 = O1 E", row.D1),
            ("D2 = O2 E", row.D2),
            ("d = O1 O2", row.d),
            ("d' = O O2", row.d_lateral),
            ("d'' = O O1", row.d_axial),
            ("C1 = B A, half of what is seen", row.C1),
            ("C2 = F G, likewise", row.C2),
            ("d_1 = O1 B", row.standoff1),
            ("d_2 = O2 F", row.standoff2),
            ("d_max, (9) at phi_max", row.d_max or np.nan),
        )
    }
    phi, phi_max = np.degrees([row.phi, row.phi_max])
    nine = row.D1**2 + row.D2**2 - 2.0 * row.D1 * row.D2 * np.cos(row.phi)
    lines = [
        f"{row.cameras[0]} (O1) and {row.cameras[1]} (O2)",
        "",
        *(f"{name}:  {value:.0f} mm" for name, value in mm.items()),
        "",
        f"phi:  {phi:.1f} deg",
        f"phi_max:  {phi_max:.1f} deg, by {row.limit[7:]}",
        "",
        f"(9):  d = {1e3 * np.sqrt(nine):.0f} mm",
        f"(10):  d'^2 + d''^2 = {row.d_lateral**2 + row.d_axial**2:.3f} m2",
        f"       < d_max^2 = {(row.d_max or np.nan) ** 2:.3f} m2",
    ]
    unit = SUPERSAMPLING
    picture = Image.new("RGB", (unit * _LIST[0], unit * _LIST[1]), BACKGROUND)
    draw = ImageDraw.Draw(picture)
    for k, line in enumerate(lines):
        draw.text((10 * unit, (10 + 22 * k) * unit), line, INK, font=font(14.0))
    return picture.resize(_LIST, Image.Resampling.BOX)
