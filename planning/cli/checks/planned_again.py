"""`plan verify --replan`: the whole plan again, from the words that asked for it."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from planning.cache.cache import NO_CACHE
from planning.cli.plans.plan_command import planned_once
from planning.model.plan import RigPlan


class PlannedAgain:
    """Plans once more what a plan says was asked, when it is first wanted.

    Files that its command names are looked for from the current folder. Nothing of a
    cache is used, and nothing is written that stays.

    Args:
        plan: The plan, as written; its members are known, too.
        options: What its command asked for, from `asked_again`.
        quiet: Whether nothing is told on the way.
    """

    def __init__(
        self, plan: RigPlan, options: Mapping[str, Any], *, quiet: bool
    ) -> None:
        self._plan, self._options, self._quiet = plan, options, quiet
        self._made: RigPlan | None = None

    def __call__(self, plan: RigPlan, threads: int) -> Mapping[str, Any]:
        """Return the document of the plan, or of one of its members, made again."""
        if self._made is None:
            self._made = self._again(threads)
        if plan is self._plan:
            return self._made.to_document()
        place = next(i for i, one in enumerate(self._plan.members) if one is plan)
        if place < len(self._made.members):
            return self._made.members[place].to_document()
        return {}

    def _again(self, threads: int) -> RigPlan:
        with tempfile.TemporaryDirectory() as folder:
            written = {
                "time_limit": None,
                "output": Path(folder) / "plan",
                "threads": threads,
                "quiet": self._quiet,
                "no_patterns": True,
                "no_report": True,
            }
            planned_once(
                {**self._options, **written},
                self._plan.document.command[1:],
                NO_CACHE,
                show=False,
            )
            return RigPlan.load(Path(folder) / "plan" / "plan.json")
