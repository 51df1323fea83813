"""What a camera records under the frames of a projector that codes its pixels."""

from collections.abc import Iterator, Sequence

import numpy as np

from planning.verify.reconstruction.arrays import Grey, Images
from planning.verify.reconstruction.patterns.dense_patterns import (
    ALONG,
    DenseFrame,
    DensePattern,
)
from planning.verify.reconstruction.patterns.ring_patterns import Frames

from .line_light import drawn_share, gathered_lines
from .photometry import Photometry
from .render import ImageCanvas
from .rendered_light import RenderedLight, Shown
from .view import RenderedView


def render_dense(
    seen: RenderedView,
    shown: Shown,
    photometry: Photometry,
    seed: tuple[int, ...],
    beside: Sequence[Shown] = (),
) -> Frames:
    """Return the frames of one camera under one projector, in the pattern's order.

    Light, exposure and noise are as of `render_pair`; others that are on at the same
    time (`beside`) show the same frames in step, or their white if theirs are rings.
    """
    pattern = _dense(shown)
    every = [
        (one, one.light(seen, photometry.projector_blur_m)) for one in (shown, *beside)
    ]
    canvas = ImageCanvas.about(seen, np.concatenate([lit.samples for _, lit in every]))
    around = seen.albedo[canvas.inside] * np.float32(photometry.ambient)
    ambient = canvas.image(around, canvas.inside, photometry)
    lit = [_DenseImages(canvas, one, light, photometry) for one, light in every]
    white = sum((one.white for one in lit[1:]), lit[0].white)
    if shown.lamp is None:
        brightest = float(np.percentile(lit[0].white + ambient, 99.9))
        gain = photometry.gain(brightest)
    else:
        gain = shown.lamp.gain(shown.projector, every[0][1].depth)
        ambient += np.float32(shown.lamp.leak) * white
    kind = np.uint8 if photometry.noisy else np.float32
    stack: Images = np.empty((len(pattern.frames), *canvas.shape), dtype=kind)
    streams = zip(*(one.images(pattern) for one in lit), strict=True)
    for number, images in enumerate(streams):
        grey = sum(images, ambient)
        stack[number] = photometry.capture(grey, (*seed, number), gain)
    return Frames(stack, canvas.corner)


class _DenseImages:
    """Images, without noise, that one projector's frames make."""

    def __init__(
        self,
        canvas: ImageCanvas,
        shown: Shown,
        light: RenderedLight,
        photometry: Photometry,
    ) -> None:
        self._canvas, self._shown, self._light = canvas, shown, light
        self._lens = photometry
        self._drawn = [
            drawn_share(n, light.pixels[:, axis], light.spread[:, axis])
            for axis, n in enumerate(shown.projector.resolution)
        ]
        self.white = self._image(self._drawn[0] * self._drawn[1])

    def images(self, pattern: DensePattern) -> Iterator[Grey]:
        """Yield the image of each frame of a pattern, whatever this one draws."""
        own = self._shown.design.dense
        dark = np.zeros_like(self.white)
        if own is None:
            yield from (
                dark if frame.kind == "black" else self.white
                for frame in pattern.frames
            )
            return
        for axis in (0, 1):
            yield from self._along(own, pattern, axis, "bit")
        yield from (self.white, dark)
        if pattern.code.shifts:
            for axis in (0, 1):
                yield from self._along(own, pattern, axis, "phase")

    def _along(
        self, own: DensePattern, pattern: DensePattern, axis: int, kind: str
    ) -> Iterator[Grey]:
        """Images of one kind of frames of columns or rows, gathered in one go."""
        asked = [
            frame
            for frame in pattern.frames
            if frame.kind == kind and frame.along == ALONG[axis]
        ]
        frames = [_like(own, frame) for frame in asked]
        response, emitted = self._shown.design.response, self._shown.projector.response
        # Frame and inverse make up white: half of the work is enough.
        halves = response.is_linear and emitted.is_linear
        have = [f for f in frames if f is not None and not (halves and f.inverse)]
        shares = iter(self._shares(have, own, axis).T)
        image = self.white
        for frame in frames:
            if frame is None:
                image = np.zeros_like(self.white)
            elif halves and frame.inverse:
                image = self.white - image
            else:
                image = self._image(next(shares))
            yield image

    def _shares(self, frames: list[DenseFrame], own: DensePattern, axis: int) -> Grey:
        """Light of frames at each place as a share of white's, (n, n_frames)."""
        response, emitted = self._shown.design.response, self._shown.projector.response
        table = np.zeros((own.resolution[axis], len(frames)), dtype=np.float32)
        for k, frame in enumerate(frames):
            table[:, k] = emitted.light[response.levels(own.shares(frame))]
        light = self._light
        shares = gathered_lines(table, light.pixels[:, axis], light.spread[:, axis])
        shares *= self._drawn[1 - axis][:, None]
        return shares

    def _image(self, share: Grey) -> Grey:
        light = self._light
        return self._canvas.image(light.white * share, light.samples, self._lens)


def _like(own: DensePattern, frame: DenseFrame) -> DenseFrame | None:
    """Return the frame of a projector that is shown with another one's."""
    wanted = frame.kind, frame.bit, frame.inverse, frame.along, frame.shift
    for one in own.frames:
        if (one.kind, one.bit, one.inverse, one.along, one.shift) == wanted:
            return one
    return None


def _dense(shown: Shown) -> DensePattern:
    pattern = shown.design.dense
    assert pattern is not None
    return pattern
