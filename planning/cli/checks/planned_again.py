"""`plan verify --replan`: the whole plan again, from the words that asked for it."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from planning.cache.cache import NO_CACHE
from planning.cli.declared.evaluate_declared import as_of_plans, evaluate
from planning.cli.declared.plan_checks import check_options, check_projectors
from planning.cli.declared.plan_declared import rig_command
from planning.cli.plan_command import planned_once
from planning.model.errors import InputError
from planning.model.plan import RigPlan

# Of these more than one plan comes, or none that its own words alone make.
_NOT_ALONE = ("pareto", "take", "watch")
_REFUSED = "command: {}, so it can't be planned again; verify without --replan"


class PlannedAgain:
    """Plans once more what a plan says was asked, when it is first wanted.

    Files that its command names are looked for from the current folder. Nothing of a
    cache is used, and nothing is written that stays.

    Args:
        plan: The plan, as written; its members are known, too.
        mesh: The mesh to plan; None: the one that the command names.
        rig: Likewise the rig, a preset or a file.
        quiet: Whether nothing is told on the way.
    """

    def __init__(
        self, plan: RigPlan, mesh: Path | None, rig: str | None = None, *, quiet: bool
    ) -> None:
        self._plan, self._quiet = plan, quiet
        self._options = _options(plan, mesh, rig)
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
                self._options | written,
                self._plan.document.command[1:],
                NO_CACHE,
                show=False,
            )
            return RigPlan.load(Path(folder) / "plan" / "plan.json")


def _options(plan: RigPlan, mesh: Path | None, rig: str | None) -> dict[str, Any]:
    """Return the options that a plan's command has.

    Raises:
        InputError: If it isn't one that plans once.
    """
    words = plan.document.command
    try:
        if any("\0" in word for word in words):
            raise click.UsageError("its words hold what no command line does")
        if words[:1] != ("plan",):
            raise click.UsageError("no words of a command are recorded")
        stands = words[1:2] == ("evaluate",)
        declared = evaluate if stands else rig_command
        # Nothing but what plans: help would print, and end in 0.
        context = declared.make_context(
            "plan", list(words[1 + stands :]), help_option_names=[]
        )
        options = context.params
        if mesh is not None:
            options |= {"meshes": (str(mesh),), "files": ()}
        options |= {} if rig is None else {"rig_name": rig}
        if stands:
            as_of_plans(options)
        else:
            check_options(options)
            check_projectors(options)
        if any(options[name] for name in _NOT_ALONE):
            raise click.UsageError("its plan is one of several")
        if plan.document.truncated:
            raise click.UsageError("the run was cut, and another isn't cut there")
    except click.ClickException as error:
        raise InputError(_REFUSED.format(error.format_message())) from None
    return options
