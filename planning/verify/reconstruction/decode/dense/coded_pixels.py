"""Images of a dense sequence to the codes that a camera's pixels show."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import rows_of
from planning.verify.reconstruction.arrays import Array, Grey, Images, Indices, Mask
from planning.verify.reconstruction.decode.code_map import CodeMap
from planning.verify.reconstruction.decode.edges import MIN_CONTRAST, SATURATED
from planning.verify.reconstruction.decode.grey_noise import GreyNoise
from planning.verify.reconstruction.patterns.dense_patterns import DensePattern
from planning.verify.reconstruction.patterns.ring_patterns import Frames

from .gray_bits import GrayStripes, read_stripes
from .phase import Phases
from .uneven_light import MOST_PX, moved_by, places_lit

# Why a lit pixel may tell no code, in the order in which it is asked.
CODE_CAUSES = ("mixed", "modulation", "outside_panel", "partly_lit")
# Phases vaguer than this are none [turns]: where light grazes the surface, millions of
# pixels would have tails. Nor are sinusoids of less than this share of what white and
# black differ by.
_VAGUE, _FAINT = 0.025, 0.15
# Beside the panel's border light is missing that phases take to be there [px].
_BORDER_PX = 2.0
# Uniform over a stripe.
_OF_STRIPE = 1.0 / np.sqrt(12.0)
_FEWEST_SURE, _LEVELS, _ASKED = 200, 12, 20_000
_CLEAR = 0.7


@dataclass(frozen=True, eq=False)
class CodedPixels:
    """What the pixels of a camera tell of a projector's.

    Attributes:
        map: Their codes.
        lit: Pixels with enough contrast that aren't saturated, flat indices, (n,).
        causes: Index in `CODE_CAUSES` of why each tells no code, -1: it does, (n,).
        stripes: Of columns and of rows, shape (n,) each.
        saturated: Pixels (u, v) that white saturates, shape (k, 2).
        noise: Of one frame.
    """

    map: CodeMap
    lit: Indices
    causes: NDArray[np.int8]
    stripes: tuple[GrayStripes, GrayStripes]
    saturated: Array
    noise: GreyNoise


def read_codes(frames: Frames, pattern: DensePattern) -> CodedPixels:
    """Return the codes of a camera's pixels.

    Raises:
        ValueError: If the frames aren't as many as the pattern's.
    """
    stack, n_frames = frames.stack, len(pattern.frames)
    if len(stack) != n_frames:
        raise ValueError(
            f"{len(stack)} frames, but {pattern.resolution[0]} x "
            f"{pattern.resolution[1]} px are coded in {n_frames}"
        )
    shape = stack.shape[1:]
    white, black = (stack[pattern.white + k].astype(np.float32) for k in (0, 1))
    difference = white - black
    full = white >= SATURATED
    lit = np.flatnonzero((difference >= MIN_CONTRAST) & ~full)
    pixels = stack.reshape(n_frames, -1).take(lit, axis=1)
    contrast = difference.ravel()[lit]
    noise = _grey_noise(pixels, pattern, contrast)
    half = noise.at(0.5 * (white + black).ravel()[lit])
    told = [_along(pixels, pattern, axis, contrast, half, noise) for axis in (0, 1)]
    one, other = told
    aside = places_lit(difference)
    looks = np.linalg.norm(rows_of(aside.reshape(-1, 2), lit), axis=1)
    fails = {
        "mixed": one.mixed | other.mixed,
        "modulation": one.faint | other.faint,
        "outside_panel": one.outside | other.outside,
        "partly_lit": ~(looks <= MOST_PX),
    }
    causes = np.full(len(lit), -1, dtype=np.int8)
    for cause in reversed(CODE_CAUSES):
        causes[fails[cause]] = CODE_CAUSES.index(cause)
    good = causes < 0
    codes, sigma = (np.full((shape[0] * shape[1], 2), np.nan, np.float32) for _ in "ab")
    for axis, along in enumerate(told):
        codes[lit[good], axis] = along.places[good]
        sigma[lit[good], axis] = along.sigma[good]
    codes, sigma = (values.reshape(*shape, 2) for values in (codes, sigma))
    moved = moved_by(aside, codes)
    return CodedPixels(
        CodeMap(codes - moved, sigma, moved, frames.corner),
        lit,
        causes,
        (one.stripes, other.stripes),
        np.argwhere(full)[:, ::-1] + np.array(frames.corner, dtype=np.float64),
        noise,
    )


@dataclass(frozen=True, eq=False)
class _Along:
    """What pixels tell of columns, or of rows, and why they don't, shape (n,)."""

    places: Array
    sigma: Array
    mixed: Mask
    faint: Mask
    outside: Mask
    stripes: GrayStripes


def _along(
    pixels: Images,
    pattern: DensePattern,
    axis: int,
    contrast: Grey,
    half: Array,
    noise: GreyNoise,
) -> _Along:
    """Read columns (0) or rows (1) of frames at pixels, shape (n_frames, n)."""
    first, code = pattern.first_bit(axis), pattern.code
    bits = pixels[first : first + 2 * pattern.bits(axis)]
    stripes = read_stripes(bits, contrast, half, code.finest_px)
    faint = np.zeros(pixels.shape[1], dtype=bool)
    mixed, places = stripes.mixed, stripes.middle
    sigma = np.full(len(places), _OF_STRIPE * stripes.width_px)
    # Of stripes that aren't resolved none says which period a phase is of.
    if code.shifts and not stripes.dropped:
        begin = pattern.first_shift(axis)
        phases = Phases.of(pixels[begin : begin + code.shifts], noise)
        places, contradicts = phases.places(stripes, code.period_px)
        mixed = mixed | contradicts
        faint = (phases.sigma > _VAGUE) | (phases.modulation < _FAINT * contrast / 2.0)
        sigma = phases.sigma * code.period_px
    n = pattern.resolution[axis]
    outside = (places < _BORDER_PX - 0.5) | (places > n - 0.5 - _BORDER_PX)
    return _Along(places, sigma, mixed, faint, outside, stripes)


def _grey_noise(pixels: Images, pattern: DensePattern, contrast: Grey) -> GreyNoise:
    """Return the noise of one frame, from ``I + I_inv = W + K`` in the highest bits."""
    w = pattern.white
    spread: list[float] = []
    level: list[float] = []
    for first in (pattern.first_bit(0), pattern.first_bit(1)):
        apart = np.subtract(pixels[first], pixels[first + 1], dtype=np.float32)
        clear = np.flatnonzero(np.abs(apart) >= _CLEAR * contrast)
        if len(clear) < _FEWEST_SURE:
            continue
        some = clear[:: max(1, len(clear) // _ASKED)]
        four = pixels[[[first], [first + 1], [w], [w + 1]], some].astype(np.float64)
        rest = np.abs(four[0] + four[1] - four[2] - four[3])
        light = 0.5 * (four[2] + four[3])
        order = np.argsort(light, kind="stable")
        for part in np.array_split(order, _LEVELS):
            # Mean absolute values: a median of whole grey levels would be a whole one.
            spread.append(0.5 * np.sqrt(0.5 * np.pi) * float(rest[part].mean()))
            level.append(float(light[part].mean()))
    if not spread:
        return GreyNoise(1.0, 0.0)
    return GreyNoise.fitted(np.array(level), np.square(spread))
