"""What the cameras record under a projector's patterns."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.arrays import Grey, Images, Indices
from planning.verify.reconstruction.patterns.panel import PanelCanvas, frame_levels
from planning.verify.reconstruction.patterns.ring_patterns import (
    Frame,
    Frames,
    RingsForCamera,
)

from .panel_light import PanelLight
from .photometry import Photometry
from .rendered_light import RenderedLight, Shown
from .view import RenderedView

# Blurred light reaches no further than this beyond the samples that are lit [px].
_MARGIN_PX = 6
# Whose root disc is drawn: the camera that looks.
_CAMERA = "camera"


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

    A projector whose light is known is exposed as planned, and leaks into what is dark.
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
        _images(canvas, one, light, patterns, photometry) for one, light in every
    ]
    whites = [next(images) for images in streams]
    white = sum(whites[1:], whites[0])
    if shown.lamp is None:
        gain = photometry.gain(float(np.percentile(whites[0] + ambient, 99.9)))
    else:
        gain = shown.lamp.gain(shown.projector, every[0][1].depth)
        ambient += np.float32(shown.lamp.leak) * white
    kind = np.uint8 if photometry.noisy else np.float32
    stack: Images = np.empty((patterns.n_frames, *canvas.shape), dtype=kind)
    stack[0] = photometry.capture(white + ambient, (*seed, 0), gain)
    stack[1] = photometry.capture(ambient, (*seed, 1), gain)
    for number, images in enumerate(zip(*streams, strict=True), start=2):
        bright = sum(images, ambient)
        stack[number] = photometry.capture(bright, (*seed, number), gain)
    return Frames(stack, canvas.corner)


def _images(
    canvas: ImageCanvas,
    shown: Shown,
    light: RenderedLight,
    read: RingsForCamera,
    photometry: Photometry,
) -> Iterator[Grey]:
    """Images of a projector's white, and of the frames and inverses that are read.

    Bits that it hasn't are dark.
    """
    at = light.samples, photometry
    patterns, codes = shown.patterns, shown.design.response
    frames = [one for one in patterns.frames([_CAMERA]) if one.kind != "black"]
    if codes.is_linear and shown.projector.response.is_linear:
        # Frame and inverse make up white: half of the work is enough.
        frames = [one for one in frames if not one.inverse]
    panel = PanelLight(light.pixels, light.spread)
    window = panel.window
    drawn = PanelCanvas.of(shown.design, patterns, {_CAMERA: patterns}, window)
    levels = [frame_levels(drawn, patterns, frame, codes).ravel() for frame in frames]
    emitted = shown.projector.response.light.astype(np.float32)
    shares = panel.gathered(emitted[np.stack(levels, axis=1)], window)
    places = map(_place, frames)
    shown_as = dict(zip(places, shares.T, strict=True))
    white = canvas.image(light.white * shown_as["white", None, False], *at)
    yield white
    image = white
    for frame in read.frames([_CAMERA])[2:]:
        share = shown_as.get(_place(frame))
        if share is not None:
            image = canvas.image(light.white * share, *at)
        else:
            image = white - image if frame.inverse else np.zeros_like(white)
        yield image


def _place(frame: Frame) -> tuple[str, int | None, bool]:
    return frame.kind, frame.bit, frame.inverse


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
        panel, patterns = PanelLight(light.pixels, light.spread), one.patterns
        drawn = PanelCanvas.of(one.design, patterns, {}, panel.window)
        odd = (np.arange(patterns.n_annuli) % 2).astype(np.float32)
        levels = one.design.response.levels(drawn.shares(odd))
        emitted = one.projector.response.light.astype(np.float32)[levels.reshape(-1, 1)]
        level = light.white * panel.gathered(emitted, drawn.window)[:, 0]
        image += canvas.image(level, light.samples, photometry)
    # Lines may cover little of the image; the brightest are exposed for all the same.
    brightest = float(np.percentile(image[image > 0.0], 99.0)) if image.any() else 1.0
    captured = photometry.capture(image, seed, photometry.gain(brightest))
    return Frames(captured[None], canvas.corner)


def _binned(cells: Grey, fold: int) -> Grey:
    """Mean of the cells of each pixel."""
    if fold == 1:
        return cells
    total = np.zeros((len(cells) // fold, cells.shape[1] // fold), dtype=np.float32)
    for i in range(fold):
        for j in range(fold):
            total += cells[i::fold, j::fold]
    return total / np.float32(fold * fold)
