"""The fewest changes that explain what changing everything together explains.

About the bundle adjustment of all poses and optics the sum of squares is a quadratic
form, so that what one device alone, or the object, can explain beside what is expected
of all others is a small linear system; the best are adjusted again. What explains most
is chosen; of what edges can't tell apart all is kept.
"""

import numpy as np

from planning.model.devices.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.arrays import Array

from .adjustment import Adjusted, adjust, expected_of
from .explanations import ROLES, Cause, Change, Explanation, misfit

# What one fault may amount to.
FAULT = CalibrationErrors(0.3, 0.3, 0.1)
# A change is named if it takes away so much of chi squared, and is as good as another
# if it leaves no more than this beyond it; each parameter must earn its place.
_TOLD, _EACH = 16.0, 4.0
# The best few by the quadratic form, which errs by such a share, are adjusted.
_PROMISING, _MOST_ADJUSTED = 2.0, 6
MOST_CAUSES = 3
Good = list[tuple[Change, Adjusted]]


class Search:
    """For the fewest changes that explain what changing everything explains."""

    def __init__(self, every: Adjusted, errors: CalibrationErrors) -> None:
        """Begin with what changing everything explains.

        `errors` is what devices may be off by without being to blame. The object may
        not: its mesh is what the world is named by, and no edge tells where both are.
        """
        self._bundle = bundle = every.bundle
        self._rest = expected_of(bundle, errors)
        self._rest[bundle.columns("objects", 0)] = 0.0
        self._fault = expected_of(bundle, FAULT)
        self._unit = max(1.0, every.scatter)
        self._known: dict[frozenset[Change], Adjusted] = {}
        self._changes = [
            Change(role, (index,), moves)
            for role, moves_of in ROLES.items()
            for index in range(len(getattr(bundle.supposed, role)))
            for moves in moves_of
        ]
        n = len(bundle.evidence)
        slopes = every.slopes(every.z)[:n] / every.expected
        wanted = slopes @ every.x - every.residuals(every.z)[:n]
        self._least = float(np.sum(every.residuals(every.z)[:n] ** 2))
        self._form = slopes.T @ slopes, slopes.T @ wanted, float(wanted @ wanted)

    def causes(
        self, most: int = MOST_CAUSES, enough: float = 0.0
    ) -> tuple[list[Cause], Adjusted]:
        """Return what is to blame, what explains most first, and all adjusted so.

        Each takes more than `enough` [m] off the edges' mean distance from their rings.
        """
        chosen: list[Change] = []
        while len(chosen) < most:
            best, found = self._as_good(chosen)[0]
            if self._adjusted(chosen).cost - found.cost < _TOLD:
                break
            # What this explains better isn't to blame any more.
            chosen = [c for c in chosen if self._worth(c, [*chosen, best])] + [best]
        chosen = [c for c in chosen if self._moves(c, chosen, enough)]
        rig, found = self._bundle.supposed, self._adjusted(chosen)
        stages = [
            rig,
            *(self._adjusted(chosen[: k + 1]).supposed for k in range(len(chosen))),
        ]
        left = [misfit(self._bundle.evidence, one) for one in stages]
        causes: list[Cause] = []
        for k, change in enumerate(chosen):
            good = self._as_good([*chosen[:k], *chosen[k + 1 :]])
            others = [one for one in good if not one[0].repeats(change)]
            causes.append(
                tuple(
                    Explanation(one, rig, by.supposed, (left[k], left[k + 1]))
                    for one, by in [(change, found), *others]
                )
            )
        return causes, found

    def _moves(self, change: Change, chosen: list[Change], enough: float) -> bool:
        """Whether it moves edges by more than sound rigs have [m].

        Squares of independent distances add up; what biased edges feign takes little.
        """
        x = self._adjusted(chosen).x
        undone = x.copy()
        undone[change.columns(self._bundle)] = 0.0
        without, left = (
            misfit(self._bundle.evidence, self._bundle.moved(one))
            for one in (undone, x)
        )
        return without**2 - left**2 > enough**2

    def _worth(self, change: Change, chosen: list[Change]) -> bool:
        others = [one for one in chosen if one != change]
        gain = self._adjusted(others).cost - self._adjusted(chosen).cost
        return gain >= _TOLD

    def _adjusted(self, changes: list[Change]) -> Adjusted:
        key = frozenset(changes)
        if key not in self._known:
            start, _ = self._by_form(changes)
            expected = self._expected(changes)
            self._known[key] = adjust(
                self._bundle, expected, start=start, unit=self._unit
            )
        return self._known[key]

    def _expected(self, changes: list[Change]) -> Array:
        expected = self._rest.copy()
        for change in changes:
            columns = change.columns(self._bundle)
            expected[columns] = self._fault[columns]
        return expected

    def _as_good(self, chosen: list[Change]) -> Good:
        """Return the best further change, and others as good that don't contain it."""
        others = [c for c in self._changes if not any(c.repeats(k) for k in chosen)]
        forms = [self._by_form([*chosen, c])[1] + _EACH * c.size for c in others]
        most = min(forms) + _PROMISING * (min(forms) - self._least) + 2.0 * _TOLD
        most = max(min(forms), min(most, self._by_form(chosen)[1] - 0.5 * _TOLD))
        order = [k for k in np.argsort(forms).tolist() if forms[k] <= most]
        promising = [others[k] for k in order[:_MOST_ADJUSTED]]
        tried: Good = [(c, self._adjusted([*chosen, c])) for c in promising]
        tried.sort(key=lambda one: one[1].cost + _EACH * one[0].size)
        good: Good = []
        for change, adjusted in tried:
            as_good = adjusted.cost <= tried[0][1].cost + _TOLD
            if as_good and not any(change.repeats(other) for other, _ in good):
                good.append((change, adjusted))
        return good

    def _by_form(self, changes: list[Change]) -> tuple[Array, float]:
        """Return changes by the quadratic form about what explains most, their cost."""
        squares, wanted, before = self._form
        expected = self._expected(changes)
        squares = expected[:, None] * squares * expected + np.eye(len(expected))
        z = np.linalg.solve(squares, expected * wanted)
        return expected * z, before - float(expected * wanted @ z)
