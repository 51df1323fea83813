"""What the cameras record under a projector's patterns."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.arrays import Grey, Images, Indices
from planning.verify.reconstruction.patterns.ring_patterns import Frames

from .photometry import Photometry
from .rendered_light import RenderedLight, Shown
from .view import RenderedView

# Blurred light reaches no further than this beyond the samples that are lit [px].
_MARGIN_PX = 6


@dataclass(frozen=True, eq=False)
class ImageCanvas:
    """The part of a view's window that a projector lights.

    Without its light a frame and its inverse are alike, so nothing is decoded there.

    Attributes:
        seen: The view.
        corner: Pixel (u, v) of the top-left pixel.
        shape: Rows and columns, in pixels.
        cells: Flat index of each sample's cell, senseless outside, shape (n,).
        inside: Samples inside.
    """

    seen: RenderedView
    corner: tuple[int, int]
    shape: tuple[int, int]
    cells: Indices
    inside: Indices

    @classmethod
    def about(cls, seen: RenderedView, lit: Indices) -> "ImageCanvas":
        """Return the bounding box of samples and a margin; all where there is none."""
        fold, (rows, columns) = seen.fold, seen.shape
        y, x = np.divmod(seen.cells, fold * columns)
        v, u = y // fold, x // fold
        top, left, bottom, right = 0, 0, rows, columns
        if len(lit):
            top = max(0, int(v[lit].min()) - _MARGIN_PX)
            left = max(0, int(u[lit].min()) - _MARGIN_PX)
            bottom = min(rows, int(v[lit].max()) + 1 + _MARGIN_PX)
            right = min(columns, int(u[lit].max()) + 1 + _MARGIN_PX)
        inside = (v >= top) & (v < bottom) & (u >= left) & (u < right)
        return cls(
            seen,
            (seen.corner[0] + left, seen.corner[1] + top),
            (bottom - top, right - left),
            (y - fold * top) * (fold * (right - left)) + (x - fold * left),
            np.flatnonzero(inside),
        )

    def image(self, values: Grey, samples: Indices, lens: Photometry) -> Grey:
        """Return the image (h, w) that samples of these values make behind a lens."""
        fold = self.seen.fold
        rows, columns = (fold * side for side in self.shape)
        weighted = self.seen.weights[samples] * values
        summed = np.bincount(self.cells[samples], weighted, rows * columns)
        cells = summed.astype(np.float32).reshape(rows, columns)
        return _binned(lens.blur(cells, fold), fold)


def render_pair(
    seen: RenderedView,
    shown: Shown,
    photometry: Photometry,
    seed: tuple[int, ...],
    beside: Sequence[Shown] = (),
) -> Frames:
    """Return the frames of one camera under one projector.

    The light of others that are on at the same time (`beside`) adds up, in step: white
    with white, each bit and each camera's disc with its like. The exposure is that of
    the one projector.
    """
    patterns = shown.patterns
    every = [
        (one, one.light(seen, photometry.projector_blur_m)) for one in (shown, *beside)
    ]
    canvas = ImageCanvas.about(seen, np.concatenate([lit.samples for _, lit in every]))
    around = seen.albedo[canvas.inside] * np.float32(photometry.ambient)
    ambient = canvas.image(around, canvas.inside, photometry)
    streams = [
        _images(canvas, one, light, patterns.n_bits, photometry) for one, light in every
    ]
    whites = [next(images) for images in streams]
    gain = photometry.gain(float(np.percentile(whites[0] + ambient, 99.9)))
    white = sum(whites[1:], whites[0])
    kind = np.uint8 if photometry.noisy else np.float32
    stack: Images = np.empty((patterns.n_frames, *canvas.shape), dtype=kind)
    stack[0] = photometry.capture(white + ambient, (*seed, 0), gain)
    stack[1] = photometry.capture(ambient, (*seed, 1), gain)
    for index, images in enumerate(zip(*streams, strict=True)):
        bright = sum(images[1:], images[0])
        first = 2 + 2 * index
        stack[first] = photometry.capture(bright + ambient, (*seed, first), gain)
        dark = white - bright + ambient
        stack[first + 1] = photometry.capture(dark, (*seed, first + 1), gain)
    return Frames(stack, canvas.corner)


def _images(
    canvas: ImageCanvas,
    shown: Shown,
    light: RenderedLight,
    n_bits: int,
    photometry: Photometry,
) -> Iterator[Grey]:
    """Images of a projector's white, so many bits and disc; what it lacks is dark."""
    patterns = shown.patterns
    yield canvas.image(light.white, light.samples, photometry)
    for bit in range(n_bits):
        level = np.zeros_like(light.white)
        if bit < patterns.n_bits:
            level = _level(patterns.bit(bit), light)
        yield canvas.image(light.white * level, light.samples, photometry)
    yield canvas.image(light.white * light.root, light.samples, photometry)


def render_lines(
    seen: RenderedView,
    shown: Sequence[Shown],
    photometry: Photometry,
    seed: tuple[int, ...],
) -> Frames:
    """Return one image under projectors that shine at once, odd annuli bright."""
    everything = np.arange(len(seen.cells))
    canvas = ImageCanvas.about(seen, everything)
    around = seen.albedo * np.float32(photometry.ambient)
    image = canvas.image(around, everything, photometry)
    for one in shown:
        light = one.light(seen, photometry.projector_blur_m)
        bright = (np.arange(one.patterns.n_annuli) % 2).astype(np.float32)
        level = light.white * _level(bright, light)
        image += canvas.image(level, light.samples, photometry)
    # Lines may cover little of the image; the brightest are exposed for all the same.
    brightest = float(np.percentile(image[image > 0.0], 99.0)) if image.any() else 1.0
    captured = photometry.capture(image, seed, photometry.gain(brightest))
    return Frames(captured[None], canvas.corner)


def _level(bright: Grey, light: RenderedLight) -> Grey:
    """Blurred brightness at each lit sample, by that of the annuli."""
    inwards = np.concatenate([bright[:1], bright[:-1]]) - bright
    outwards = np.concatenate([bright[1:], bright[-1:]]) - bright
    k = light.annulus
    level = bright[k] + inwards[k] * light.inner + outwards[k] * light.outer
    return level.astype(np.float32, copy=False)


def _binned(cells: Grey, fold: int) -> Grey:
    """Mean of the cells of each pixel."""
    if fold == 1:
        return cells
    total = np.zeros((len(cells) // fold, cells.shape[1] // fold), dtype=np.float32)
    for i in range(fold):
        for j in range(fold):
            total += cells[i::fold, j::fold]
    return total / np.float32(fold * fold)
