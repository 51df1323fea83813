"""Pixels that two projectors light: from one image's brightness, and from two.

The paper fires neighbouring projectors at once and calls the brighter pixels their
overlap, ``I_j and I_j+1 != 0``. That needs surface of one albedo, little ambient light
and a threshold; one white frame of each projector alone needs none of them.
"""

import numpy as np

from planning.verify.reconstruction.arrays import Array, Grey, Images, Indices, Mask

# Less contrast between on and off is noise: three deviations of both [grey levels].
MIN_CONTRAST = 5.0
_LEVELS = 256


def overlap_by_intensity(
    together: Images, dark: Images, threshold: float | None = None
) -> Mask:
    """Return the paper's overlap: pixels brighter than one projector makes them.

    Args:
        together: All projectors on, grey levels, shape (h, w).
        dark: All off, same shape.
        threshold: Of the brightness above dark; None: the upper one of `three_classes`.
    """
    light = _brighter(together, dark)
    if threshold is None:
        threshold = three_classes(light)[1]
    return light > max(threshold, MIN_CONTRAST)


def overlap_by_frames(alone: Images, dark: Images) -> Mask:
    """Return pixels that two projectors or more light, from a white frame of each.

    Args:
        alone: One projector on at a time, grey levels, shape (n_projectors, h, w).
        dark: All off, shape (h, w).
    """
    lit = np.stack([_brighter(one, dark) >= MIN_CONTRAST for one in alone])
    return np.count_nonzero(lit, axis=0) >= 2


def three_classes(light: Grey) -> tuple[float, float]:
    """Return the thresholds that part grey levels into three classes.

    They maximise the variance between the classes. Source: Otsu, "A threshold selection
    method from gray-level histograms", IEEE Trans. SMC 1979, section IV.

    Args:
        light: Grey levels above dark, any shape.
    """
    level = np.clip(np.rint(light), 0, _LEVELS - 1).astype(np.int64)
    count = np.bincount(level.ravel(), minlength=_LEVELS).astype(np.float64)
    below = np.concatenate([[0.0], np.cumsum(count)])
    moment = np.concatenate([[0.0], np.cumsum(count * np.arange(_LEVELS))])

    def gain(first: Indices, last: Indices) -> Array:
        n, sum_ = below[last] - below[first], moment[last] - moment[first]
        return sum_ * sum_ / np.maximum(n, 1.0)

    ends = np.arange(_LEVELS + 1)
    low, high = np.meshgrid(ends, ends, indexing="ij")
    whole = np.full_like(low, _LEVELS)
    between = gain(np.zeros_like(low), low) + gain(low, high) + gain(high, whole)
    between[low > high] = -np.inf
    # Between heaps of grey every threshold is as good: the middle one is taken.
    best = np.argwhere(between >= (1.0 - 1e-12) * between.max())
    one, two = best.mean(axis=0) - 0.5
    return float(one), float(two)


def _brighter(image: Images, dark: Images) -> Grey:
    return np.subtract(image, dark, dtype=np.float32)
