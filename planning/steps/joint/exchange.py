"""Devices of both kinds under exchange, until nothing is lacking and margins are wide.

What is lacking of the quotas counts first, then the slack that as many samples have as
must be measured (`slack`). A device goes for another one on offer of its model; while
samples are lacking also a projector and a camera at once, for what a pair measures
neither of them needs to gain alone.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from planning.proofs.quotas import Quotas

from .slack import slack_at_share
from .tables import JointTables

_Slack = NDArray[np.float32]
# What is lacking, then minus the slack.
Score = tuple[int, float]
# A gain of slack that is worth an exchange; pairs that are taken out, and of each those
# that are looked at in full in their place.
_GAIN, _TRIED, _PAIRS = 2e-3, 9, 8


@dataclass(eq=False)
class Exchange:
    """Projectors and cameras by their places in tables, and what they must do."""

    tables: JointTables
    lit: Quotas
    measured: Quotas
    projectors: list[int]
    cameras: list[int]
    score: Score = field(init=False)

    def __post_init__(self) -> None:
        self.score = self._of(self.projectors, self.cameras)

    def run(self) -> None:
        """Exchange devices as long as that is worth it."""
        while self._one() or (self.score[0] > 0 and self._two()):
            self.tables.scene.check_cancelled()

    def _of(self, projectors: Sequence[int], cameras: Sequence[int]) -> Score:
        lit = np.any(self.tables.lit[:, list(projectors)], axis=1)
        return self._scored(lit, self.tables.best(projectors, cameras))

    def _scored(self, lit: NDArray[np.bool_], best: _Slack) -> Score:
        lacking = self.lit.lacking(lit) + self.measured.lacking(np.isfinite(best))
        return lacking, -slack_at_share(best, self.measured.total)

    def _gains(self, score: Score) -> bool:
        if score[0] != self.score[0]:
            return score[0] < self.score[0]
        return score[0] == 0 and score[1] < self.score[1] - _GAIN

    def _one(self) -> bool:
        """Take the best exchange of one device; whether there is any."""
        found = min(
            (*self._projectors(), *self._cameras()),
            key=lambda one: one[0],
            default=None,
        )
        if found is None or not self._gains(found[0]):
            return False
        self.score, self.projectors, self.cameras = found
        return True

    def _projectors(self) -> Iterator[tuple[Score, list[int], list[int]]]:
        tables = self.tables
        with_these = tables.slack[:, self.cameras].max(axis=1)
        for others, old in _without_each(self.projectors):
            lit = np.any(tables.lit[:, others], axis=1)
            best = tables.best(others, self.cameras)
            for p in self._alike(tables.projectors, old, self.projectors):
                score = self._scored(
                    lit | tables.lit[:, p], np.maximum(best, with_these[:, p])
                )
                yield score, [*others, p], self.cameras

    def _cameras(self) -> Iterator[tuple[Score, list[int], list[int]]]:
        tables = self.tables
        lit = np.any(tables.lit[:, self.projectors], axis=1)
        with_these = tables.slack[:, :, self.projectors].max(axis=2)
        for others, old in _without_each(self.cameras):
            best = tables.best(self.projectors, others)
            for c in self._alike(tables.cameras, old, self.cameras):
                score = self._scored(lit, np.maximum(best, with_these[:, c]))
                yield score, self.projectors, [*others, c]

    def _two(self) -> bool:
        """Take the best exchange of a projector and a camera; whether there is any."""
        found: tuple[Score, list[int], list[int]] | None = None
        places = product(_without_each(self.projectors), _without_each(self.cameras))
        # Those without which least is lost go first.
        order = sorted(places, key=lambda two: self._of(two[0][0], two[1][0]))
        for (lights, p), (views, c) in order[:_TRIED]:
            for q, d in self._promising(lights, p, views, c):
                score = self._of([*lights, q], [*views, d])
                if found is None or score < found[0]:
                    found = score, [*lights, q], [*views, d]
        if found is None or not self._gains(found[0]):
            return False
        self.score, self.projectors, self.cameras = found
        return True

    def _promising(
        self, lights: list[int], p: int, views: list[int], c: int
    ) -> Iterator[tuple[int, int]]:
        """Yield pairs in the place of p and c that light and measure most, a few."""
        tables = self.tables
        offered = self._alike(tables.projectors, p, self.projectors)
        seeing = self._alike(tables.cameras, c, self.cameras)
        if not (offered and seeing):
            return
        present = np.any(tables.lit[:, lights], axis=1)
        lit = (present[:, None] | tables.lit[:, offered]).sum(axis=0)
        short = np.maximum(self.lit.total - lit, 0)
        base = np.isfinite(tables.best(lights, views))
        with_views = base[:, None] | np.isfinite(
            tables.slack[:, views][:, :, offered].max(axis=1, initial=-np.inf)
        )
        lack = np.empty((len(seeing), len(offered)))
        for row, d in enumerate(seeing):
            own = np.isfinite(
                tables.slack[:, d][:, lights].max(axis=1, initial=-np.inf)
            )
            both = with_views | np.isfinite(tables.slack[:, d][:, offered])
            done = (both | own[:, None]).sum(axis=0)
            lack[row] = np.maximum(self.measured.total - done, 0) + short
        for place in np.argsort(lack, axis=None, kind="stable")[:_PAIRS]:
            row, column = divmod(int(place), len(offered))
            yield offered[column], seeing[row]

    def _alike(
        self, devices: Sequence[object], old: int, taken: Sequence[int]
    ) -> list[int]:
        """Places of devices of the model of an old one that aren't taken."""
        model = getattr(devices[old], "model", "")
        return [
            k
            for k, one in enumerate(devices)
            if k not in taken and getattr(one, "model", "") == model
        ]


def _without_each(places: list[int]) -> Iterator[tuple[list[int], int]]:
    """Yield the others, and the one that is left out."""
    for k, place in enumerate(places):
        yield places[:k] + places[k + 1 :], place
