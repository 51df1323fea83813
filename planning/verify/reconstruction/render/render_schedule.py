"""Which projectors really fire together, though the plan parts them."""

from planning.model.plan import RigPlan


def on_at_once(plan: RigPlan, truth: RigPlan) -> list[list[int]]:
    """Return for each projector those that are on at the same time, by mistake.

    What the plan itself fires together lights apart, and is rendered one by one.

    Args:
        plan: Whose firing schedule is meant.
        truth: Whose firing schedule is followed.
    """
    names = [projector.id for projector in plan.projectors]
    fired, planned = _fired_with(truth), _fired_with(plan)
    nothing: frozenset[str] = frozenset()
    wrong = {n: fired.get(n, nothing) - planned.get(n, nothing) for n in names}
    return [[k for k, one in enumerate(names) if one in wrong[n]] for n in names]


def _fired_with(plan: RigPlan) -> dict[str, frozenset[str]]:
    """Return which projectors share the group of each, if there is a schedule."""
    groups = (plan.document.get("firing_schedule") or {}).get("groups", ())
    return {name: frozenset(group) - {name} for group in groups for name in group}
