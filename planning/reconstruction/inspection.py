"""Whether images can be what they are taken for, from their pixels alone.

Light adds up, so that every frame and its inverse together are white and black:
``I + I_inv = W + K`` in every pixel, with light that surfaces pass on to each other
too. Frames that were exchanged, exposed otherwise, cut or disturbed break that rule;
where they do in places, these are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import CapturesError
from .patterns import Frames, Images, RingPatterns

# A pixel is lit if white exceeds black by this many levels of 255, as in the decoder.
_LIT = 10.0
_FEWEST_LIT = 100
# From this level of 255 on, or where levels pile up, a sensor is taken to be clipped.
_CLIPPED = 250.0
_PILED = 50
_PILE = 4.0
# A frame brighter or darker than the rest by this share shifts edges by half of it,
# about a fiftieth of a pixel.
_MOST_DRIFT = 0.03
# A pixel breaks the rule if its rest exceeds this share of its contrast and this many
# standard deviations; a frame does if more than that share of its pixels do.
_REST_SHARE = 0.1
_REST_SIGMAS = 8.0
_MOST_BROKEN = 0.2
# Pixels left out, and codes that no annulus has, are worth a word from these shares on.
_WORTH_A_WORD = 0.01
_MOST_STRANGE = 0.02
_SURE = 0.25
# Pixels beyond the lit ones that the decoder needs about them.
_MARGIN_PX = 4


@dataclass(frozen=True, eq=False)
class Inspected:
    """Images that may be decoded.

    Attributes:
        frames: The lit part; pixels that can't be trusted are made dark.
        notes: A clause for each reason for which pixels were left out.
    """

    frames: Frames
    notes: tuple[str, ...]


class DarkError(CapturesError):
    """White is no brighter than black; whether light should be there, others know."""


def inspect(stack: Images, patterns: RingPatterns, names: Sequence[str]) -> Inspected:
    """Hold the images of a camera under a projector against each other.

    Args:
        stack: White, black, bits and root disc with their inverses, (n_frames, h, w),
            levels 0 to 255, of the camera's whole image.
        patterns: What the projector drew.
        names: Of the frames.

    Raises:
        CapturesError: If the images contradict each other or the patterns.
        DarkError: If there is no light.
    """
    lit, corner = _lit_part(stack)
    clipped = _clipped(lit)
    seen = _contrast(lit) >= _LIT
    share = _share(clipped, seen)
    if share > 0.5:
        raise CapturesError(
            f"{share:.0%} of the lit pixels are clipped: over-exposed; shorten the "
            f"exposure until {names[0]} keeps below 250 of 255"
        )
    notes: list[str] = []
    if share > _WORTH_A_WORD:
        notes.append(f"{share:.1%} of the lit pixels are clipped and left out")
    _require_different(lit, names)
    good = seen & ~clipped
    broken = _broken(lit, good, names)
    _require_codes(lit, good & ~broken, patterns)
    share = _share(broken, good)
    if share > _WORTH_A_WORD:
        notes.append(
            f"{share:.1%} of the lit pixels are left out: frames and inverses there "
            f"don't add up to white and black"
        )
    frames = lit.copy()
    frames[:, clipped | broken] = 0
    return Inspected(Frames(frames, corner), tuple(notes))


def _contrast(stack: Images) -> NDArray[np.float32]:
    return np.subtract(stack[0], stack[1], dtype=np.float32)


def _share(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
    return float(np.count_nonzero(part & whole) / max(1, np.count_nonzero(whole)))


def _lit_part(stack: Images) -> tuple[Images, tuple[int, int]]:
    """Return the part of the images that holds all lit pixels, and its corner (u, v).

    Raises:
        CapturesError: If white is darker than black.
        DarkError: If there is no light.
    """
    contrast = _contrast(stack)
    lit = contrast >= _LIT
    n_lit = int(np.count_nonzero(lit))
    n_below = int(np.count_nonzero(contrast <= -_LIT))
    if n_below > max(n_lit, _FEWEST_LIT):
        raise CapturesError(
            f"white is darker than black in {n_below} pixels, brighter in {n_lit}: "
            f"the two were exchanged, or are frames of something else"
        )
    if n_lit < _FEWEST_LIT:
        levels = [float(np.median(image)) for image in stack[:2]]
        raise DarkError(
            f"no light: white exceeds black by {_LIT:.0f} of 255 in {n_lit} pixels "
            f"(median levels {levels[0]:.0f} and {levels[1]:.0f}); light the object, "
            f"or expose longer; shorter if both are near 255"
        )
    rows, columns = (np.flatnonzero(lit.any(axis=axis)) for axis in (1, 0))
    top, left = (max(0, int(place[0]) - _MARGIN_PX) for place in (rows, columns))
    bottom, right = (int(place[-1]) + 1 + _MARGIN_PX for place in (rows, columns))
    return stack[:, top:bottom, left:right], (left, top)


def _clipped(stack: Images) -> NDArray[np.bool_]:
    """Pixels in which any frame reaches what the sensor can tell apart at most."""
    return stack.max(axis=0) >= min(_CLIPPED, _piled_level(stack[0]))


def _piled_level(white: NDArray[np.uint8 | np.float32]) -> float:
    """Return the brightest level if pixels pile up there, inf if they don't.

    A sensor may be full before its numbers are.
    """
    levels, counts = np.unique(white, return_counts=True)
    if len(levels) < 2 or counts[-1] < _PILED or counts[-1] < _PILE * counts[-2]:
        return float("inf")
    return float(levels[-1])


def _require_different(stack: Images, names: Sequence[str]) -> None:
    """Refuse two frames of the same pixels: noise makes any two differ."""
    seen: dict[int, int] = {}
    for k, image in enumerate(stack):
        before = seen.setdefault(hash(image.tobytes()), k)
        if before != k and np.array_equal(image, stack[before]):
            raise CapturesError(
                f"{names[before]} and {names[k]} are the same image; take it again"
            )


def _broken(
    stack: Images, good: NDArray[np.bool_], names: Sequence[str]
) -> NDArray[np.bool_]:
    """Pixels of which a frame and its inverse don't add up to white and black.

    Raises:
        CapturesError: If that is so in much of the image, or a frame is brighter or
            darker than the rest as a whole.
    """
    rows, columns = np.nonzero(good)
    pixels = stack[:, rows, columns].astype(np.float32)
    white, black, pairs = pixels[0], pixels[1], pixels[2:].reshape(-1, 2, len(rows))
    contrast = white - black
    rests = pairs.sum(axis=1) - (white + black)
    spreads = [float(np.median(np.abs(rest))) for rest in rests]
    spread = max(1.0, 1.4826 * float(np.median(spreads)))
    wrong = np.abs(rests) > _REST_SHARE * contrast + _REST_SIGMAS * spread
    shares = wrong.mean(axis=1) if len(rows) else np.zeros(len(rests))
    if np.any(shares > _MOST_BROKEN):
        raise CapturesError(_which_broke(shares, names))
    _require_one_exposure(pairs, rests, contrast, names)
    broken = np.zeros(good.shape, dtype=bool)
    broken[rows, columns] = wrong.any(axis=0)
    return broken


def _which_broke(shares: NDArray[np.float64], names: Sequence[str]) -> str:
    bad = np.flatnonzero(shares > _MOST_BROKEN)
    share = float(shares.max())
    if len(bad) > 0.5 * len(shares) and len(shares) > 2:
        which = f"{names[0]} or {names[1]}"
        rule = "is no frame of this sequence, or was exposed otherwise: no frame and "
        rule += "its inverse add up to them"
    else:
        which = ", ".join(
            f"{names[2 + 2 * b]} and {names[3 + 2 * b]}" for b in bad.tolist()
        )
        rule = "don't add up to white and black: exchanged, cut, moved or exposed "
        rule += "otherwise"
    return f"{which} {rule} (in {share:.0%} of the lit pixels)"


def _require_one_exposure(
    pairs: NDArray[np.float32],
    rests: NDArray[np.float32],
    contrast: NDArray[np.float32],
    names: Sequence[str],
) -> None:
    """Refuse frames brighter or darker than the rest, by the pixels that they light."""
    drift = np.zeros(pairs.shape[:2])
    for b, (frame, inverse) in enumerate(pairs):
        for side, bright in enumerate((frame > inverse, frame < inverse)):
            if np.count_nonzero(bright) >= _FEWEST_LIT:
                rest = float(np.median(rests[b][bright]))
                drift[b, side] = rest / float(np.median(contrast[bright]))
    off = np.abs(drift) > _MOST_DRIFT
    if not off.any():
        return
    b, side = np.unravel_index(np.argmax(np.abs(drift)), drift.shape)
    if np.count_nonzero(off) > 0.5 * off.size and off.size > 2:
        value, which = -float(np.median(drift)), f"{names[0]} or {names[1]}"
    else:
        value, which = float(drift[b, side]), names[2 + 2 * int(b) + int(side)]
    raise CapturesError(
        f"{which} is {abs(value):.0%} {'brighter' if value > 0 else 'darker'} than the "
        f"other frames, at most {_MOST_DRIFT:.0%}: one exposure and gain for all"
    )


def _require_codes(
    stack: Images, good: NDArray[np.bool_], patterns: RingPatterns
) -> None:
    """Refuse images whose pixels hold codes that the projector never drew."""
    rows, columns = np.nonzero(good)
    contrast = _contrast(stack)[rows, columns]
    code = np.zeros(len(rows), dtype=np.int64)
    sure = np.ones(len(rows), dtype=bool)
    for bit in range(patterns.n_bits):
        pair = stack[2 + 2 * bit : 4 + 2 * bit, rows, columns].astype(np.float32)
        level = pair[0] - pair[1]
        code |= (level > 0.0).astype(np.int64) << bit
        sure &= np.abs(level) >= _SURE * contrast
    strange = patterns.index_of_code[code[sure]] < 0
    share = float(strange.mean()) if len(strange) else 0.0
    if share > _MOST_STRANGE:
        raise CapturesError(
            f"{share:.0%} of the lit pixels hold codes of no ring: a bit exchanged "
            f"with another or its inverse, or frames of another projector"
        )
