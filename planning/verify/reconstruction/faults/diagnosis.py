"""Which changes of the rig or the object the measured edges ask for.

It is an inference from images and calibration alone: "as if", not "is".
"""

from dataclasses import dataclass

from planning.model.devices.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.scanner import Scanner

from .adjustment import Adjusted, adjust, expected_of
from .bundle import Bundle
from .explanations import Cause, misfit
from .gross import MUST_LEAVE, gross
from .search import MOST_CAUSES, Search
from .supposed import Evidence, Supposed

# What anything of a rig may be off by [rad], [m], shares, [px].
MOUNTED = CalibrationErrors(8e-3, 8e-3, 5e-3, 5.0)
# Where no calibration is stated: as planned, but for what biased edges feign.
AS_PLANNED = CalibrationErrors(3e-5, 3e-5, 3e-5)
# Edges lie on their rings within this share of the limit on the rms distance.
_FINE_SHARE = 0.12
# Edges scatter from so many deviations of their noise on.
_SCATTERED = 1.5
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
    before, least = (
        misfit(evidence, one) for one in (every.bundle.supposed, every.supposed)
    )
    shifted = least <= MUST_LEAVE * before or every.scatter < _SCATTERED
    if enough < before and shifted:
        search = Search(every, stated(plan, AS_PLANNED))
        causes += search.causes(MOST_CAUSES - len(causes), enough)[0]
    if not causes:
        return Diagnosis(remark=_remark(plan, before, least))
    return Diagnosis(tuple(causes))


def stated(plan: Scanner, otherwise: CalibrationErrors) -> CalibrationErrors:
    """Return what a plan says that its calibration leaves, or else something else."""
    errors = plan.calibration or CalibrationErrors()
    return otherwise if errors == CalibrationErrors() else errors


def reachable(plan: Scanner, evidence: Evidence) -> tuple[Adjusted, list[Cause]]:
    """Return what changing everything explains, and the gross faults mended first."""
    rig, causes = Supposed.of(plan), list[Cause]()
    while True:
        bundle = Bundle(evidence, rig)
        every = adjust(bundle, expected_of(bundle, MOUNTED))
        near = misfit(evidence, every.supposed) <= plan.limits.check.max_rms_m
        if near or len(causes) == MOST_CAUSES:
            return every, causes
        found = gross(evidence, rig)
        if found.left_m[1] > MUST_LEAVE * found.left_m[0]:
            return every, causes
        causes.append((found,))
        rig = found.after


def _remark(plan: Scanner, before: float, least: float) -> str | None:
    """Say what edges' distances from their rings are, if no change explains them."""
    off = f"the edges are {_MM * before:.3f} mm off their rings (mean)"
    if least > MUST_LEAVE * before:
        return (
            f"{off}, and with every pose and focal length free still "
            f"{_MM * least:.3f}: they scatter and aren't shifted, so that no device is "
            f"to blame, but light that isn't the projectors' own (interreflection, "
            f"gloss, ambient), noise, or an object that isn't the mesh"
        )
    if stated(plan, AS_PLANNED) == AS_PLANNED:
        return None
    return (
        f"{off}, {_MM * least:.3f} with every pose and focal length free: no "
        f"device is off by more than its calibration leaves, which together "
        f"explains it; `plan reconstruct --captures FOLDER --refine` mends that"
    )
