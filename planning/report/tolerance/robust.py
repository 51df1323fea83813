"""Plans that enough drawn rigs meet: requirements grow until a quantile holds.

A plan is made for what is asked. Then rigs are drawn (`drawn_rigs`), and where too few
meet it, what they miss is asked for tighter, by as much as the quantile of these rigs
is short: the required shares by the difference, the accuracy by the ratio. The plan is
made again, in counted rounds. Enough meet it when fewer would be likely (1 - 5 %) only
if less than the quantile of all rigs did.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from scipy.stats import binom

from planning.model.calibration_errors import PERFECT, Robust
from planning.model.document.coverage_records import RobustRecord
from planning.model.errors import InfeasibleLimitsError
from planning.model.plan import InterruptedPlanError, RigPlan
from planning.model.progress import TIME_IS_UP, Stopwatch
from planning.model.requirements import Requirements
from planning.report.partial_plan import PartialPlan, PlanRequest
from planning.rig.wishes import Wishes

from .asked import Asked, Figures
from .built_case import BuiltCase
from .drawn_rigs import PLANNING
from .studies import Question
from .tolerance import draw

Keep = Callable[[RigPlan], None]
Planned = Callable[[PlanRequest, Stopwatch, Keep | None], tuple[RigPlan, PartialPlan]]
# Rigs that a plan is held against: fewer tell a quantile too roughly, and what is asked
# too tight costs cameras.
_RIGS = 400
# How unlikely it must be that as many rigs meet what less than the quantile meets.
_DOUBT = 0.05
_ROUNDS = 5
# What is asked beyond what the drawn rigs lack: of a share, and of the accuracy.
_SHARE_SPARE, _SIGMA_SPARE = 0.0005, 0.005
# No share that is asked for is larger.
_LARGEST = 0.999


@dataclass(frozen=True, eq=False)
class _Round:
    """A plan and how its drawn rigs fared."""

    plan: RigPlan
    partial: PartialPlan
    rigs: tuple[Figures, ...]
    n_met: int


def least_met(quantile: float, n: int) -> int:
    """Return how many of n rigs must meet what is asked.

    The least k with P(K >= k) <= 5 % for K of n rigs each of which meets it with the
    probability `quantile`; n at most.
    """
    return min(int(binom.ppf(1.0 - _DOUBT, n, quantile)) + 1, n)


def robustly(planned: Planned) -> Planned:
    """Return what plans so that enough rigs meet it, where that is asked."""

    def made(
        request: PlanRequest, clock: Stopwatch, keep: Keep | None
    ) -> tuple[RigPlan, PartialPlan]:
        plan, partial = planned(request, clock, keep)
        if request.wishes.robust is None or plan.document.truncated:
            return plan, partial
        latest, asked = (plan, partial), plan.requirements
        rounds: list[_Round] = []
        try:
            while True:
                rounds.append(_drawn(*latest, _robust(request, asked), clock))
                wishes = _tightened(rounds[-1], request.wishes, asked)
                if wishes is None or len(rounds) > _ROUNDS:
                    break
                request = replace(request, wishes=wishes)
                latest = planned(request, clock, keep)
                if latest[0].document.truncated:
                    # The one before is whole, and better known.
                    return _cut(rounds[-1].plan), rounds[-1].partial
        except InfeasibleLimitsError as error:
            clock.say(f"  nothing tighter can be planned: {error}")
        except KeyboardInterrupt:
            raise InterruptedPlanError(_cut(latest[0])) from None
        except TIME_IS_UP:
            clock.extend()
            return _cut(latest[0]), latest[1]
        return _recorded(rounds, _robust(request, asked))

    return made


def _robust(request: PlanRequest, asked: Requirements) -> Robust:
    return Robust(
        request.wishes.robust or 0.0,
        request.rig.table.mounting.bounds(),
        asked.dominant_coverage,
        asked.coverage,
        asked.region_coverage,
        asked.triangulation.max_sigma_m,
    )


def _cut(plan: RigPlan) -> RigPlan:
    return RigPlan(plan.document.changed(truncated=True), plan.surface)


def _with(plan: RigPlan, robust: Robust) -> RigPlan:
    requirements = replace(plan.requirements, robust=robust)
    return RigPlan(plan.document.changed(requirements=requirements), plan.surface)


def _drawn(
    plan: RigPlan, partial: PartialPlan, robust: Robust, clock: Stopwatch
) -> _Round:
    """Hold drawn rigs against what is asked."""
    plan, threads = _with(plan, robust), partial.request.threads
    errors = plan.requirements.triangulation.calibration or PERFECT
    question = Question("", robust.mounting, errors, plan.document.seed)
    asked = Asked.of(plan.requirements)
    with clock.stage("robust", "rigs that aren't built exactly as planned"):
        case = BuiltCase.of(plan, threads=threads).shared()
        rigs = draw(case, question, range(_RIGS), threads=threads, stream=PLANNING)
        n_met = sum(not asked.missed(rig) for rig in rigs)
        clock.say(f"  {n_met} of {len(rigs)} drawn rigs meet what is asked")
    return _Round(plan, partial, tuple(rigs), n_met)


def _tightened(drawn: _Round, wishes: Wishes, asked: Requirements) -> Wishes | None:
    """Return wishes for what too many rigs miss; None: enough meet it, or it is in
    vain.
    """  # noqa: D205 - as short as it gets
    spare = _RIGS - least_met(wishes.robust or 0.0, _RIGS)
    if _RIGS - drawn.n_met <= spare:
        return None
    goals, required = Asked.of(drawn.plan.requirements), drawn.plan.requirements
    short = _short(drawn.rigs, goals, spare)
    changes: dict[str, float] = {}
    for name, key, now in (
        ("lit", "dominant_coverage", required.dominant_coverage),
        ("coverage", "coverage", required.coverage),
        ("worst_region", "region_coverage", required.region_coverage),
    ):
        if name in short:
            lacking = getattr(goals, name) - short[name] + _SHARE_SPARE
            changes[key] = min(now + lacking, _LARGEST)
    sigma, rms = required.triangulation.max_sigma_m, short.get("rms_m")
    if rms is not None and sigma is not None and goals.rms_m is not None:
        changes["accuracy_mm"] = 1e3 * sigma * goals.rms_m / rms * (1.0 - _SIGMA_SPARE)
    return replace(wishes, **changes) if changes else None


def _short(rigs: Sequence[Figures], asked: Asked, spare: int) -> dict[str, float]:
    """Return of each figure that more than so many rigs miss what all but these reach.

    Several figures share what is to spare: each may be missed by other rigs.
    """
    missed = [name for rig in rigs for name in asked.missed(rig)]
    names = list(dict.fromkeys(missed))
    each = spare // max(len(names), 1)
    found: dict[str, float] = {}
    for name in names:
        if missed.count(name) <= each:
            continue
        values = sorted(getattr(rig, name) or 0.0 for rig in rigs)
        found[name] = values[-1 - each] if name == "rms_m" else values[each]
    return found


def _recorded(rounds: Sequence[_Round], robust: Robust) -> tuple[RigPlan, PartialPlan]:
    """The plan whose rigs fare best, with what it costs."""
    first = rounds[0]
    best = max(rounds, key=lambda one: one.n_met)
    record = RobustRecord(
        n_drawn=_RIGS,
        n_met=best.n_met,
        least=least_met(robust.quantile, _RIGS),
        rounds=rounds.index(best),
        n_projectors_without=len(first.plan.projectors),
        n_cameras_without=len(first.plan.cameras),
        n_met_without=first.n_met,
    )
    document = best.plan.document.changed(robust=record)
    return RigPlan(document, best.plan.surface), best.partial
