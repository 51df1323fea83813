"""How the pictures of the documentation are drawn: views, colours, points."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from geometry.rays.rays import RayCaster
from planning.report.drawing.panel import Panel
from planning.report.drawing.picture_view import (
    BACKGROUND,
    SUPERSAMPLING,
    PictureView,
    fitted,
)
from planning.report.drawing.shader import Shader

from .job import Colours, Job

FRONT, SIDE, ABOVE = (-0.45, -1.0, 0.2), (0.8, -0.7, 0.15), (-0.5, -0.8, 0.55)
UP = (0.0, 0.0, 1.0)
CLAY, DARK = (214, 205, 196), (92, 92, 100)
BLUE, ORANGE, PINK, GREEN = (0, 90, 160), (200, 80, 0), (240, 40, 140), (46, 132, 74)
LIGHT = (250, 214, 120)
SIZE = (420, 480)


def by(
    where: NDArray[np.bool_], yes: tuple[int, int, int], no: tuple[int, int, int]
) -> Colours:
    """Return one colour where something holds, another elsewhere, (n, 3)."""
    return np.where(where[:, None], np.array(yes, float), np.array(no, float))


def ramp(
    share: NDArray[np.float64], low: tuple[int, ...], high: tuple[int, ...]
) -> Colours:
    """Return colours between two, by shares within [0, 1], (n, 3)."""
    ends = np.array([low, high], dtype=float)
    return ends[0] + np.clip(share, 0.0, 1.0)[:, None] * (ends[1] - ends[0])


def signed_colours(values: NDArray[np.float64], limit: float) -> Colours:
    """Return blue for negative, red for positive values, deepest at the limit."""
    share = np.clip(values / limit, -1.0, 1.0)
    colours = ramp(np.abs(share), (250, 250, 215), (220, 40, 30))
    inside = share < 0
    colours[inside] = ramp(-share[inside], (250, 250, 215), (60, 90, 230))
    return colours


def view_of(
    points: NDArray[np.float64], direction: tuple[float, ...], size: tuple[int, int]
) -> PictureView:
    """Return the view of points from a direction, with some room about them."""
    fine = (size[0] * SUPERSAMPLING, size[1] * SUPERSAMPLING)
    return fitted(points, direction, UP, fine, margin_px=0.08 * min(fine))


def shaded(caster: RayCaster, colour: tuple[int, int, int]) -> Shader:
    """Return a shader in one colour."""
    n = len(caster.mesh.faces)
    return Shader(caster, np.tile(np.array(colour, dtype=float), (n, 1)))


def drawn(job: Job, colours: Colours, direction: tuple[float, ...]) -> Image.Image:
    """Return the object in the colours of its faces."""
    points = job.mesh.corners.reshape(-1, 3)
    return pictured(job.caster, colours, points, direction, SIZE)


def pictured(
    caster: RayCaster,
    colours: Colours,
    points: NDArray[np.float64],
    direction: tuple[float, ...],
    size: tuple[int, int],
) -> Image.Image:
    """Return a mesh in the colours of its faces, as large as the points allow."""
    image = Shader(caster, colours).shade(view_of(points, direction, size))
    return image.resize(size, Image.Resampling.BOX)


def points_on(
    job: Job,
    points: NDArray[np.float64],
    colours: Colours,
    direction: tuple[float, ...],
    there: RayCaster | None = None,
) -> Image.Image:
    """Points on the dark object; those behind it are left out."""
    caster = there or job.caster
    view = view_of(job.mesh.corners.reshape(-1, 3), direction, SIZE)
    picture = np.asarray(shaded(caster, DARK).shade(view)).copy()
    ray = np.broadcast_to(view.to_viewer, points.shape)
    reach = np.full(len(points), 4.0 * job.mesh.reach)
    hidden = caster.occluded(points + 2e-3 * ray, ray, reach)
    pixels = np.rint(view.project(points[~hidden])).astype(int)
    for shift in ((0, 0), (1, 0), (0, 1), (1, 1)):
        u, v = np.clip(pixels + shift, 0, np.array(view.size) - 1).T
        picture[v, u] = colours[~hidden].astype(np.uint8)
    return Image.fromarray(picture).resize(SIZE, Image.Resampling.BOX)


def finished(panel: Panel) -> Image.Image:
    """Return a panel at its final size."""
    size = tuple(side // SUPERSAMPLING for side in panel.view.size)
    return panel.image.resize(size, Image.Resampling.BOX)


def save(picture: Image.Image, path: Path) -> None:
    """Write a picture in 256 colours, rare ones too (the median cut drops them)."""
    palette = picture.convert("RGB").quantize(method=Image.Quantize.FASTOCTREE)
    palette.save(path, optimize=True)


def beside_each_other(*pictures: Image.Image) -> Image.Image:
    """Return pictures in a row."""
    width = sum(picture.width for picture in pictures)
    sheet = Image.new("RGB", (width, max(p.height for p in pictures)), BACKGROUND)
    left = 0
    for picture in pictures:
        sheet.paste(picture, (left, 0))
        left += picture.width
    return sheet
