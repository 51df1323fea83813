"""Images to labelled ring edges, with no knowledge of the object.

An edge is where the decoded annulus index changes by exactly one between neighbouring
pixels; which bit flipped says which frame holds the edge, and the zero level of that
frame's normalised difference between the two pixels is the sub-pixel position.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfinv

from planning.verify.reconstruction.arrays import (
    Array,
    Columns,
    Grey,
    Images,
    Indices,
    Mask,
)
from planning.verify.reconstruction.patterns.ring_patterns import Frames, RingsForCamera

from .grey_noise import GreyNoise
from .lit_image import LitImage

# A pixel is lit if white exceeds black by this many levels of 255.
MIN_CONTRAST = 10.0
SATURATED = 254.5
# Least |I - I_inv| / (W - K) of every bit beside an edge, and of the root bit on it:
# the level 1.5 px off an edge that is blurred by 6.6 px.
_MIN_CERTAINTY = 0.18
# Least contrast of a pixel, as a share of the largest beside it: less is the rim of an
# object or shadow, whose mixed pixels shift edges.
_MIN_EVENNESS = 0.6
# Most light of elsewhere on an edge, as the share by which another bit misses its
# level, and the standard deviations of noise that are allowed for.
_MOST_FOREIGN, _SIGMAS = 0.2, 3.0
# Pixels that tell the noise, and grey levels among which they are told apart.
_FEWEST_SURE, _LEVELS, _CLEAR = 100, 8, 0.8
# Beyond this an edge is saturated, and its probit says nothing.
_MAX_LEVEL = 0.98
# Blur of a lens and its pixels that shifts edges where brightness changes [px].
_LENS_PX = 0.7


@dataclass(frozen=True, eq=False)
class ImageEdges(Columns):
    """Ring edges in one camera's image.

    Attributes:
        pixels: Sub-pixel positions (u, v) in the camera's image, shape (n, 2).
        rings: Ring edge of each, shape (n,).
        roots: Sign of r.m, from the root disc, shape (n,).
        across: Unit direction in the image across the edge, shape (n, 2).
        noise_px: Standard deviation of the position along `across` [px], shape (n,).
        blur_px: That of the blur of the edge along it [px]; NaN: unknown, shape (n,).
        bias_px: What brightness that changes across the edge may shift it [px], (n,).
    """

    pixels: Array
    rings: Indices
    roots: NDArray[np.int8]
    across: Array
    noise_px: Array
    blur_px: Array
    bias_px: Array

    @classmethod
    def nothing(cls) -> "ImageEdges":
        """Return no edges."""
        places, numbers = np.zeros((0, 2)), np.zeros(0)
        rings, roots = numbers.astype(np.int64), numbers.astype(np.int8)
        return cls(places, rings, roots, places, numbers, numbers, numbers)


def find_edges(
    frames: Frames, patterns: RingsForCamera
) -> tuple[ImageEdges, LitImage, int, Indices]:
    """Return the labelled ring edges of a stack of images.

    Returns:
        The edges; which pixels show which annulus; how many pixels are lit; and, shape
        (2, n_bits), the changes of one bit alone between lit pixels, and those of them
        that name a ring.
    """
    reader = _Reader(frames.stack, patterns)
    by_rows, changes = _crossings(reader)
    by_columns, more = _crossings(reader.transposed())
    pixels, across = by_columns.pixels[:, ::-1], by_columns.across[:, ::-1]
    by_columns = replace(by_columns, pixels=pixels, across=across)
    # A crossing is kept in the one direction that runs more squarely into the edge.
    flat = np.abs(by_rows.across[:, 0]) >= np.abs(by_rows.across[:, 1])
    steep = np.abs(across[:, 1]) > np.abs(across[:, 0])
    edges = ImageEdges.join([by_rows.take(flat), by_columns.take(steep)])
    edges = replace(edges, pixels=edges.pixels + np.array(frames.corner))
    lit = LitImage.of(reader.index, frames.corner)
    return edges, lit, int(np.count_nonzero(reader.valid)), changes + more


class _Reader:
    """Bits, annulus indices and normalised differences of a stack of images.

    Attributes:
        contrast: White - black, at least 1, shape (h, w).
        valid: Pixels bright enough under the white frame and not saturated.
        code: Bits of each pixel.
        index: Annulus of each pixel, -1 where there is none.
        sure: Pixels whose every bit stands out.
        noise: Of one frame.
        even: Pixels about which the contrast is nearly the same.
    """

    def __init__(self, stack: Images, patterns: RingsForCamera) -> None:
        self._stack = stack
        self.patterns = patterns
        white, black = stack[0].astype(np.float32), stack[1].astype(np.float32)
        contrast = white - black
        self.valid = (contrast >= MIN_CONTRAST) & (white < SATURATED)
        self.contrast = np.maximum(contrast, np.float32(1.0))
        self.code, least = read_code(stack, patterns.n_bits)
        self.index = np.where(
            self.valid, patterns.index_of_code[self.code], np.int16(-1)
        )
        self.sure = self.valid & (least >= _MIN_CERTAINTY * self.contrast)
        self.noise = self.grey_noise()
        self.even = _even(contrast, self.noise.at(0.5 * (white + black)))

    def transposed(self) -> "_Reader":
        """Return the same reader with rows and columns exchanged."""
        other = object.__new__(_Reader)
        other._stack = self._stack.transpose(0, 2, 1)
        other.patterns = self.patterns
        for name in ("contrast", "valid", "code", "index", "sure", "even"):
            setattr(other, name, getattr(self, name).T)
        other.noise = self.noise
        return other

    def level(self, frame: Indices | int, i: Indices, j: Indices) -> Grey:
        """Return (I - I_inv) / (W - K) of a frame at pixels: -1 dark to 1 bright."""
        stack = self._stack
        bright = stack[frame, i, j].astype(np.float32)
        return (bright - stack[frame + 1, i, j]) / self.contrast[i, j]

    def grey_noise(self) -> GreyNoise:
        """Return the noise of one frame, from I + I_inv = W + K."""
        bit = np.subtract(self._stack[2], self._stack[3], dtype=np.float32)
        # Bright in one and dark in the other, they add up in a camera with gamma, too.
        i, j = np.nonzero(self.sure & (np.abs(bit) >= _CLEAR * self.contrast))
        if len(i) < _FEWEST_SURE:
            return GreyNoise(1.0, 0.0)
        step = max(1, len(i) // 20_000)
        frames = self._stack[:4, i[::step], j[::step]].astype(np.float64)
        rest = np.abs(frames[2] + frames[3] - frames[0] - frames[1])
        light = 0.5 * (frames[0] + frames[1])
        order = np.argsort(light, kind="stable")
        parts = [order] if len(order) < 1000 else np.array_split(order, _LEVELS)
        # Mean absolute values: a median of whole grey levels would be a whole one.
        spread = [0.5 * np.sqrt(0.5 * np.pi) * rest[part].mean() for part in parts]
        level = [light[part].mean() for part in parts]
        return GreyNoise.fitted(np.array(level), np.square(spread))

    def half_lit(self, i: Indices, j: Indices) -> Grey:
        """Return half of white and black, the grey level of an edge."""
        white, black = (self._stack[k, i, j].astype(np.float32) for k in (0, 1))
        return 0.5 * (white + black)


def read_code(stack: Images, n_bits: int) -> tuple[NDArray[np.int16], Grey]:
    """Return the Gray code of pixels, and how far their least clear bit stands out.

    Args:
        stack: As in `Frames`, or some of its pixels, shape (n_frames, ...).
        n_bits: Of the code.
    """
    code = np.zeros(stack.shape[1:], dtype=np.int16)
    least = np.full(stack.shape[1:], np.inf, dtype=np.float32)
    for bit in range(n_bits):
        frame = 2 + 2 * bit
        difference = np.subtract(stack[frame], stack[frame + 1], dtype=np.float32)
        code |= (difference > 0.0).astype(np.int16) << bit
        np.minimum(least, np.abs(difference), out=least)
    return code, least


def _even(contrast: Grey, noise: Array) -> Mask:
    """Pixels whose 3 x 3 neighbours' contrast differs by little, noise allowed for."""
    low, high = (_about(contrast, extreme) for extreme in (np.minimum, np.maximum))
    return low >= np.float32(_MIN_EVENNESS) * high - (4.0 * noise).astype(np.float32)


def _about(image: Grey, extreme: np.ufunc) -> Grey:
    """Extreme of each pixel and its eight neighbours; SciPy's filters take longer."""
    padded = np.pad(image, 1, mode="edge")
    padded = extreme(extreme(padded[:-2], padded[1:-1]), padded[2:])
    return extreme(extreme(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])


def _crossings(reader: _Reader) -> tuple[ImageEdges, Indices]:
    """Edges between pixels of one row, in pixels (column, row), and changes of bits."""
    index, sure = reader.index, reader.sure
    before, after = index[:, 1:-2], index[:, 2:-1]
    code, usable = reader.code, reader.valid & reader.even
    edge = (code[:, 1:-2] != code[:, 2:-1]) & sure[:, :-3] & sure[:, 3:]
    edge &= usable[:, 1:-2] & usable[:, 2:-1]
    edge[:1] = edge[-1:] = False
    flipped = code[:, 1:-2] ^ code[:, 2:-1]
    flips = _count_single(flipped[edge], reader.patterns.n_bits)
    edge &= (np.abs(after - before) == 1) & (before >= 0) & (after >= 0)
    named = _count_single(flipped[edge], reader.patterns.n_bits)
    edge &= (index[:, :-3] == before) & (index[:, 3:] == after)
    i, j = np.nonzero(edge)
    j = j + 1
    rings = np.minimum(index[i, j], index[i, j + 1]).astype(np.int64)
    frame = 2 + 2 * reader.patterns.flipping_bit[rings]
    first, second = reader.level(frame, i, j), reader.level(frame, i, j + 1)
    along = second - first
    cross = _row_slope(reader, frame, i, j)
    root_frame = 2 + 2 * reader.patterns.n_bits
    root = 0.5 * (reader.level(root_frame, i, j) + reader.level(root_frame, i, j + 1))
    good = ((first > 0.0) != (second > 0.0)) & (np.abs(root) >= _MIN_CERTAINTY)
    good &= ~_foreign(reader, frame, i, j)
    i, j, first, second = i[good], j[good], first[good], second[good]
    zero, spread, blur = _zero_between(first, second)
    along, cross = along[good].astype(np.float64), cross[good].astype(np.float64)
    slope = np.hypot(along, cross)
    contrast = 0.5 * (reader.contrast[i, j] + reader.contrast[i, j + 1])
    noise = reader.noise.at(0.5 * (reader.half_lit(i, j) + reader.half_lit(i, j + 1)))
    grey = np.sqrt(2.0) * noise / contrast
    uneven = _unevenness(reader.contrast, i, j, along / slope, cross / slope)
    uneven = np.sqrt(np.maximum(np.square(uneven) - np.square(0.5 * grey), 0.0))
    edges = ImageEdges(
        np.column_stack([j + zero, i.astype(np.float64)]),
        rings[good],
        np.where(root[good] > 0.0, 1, -1).astype(np.int8),
        np.column_stack([along, cross]) / slope[:, None],
        grey * spread * np.abs(along) / slope,
        blur * np.abs(along) / slope,
        _LENS_PX**2 * uneven,
    )
    return edges, np.array([flips, named])


def _foreign(reader: _Reader, frame: Indices, i: Indices, j: Indices) -> Mask:
    """Edges between (i, j) and (i, j + 1) that much light of elsewhere falls on.

    A Gray code flips one bit at an edge; all others are as bright or as dark on both
    sides, and their levels 1 or -1. Light B that comes by another surface beside the
    direct light E brings the code of the place it comes from. Where its bit is the
    other one::

        |level| = |E - B| / (E + B) = 1 - 2 B / (E + B),   B < E

    and the same light moves the edge, if its frame is among those: `interreflection`.
    Of many bits some differ, so that the least level tells.
    """
    least = np.full(len(i), np.inf, dtype=np.float32)
    for bit in range(reader.patterns.n_bits):
        other = 2 + 2 * bit
        level = 0.5 * np.abs(reader.level(other, i, j) + reader.level(other, i, j + 1))
        least = np.where(frame == other, least, np.minimum(least, level))
    noise = reader.noise.at(0.5 * (reader.half_lit(i, j) + reader.half_lit(i, j + 1)))
    contrast = 0.5 * (reader.contrast[i, j] + reader.contrast[i, j + 1])
    return least < 1.0 - _MOST_FOREIGN - _SIGMAS * noise / contrast


def _unevenness(
    contrast: Grey, i: Indices, j: Indices, across: Array, down: Array
) -> Array:
    """Return |d ln(contrast)| a pixel across an edge between (i, j) and (i, j + 1)."""
    right = contrast[i, j + 1] + contrast[i, j + 2]
    left = contrast[i, j] + contrast[i, j - 1]
    below, above = (contrast[i + d, j] + contrast[i + d, j + 1] for d in (1, -1))
    rise = across * (right - left) / (right + left)
    rise += down * (below - above) / (below + above)
    return np.abs(rise)


def _count_single(flipped: NDArray[np.int16], n_bits: int) -> Indices:
    """Count the changes of one bit alone, by bit; between rings there are no others."""
    count = np.bincount(flipped, minlength=1 << n_bits)
    return count[1 << np.arange(n_bits)].astype(np.int64)


def _zero_between(first: Grey, second: Grey) -> tuple[Array, Array, Array]:
    """Where between levels of two pixels a blurred step crosses zero, and how surely.

    A blurred step is an error function, whose inverse makes it a straight line: with
    a, b = erfinv(first), erfinv(second) the crossing is at a / (a - b). Its standard
    deviation is for levels that have one of 1; that of the blur, 1 / (sqrt(2) |a - b|),
    comes third.
    """
    a, b = (
        erfinv(np.clip(level, -_MAX_LEVEL, _MAX_LEVEL).astype(np.float64))
        for level in (first, second)
    )
    rise = np.abs(a - b)
    of_first, of_second = b * np.exp(a * a), a * np.exp(b * b)
    of_first *= np.sqrt(1.0 + np.square(first))
    of_second *= np.sqrt(1.0 + np.square(second))
    spread = np.hypot(of_first, of_second) / np.square(rise)
    blur = np.sqrt(0.5) / rise
    return a / (a - b), 0.5 * np.sqrt(np.pi) * spread, blur


def _row_slope(reader: _Reader, frame: Indices, i: Indices, j: Indices) -> Grey:
    """Change of the level from row to row at an edge; 0 beside unlit pixels."""
    below, above = (
        reader.level(frame, i + side, j) + reader.level(frame, i + side, j + 1)
        for side in (1, -1)
    )
    valid = reader.valid
    lit = valid[i + 1, j] & valid[i + 1, j + 1] & valid[i - 1, j] & valid[i - 1, j + 1]
    return np.where(lit, np.float32(0.25) * (below - above), np.float32(0.0))
