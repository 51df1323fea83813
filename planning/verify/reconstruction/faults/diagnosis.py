"""Which single change of the rig or the object the measured edges ask for.

Each device may be turned, displaced, zoomed, or swapped with another, and the object be
larger or elsewhere. Every such change is fitted to the decoded edges; what removes most
of their mismatch with the fewest parameters is the diagnosis. It is an inference from
images and calibration alone: "as if", not "is".
"""

import numpy as np

from planning.verify.reconstruction.scanner import Scanner

from .explanations import CAP_M, SOUND_SHARE, Explanation, State, capped
from .supposed import Evidence, Supposed, places

# An explanation must leave no more than this share of what it bears on ...
_MUST_LEAVE = 0.5
# ... and is as good as another if edge by edge it leaves no more by so many standard
# errors; by this share it is as good anyway, by that one never.
_AS_GOOD_ERRORS, _AS_GOOD_SHARE, _WORSE_SHARE = 4.0, 0.03, 0.25
# Edges lie on their rings if they do within this share of the limit on the rms
# distance, or so many standard deviations of their own noise.
_FINE_SHARE, _FINE_NOISE = 0.12, 2.0
_MOST_CAUSES = 3
# Equally good explanations of one thing that is wrong, the simplest first.
Cause = tuple[Explanation, ...]


def diagnose(plan: Scanner, evidence: Evidence) -> tuple[Cause, ...]:
    """Return the changes of a plan that edges ask for, what explains most first."""
    if len(evidence) == 0:
        return ()
    supposed = Supposed.of(plan)
    noise = _FINE_NOISE * _noise_m(evidence, supposed)
    fine = max(_FINE_SHARE * plan.limits.check.max_rms_m, noise)
    state = State(evidence, supposed, fine)
    causes: list[Cause] = []
    while len(causes) < _MOST_CAUSES and state.misfit() > fine:
        good = _equally_good(state.explanations())
        if not good:
            break
        before, after = (s.misfit(good[0].concerned) for s in (state, good[0].after))
        if after > _MUST_LEAVE * before:
            break
        causes.append(good)
        state = good[0].after
    return tuple(causes)


def _equally_good(tried: list[Explanation]) -> Cause:
    """Return the simplest of the best, and others as good that don't contain it."""
    best = min(tried, key=lambda e: e.remaining_m, default=None)
    good = [e for e in tried if best is not None and not _clearly_worse(e, best)]
    good.sort(key=lambda e: (e.correction.n_parameters, e.remaining_m))
    simplest: list[Explanation] = []
    for one in good:
        if not any(one.correction.repeats(e.correction) for e in simplest):
            simplest.append(one)
    return tuple(simplest)


def _clearly_worse(one: Explanation, best: Explanation) -> bool:
    """Whether the edges that the better change puts right tell that it is."""
    remaining, least = (
        capped(e.after.mismatch[best.concerned], CAP_M) for e in (one, best)
    )
    # Outliers of either are no evidence.
    size = np.minimum(remaining, least)
    sound = size <= np.quantile(size, SOUND_SHARE)
    excess = (remaining - least)[sound]
    share = float(np.mean(excess)) / float(np.mean(least[sound]))
    if not _AS_GOOD_SHARE < share <= _WORSE_SHARE:
        return share > _WORSE_SHARE
    error = float(np.std(excess)) / np.sqrt(len(excess))
    return float(np.mean(excess)) > _AS_GOOD_ERRORS * error


def _noise_m(evidence: Evidence, supposed: Supposed) -> float:
    """Median standard deviation of the edges across themselves, at the object."""
    centres = np.array([camera.centre for camera in supposed.cameras])
    focal = np.array([camera.focal_px for camera in supposed.cameras])
    points, _ = places(evidence, supposed)
    reach = np.linalg.norm(points - centres[evidence.camera], axis=1)
    noise = evidence.noise_px * reach / focal[evidence.camera]
    known = np.isfinite(noise)
    return float(np.median(noise[known])) if known.any() else 0.0
