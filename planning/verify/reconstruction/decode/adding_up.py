"""Light adds up: every frame and its inverse together are white and black.

``I + I_inv = W + K`` holds in every pixel, with the light that surfaces pass on to each
other too. Frames that were exchanged, exposed otherwise, cut, moved or disturbed break
the rule.
"""

from collections.abc import Sequence

import numpy as np

from planning.model.errors import CapturesError
from planning.verify.reconstruction.arrays import Array, Grey, Images, Mask

_FEWEST_BRIGHT = 100
# A pixel is surely bright in a frame that exceeds its inverse by this share of white.
_SURELY = 0.5
_HALF_BRIGHT = 0.3
_MOST_BENT = 0.05
# A frame brighter or darker than the rest by this share shifts edges by half of it,
# about a fiftieth of a pixel.
_MOST_DRIFT = 0.03
# What is found must exceed this many standard deviations of the noise, too.
_SIGMAS = 8.0
# A pixel breaks the rule if its rest exceeds this share of its contrast; a frame does
# if more than that share of its pixels do.
_REST_SHARE = 0.1
_MOST_BROKEN = 0.2
# A frame that moved by d leaves a rest of -d . grad I; edges move by half of d [px].
_MOST_MOVED_PX = 0.1
# Variance of a sum of four frames that are rounded to grey levels of 255.
_ROUNDING = 4.0 / 12.0


def broken_pixels(stack: Images, good: Mask, names: Sequence[str]) -> Mask:
    """Return pixels of which a frame and its inverse don't add up to white and black.

    Raises:
        CapturesError: If that is so in much of the image, or a frame is brighter or
            darker than the rest as a whole.
    """
    pixels = stack[:, good].astype(np.float32)
    n = pixels.shape[1]
    white, black, pairs = pixels[0], pixels[1], pixels[2:].reshape(-1, 2, n)
    sums = pairs.sum(axis=1)
    by_bits = np.median(sums, axis=0) - 2.0 * black
    contrast = np.maximum(np.maximum(white - black, by_bits), 1.0)
    rests = sums - (white + black)
    _require_linear(pairs, rests, contrast)
    spreads = [float(np.median(np.abs(rest))) for rest in rests]
    spread = max(1.0, 1.4826 * float(np.median(spreads)))
    wrong = np.abs(rests) > _REST_SHARE * contrast + _SIGMAS * spread
    shares = wrong.mean(axis=1) if n else np.zeros(len(rests))
    if np.any(shares > _MOST_BROKEN):
        raise CapturesError(_which_broke(shares, names))
    _require_one_exposure(pairs, rests, white - black, spread, names)
    broken = np.zeros(good.shape, dtype=bool)
    broken[good] = wrong.any(axis=0)
    _require_still(stack, good & ~broken, rests[:, ~broken[good]], names)
    return broken


def bent(stack: Images, good: Mask) -> float:
    """Return by how much half-bright frames and inverses exceed white, as a share.

    0 where grey levels are in proportion to light, whatever surfaces pass on.
    """
    pixels = stack[:, good].astype(np.float32)
    pairs = pixels[2:].reshape(-1, 2, pixels.shape[1])
    sums = pairs.sum(axis=1)
    by_bits = np.median(sums, axis=0) - 2.0 * pixels[1]
    contrast = np.maximum(np.maximum(pixels[0] - pixels[1], by_bits), 1.0)
    return _excess(pairs, sums - (pixels[0] + pixels[1]), contrast)


def is_bent(excess: float) -> bool:
    """Return whether an excess of half-bright frames is more than light explains."""
    return not abs(excess) <= _MOST_BENT


def _excess(pairs: Grey, rests: Grey, contrast: Grey) -> float:
    # If dark tones were lifted, most frames and inverses together exceed white there.
    clear = contrast >= 0.5 * float(np.median(contrast))
    level = (pairs[:, 0, clear] - pairs[:, 1, clear]) / contrast[clear]
    share = rests[:, clear] / contrast[clear]
    half = np.abs(level) <= _HALF_BRIGHT
    excesses = [
        float(np.median(rest[mid]) - np.median(rest[~mid]))
        for rest, mid in zip(share, half, strict=True)
        if min(np.count_nonzero(mid), np.count_nonzero(~mid)) >= _FEWEST_BRIGHT
    ]
    return float(np.median(excesses)) if excesses else 0.0


def _require_linear(pairs: Grey, rests: Grey, contrast: Grey) -> None:
    """Refuse grey levels that no curve brings in proportion to light."""
    excess = _excess(pairs, rests, contrast)
    if is_bent(excess):
        raise CapturesError(
            f"where a frame and its inverse are half bright they add up to "
            f"{1.0 + excess:.0%} of white, and no one curve from grey levels to light "
            f"mends it; switch automatic contrast and local tone mapping off"
        )


def _which_broke(shares: Array, names: Sequence[str]) -> str:
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
    pairs: Grey, rests: Grey, contrast: Grey, spread: float, names: Sequence[str]
) -> None:
    """Refuse frames brighter or darker than the rest, by the pixels that they light.

    Beyond the noise of a median over them, the rests of pixels having this spread.
    """
    drift = np.zeros(pairs.shape[:2])
    typical = 0.5 * float(np.median(contrast))
    for b, (frame, inverse) in enumerate(pairs):
        surely = _SURELY * contrast
        for side, bright in enumerate((frame - inverse, inverse - frame)):
            bright = (bright >= surely) & (contrast >= typical)
            n = np.count_nonzero(bright)
            if n >= _FEWEST_BRIGHT:
                rest = float(np.median(rests[b][bright]))
                noise = _SIGMAS * spread / np.sqrt(n)
                sure = np.sign(rest) * max(abs(rest) - noise, 0.0)
                drift[b, side] = sure / float(np.median(contrast[bright]))
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


def _require_still(
    stack: Images, good: Mask, rests: Grey, names: Sequence[str]
) -> None:
    """Refuse frames that moved against the others, by least squares over the image.

    The rest is fitted by ``-a . grad I - b . grad W``: a frame that moved by d has
    a = d, b = 0, its inverse a = -d, b = d, both together b = d, white b = -d.
    """
    white = _gradient(stack[0], good)
    for b, rest in enumerate(rests):
        terms = np.concatenate([_gradient(stack[2 + 2 * b], good), white])
        moved, sigma = _least_squares(terms, np.asarray(rest))
        off = np.maximum(np.hypot(*moved[:2]), np.hypot(*moved[2:]))
        surely = np.abs(moved) > np.maximum(_MOST_MOVED_PX, _SIGMAS * sigma)
        if surely.any():
            raise CapturesError(
                f"{names[2 + 2 * b]}, its inverse or {names[0]} moved by {off:.2g} px "
                f"against the others, at most {_MOST_MOVED_PX} px: object and devices "
                f"must stand still"
            )


def _gradient(image: Images, good: Mask) -> Array:
    """Grey levels a pixel along u and v at the good pixels, shape (2, n)."""
    down, across = map(np.asarray, np.gradient(image.astype(np.float32)))
    return np.stack([across[good], down[good]]).astype(np.float64)


def _least_squares(terms: Array, rest: Grey) -> tuple[Array, Array]:
    """Return the factors of ``rest = -factors . terms``, and their deviations."""
    normal = np.linalg.pinv(terms @ terms.T, hermitian=True)
    factors = -normal @ (terms @ rest)
    residual = rest + factors @ terms
    variance = float(residual @ residual) / max(1, len(rest) - len(terms))
    # Without noise the rest is 0 but where a frame differs from white and black.
    variance = max(variance, _ROUNDING)
    return factors, np.sqrt(variance * np.maximum(np.diag(normal), 0.0))
