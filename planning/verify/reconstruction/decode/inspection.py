"""Whether images can be what they are taken for, from their pixels alone."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import binary_opening

from planning.model.errors import CapturesError
from planning.verify.reconstruction.arrays import Grey, Images, Mask
from planning.verify.reconstruction.patterns.ring_patterns import Frames, RingsForCamera

from .adding_up import bent, broken_pixels, is_bent
from .edges import MIN_CONTRAST, read_code
from .tone_curve import in_light, tone_curve

_LIT_BY_BITS = 20.0
_FEWEST_LIT = 100
# Beyond what so many deviations of a count explain.
_DEVIATIONS = 4.0
# From this level of 255 on, or where levels pile up, a sensor is taken to be clipped.
_CLIPPED = 250.0
_PILED = 50
_PILE = 4.0
_MOST_CLIPPED = 0.5
# Pixels left out, and codes that no annulus has, are worth a word from these shares on.
_WORTH_A_WORD = 0.01
_MOST_STRANGE = 0.02
# A frame shows a pattern if more than this share is bright, and is dark.
_PLAIN = 0.01
_SURE = 0.25
# Pixels beyond the lit ones that the decoder needs about them.
_MARGIN_PX = 4


class DarkError(CapturesError):
    """White is no brighter than black; whether light should be there, others know."""


def inspect(
    stack: Images, patterns: RingsForCamera, names: Sequence[str]
) -> tuple[Frames, tuple[str, ...]]:
    """Hold the images of a camera under a projector against each other.

    Returns their lit part, where pixels that can't be trusted are dark; and a clause
    for each reason for which pixels were left out.

    Args:
        stack: As of `Frames`, but of the camera's whole image.
        patterns: What the projector drew.
        names: Of the frames.

    Raises:
        CapturesError: If the images contradict each other or the patterns.
        DarkError: If there is no light.
    """
    window, corner = lit_part(stack)
    lit = lit_pixels(window)
    clipped = clipped_pixels(window, lit, names)
    require_different(window, lit, names)
    good = lit & ~clipped
    curved = bent(window, good)
    if is_bent(curved):
        window = in_light(window, tone_curve(window, good))
    broken = broken_pixels(window, good, names)
    _require_codes(window, good & ~broken, patterns)
    frames, notes = usable_frames(window, lit, clipped, broken, curved)
    return Frames(frames, corner), notes


def usable_frames(
    window: Images, lit: Mask, clipped: Mask, broken: Mask, curved: float
) -> tuple[Images, tuple[str, ...]]:
    """Return images without what can't be trusted, and a clause for each reason."""
    reasons = (
        (share_of_lit(clipped, lit), "are clipped and left out"),
        (
            share_of_lit(broken, lit & ~clipped),
            "are left out: frames and inverses there don't add up to white and black",
        ),
    )
    notes = tuple(
        f"{share:.1%} of the lit pixels {why}"
        for share, why in reasons
        if share > _WORTH_A_WORD
    )
    if is_bent(curved):
        notes += (
            f"grey levels weren't in proportion to light (half-bright frames and "
            f"inverses added up to {1.0 + curved:.0%} of white); one curve for all "
            f"frames made that good",
        )
    frames = window.copy()
    # Without contrast nothing is decoded; what is clipped stays so for all to see.
    frames[:, broken] = 0
    frames[:, clipped] = 255
    return frames, notes


def lit_pixels(stack: Images) -> Mask:
    """Pixels that get light: in white, or in the first bits and their inverses."""
    # Two bits: a single damaged frame lights nothing. What is isolated is noise.
    black = stack[1].astype(np.float32)
    sums = [np.add(stack[k], stack[k + 1], dtype=np.float32) for k in (2, 4)]
    by_bits = np.minimum(*sums) - 2.0 * black >= _LIT_BY_BITS
    opened = np.asarray(binary_opening(by_bits, np.ones((3, 3))), dtype=bool)
    return (_contrast(stack) >= MIN_CONTRAST) | opened


def _contrast(stack: Images) -> Grey:
    return np.subtract(stack[0], stack[1], dtype=np.float32)


def share_of_lit(some: Mask, whole: Mask) -> float:
    """Return the share of the whole that some of it is; 0 of nothing."""
    return float(np.count_nonzero(some & whole) / max(1, np.count_nonzero(whole)))


def lit_part(stack: Images) -> tuple[Images, tuple[int, int]]:
    """Return the part of the images that holds all lit pixels, and its corner."""
    contrast, lit = _contrast(stack), lit_pixels(stack)
    n_lit = int(np.count_nonzero(contrast >= MIN_CONTRAST))
    n_below = int(np.count_nonzero(contrast <= -MIN_CONTRAST))
    # Noise brightens about as many as it darkens.
    surplus, chance = n_lit - n_below, _DEVIATIONS * np.sqrt(n_lit + n_below)
    if -surplus > max(chance, _FEWEST_LIT):
        raise CapturesError(
            f"white is darker than black in {n_below} pixels, brighter in {n_lit}: "
            f"the two were exchanged, or are frames of something else"
        )
    if surplus < max(chance, _FEWEST_LIT):
        white, black = (float(np.median(image)) for image in stack[:2])
        raise DarkError(
            f"no light: white exceeds black by {MIN_CONTRAST:.0f} of 255 in {n_lit} "
            f"pixels, black exceeds white in {n_below} (median levels {white:.0f} and "
            f"{black:.0f}); light the object, or expose longer; shorter if both are "
            f"near 255"
        )
    rows, columns = (np.flatnonzero(lit.any(axis=axis)) for axis in (1, 0))
    top, left = (max(0, int(place[0]) - _MARGIN_PX) for place in (rows, columns))
    bottom, right = (int(place[-1]) + 1 + _MARGIN_PX for place in (rows, columns))
    return stack[:, top:bottom, left:right], (left, top)


def clipped_pixels(stack: Images, lit: Mask, names: Sequence[str]) -> Mask:
    """Pixels in which any frame reaches what the sensor can tell apart at most."""
    level = min(_CLIPPED, _piled_level(stack[0]))
    clipped = stack.max(axis=0) >= level
    share = share_of_lit(clipped, lit)
    if share <= _MOST_CLIPPED:
        return clipped
    by_frame = [share_of_lit(image >= level, lit) for image in stack]
    worst = int(np.argmax(by_frame))
    if by_frame[worst] > 2.0 * by_frame[0]:
        raise CapturesError(
            f"{names[worst]} is clipped in {by_frame[worst]:.0%} of the lit pixels, "
            f"{names[0]} in {by_frame[0]:.0%}: it isn't of the same exposure"
        )
    raise CapturesError(
        f"over-exposed: {share:.0%} of the lit pixels are clipped; shorten the "
        f"exposure until {names[0]} keeps below {_CLIPPED:.0f} of 255"
    )


def _piled_level(white: Images) -> float:
    """Brightest level if pixels pile up there: sensors may be full before numbers."""
    levels, counts = np.unique(white, return_counts=True)
    if len(levels) < 2 or counts[-1] < _PILED or counts[-1] < _PILE * counts[-2]:
        return float("inf")
    return float(levels[-1])


def require_different(stack: Images, lit: Mask, names: Sequence[str]) -> None:
    """Refuse two frames of the same pixels, unless both are white or black all over.

    Without noise a bit that is the same everywhere equals white or black, and so does
    a root disc that this camera doesn't see. No two bits draw the same pattern.
    """
    half = 0.5 * (stack[0][lit].astype(np.float32) + stack[1][lit])
    seen: dict[int, int] = {}
    for k, image in enumerate(stack):
        before = seen.setdefault(hash(image.tobytes()), k)
        bright = float(np.mean(image[lit] > half))
        drawn = _PLAIN < bright < 1.0 - _PLAIN
        if before != k and drawn and np.array_equal(image, stack[before]):
            raise CapturesError(
                f"{names[before]} and {names[k]} are the same image; take it again"
            )


def _require_codes(stack: Images, good: Mask, patterns: RingsForCamera) -> None:
    """Refuse images whose pixels hold codes that the projector never drew."""
    contrast = _contrast(stack)
    read = good & (contrast >= MIN_CONTRAST)
    code, least = read_code(stack[:, read], patterns.n_bits)
    sure = least >= _SURE * contrast[read]
    strange = patterns.index_of_code[code[sure]] < 0
    share = float(strange.mean()) if len(strange) else 0.0
    if share > _MOST_STRANGE:
        raise CapturesError(
            f"{share:.0%} of the lit pixels hold codes of no ring: a bit exchanged "
            f"with another or its inverse, or frames of another projector"
        )
