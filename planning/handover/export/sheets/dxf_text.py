"""DXF R12, the drawing format that every CAD program reads: lines, circles, texts."""

from collections.abc import Sequence

import numpy as np

from geometry.arrays import Array

# Layers with their colour numbers of AutoCAD.
LAYERS = {
    "OBJECT": 7,
    "OBSTACLES": 8,
    "HOUSINGS": 5,
    "FRUSTA": 30,
    "POINTS": 1,
    "NAMES": 7,
    "DIMENSIONS": 3,
}


class DxfText:
    """A drawing under construction; coordinates are (x, y) in the drawing's unit."""

    def __init__(self) -> None:
        self._groups: list[tuple[int, object]] = []

    def line(self, layer: str, start: Array, end: Array) -> None:
        """Draw a line."""
        self._entity("LINE", layer)
        self._place(start)
        self._place(end, 1)

    def outline(self, layer: str, points: Array) -> None:
        """Draw a closed polygon (n, 2)."""
        for start, end in zip(points, np.roll(points, -1, axis=0), strict=True):
            self.line(layer, start, end)

    def circle(self, layer: str, centre: Array, radius: float) -> None:
        """Draw a circle, and a point in its middle."""
        self._entity("POINT", layer)
        self._place(centre)
        self._entity("CIRCLE", layer)
        self._place(centre)
        self._groups.append((40, float(radius)))

    def text(
        self, layer: str, place: Array, height: float, words: str, turn_deg: float = 0.0
    ) -> None:
        """Write words from their lower left corner on."""
        self._entity("TEXT", layer)
        self._place(place)
        self._groups += [(40, float(height)), (1, words), (50, float(turn_deg))]

    def content(self, notes: Sequence[str]) -> bytes:
        """Return the file, with notes as comments."""
        groups: list[tuple[int, object]] = [(999, note) for note in notes]
        groups += [(0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009")]
        groups += [(0, "ENDSEC"), (0, "SECTION"), (2, "TABLES"), (0, "TABLE")]
        groups += [(2, "LAYER"), (70, len(LAYERS))]
        for name, colour in LAYERS.items():
            groups += [(0, "LAYER"), (2, name), (70, 0), (62, colour)]
            groups.append((6, "CONTINUOUS"))
        groups += [(0, "ENDTAB"), (0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES")]
        groups += [*self._groups, (0, "ENDSEC"), (0, "EOF")]
        text = "".join(f"{code}\n{value}\n" for code, value in groups)
        return text.encode("ascii", "replace")

    def _entity(self, kind: str, layer: str) -> None:
        self._groups += [(0, kind), (8, layer)]

    def _place(self, point: Array, which: int = 0) -> None:
        x, y = (float(value) for value in point)
        self._groups += [(10 + which, x), (20 + which, y), (30 + which, 0.0)]
