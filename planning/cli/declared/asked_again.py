"""What a plan's own command asked for, read once more."""

from pathlib import Path
from typing import Any

import click

from planning.model.errors import InputError
from planning.model.plan import RigPlan

from .evaluate_declared import as_of_plans, evaluate
from .plan_checks import check_options, check_projectors
from .plan_declared import rig_command

# Of these more than one plan comes, or none that its own words alone make.
_NOT_ALONE = ("pareto", "take", "watch")
_REFUSED = "command: {}, so it can't be planned again; verify without --replan"


def asked_again(
    plan: RigPlan, mesh: Path | None = None, rig: str | None = None
) -> dict[str, Any]:
    """Return the options that a plan's command has.

    Args:
        plan: The plan, as written.
        mesh: The mesh to plan; None: the one that the command names.
        rig: Likewise the rig, a preset or a file.

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
            if any(options[name] for name in _NOT_ALONE):
                raise click.UsageError("its plan is one of several")
            check_projectors(options)
        if plan.document.truncated:
            raise click.UsageError("the run was cut, and another isn't cut there")
    except click.ClickException as error:
        raise InputError(_REFUSED.format(error.format_message())) from None
    return options
