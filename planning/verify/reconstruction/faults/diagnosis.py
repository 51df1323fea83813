"""Which changes of the rig or the object the measured edges ask for.

It is an inference from images and calibration alone: "as if", not "is".
"""

from dataclasses import dataclass

import numpy as np

from planning.model.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.scanner import Scanner

from .adjustment import Adjusted, adjust, expected_of
from .bundle import Bundle
from .explanations import Cause, misfit
from .gross import gross
from .search import Search
from .supposed import Evidence, Supposed, places

# What a rig that isn't as planned may be off by, device by device, and its object
# [rad], [m], shares; expected of each alike where no calibration is stated.
MOUNTED = CalibrationErrors(5e-3, 5e-3, 5e-3)
PLACED = (5e-3, 5e-3, 5e-3)
# A gross change must leave no more than this share of the mismatch.
_MUST_LEAVE = 0.5
# Edges lie on their rings if they do within this share of the limit on the rms
# distance, or so many standard deviations of their own noise.
_FINE_SHARE, _FINE_NOISE = 0.12, 2.0
# Beyond so many times that, all that is near together can't explain it.
_FAR_TIMES = 4.0
_MOST_CAUSES = 3
_MM = 1e3


@dataclass(frozen=True)
class Diagnosis:
    """What edges ask for.

    Attributes:
        causes: Changes of the plan, what explains most first.
        remark: What no change of one device, nor of the object, explains; None:
            nothing is left that would be worth a word.
    """

    causes: tuple[Cause, ...] = ()
    remark: str | None = None


def diagnose(plan: Scanner, evidence: Evidence) -> Diagnosis:
    """Return which changes of a plan edges ask for."""
    enough = _FINE_SHARE * plan.limits.check.max_rms_m
    if len(evidence) == 0 or misfit(evidence, Supposed.of(plan)) <= enough:
        return Diagnosis()
    every, causes = reachable(plan, evidence)
    rig = every.bundle.supposed
    before, least = (misfit(evidence, one) for one in (rig, every.supposed))
    fine = fine_m(plan, evidence, rig)
    if len(causes) < _MOST_CAUSES and enough < before and least <= _FAR_TIMES * fine:
        causes += Search(plan, every, least).causes()
    if not causes and before > fine:
        return Diagnosis(remark=_remark(plan, before, least))
    return Diagnosis(tuple(causes))


def reachable(plan: Scanner, evidence: Evidence) -> tuple[Adjusted, list[Cause]]:
    """Return what changing everything explains, and the gross faults mended first."""
    rig, causes = Supposed.of(plan), list[Cause]()
    fine = fine_m(plan, evidence, rig)
    every = _everything(evidence, rig)
    while len(causes) < _MOST_CAUSES:
        if misfit(evidence, every.supposed) <= _FAR_TIMES * fine:
            break
        found = gross(evidence, rig)
        if found.left_m[1] > _MUST_LEAVE * misfit(evidence, rig):
            break
        causes.append((found,))
        rig = found.after
        every = _everything(evidence, rig)
    return every, causes


def _everything(evidence: Evidence, rig: Supposed) -> Adjusted:
    bundle = Bundle(evidence, rig)
    return adjust(bundle, expected_of(bundle, MOUNTED, PLACED))


def _remark(plan: Scanner, before: float, least: float) -> str | None:
    """Say what edges' distances from their rings are, if no change explains them."""
    off = f"the edges are {_MM * before:.3f} mm off their rings (mean)"
    if least > _MUST_LEAVE * before:
        return (
            f"{off}, and with every pose and focal length free still "
            f"{_MM * least:.3f}: they scatter and aren't shifted, so that no device is "
            f"to blame, but light that isn't the projectors' own (interreflection, "
            f"gloss, ambient), noise, or an object that isn't the mesh"
        )
    if plan.calibration is not None and plan.calibration != CalibrationErrors():
        return (
            f"{off}, {_MM * least:.3f} with every pose and focal length free: no "
            f"device is off by more than its calibration leaves, which together "
            f"explains it; `plan reconstruct --captures FOLDER --refine` mends that"
        )
    return None


def fine_m(plan: Scanner, evidence: Evidence, rig: Supposed) -> float:
    """Return up to what mismatch [m] nothing is wrong."""
    centres = np.array([camera.centre for camera in rig.cameras])
    focal = np.array([camera.focal_px for camera in rig.cameras])
    points, _ = places(evidence, rig)
    reach = np.linalg.norm(points - centres[evidence.camera], axis=1)
    noise = evidence.noise_px * reach / focal[evidence.camera]
    known = np.isfinite(noise)
    typical = float(np.median(noise[known])) if known.any() else 0.0
    return max(_FINE_SHARE * plan.limits.check.max_rms_m, _FINE_NOISE * typical)
