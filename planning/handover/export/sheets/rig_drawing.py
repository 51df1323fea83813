"""A drawing of the rig in three views, dimensioned from the first datum point."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from geometry.arrays import Array
from geometry.poses import horizontal_axes
from planning.handover.export.exported_rig import BOX_QUADS, Content, ExportedRig
from planning.handover.export.mount_tables import reference_point
from planning.report.summary.devices.device_lines import axis_name

from .dxf_text import DxfText

# Height of letters, and of a row of dimensions, as shares of the view's width.
_LETTER, _ROW = 1.0 / 90.0, 1.0 / 45.0


class RigDrawing:
    """`rig.dxf`."""

    name = "drawing"
    what = "DXF drawing"
    notes = (
        "rig.dxf (R12): millimetres, 1:1. FRONT at its true coordinates; TOP above "
        "it, of which only the second coordinate is displaced; SIDE to the right, "
        "displaced in the first. Layers: OBJECT (its convex outline), OBSTACLES, "
        "HOUSINGS, FRUSTA, POINTS (mount, or else optical centre, of each device; "
        "datum points D1 to D4), NAMES, DIMENSIONS (each device's point from D1, a "
        "row a device)."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return nothing: optics are no matter of a drawing."""
        return []

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return `rig.dxf`."""
        first, second = horizontal_axes(rig.up)
        front = _View("FRONT", np.stack([first, rig.up]), rig)
        top = _View("TOP", np.stack([first, second]), rig)
        side = _View("SIDE", np.stack([second, rig.up]), rig)
        top.offset[1] = front.bounds[1, 1] - top.bounds[0, 1]
        side.offset[0] = front.bounds[1, 0] - side.bounds[0, 0]
        drawing = DxfText()
        for view in (front, top, side):
            view.draw(drawing)
        notes = (f"plan {rig.plan.digest}", "millimetres", f"frame: {rig.frame.words}")
        return {"rig.dxf": drawing.content(notes)}


@dataclass(eq=False)
class _View:
    """One view: which two axes (2, 3) lie across and up the sheet."""

    name: str
    axes: Array
    rig: ExportedRig

    def __post_init__(self) -> None:
        self.offset = np.zeros(2)
        seen = [self.rig.mesh.vertices, self.rig.datums]
        seen += [mesh.vertices for mesh in self.rig.obstacles.values()]
        for device in self.rig.devices:
            seen.append(device.frustum.reshape(-1, 3))
            seen.append(reference_point(device)[1][None])
            if device.box is not None:
                seen.append(device.box.corners)
        flat = 1e3 * np.concatenate(seen) @ self.axes.T
        low, high = flat.min(axis=0), flat.max(axis=0)
        self._drawn = np.stack([low, high])
        self._size = float((high - low).max())
        # Rows of dimensions below and on the left, the title above.
        margin = self._size * _ROW * (len(self.rig.devices) + 4)
        self.bounds = np.stack([low - margin, high + self._size * _ROW * 4])

    def draw(self, drawing: DxfText) -> None:
        """Draw the view."""
        letter = self._size * _LETTER
        drawing.outline("OBJECT", self._hull(self.rig.mesh.vertices))
        for mesh in self.rig.obstacles.values():
            drawing.outline("OBSTACLES", self._hull(mesh.vertices))
        for number, datum in enumerate(self.rig.datums, 1):
            place = self._flat(datum)
            drawing.circle("POINTS", place, 0.4 * letter)
            if self.name == "TOP" or number == 1:
                drawing.text("NAMES", place - 1.6 * letter, letter, f"D{number}")
        for row, device in enumerate(self.rig.devices):
            for start, end in device.frustum_lines:
                drawing.line("FRUSTA", self._flat(start), self._flat(end))
            if device.box is not None:
                corners = self._flat(device.box.corners)
                for quad in BOX_QUADS:
                    drawing.outline("HOUSINGS", corners[list(quad)])
            place = self._flat(reference_point(device)[1])
            drawing.circle("POINTS", place, 0.5 * letter)
            drawing.text("NAMES", place + letter, letter, device.id)
            self._dimension(drawing, device.id, place, row)
        words = f"{self.name}: {' and '.join(map(axis_name, self.axes))} [mm]"
        if self.offset.any():
            x, y = self.offset
            words += f", displaced by {x:.1f}, {y:.1f}"
        title = self._drawn[1] * [0.0, 1.0] + self._drawn[0] * [1.0, 0.0]
        drawing.text(
            "NAMES", title + self.offset + [0.0, 2.0 * letter], 1.5 * letter, words
        )

    def _dimension(self, drawing: DxfText, name: str, place: Array, row: int) -> None:
        """Tell how far a point is from D1, across and up."""
        datum, letter = self._flat(self.rig.datums[0]), self._size * _LETTER
        beside = self._drawn[0] + self.offset - self._size * _ROW * (row + 2)
        for axis in (0, 1):
            ends = np.stack([datum, place])
            ends[:, 1 - axis] = beside[1 - axis]
            drawing.line("DIMENSIONS", ends[0], ends[1])
            tick = 0.4 * letter * np.eye(2)[1 - axis]
            for end in ends:
                drawing.line("DIMENSIONS", end - tick, end + tick)
            drawing.line("DIMENSIONS", place, ends[1])
            words = f"{name} {place[axis] - datum[axis] + 0.0:.2f}"
            gap = 0.3 * letter * (np.eye(2)[1] if axis == 0 else -np.eye(2)[0])
            drawing.text(
                "DIMENSIONS", ends.mean(axis=0) + gap, letter, words, 90.0 * axis
            )

    def _flat(self, points: Array) -> Array:
        return 1e3 * points @ self.axes.T + self.offset

    def _hull(self, points: Array) -> Array:
        flat = self._flat(points)
        try:
            return flat[ConvexHull(flat).vertices]
        except QhullError:
            # A plate seen from its edge: a line.
            along = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)[2][0]
            way = flat @ along
            return flat[[int(np.argmin(way)), int(np.argmax(way))]]
