"""The parameters of a correction that edges agree with best, outliers among them."""

from collections.abc import Callable

import numpy as np

from planning.verify.reconstruction.arrays import Array

# Step of finite differences at the object [m].
_STEP_M = 2e-5
_STEPS = 25
_TRIALS = 5
# Mismatches beyond so many medians, and at least this, pull no more [m].
_FAR_MEDIANS, _FAR_M = 4.0, 1e-3
# Directions whose singular value is this small against the largest leave no trace.
_SILENT, _PULLS_BACK, _NO_WORSE = 1e-3, 2, 1.02
# Below so many medians, and at least this, they count by their square [m].
_SMALL_MEDIANS, _SMALL_M = 0.5, 5e-6
_SETTLED_M = 2e-8


def least_change(
    mismatch: Callable[[Array], Array], found: Array, origin: Array
) -> Array:
    """Return parameters as good as those found, and nearer to where they began.

    A turn of a projector about its rings' axis, for one, leaves no trace in any edge:
    whatever of it a start held is taken out again.

    Args:
        mismatch: Mismatch of each edge in [m], NaN where it has none, shape (n,).
        found: Fitted parameters [m], shape (k,).
        origin: Parameters without any change, shape (k,).
    """
    error = mismatch(found)
    cap = max(_FAR_MEDIANS * _typical(error), _FAR_M)
    for _ in range(_PULLS_BACK):
        slopes = _slopes(mismatch, found, error)
        slopes = slopes[np.all(np.isfinite(slopes), axis=1)]
        if len(slopes) < len(found):
            return found
        values, directions = np.linalg.svd(slopes, full_matrices=False)[1:]
        silent = directions[values < _SILENT * values[0]]
        nearer = found - silent.T @ (silent @ (found - origin))
        tried = fit(mismatch, nearer)
        left = mismatch(tried)
        if _cost(left, cap) > _NO_WORSE * _cost(error, cap):
            return found
        found, error = tried, left
    return found


def fit(mismatch: Callable[[Array], Array], start: Array) -> Array:
    """Return parameters of a small sum of capped absolute mismatches.

    Levenberg-Marquardt steps on reweighted squares, w = 1 / max(|e|, small), zero
    beyond a cap; both follow the median of |e|. What edges can't tell stays as it was.

    Args:
        mismatch: Mismatch of each edge in [m], NaN where it has none, shape (n,).
        start: Parameters [m], shape (k,).
    """
    x, error = start, mismatch(start)
    damping = 1e-3
    for _ in range(_STEPS):
        typical = _typical(error)
        if not np.isfinite(typical):
            return x
        cap = max(_FAR_MEDIANS * typical, _FAR_M)
        slopes = _slopes(mismatch, x, error)
        step = None
        for _ in range(_TRIALS):
            tried = _step(
                error, slopes, cap, max(_SMALL_MEDIANS * typical, _SMALL_M), damping
            )
            found = mismatch(x + tried)
            if _cost(found, cap) < _cost(error, cap):
                step = tried
                x, error, damping = x + tried, found, 0.2 * damping
                break
            damping *= 10.0
        if step is None or np.abs(step).max() < _SETTLED_M:
            return x
    return x


def _typical(error: Array) -> float:
    known = np.isfinite(error)
    return float(np.median(np.abs(error[known]))) if known.any() else np.inf


def _cost(error: Array, cap: float) -> float:
    return float(
        np.mean(np.minimum(np.where(np.isfinite(error), np.abs(error), cap), cap))
    )


def _slopes(mismatch: Callable[[Array], Array], x: Array, error: Array) -> Array:
    """Return the derivative of each mismatch by each parameter, shape (n, k)."""
    steps = _STEP_M * np.eye(len(x))
    return np.stack([(mismatch(x + step) - error) / _STEP_M for step in steps], axis=1)


def _step(
    error: Array, slopes: Array, cap: float, small: float, damping: float
) -> Array:
    size = np.abs(error)
    use = (size < cap) & np.all(np.isfinite(slopes), axis=1)
    # Where a ray leaves one surface for another in the step, the slope is senseless.
    use &= np.all(np.abs(slopes) < 50.0, axis=1)
    weight = 1.0 / np.maximum(size[use], small)
    normal = (slopes[use] * weight[:, None]).T @ slopes[use]
    pull = (slopes[use] * weight[:, None]).T @ error[use]
    floor = 1e-9 * float(np.trace(normal)) + 1e-30
    damped = normal + np.diag(damping * np.diag(normal) + floor)
    return -np.linalg.solve(damped, pull).astype(np.float64)
