"""Which single change of the rig or the object the measured edges ask for.

Each device may be turned, displaced, zoomed, or swapped with another, and the object be
larger or elsewhere. Every such change is fitted to the decoded edges; what removes most
of their mismatch with the fewest parameters is the diagnosis. It is an inference from
images and calibration alone: "as if", not "is".
"""

from dataclasses import dataclass

import numpy as np

from planning.verify.reconstruction.decode.decode import Pairs
from planning.verify.reconstruction.scanner import Scanner

from .explanations import CAP_M, SOUND_SHARE, Explanation, State, capped
from .supposed import Evidence, Places, Supposed, mismatches, places

# An explanation must leave no more than this share of what it bears on ...
_MUST_LEAVE = 0.5
# ... and is as good as another if edge by edge it leaves no more by so many standard
# errors; by this share it is as good anyway, by that one never.
_AS_GOOD_ERRORS, _AS_GOOD_SHARE, _WORSE_SHARE = 4.0, 0.03, 0.25
# Edges lie on their rings if they do within this share of the limit on the rms
# distance, or so many standard deviations of their own noise.
_FINE_SHARE, _FINE_NOISE = 0.12, 2.0
_MOST_CAUSES = 3


@dataclass(frozen=True, eq=False)
class Cause:
    """One thing that is wrong.

    Attributes:
        explanations: Equally good ones, the simplest first.
        before_m: Mismatch of the edges before it, mean over the pairs of devices [m].
    """

    explanations: tuple[Explanation, ...]
    before_m: float


def diagnose(plan: Scanner, decoded: Pairs) -> tuple[Cause, ...]:
    """Return the changes that the edges of a check ask for, see `diagnose_edges`."""
    return diagnose_edges(plan, Evidence.of(plan, decoded))


def diagnose_edges(plan: Scanner, evidence: Evidence) -> tuple[Cause, ...]:
    """Return the changes that edges ask for, what explains most first.

    Args:
        plan: How everything should stand.
        evidence: Labelled edges of the pairs of devices.
    """
    if len(evidence) == 0:
        return ()
    supposed = Supposed.of(plan)
    at = places(evidence, supposed)
    fine = max(
        _FINE_SHARE * plan.limits.check.max_rms_m,
        _FINE_NOISE * _noise(evidence, supposed, at),
    )
    lies = mismatches(evidence, supposed, at)
    state = State(evidence, supposed, lies, fine)
    causes: list[Cause] = []
    while len(causes) < _MOST_CAUSES and state.misfit() > fine:
        good = _equally_good(state.explanations())
        if not good or not _helps(good[0], state):
            break
        causes.append(Cause(good, state.misfit()))
        state = State(evidence, good[0].after, good[0].mismatch, fine)
    return tuple(causes)


def _helps(one: Explanation, state: State) -> bool:
    """Whether it removes most of the mismatch of the edges that it bears on."""
    was, left = state.misfit(rows=one.rows), state.misfit(one.mismatch, one.rows)
    return left <= _MUST_LEAVE * was


def _equally_good(tried: list[Explanation]) -> tuple[Explanation, ...]:
    """Return the simplest of the best, and others as good that don't contain it."""
    if not tried:
        return ()
    best = min(tried, key=lambda e: e.remaining_m)
    good = [e for e in tried if not _clearly_worse(e, best)]
    good.sort(key=lambda e: (e.correction.n_parameters, e.remaining_m))
    simplest: list[Explanation] = []
    for one in good:
        if not any(one.correction.repeats(e.correction) for e in simplest):
            simplest.append(one)
    return tuple(simplest)


def _clearly_worse(one: Explanation, best: Explanation) -> bool:
    """Whether the edges that the better change puts right tell that it is."""
    rows = best.rows
    left, least = (capped(e.mismatch[rows], CAP_M) for e in (one, best))
    # Outliers of either are no evidence.
    size = np.minimum(left, least)
    sound = size <= np.quantile(size, SOUND_SHARE)
    excess = (left - least)[sound]
    share = float(np.mean(excess)) / float(np.mean(least[sound]))
    if not _AS_GOOD_SHARE < share <= _WORSE_SHARE:
        return share > _WORSE_SHARE
    error = float(np.std(excess)) / np.sqrt(len(excess))
    return float(np.mean(excess)) > _AS_GOOD_ERRORS * error


def _noise(evidence: Evidence, supposed: Supposed, at: Places) -> float:
    """Median standard deviation of the edges across themselves, at the object [m]."""
    centres = np.array([camera.centre for camera in supposed.cameras])
    focal = np.array([camera.focal_px for camera in supposed.cameras])
    reach = np.linalg.norm(at[0] - centres[evidence.camera], axis=1)
    width = reach / focal[evidence.camera]
    known = np.isfinite(width)
    return float(np.median((evidence.noise_px * width)[known])) if known.any() else 0.0
