"""Whether images can be the frames of a dense sequence, from their pixels alone.

Neighbouring pixels that differ in one bit lie on both sides of a border, and a border
is between two stripes that follow each other. Where a bit changes alone and the stripes
are far apart, its frame isn't that bit: frames are out of order, or of another code.
"""

from collections.abc import Sequence

import numpy as np

from planning.model.errors import CapturesError
from planning.verify.reconstruction.arrays import Images, Indices, Mask
from planning.verify.reconstruction.decode.adding_up import (
    bent,
    broken_pixels,
    is_bent,
)
from planning.verify.reconstruction.decode.edges import MIN_CONTRAST
from planning.verify.reconstruction.decode.inspection import (
    clipped_pixels,
    lit_part,
    lit_pixels,
    require_different,
    usable_frames,
)
from planning.verify.reconstruction.decode.tone_curve import in_light, tone_curve
from planning.verify.reconstruction.patterns.dense_patterns import DensePattern
from planning.verify.reconstruction.patterns.ring_patterns import Frames

# Bits that stand out by this share of the contrast are looked at.
_SURE = 0.3
# A frame is its bit if it changes between stripes that follow each other in this share
# of the places where it changes alone; fewer places say nothing.
_MIN_NAMED, _HARDLY, _FEWEST = 1.0 / 3.0, 0.05, 30
# Pixels by which frames are judged as a whole, about; a pixel breaks the rule of light
# if its rest exceeds this share of its contrast and so many deviations of noise.
_JUDGED, _REST_SHARE, _SIGMAS = 60_000, 0.1, 8.0
# How far pixels are apart that are held against each other [px]: a border between them
# may leave those on it unsure.
_APART_PX = 2
# Codes beyond the panel in more of the pixels are those of another one.
_MOST_OUTSIDE = 0.05


def inspect_dense(
    stack: Images, pattern: DensePattern, names: Sequence[str]
) -> tuple[Frames, tuple[str, ...]]:
    """Hold the images of a camera under a projector against each other.

    Returns their lit part, where pixels that can't be trusted are dark; and a clause
    for each reason for which pixels were left out.

    Args:
        stack: In the pattern's order, of the camera's whole image.
        pattern: What the projector drew.
        names: Of the frames.

    Raises:
        CapturesError: If the images contradict each other or the pattern.
        DarkError: If there is no light.
    """
    w, n = pattern.white, len(stack)
    # White and black before the bits, as the rules of light take them.
    order = [w, w + 1, *range(w), *range(w + 2, n)]
    window, corner = lit_part(stack[np.array(order)])
    named = [names[k] for k in order]
    lit, n_paired = lit_pixels(window), w + 2
    clipped = clipped_pixels(window, lit, named)
    require_different(window, lit, named)
    good = lit & ~clipped
    few = _some_of(good)
    curved = bent(window[:n_paired], few)
    if is_bent(curved):
        window = in_light(window, tone_curve(window[:n_paired], few))
    broken_pixels(window[:n_paired], few, named[:n_paired])
    broken = good & _broken(window[:n_paired], few)
    require_order(window[:n_paired], good & ~broken, pattern, named)
    frames, notes = usable_frames(window, lit, clipped, broken, curved)
    return Frames(frames[np.argsort(order)], corner), notes


def _some_of(good: Mask) -> Mask:
    """Return a grid's part of pixels, enough to judge frames as a whole by."""
    every = max(1, int(np.sqrt(np.count_nonzero(good) / _JUDGED)))
    some = np.zeros_like(good)
    some[::every, ::every] = good[::every, ::every]
    return some


def _broken(window: Images, few: Mask) -> Mask:
    """Pixels of which a frame and its inverse don't add up to white and black.

    Args:
        window: White, black, then the bits, each with its inverse.
        few: Pixels by which noise is judged.
    """
    both = window[0].astype(np.float32) + window[1]
    contrast = np.subtract(window[0], window[1], dtype=np.float32)
    most = _REST_SHARE * np.maximum(contrast, 1.0)
    broken = np.zeros(contrast.shape, dtype=bool)
    for k in range(2, len(window), 2):
        rest = np.abs(window[k].astype(np.float32) + window[k + 1] - both)
        spread = 1.4826 * float(np.median(rest[few])) if few.any() else 0.0
        broken |= rest > most + _SIGMAS * max(spread, 1.0)
    return broken


def require_order(
    window: Images, good: Mask, pattern: DensePattern, names: Sequence[str]
) -> None:
    """Refuse frames that aren't the bits that they are taken for (CapturesError).

    Args:
        window: White, black, then the bits, each with its inverse.
        good: Pixels that are lit and trusted, shape (h, w).
        pattern: What was shown.
        names: Of the frames of the window.
    """
    contrast = np.subtract(window[0], window[1], dtype=np.float32)
    read = good & (contrast >= MIN_CONTRAST)
    least = _SURE * contrast
    for axis, what in enumerate(("columns", "rows")):
        first, n_bits = 2 + pattern.first_bit(axis), pattern.bits(axis)
        stripe = np.zeros(read.shape, dtype=np.int64)
        code = np.zeros_like(stripe)
        sure, bright = read.copy(), np.zeros(read.shape, dtype=bool)
        for b in range(n_bits):
            one, other = window[first + 2 * b], window[first + 2 * b + 1]
            apart = np.subtract(one, other, dtype=np.float32)
            bright ^= apart > 0.0
            stripe, code = (stripe << 1) | bright, (code << 1) | (apart > 0.0)
            sure &= np.abs(apart) >= least
        flips, follow = _changes(code, stripe, sure, n_bits)
        wrong = (flips >= _FEWEST) & (follow < _MIN_NAMED * flips)
        if np.count_nonzero(wrong) == 1:
            # Steps of the object may lie along the border of one bit; of two frames
            # exchanged both bits are wrong, or one wherever it changes.
            wrong &= follow < _HARDLY * flips
        if wrong.any():
            late = np.flatnonzero(wrong).tolist()
            bad = [names[first + 2 * (n_bits - 1 - b)] for b in late]
            raise CapturesError(
                f"{', '.join(reversed(bad))} can't be the bit{'s' * (len(bad) > 1)} "
                f"of {what} that the order says: stripes that follow each other differ "
                f"elsewhere; bring the frames into order (each bit from the highest, "
                f"columns before rows, each followed by its inverse)"
            )
        last = (pattern.resolution[axis] - 1) // pattern.code.finest_px
        outside = float(np.mean(stripe[sure] > last)) if sure.any() else 0.0
        if outside > _MOST_OUTSIDE:
            raise CapturesError(
                f"{outside:.0%} of the lit pixels show {what} beyond the projector's "
                f"{pattern.resolution[axis]}: frames and inverses exchanged, or a "
                f"projector of another size"
            )


def _changes(
    code: Indices, stripe: Indices, sure: Mask, n_bits: int
) -> tuple[Indices, Indices]:
    """Count where each bit changes alone, and where to the next stripe, (n_bits,).

    From the finest bit on.
    """
    flips, follow = np.zeros((2, n_bits), dtype=np.int64)
    for axis in (0, 1):
        ahead, behind = [slice(None)] * 2, [slice(None)] * 2
        ahead[axis], behind[axis] = slice(_APART_PX, None), slice(-_APART_PX)
        one, other = tuple(ahead), tuple(behind)
        both = sure[one] & sure[other]
        changed = (code[one] ^ code[other])[both]
        single = (changed > 0) & (changed & (changed - 1) == 0)
        bit = np.log2(changed[single]).astype(np.int64)
        next_to = np.abs(stripe[one][both] - stripe[other][both])[single] == 1
        flips += np.bincount(bit, minlength=n_bits)
        follow += np.bincount(bit[next_to], minlength=n_bits)
    return flips, follow
