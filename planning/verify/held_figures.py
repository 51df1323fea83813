"""How closely figures of a plan are held: to the last digit, or within tolerances."""

from collections.abc import Callable, Mapping
from typing import Any

from planning.model.document.check_records import ReconstructionRecord
from planning.model.document.made_with import MadeWith
from planning.model.plan import RigPlan
from planning.verify.again_claims import compare_again
from planning.verify.audit.figure_claims import compare_exactly, compare_figures

from .no_claims import NO_CLAIM, claims_alone

EXACTLY = "to the last digit"
WHOLLY = f"{EXACTLY}, of the whole plan made again from its request"
# Computes parts of a plan's document again by the code that made them, or all of it, on
# so many threads; or says why that can't be.
Again = Callable[[RigPlan, int], Mapping[str, Any] | str]


def hold_figures(
    plan: RigPlan, fresh: ReconstructionRecord, seed: int
) -> tuple[list[str], str]:
    """Return which recorded figures a check again gives otherwise, and how it was held.

    To the last digit where nothing of what made the plan is different, and the seed of
    the check again is the plan's.
    """
    recorded = plan.document.reconstruction
    if recorded is None:
        return [], ""
    false = compare_figures(recorded, fresh)
    if apart := _made_apart(plan, seed):
        return false, f"within tolerances: {apart}"
    return false + compare_exactly(recorded, fresh), EXACTLY


def hold_claims(
    plan: RigPlan, again: Again | None, threads: int
) -> tuple[tuple[str, ...], str]:
    """Return which claims don't come out again as written, and how they were held.

    The audit has held them within what its own samples tell.
    """
    why = _made_apart(plan, plan.document.seed)
    if again is None:
        why = why or "they weren't computed again by the code that made them"
    if again is None or why:
        return (), f"within tolerances: {why}"
    made = again(plan, threads)
    if isinstance(made, str):
        return (), f"within tolerances: {made}"
    document = plan.to_document()
    if whole := document.keys() - NO_CLAIM <= made.keys():
        document, made = claims_alone(document), claims_alone(made)
    false = compare_again(document, made, whole=whole)
    if plan.document.request is None:
        false += ("request: is missing, and what made this plan always writes it",)
    return false, WHOLLY if whole else EXACTLY


def _made_apart(plan: RigPlan, seed: int) -> str:
    """Why the check needn't give the same figures again; "": nothing is different."""
    if seed != plan.document.seed:
        return f"made with seed {plan.document.seed}, here {seed}"
    made = plan.document.made_with
    if made is None:
        return "the plan doesn't say what it was made with"
    differs = made.differs(MadeWith.here())
    return f"made with {differs}" if differs else ""
