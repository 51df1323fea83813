"""Lines, labels, a scale bar and axes on top of a picture."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from geometry.rays.rays import RayCaster

from .picture_view import BACKGROUND, SUPERSAMPLING, Colour, PictureView

INK: Colour = (30, 30, 34)
PALE: Colour = (120, 120, 126)

# The file's axes; told apart by their letters, the colours only help.
_AXES: tuple[tuple[str, Colour], ...] = (
    ("x", (196, 50, 40)),
    ("y", (52, 128, 60)),
    ("z", (40, 80, 190)),
)
_PIECES = 96

_Box = tuple[float, float, float, float]


@dataclass(eq=False)
class Panel:
    """A part of the picture that shows a scene; coordinates are its own fine pixels.

    Attributes:
        image: What is drawn so far.
        view: How the world falls into it.
        caster: Over the mesh that hides lines; None: nothing does.
        taken: Boxes that no label may cover.
    """

    image: Image.Image
    view: PictureView
    caster: RayCaster | None = None
    taken: list[_Box] = field(default_factory=list[_Box])

    @property
    def _draw(self) -> ImageDraw.ImageDraw:
        return ImageDraw.Draw(self.image, "RGBA")

    def polyline(
        self,
        points: NDArray[np.float64],
        colour: Colour,
        *,
        width: float,
        alpha: int = 255,
    ) -> None:
        """Draw a polyline of the world, (n, 3); what the mesh hides is nearly left out.

        The width is in final pixels, the opacity 0 to 255.
        """
        draw, thick = self._draw, max(1, round(width * SUPERSAMPLING))
        for start, end in pairwise(points):
            t = np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
            line = start + t * (end - start)
            hidden = self._hidden(line)
            pixels = self.view.project(line)
            # Pieces of one opacity are one line: drawn apart they would overlap.
            faint = hidden[:-1] | hidden[1:]
            cuts = [0, *(np.flatnonzero(np.diff(faint)) + 1).tolist(), len(faint)]
            for first, last in pairwise(cuts):
                opacity = alpha // 6 if faint[first] else alpha
                ends = [tuple(pixels[first]), tuple(pixels[last])]
                draw.line(ends, fill=(*colour, opacity), width=thick)

    def frame(
        self, point: NDArray[np.float64], colour: Colour, *, radius: float
    ) -> None:
        """Draw a square about a point of the world; the radius is in final pixels."""
        box = self._about(point, radius)
        self._draw.rectangle(box, outline=(*colour, 255), width=2 * SUPERSAMPLING)
        self.taken.append(box)

    def dot(self, point: NDArray[np.float64], colour: Colour, *, radius: float) -> None:
        """Draw a filled dot at a point of the world; the radius is in final pixels."""
        self._draw.ellipse(self._about(point, radius), fill=(*colour, 255))

    def _about(self, point: NDArray[np.float64], radius: float) -> _Box:
        x, y = self.view.project(point).tolist()
        r = radius * SUPERSAMPLING
        return x - r, y - r, x + r, y + r

    def keep_clear(self, points: NDArray[np.float64]) -> None:
        """Keep labels off the box about points of the world, shape (n, 3)."""
        pixels = self.view.project(points)
        (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
        self.taken.append((left, top, right, bottom))

    def label(
        self, point: NDArray[np.float64], text: str, colour: Colour, *, size: float
    ) -> None:
        """Write a label near a point of the world, where it covers least."""
        left, top, right, bottom = font(size).getbbox(text)
        pad = 3.0 * SUPERSAMPLING
        extent = np.array([right - left, bottom - top]) + 2.0 * pad
        box = self._clearest(self.view.project(point), extent)
        self._draw.rounded_rectangle(box, radius=pad, fill=(255, 255, 255, 215))
        spot = (box[0] + pad - left, box[1] + pad - top)
        self._draw.text(spot, text, colour, font=font(size))
        self.taken.append(box)

    def mark(self, points: NDArray[np.float64], text: str, *, size: float) -> None:
        """Write a text onto the first point of the world (n, 3) where there is room."""
        halo = 2 * SUPERSAMPLING
        left, top, right, bottom = font(size).getbbox(text, anchor="mm")
        spots = self.view.project(points)
        around = [left - halo, top - halo, right + halo, bottom + halo]
        boxes = np.tile(spots, 2) + np.array(around)
        first = int(np.argmin(_overlaps(boxes, self.taken)))
        self._draw.text(
            tuple(spots[first]),
            text,
            INK,
            font=font(size),
            anchor="mm",
            stroke_width=halo,
            stroke_fill=BACKGROUND,
        )
        a, b, c, d = boxes[first].tolist()
        self.taken.append((a, b, c, d))

    def _clearest(self, spot: NDArray[np.float64], extent: NDArray[np.float64]) -> _Box:
        """The box about a spot that covers least: nearest and most outward first."""
        x, y = spot - 0.5 * np.array(self.view.size)
        steps = np.arange(12)
        turns = np.arctan2(y, x) + (steps + 1) // 2 * (-1) ** steps * np.pi / 6
        along = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        reach = 9.0 * SUPERSAMPLING * np.arange(1, 9)[:, None, None]
        low = (spot + along * (reach + 0.5 * extent) - 0.5 * extent).reshape(-1, 2)
        boxes = np.concatenate([low, low + extent], axis=1)
        inside = _overlaps(boxes, [(0, 0, *self.view.size)])
        outside = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) - inside
        covered = 4.0 * outside + _overlaps(boxes, self.taken)
        left, top, right, bottom = boxes[np.argmin(covered)].tolist()
        return left, top, right, bottom

    def _hidden(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether the mesh lies between points of the world and the viewer, (n,)."""
        if self.caster is None:
            return np.zeros(len(points), dtype=bool)
        mesh = self.caster.mesh
        away = np.linalg.norm(points - mesh.centre, axis=1).max() + 2.0 * mesh.reach
        rays = np.broadcast_to(self.view.to_viewer, points.shape)
        starts = points + 1e-4 * mesh.radius * rays
        return self.caster.occluded(starts, rays, np.full(len(points), away))

    def heading(self, text: str) -> None:
        """Name the panel in its upper left corner; labels keep off the name."""
        spot = (14 * SUPERSAMPLING, 10 * SUPERSAMPLING)
        box = self._draw.textbbox(spot, text, font=font(15.0))
        # Lines of a room or of light may run behind it.
        self._draw.rectangle(box, fill=BACKGROUND)
        self._draw.text(spot, text, PALE, font=font(15.0))
        self.taken.append(box)

    def scale_bar(self, *, size: float) -> None:
        """Draw a bar of a round length in the lower left corner."""
        height = self.view.size[1]
        room_mm = 0.28 * self.view.size[0] * self.view.m_per_px * 1e3
        length_mm = round_length(room_mm)
        pixels = length_mm * 1e-3 / self.view.m_per_px
        left, base = 16.0 * SUPERSAMPLING, height - 16.0 * SUPERSAMPLING
        right, tick, draw = left + pixels, 4 * SUPERSAMPLING, self._draw
        for ends in (
            [(left, base), (right, base)],
            *([(x, base - tick), (x, base + tick)] for x in (left, right)),
        ):
            draw.line(ends, fill=INK, width=round(1.5 * SUPERSAMPLING))
        spot, text = (left, base - 8 * SUPERSAMPLING), f"{length_mm:g} mm"
        draw.text(spot, text, INK, font=font(size), anchor="ls")
        top = base - (12 + size) * SUPERSAMPLING
        self.taken.append((left, top, right + tick, float(height)))

    def axes(self, *, size: float) -> None:
        """Draw the directions of the mesh file's axes in the lower right corner.

        Those that point to the viewer are drawn last. One along the line of sight is a
        dot.
        """
        width, height = self.view.size
        reach = 2.4 * size * SUPERSAMPLING
        x, y = width - 1.7 * reach, height - 1.7 * reach
        draw, frame = self._draw, np.stack([self.view.right, -self.view.up])
        for k in np.argsort(self.view.to_viewer):
            name, colour = _AXES[k]
            along = reach * frame[:, k]
            if np.hypot(*along) < 0.25 * reach:
                r = 4 * SUPERSAMPLING
                draw.ellipse((x - r, y - r, x + r, y + r), fill=colour)
                along = np.array([-0.35, 0.35]) * reach
            else:
                end = (x + along[0], y + along[1])
                draw.line([(x, y), end], fill=colour, width=2 * SUPERSAMPLING)
            away = 1.0 + 0.5 * size * SUPERSAMPLING / float(np.hypot(*along))
            spot = (x + away * along[0], y + away * along[1])
            draw.text(spot, name, colour, font=font(size), anchor="mm")
        left, top = x - 1.4 * reach, y - 1.5 * reach
        self.taken.append((left, top, float(width), float(height)))


def font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return Pillow's own typeface at a size in final pixels."""
    return ImageFont.load_default(size=size * SUPERSAMPLING)


def round_length(room: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... (any decade) that is at most `room`."""
    lengths = 10.0 ** np.floor(np.log10(room)) * np.array([1.0, 2.0, 5.0])
    return float(lengths[lengths <= room].max())


def _overlaps(
    boxes: NDArray[np.float64], others: Sequence[_Box]
) -> NDArray[np.float64]:
    """The area that each box, (n, 4), shares with all others, (n,)."""
    other = np.reshape(others, (-1, 4))
    ends = np.minimum(boxes[:, None, 2:], other[:, 2:])
    sides = ends - np.maximum(boxes[:, None, :2], other[:, :2])
    return np.prod(np.maximum(sides, 0.0), axis=2).sum(axis=1)
