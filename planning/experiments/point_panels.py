"""Panels of points on the object, and colours that say what each point is."""

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.report.drawing.panel import INK, PALE, Panel, font
from planning.report.drawing.picture_view import (
    BACKGROUND,
    SUPERSAMPLING,
    Colour,
    PictureView,
    fitted,
)
from planning.report.drawing.shader import Shader
from planning.verify.reconstruction.arrays import Array, Mask
from planning.verify.reconstruction.check.cloud_file import ramp

from .paper_devices import UP, bearing

# Points stand out against a dark object.
_OBJECT: Colour = (112, 112, 120)
RINGS: tuple[Colour, ...] = (
    (255, 214, 90),
    (120, 214, 255),
    (255, 150, 190),
    (150, 240, 150),
    (255, 170, 90),
    (190, 170, 255),
    (240, 240, 240),
)
PROJECTORS: tuple[Colour, ...] = ((255, 176, 60), (110, 200, 255))
KEPT: Colour = (120, 214, 255)
REMOVED: Colour = (240, 70, 60)
# Inside to outside, told apart by lightness at both ends.
_SIGNED = "3c5ae6 96c8fa fafad7 faaa50 dc281e"
_HEAD_PX = 30
_RADIUS_PX = 2
Legend = Sequence[tuple[str, Colour]]


class PanelStage:
    """The object from the front, where clouds are drawn on it.

    Args:
        mesh: The object.
        size: Width and height of a panel, its heading aside, in [px].
    """

    def __init__(self, mesh: TriangleMesh, size: tuple[int, int] = (480, 480)) -> None:
        self.width = size[0]
        self.caster = RayCaster(mesh, threads=1)
        fine = (size[0] * SUPERSAMPLING, size[1] * SUPERSAMPLING)
        corners = mesh.corners.reshape(-1, 3)
        direction = bearing(20.0, 8.0)
        self.view: PictureView = fitted(
            corners, direction, UP, fine, margin_px=0.05 * min(fine)
        )
        colours = np.tile(np.array(_OBJECT, dtype=np.float64), (len(mesh.faces), 1))
        self._object = Shader(self.caster, colours).shade(self.view)

    def panel(
        self, title: str, points: Array, colours: Array, legend: Legend = ()
    ) -> Image.Image:
        """Return a panel of points (n, 3) of some colours, but for those behind it."""
        panel = Panel(self._object.copy(), self.view)
        picture = np.asarray(panel.image).copy()
        shown = np.flatnonzero(~self._hidden(points))
        # The nearest are drawn last.
        shown = shown[np.argsort(points[shown] @ self.view.to_viewer)]
        _splat(picture, self.view.project(points[shown]), colours[shown])
        panel.image = Image.fromarray(picture)
        panel.scale_bar(size=13.0)
        return _framed(panel.image, title, legend)

    def _hidden(self, points: Array) -> Mask:
        if len(points) == 0:
            return np.zeros(0, dtype=bool)
        mesh = self.caster.mesh
        rays = np.broadcast_to(self.view.to_viewer, points.shape)
        away = np.full(len(points), 4.0 * mesh.reach)
        # False points hang up to some millimetres below the surface.
        return self.caster.occluded(points + 4e-3 * rays, rays, away)


def signed_colours(values: Array, limit: float) -> Array:
    """Return colours (n, 3) of signed values, saturated at plus and minus a limit."""
    return ramp(_SIGNED, 0.5 + 0.5 * values / limit)


def chosen_colours(palette: Sequence[Colour], index: NDArray[np.integer]) -> Array:
    """Return the palette's colour of each index, beginning again at its end, (n, 3)."""
    return np.array(palette, dtype=np.float64)[np.asarray(index) % len(palette)]


def colour_bar(width: int, limit_mm: float) -> Image.Image:
    """Return a horizontal bar of `signed_colours` with its numbers, `width` px wide."""
    fine = (width * SUPERSAMPLING, 46 * SUPERSAMPLING)
    picture = Image.new("RGB", fine, BACKGROUND)
    inner, outer = 0.25 * fine[0], 0.75 * fine[0]
    ramp = signed_colours(np.linspace(-1.0, 1.0, round(outer - inner)), 1.0)
    bar = np.tile(ramp.astype(np.uint8), (12 * SUPERSAMPLING, 1, 1))
    picture.paste(Image.fromarray(bar), (round(inner), 6 * SUPERSAMPLING))
    draw = ImageDraw.Draw(picture)
    for share in (-1.0, -0.5, 0.0, 0.5, 1.0):
        x = 0.5 * (inner + outer) + 0.5 * share * (outer - inner)
        text = f"{share * limit_mm:+g}" if share else "0 mm"
        draw.text((x, 22 * SUPERSAMPLING), text, INK, font=font(13.0), anchor="mt")
    for x, text, anchor in ((inner, "inside ", "rm"), (outer, " outside", "lm")):
        draw.text((x, 12 * SUPERSAMPLING), text, PALE, font=font(13.0), anchor=anchor)
    return picture.resize((width, 46), Image.Resampling.BOX)


def side_by_side(
    panels: Sequence[Image.Image], *, columns: int, foot: Image.Image | None = None
) -> Image.Image:
    """Return panels of one size in rows, a foot below them."""
    width, height = panels[0].size
    rows = -(-len(panels) // columns)
    below = 0 if foot is None else foot.height
    sheet = Image.new("RGB", (columns * width, rows * height + below), BACKGROUND)
    for k, panel in enumerate(panels):
        sheet.paste(panel, ((k % columns) * width, (k // columns) * height))
    if foot is not None:
        sheet.paste(foot, ((sheet.width - foot.width) // 2, rows * height))
    return sheet


def captioned(image: Image.Image, title: str) -> Image.Image:
    """Return an image in final pixels with a title above it."""
    size = (image.width * SUPERSAMPLING, image.height * SUPERSAMPLING)
    return _framed(image.resize(size, Image.Resampling.BICUBIC), title, ())


def _framed(image: Image.Image, title: str, legend: Legend) -> Image.Image:
    """Put a heading above and a legend below an image in fine pixels."""
    head = _HEAD_PX * SUPERSAMPLING
    foot = head if legend else 0
    sheet = Image.new("RGB", (image.width, image.height + head + foot), BACKGROUND)
    sheet.paste(image, (0, head))
    draw = ImageDraw.Draw(sheet)
    at = (12 * SUPERSAMPLING, head // 2)
    draw.text(at, title, INK, font=font(15.0), anchor="lm")
    x, y = 12.0 * SUPERSAMPLING, head + image.height + foot // 2
    for text, colour in legend:
        r = 5 * SUPERSAMPLING
        draw.ellipse((x, y - r, x + 2 * r, y + r), fill=colour, outline=PALE)
        x += 2.8 * r
        draw.text((x, y), text, INK, font=font(13.0), anchor="lm")
        x += draw.textlength(text, font=font(13.0)) + 11 * SUPERSAMPLING
    final = (sheet.width // SUPERSAMPLING, sheet.height // SUPERSAMPLING)
    return sheet.resize(final, Image.Resampling.BOX)


def _splat(picture: NDArray[np.uint8], pixels: Array, colours: Array) -> None:
    """Draw points as small discs into a picture (h, w, 3)."""
    height, width = picture.shape[:2]
    middle = np.rint(pixels).astype(np.int64)
    reach = np.arange(-_RADIUS_PX, _RADIUS_PX + 1)
    for dv, du in product(reach, reach):
        if du * du + dv * dv <= _RADIUS_PX * _RADIUS_PX:
            u, v = middle[:, 0] + du, middle[:, 1] + dv
            inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
            picture[v[inside], u[inside]] = colours[inside].astype(np.uint8)
