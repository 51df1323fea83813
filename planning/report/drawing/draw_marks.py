"""Lines, labels, scale bars and axes on top of a picture."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial import ConvexHull

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster

from .draw_views import SUPERSAMPLING, Colour, PictureView

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
        taken: Boxes that no label may cover.
    """

    image: Image.Image
    view: PictureView
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
        caster: RayCaster | None = None,
        alpha: int = 255,
    ) -> None:
        """Draw a polyline of the world; what a mesh hides is nearly left out.

        Args:
            points: In [m], shape (n, 3).
            colour: Of the line.
            width: Of the line in final pixels.
            caster: Over the mesh that can hide it.
            alpha: Opacity, 0 to 255.
        """
        draw, thick = self._draw, max(1, round(width * SUPERSAMPLING))
        for start, end in pairwise(points):
            t = np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
            line = start + t * (end - start)
            hidden = _hidden(line, self.view, caster)
            pixels = self.view.project(line)
            for first, last in _runs(hidden[:-1] | hidden[1:]):
                opacity = alpha // 6 if hidden[first : last + 1].any() else alpha
                ends = [tuple(pixels[first]), tuple(pixels[last])]
                draw.line(ends, fill=(*colour, opacity), width=thick)

    def tint(self, points: NDArray[np.float64], colour: Colour, *, alpha: int) -> None:
        """Tint what the convex hull of points of the world covers, shape (n, 3)."""
        pixels = self.view.project(points)
        # A slab seen edge on covers less than a pixel and has no hull to fill.
        if np.linalg.matrix_rank(pixels - pixels[0], tol=1.0) < 2:
            return
        outline = pixels[ConvexHull(pixels).vertices]
        self._draw.polygon([tuple(p) for p in outline], fill=(*colour, alpha))

    def frame(
        self, point: NDArray[np.float64], colour: Colour, *, radius: float
    ) -> None:
        """Draw a square about a point of the world; the radius is in final pixels."""
        x, y = self.view.project(point)
        r = radius * SUPERSAMPLING
        box = (x - r, y - r, x + r, y + r)
        self._draw.rectangle(box, outline=(*colour, 255), width=2 * SUPERSAMPLING)
        self.taken.append(box)

    def dot(self, point: NDArray[np.float64], colour: Colour, *, radius: float) -> None:
        """Draw a filled dot at a point of the world; the radius is in final pixels."""
        x, y = self.view.project(point)
        r = radius * SUPERSAMPLING
        self._draw.ellipse((x - r, y - r, x + r, y + r), fill=(*colour, 255))

    def keep_clear(self, points: NDArray[np.float64]) -> None:
        """Keep labels off the box about points of the world, shape (n, 3)."""
        pixels = self.view.project(points)
        (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
        self.taken.append((left, top, right, bottom))

    def label(
        self, point: NDArray[np.float64], text: str, colour: Colour, *, size: float
    ) -> None:
        """Write a label near a point of the world where it covers least.

        It moves outwards in rings until it finds room; a thin line leads back when it
        ends far away.
        """
        x, y = self.view.project(point)
        type_ = font(size)
        left, top, right, bottom = type_.getbbox(text)
        width, height = right - left, bottom - top
        pad = 3.0 * SUPERSAMPLING
        box = self._free_place(x, y, width + 2 * pad, height + 2 * pad)
        middle = (0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))
        draw = self._draw
        away = np.hypot(middle[0] - x, middle[1] - y)
        if away > 0.5 * (width + height) + 16 * SUPERSAMPLING:
            draw.line([(x, y), middle], fill=(*colour, 120), width=SUPERSAMPLING)
        draw.rounded_rectangle(box, radius=pad, fill=(255, 255, 255, 215))
        draw.text((box[0] + pad - left, box[1] + pad - top), text, colour, font=type_)
        self.taken.append(box)

    def _free_place(self, x: float, y: float, width: float, height: float) -> _Box:
        best, least = (x, y, x + width, y + height), np.inf
        middle_x, middle_y = 0.5 * self.view.size[0], 0.5 * self.view.size[1]
        outward = np.arctan2(y - middle_y, x - middle_x)
        for ring in range(1, 9):
            reach = 9.0 * ring * SUPERSAMPLING
            for step in range(12):
                # Outwards first, then alternating to both sides.
                turn = outward + (step + 1) // 2 * (-1) ** step * np.pi / 6
                left = x + np.cos(turn) * (reach + 0.5 * width) - 0.5 * width
                top = y + np.sin(turn) * (reach + 0.5 * height) - 0.5 * height
                box = (left, top, left + width, top + height)
                covered = self._covered(box) + 0.02 * width * height * (ring - 1)
                if covered < least - 1e-6:
                    best, least = box, covered
        return best

    def _covered(self, box: _Box) -> float:
        """Area of a box that is taken or outside the panel."""
        width, height = self.view.size
        area = (box[2] - box[0]) * (box[3] - box[1])
        outside = area - _overlap(box, (0, 0, width, height))
        return 4.0 * outside + sum(_overlap(box, other) for other in self.taken)

    def scale_bar(self, *, size: float) -> None:
        """Draw a bar of a round length in the lower left corner."""
        height = self.view.size[1]
        room_mm = 0.28 * self.view.size[0] * self.view.m_per_px * 1e3
        length_mm = round_length(room_mm)
        pixels = length_mm * 1e-3 / self.view.m_per_px
        left, base = 16.0 * SUPERSAMPLING, height - 16.0 * SUPERSAMPLING
        tick, draw = 4 * SUPERSAMPLING, self._draw
        for ends in (
            [(left, base), (left + pixels, base)],
            [(left, base - tick), (left, base + tick)],
            [(left + pixels, base - tick), (left + pixels, base + tick)],
        ):
            draw.line(ends, fill=INK, width=round(1.5 * SUPERSAMPLING))
        text = f"{length_mm:g} mm"
        draw.text(
            (left, base - 8 * SUPERSAMPLING), text, INK, font=font(size), anchor="ls"
        )
        top = base - (12 + size) * SUPERSAMPLING
        self.taken.append((left, top, left + pixels + tick, float(height)))

    def axes(self, *, size: float) -> None:
        """Draw the directions of the mesh file's axes in the lower right corner."""
        width, height = self.view.size
        reach = 2.4 * size * SUPERSAMPLING
        x0, y0 = width - 1.7 * reach, height - 1.7 * reach
        draw, type_ = self._draw, font(size)
        back = self.view.to_viewer
        for k in np.argsort(np.eye(3) @ back):
            name, colour = _AXES[k]
            axis = np.eye(3)[k]
            dx = reach * float(axis @ self.view.right)
            dy = -reach * float(axis @ self.view.up)
            towards = float(axis @ back)
            if np.hypot(dx, dy) < 0.25 * reach:
                _end_on(draw, x0, y0, colour, towards)
                dx, dy = -0.35 * reach, 0.35 * reach
            else:
                _arrow(draw, (x0, y0), (x0 + dx, y0 + dy), colour)
            away = 1.0 + 0.75 * size * SUPERSAMPLING / max(float(np.hypot(dx, dy)), 1.0)
            spot = (x0 + dx * away, y0 + dy * away)
            draw.text(spot, name, colour, font=type_, anchor="mm")
        self.taken.append(
            (x0 - 1.4 * reach, y0 - 1.5 * reach, float(width), float(height))
        )


def font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return Pillow's own typeface at a size in final pixels."""
    return ImageFont.load_default(size=size * SUPERSAMPLING)


def round_length(room: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... (any decade) that is at most `room`."""
    decade = 10.0 ** np.floor(np.log10(room))
    return float(
        max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= room)
    )


def _hidden(
    points: NDArray[np.float64], view: PictureView, caster: RayCaster | None
) -> NDArray[np.bool_]:
    """Whether the mesh lies between points of the world and the viewer, (n,)."""
    if caster is None:
        return np.zeros(len(points), dtype=bool)
    mesh: TriangleMesh = caster.mesh
    away = np.linalg.norm(points - mesh.centre, axis=1).max() + 2.0 * mesh.reach
    rays = np.broadcast_to(view.to_viewer, points.shape)
    slack = 1e-4 * mesh.radius
    return caster.occluded(points + slack * rays, rays, np.full(len(points), away))


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Half-open index ranges over which flags stay the same."""
    cuts = [0, *(np.flatnonzero(flags[1:] != flags[:-1]) + 1).tolist(), len(flags)]
    return list(pairwise(cuts))


def _overlap(a: _Box, b: _Box) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return max(width, 0.0) * max(height, 0.0)


def _arrow(
    draw: ImageDraw.ImageDraw,
    start: tuple[float, float],
    end: tuple[float, float],
    colour: Colour,
) -> None:
    draw.line([start, end], fill=colour, width=2 * SUPERSAMPLING)
    along = np.subtract(end, start)
    along = along / np.linalg.norm(along) * 7.0 * SUPERSAMPLING
    across = 0.45 * np.array([-along[1], along[0]])
    tip = np.array(end) + 0.5 * along
    corners = [tip, tip - along + across, tip - along - across]
    draw.polygon([tuple(corner) for corner in corners], fill=colour)


def _end_on(
    draw: ImageDraw.ImageDraw, x: float, y: float, colour: Colour, towards: float
) -> None:
    """An axis along the line of sight: a dot if it points here, a cross if away."""
    r, line = 6.0 * SUPERSAMPLING, round(1.5 * SUPERSAMPLING)
    draw.ellipse(
        (x - r, y - r, x + r, y + r), fill=(255, 255, 255), outline=colour, width=line
    )
    if towards > 0:
        draw.ellipse((x - r / 3, y - r / 3, x + r / 3, y + r / 3), fill=colour)
    else:
        s = 0.7 * r
        draw.line([(x - s, y - s), (x + s, y + s)], fill=colour, width=line)
        draw.line([(x - s, y + s), (x + s, y - s)], fill=colour, width=line)
