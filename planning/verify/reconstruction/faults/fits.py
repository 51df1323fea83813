"""The parameters of a correction that edges agree with best, outliers among them."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from planning.verify.reconstruction.arrays import Array

# Step of finite differences at the object [m].
_STEP_M = 2e-5
# A step along which a mismatch changes faster left one surface for another.
_MOST_SLOPE = 50.0
# Mismatches beyond so many medians, and at least this, pull no more [m].
_FAR_MEDIANS, _FAR_M = 4.0, 1e-3
# Below this share of the median, and at least this, they count by their square [m].
_SMALL_SHARE, _SMALL_M = 0.5, 5e-6
# What leaves no trace in any edge, as a turn of a projector about its rings' axis, is
# drawn back to no change by this share of itself.
_DRAWN_BACK = 1e-3
_ROUNDS, _STEPS_A_ROUND, _SETTLED_M = 8, 6, 2e-8


def fit(mismatch: Callable[[Array], Array], start: Array) -> Array:
    """Return parameters of a small sum of absolute mismatches, none without effect.

    Reweighted least squares, w = 1 / max(|e|, small), zero beyond a cap; both follow
    the median of |e| from round to round.

    Args:
        mismatch: Mismatch of each edge in [m], NaN where it has none, shape (n,).
        start: Parameters [m], shape (k,); zeros are no change.
    """
    x = start
    for _ in range(_ROUNDS):
        size = np.abs(mismatch(x))
        if not np.isfinite(size).any():
            return x
        typical = float(np.nanmedian(size))
        cap = max(_FAR_MEDIANS * typical, _FAR_M)
        small = max(_SMALL_SHARE * typical, _SMALL_M)
        pulls = np.where(size < cap, 1.0 / np.sqrt(np.fmax(size, small)), 0.0)
        before, x = x, _weighed(mismatch, x, pulls, cap, _DRAWN_BACK / np.sqrt(small))
        if np.abs(x - before).max() < _SETTLED_M:
            return x
    return x


def _weighed(
    mismatch: Callable[[Array], Array],
    start: Array,
    pulls: Array,
    cap: float,
    back: float,
) -> Array:
    """Least squares of mismatches by fixed weights, from a start."""

    def residuals(x: Array) -> Array:
        error = mismatch(x)
        size = np.where(np.isfinite(error), np.clip(error, -cap, cap), cap)
        return np.concatenate([pulls * size, back * x])

    def slopes(x: Array) -> Array:
        error, every = mismatch(x), np.eye(len(x))
        changes = [mismatch(x + _STEP_M * one) - error for one in every]
        rates = np.stack(changes, axis=1) / _STEP_M
        sound = np.all(np.abs(rates) < _MOST_SLOPE, axis=1)
        rates = np.where(sound[:, None], pulls[:, None] * rates, 0.0)
        return np.concatenate([rates, back * every])

    steps = least_squares(
        residuals,
        start,
        slopes,  # pyright: ignore[reportArgumentType]
        xtol=1e-12,
        ftol=1e-12,
        max_nfev=_STEPS_A_ROUND,
    )
    return np.asarray(steps.x)
