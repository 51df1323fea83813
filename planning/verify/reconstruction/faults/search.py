"""The fewest changes that explain what changing everything together explains.

About the bundle adjustment of all poses and optics the sum of squares is a quadratic
form, so that what one device alone, or the object, can explain is a small linear
system; the best are adjusted again with nothing else free. What removes most with the
fewest parameters is chosen; of what edges can't tell apart all is kept.
"""

import numpy as np

from planning.model.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.scanner import Scanner

from .adjustment import Adjusted, adjust, expected_of
from .explanations import ROLES, Cause, Change, Explanation, misfit

# What one fault may amount to.
_FAULT, _FAULT_OF_OBJECT = CalibrationErrors(0.3, 0.3, 0.1), (0.3, 0.1, 0.1)
# An explanation must leave no more than this share of the mismatch; where all devices
# are off by what a calibration leaves, it must cost so much less than that.
_MUST_LEAVE, _SURE = 0.5, 30.0
# It is as good as another if it costs no more than this beyond it, or by this share.
_AS_GOOD, _AS_GOOD_SHARE = 16.0, 0.01
# Edges lie on their rings if they do within this share of the limit on the rms
# distance, or so many times what changing everything leaves.
_FINE_SHARE, _FINE_TIMES = 0.12, 1.25
# Changes whose quadratic form is so many times the least are adjusted, the best few.
_PROMISING, _MOST_ADJUSTED = 10.0, 8
_MOST_CAUSES = 3
Good = list[tuple[Change, Adjusted]]


class Search:
    """For the fewest changes that explain what changing everything explains."""

    def __init__(
        self,
        plan: Scanner,
        every: Adjusted,
        least: float,
        body: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Begin.

        Args:
            plan: With what its calibration leaves of each device.
            every: What changing everything explains.
            least: Mismatch that this leaves [m].
            body: What the object may be off by without being to blame: turn [rad],
                displacement [m], size as a share.
        """
        self._bundle, self._every = every.bundle, every
        enough = _FINE_SHARE * plan.limits.check.max_rms_m
        self._fine = max(enough, _FINE_TIMES * least)
        # What isn't to blame is off by what its calibration leaves, and no more.
        errors = plan.calibration or CalibrationErrors()
        self._rest = expected_of(self._bundle, errors, body)
        self._calibrated = errors != CalibrationErrors()
        self._fault = expected_of(self._bundle, _FAULT, _FAULT_OF_OBJECT)
        self._unit = max(1.0, every.scatter)
        rig = self._bundle.supposed
        self._changes = [
            Change(role, (index,), moves)
            for role, moves_of in ROLES.items()
            for index in range(len(getattr(rig, role)))
            for moves in moves_of
            if role != "objects" or not any(body)
        ]
        self._chosen: list[Change] = []
        self._left_m = [misfit(self._bundle.evidence, rig)]
        self._good: Good = []
        self.found = self._adjusted(self._chosen)
        while len(self._chosen) < _MOST_CAUSES and self._next():
            pass

    def _next(self) -> bool:
        """Choose one change more; whether one was called for."""
        good = self._as_good(self._chosen)
        change, found = good[0]
        before, left = self._left_m[-1], self._left(found)
        if self._calibrated:
            named = self.found.cost - found.cost > _SURE
        else:
            named = before > self._fine and left < _MUST_LEAVE * before
        if named:
            self._chosen.append(change)
            self._left_m.append(left)
            self._good, self.found = good, found
        return named

    def causes(self) -> list[Cause]:
        """Return one after the other what leaves least with those before it."""
        causes: list[Cause] = []
        rig, every = self._bundle.supposed, self._chosen
        for k, change in enumerate(every):
            good = self._good
            if k < len(every) - 1:
                good = self._as_good([*every[:k], *every[k + 1 :]])
            good = [one for one in good if not one[0].repeats(change)]
            left = self._left_m[k], self._left_m[k + 1]
            causes.append(
                tuple(
                    Explanation(one, rig, by.supposed, left)
                    for one, by in [(change, self.found), *good]
                )
            )
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
