"""Which changes of the rig or the object the measured edges ask for.

One bundle adjustment of all poses and optics says what everything together can explain.
About it the sum of squares is a quadratic form, so that what one device alone, or the
object, can explain is a small linear system; the best are adjusted again with nothing
else free. What removes most with the fewest parameters is the diagnosis. It is an
inference from images and calibration alone: "as if", not "is".
"""

from dataclasses import dataclass

import numpy as np

from planning.model.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.scanner import Scanner

from .adjustment import Adjusted, adjust, expected_of
from .bundle import Bundle
from .explanations import (
    ROLES,
    Change,
    Explanation,
    misfit,
)
from .gross import gross
from .supposed import Evidence, Supposed, places

# What a rig that isn't as planned may be off by, device by device, and its object
# [rad], [m], shares; expected of each alike where no calibration is stated.
MOUNTED = CalibrationErrors(5e-3, 5e-3, 5e-3)
PLACED = (5e-3, 5e-3, 5e-3)
# What one fault may amount to.
_FAULT, _FAULT_OF_OBJECT = CalibrationErrors(0.3, 0.3, 0.1), (0.3, 0.1, 0.1)
# An explanation must leave no more than this share of the mismatch; where all devices
# are off by what a calibration leaves, it must cost so much less than that.
_MUST_LEAVE, _SURE = 0.5, 50.0
# It is as good as another if it costs no more than this beyond it, or by this share.
_AS_GOOD, _AS_GOOD_SHARE = 16.0, 0.01
# Edges lie on their rings if they do within this share of the limit on the rms
# distance, or so many standard deviations of their own noise; once everything was
# adjusted, so many times what that leaves.
_FINE_SHARE, _FINE_NOISE, _FINE_TIMES = 0.12, 2.0, 1.25
# Beyond so many times that, all that is near together can't explain it.
_FAR_TIMES = 4.0
_MOST_CAUSES = 3
_MM = 1e3
# Changes whose quadratic form is so many times the least are adjusted, the best few.
_PROMISING, _MOST_ADJUSTED = 10.0, 8
# Equally good explanations of one thing that is wrong, the simplest first.
Cause = tuple[Explanation, ...]
Good = list[tuple[Change, Adjusted]]


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
    if len(evidence) == 0:
        return Diagnosis()
    rig = Supposed.of(plan)
    fine = fine_m(plan, evidence, rig)
    causes: list[Cause] = []
    enough = _FINE_SHARE * plan.limits.check.max_rms_m
    while len(causes) < _MOST_CAUSES and (before := misfit(evidence, rig)) > enough:
        bundle = Bundle(evidence, rig)
        every = adjust(bundle, expected_of(bundle, MOUNTED, PLACED))
        least = misfit(evidence, every.supposed)
        if least <= _FAR_TIMES * fine:
            more = _Search(plan, every, least).causes()
            told = causes or more or before <= fine
            return Diagnosis(
                (*causes, *more), None if told else _remark(plan, before, least)
            )
        found = gross(evidence, rig)
        if found.left_m[1] > _MUST_LEAVE * before:
            remark = None if causes else _remark(plan, before, least)
            return Diagnosis(tuple(causes), remark)
        causes.append((found,))
        rig = found.after
    return Diagnosis(tuple(causes))


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


class _Search:
    """For the fewest changes that explain what changing everything explains."""

    def __init__(self, plan: Scanner, every: Adjusted, least: float) -> None:
        self._bundle, self._every = every.bundle, every
        enough = _FINE_SHARE * plan.limits.check.max_rms_m
        self._fine = max(enough, _FINE_TIMES * least)
        # What isn't to blame is off by what its calibration leaves, and no more.
        self._rest = expected_of(
            self._bundle, plan.calibration or CalibrationErrors(), (0.0, 0.0, 0.0)
        )
        self._fault = expected_of(self._bundle, _FAULT, _FAULT_OF_OBJECT)
        self._unit = max(1.0, float(1.4826 * np.nanmedian(np.abs(every.offsets))))
        rig = self._bundle.supposed
        self._changes = [
            Change(role, (index,), moves)
            for role, moves_of in ROLES.items()
            for index in range(len(getattr(rig, role)))
            for moves in moves_of
        ]

    def causes(self) -> list[Cause]:
        """Return one after the other what leaves least with those before it."""
        chosen: list[Change] = []
        last: Good = []
        now = self._adjusted(chosen)
        left = [misfit(self._bundle.evidence, self._bundle.supposed)]
        while len(chosen) < _MOST_CAUSES:
            good = self._as_good(chosen)
            found = good[0][1]
            left.append(self._left(found))
            if self._rest.any():
                named = now.cost - found.cost > _SURE
            else:
                named = left[-2] > self._fine and left[-1] < _MUST_LEAVE * left[-2]
            if not named:
                break
            chosen.append(good[0][0])
            last, now = good, found
        causes: list[Cause] = []
        for k, change in enumerate(chosen):
            others = [*chosen[:k], *chosen[k + 1 :]]
            good = last if k == len(chosen) - 1 else self._as_good(others)
            good = [one for one in good if not one[0].repeats(change)]
            causes.append(self._cause(change, now, good, (left[k], left[k + 1])))
        return causes

    def _left(self, adjusted: Adjusted) -> float:
        return misfit(self._bundle.evidence, adjusted.supposed)

    def _adjusted(self, changes: list[Change]) -> Adjusted:
        expected = self._expected(changes)
        start, _ = self._by_form(changes)
        return adjust(self._bundle, expected, start=start, unit=self._unit)

    def _expected(self, changes: list[Change]) -> Array:
        expected = self._rest.copy()
        for change in changes:
            columns = change.columns(self._bundle)
            expected[columns] = self._fault[columns]
        return expected

    def _as_good(self, chosen: list[Change]) -> Good:
        """Return the simplest of the best further changes, and others as good.

        None that contains another one.
        """
        others = [c for c in self._changes if not any(c.repeats(k) for k in chosen)]
        forms = [self._by_form([*chosen, change])[1] for change in others]
        most = _PROMISING * min(forms) + _AS_GOOD
        order = [k for k in np.argsort(forms).tolist() if forms[k] <= most]
        tried: Good = [
            (others[k], self._adjusted([*chosen, others[k]]))
            for k in order[:_MOST_ADJUSTED]
        ]
        least = min(adjusted.cost for _, adjusted in tried)
        most = least + max(_AS_GOOD, _AS_GOOD_SHARE * least)
        tried = [one for one in tried if one[1].cost <= most]
        tried.sort(key=lambda one: (one[0].size, one[1].cost))
        simplest: Good = []
        for change, adjusted in tried:
            if not any(change.repeats(other) for other, _ in simplest):
                simplest.append((change, adjusted))
        return simplest

    def _by_form(self, changes: list[Change]) -> tuple[Array, float]:
        """Return changes by the quadratic form about what explains most, their cost."""
        slopes, off = self._every.weighed
        expected = self._expected(changes)
        free = expected > 0.0
        wanted = slopes @ self._every.x - off
        scaled = np.vstack([(slopes * expected)[:, free], np.eye(int(free.sum()))])
        wanted = np.concatenate([wanted, np.zeros(int(free.sum()))])
        z = np.linalg.lstsq(scaled, wanted, rcond=None)[0]
        x = np.zeros(len(expected))
        x[free] = expected[free] * z
        return x, float(np.sum((wanted - scaled @ z) ** 2))

    def _cause(
        self, change: Change, adjusted: Adjusted, good: Good, left: tuple[float, float]
    ) -> Cause:
        """Return a change with all that was found, and others as good in its place."""
        rig = self._bundle.supposed
        every = [(change, adjusted), *good]
        return tuple(Explanation(one, rig, by.supposed, left) for one, by in every)
