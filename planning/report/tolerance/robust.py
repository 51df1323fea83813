"""Plans that enough drawn rigs meet, with what that takes.

A plan is made for what is asked. Then rigs are drawn (`drawn_rigs`), and where too few
meet it, what they miss is mended and other rigs are drawn, in counted rounds:

- Errors, and what cameras measure: cameras are exchanged or added (`surer_cameras`)
  until the quantile of errors that first order predicts is below the accuracy, by as
  much as drawn ones exceed the prediction of the plan before.
- Errors that so many more cameras would take that it is the projectors' own that decide
  (cameras don't average them): one projector more, and the plan is made again.
- What projectors light, and single regions: these shares are required by the difference
  tighter, and the plan is made again.

Enough meet it when fewer would be likely (1 - 5 %) only if less than the quantile of
all rigs did.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from planning.cameras.surer_cameras import Aim
from planning.model.devices.calibration_errors import AS_PLANNED, PERFECT, Robust
from planning.model.document.coverage_records import RobustRecord
from planning.model.errors import InfeasibleLimitsError
from planning.model.plan import InterruptedPlanError, RigPlan
from planning.model.progress import TIME_IS_UP, Stopwatch
from planning.model.requirements import Requirements
from planning.proofs.candidate_certificate import larger
from planning.report.assemble import as_truncated, write_plan
from planning.report.entries.request_entry import signed
from planning.report.partial_plan import PartialPlan, PlanRequest
from planning.rig.wishes import Wishes

from .asked import FIGURES, Asked, Figures
from .built_case import BuiltCase
from .drawn_rigs import PLANNING
from .studies import Question
from .surer_plan import surer
from .tolerance import draw

Keep = Callable[[RigPlan], None]
Planned = Callable[[PlanRequest, Stopwatch, Keep | None], tuple[RigPlan, PartialPlan]]
# Rigs that a plan is held against: fewer tell a quantile too roughly, and what is asked
# too tight costs cameras. Where devices stand elsewhere all that is seen is looked at
# anew in each, which takes ten times as long.
_RIGS, _MOUNTED_RIGS = 1200, 400
# How unlikely it must be that as many rigs meet what less than the quantile meets.
_DOUBT = 0.05
_ROUNDS = 5
# Times as many cameras, beyond which a projector more is planned instead.
_MANY = 2.0
# What is asked beyond what drawn rigs lack: of a share, and of the accuracy where
# points miss tau.
_SHARE_SPARE, _TAU_SPARE = 0.0005, 0.05
# No share that is asked for is larger.
_LARGEST = 0.999


@dataclass(frozen=True, eq=False)
class _Round:
    """A plan and how its drawn rigs fared."""

    plan: RigPlan
    partial: PartialPlan
    rigs: tuple[Figures, ...]
    n_met: int
    missed_by: dict[str, int]

    def but(self, n: int, name: str) -> float:
        """Return what all but the worst n rigs reach of a figure."""
        values = sorted(getattr(rig, name) or 0.0 for rig in self.rigs)
        return values[-1 - n] if name == "rms_m" else values[n]


def least_met(quantile: float, n: int) -> int:
    """Return how many of n rigs must meet what is asked.

    The least k with P(K >= k) <= 5 % for K of n rigs each of which meets it with the
    probability `quantile`; n at most.
    """
    # Takes a second to load, which only plans that ask for drawn rigs need.
    from scipy.stats import binom

    return min(int(binom.ppf(1.0 - _DOUBT, n, quantile)) + 1, n)


def robustly(planned: Planned) -> Planned:
    """Return what plans so that enough rigs meet it, where that is asked."""

    def made(
        request: PlanRequest, clock: Stopwatch, keep: Keep | None
    ) -> tuple[RigPlan, PartialPlan]:
        plan, partial = planned(request, clock, keep)
        quantile = request.wishes.robust
        if quantile is None or plan.document.truncated:
            return plan, partial
        if keep is not None:
            # What there is if the process ends while rigs are drawn.
            keep(as_truncated(plan))
        robust = _robust(request, plan.requirements)
        rms = Asked.of(plan.requirements).rms_m
        n = _RIGS if robust.mounting == AS_PLANNED else _MOUNTED_RIGS
        # Rigs that vary as predicted leave no more than this to chance.
        latest, aim = (plan, partial), Aim(least_met(quantile, n) / n, rms)
        rounds: list[_Round] = []
        try:
            while True:
                rounds.append(_drawn(*latest, robust, clock, len(rounds) * n, n))
                short = _short(rounds[-1], quantile)
                if not short or len(rounds) > _ROUNDS:
                    break
                asked = request
                aim = _aimed(aim, short, rounds[-1])
                wishes = _tightened(rounds[-1], short, request.wishes)
                if wishes != request.wishes:
                    stated = request.stated or request.wishes
                    request, more = (
                        replace(request, wishes=wishes, stated=stated),
                        None,
                    )
                else:
                    many = _many(request, rounds)
                    more = surer(latest[1], replace(aim, most=many), clock)
                    if many and (more is None or len(more.cameras) >= many):
                        clock.say("  the projectors' own errors decide: one more")
                        one_more = 1 + len(rounds[0].plan.projectors)
                        request = replace(request, least_projectors=one_more)
                if request is not asked:
                    latest = planned(request, clock, keep)
                    if latest[0].document.truncated:
                        # The one before is whole, and better known.
                        return as_truncated(rounds[-1].plan), rounds[-1].partial
                    # Of its own rigs nothing is known.
                    aim = replace(aim, drawn_m=None)
                    more = surer(latest[1], aim, clock)
                if more is not None:
                    latest = write_plan(more, clock), more
                elif request is asked:
                    break
        except InfeasibleLimitsError as error:
            clock.say(f"  nothing tighter can be planned: {error}")
        except KeyboardInterrupt:
            raise InterruptedPlanError(as_truncated(latest[0])) from None
        except TIME_IS_UP:
            clock.extend()
            return as_truncated(latest[0]), latest[1]
        return _recorded(rounds, robust)

    return made


def _many(request: PlanRequest, rounds: Sequence[_Round]) -> int | None:
    """So many cameras, or none that help: a projector more is tried; None: it can't be.

    It is tried once.
    """
    if request.least_projectors or "rms_m" not in rounds[-1].missed_by:
        return None
    stage, before = rounds[0].partial.stage, rounds[0].plan.cameras
    if larger(stage, stage.projectors, request.wishes.max_projectors) is None:
        return None
    return int(_MANY * len(before)) + 1


def _robust(request: PlanRequest, asked: Requirements) -> Robust:
    return Robust(
        request.wishes.robust or 0.0,
        request.rig.table.mounting.bounds(),
        asked.dominant_coverage,
        asked.coverage,
        asked.region_coverage,
        asked.triangulation.max_sigma_m,
    )


def _with(plan: RigPlan, robust: Robust) -> RigPlan:
    requirements = replace(plan.requirements, robust=robust)
    document = signed(plan.document.changed(requirements=requirements))
    return replace(plan, document=document)


def _drawn(
    plan: RigPlan,
    partial: PartialPlan,
    robust: Robust,
    clock: Stopwatch,
    first: int,
    n: int,
) -> _Round:
    """Hold drawn rigs against what is asked: other ones than any plan was made for."""
    plan, threads = _with(plan, robust), partial.request.threads
    errors = plan.requirements.triangulation.calibration or PERFECT
    question = Question("", robust.mounting, errors, plan.document.seed)
    asked = Asked.of(plan.requirements)
    with clock.stage("robust", "rigs that aren't built exactly as planned"):
        case = BuiltCase.of(plan, threads=threads).shared()
        some = range(first, first + n)
        rigs = draw(case, question, some, threads=threads, stream=PLANNING)
        missed = [name for rig in rigs for name in asked.missed(rig)]
        counts = {name: missed.count(name) for name in dict.fromkeys(missed)}
        n_met = sum(not asked.missed(rig) for rig in rigs)
        clock.say(
            f"  {n_met} of {len(rigs)} drawn rigs meet what is asked"
            + "".join(f"; {n} miss {FIGURES[name]}" for name, n in counts.items())
        )
    return _Round(plan, partial, tuple(rigs), n_met, counts)


def _short(drawn: _Round, quantile: float) -> dict[str, float]:
    """Return of each figure that too many rigs miss what all but the spare reach.

    Where none alone is missed by too many, of all that are missed: by other rigs each.
    """
    n = len(drawn.rigs)
    spare = n - least_met(quantile, n)
    if n - drawn.n_met <= spare:
        return {}
    too_many = [name for name, count in drawn.missed_by.items() if count > spare]
    each = spare if too_many else spare // len(drawn.missed_by)
    return {name: drawn.but(each, name) for name in too_many or drawn.missed_by}


def _tightened(drawn: _Round, short: Mapping[str, float], wishes: Wishes) -> Wishes:
    """Return wishes for shares that other projectors or cameras have to reach."""
    goals, required = Asked.of(drawn.plan.requirements), drawn.plan.requirements
    changes: dict[str, float] = {}
    for name, key in (
        ("lit", "dominant_coverage"),
        ("worst_region", "region_coverage"),
    ):
        if name in short:
            lacking = getattr(goals, name) - short[name] + _SHARE_SPARE
            changes[key] = min(getattr(required, key) + lacking, _LARGEST)
    return replace(wishes, **changes)


def _aimed(aim: Aim, short: Mapping[str, float], drawn: _Round) -> Aim:
    """Return what cameras are to reach beyond those whose rigs were drawn."""
    goals, rms, more = Asked.of(drawn.plan.requirements), aim.rms_m, 0.0
    if rms is not None and "completeness" in short:
        rms *= 1.0 - _TAU_SPARE
    if "coverage" in short:
        more = goals.coverage - short["coverage"] + _SHARE_SPARE
    n_spare = round((1.0 - aim.quantile) * len(drawn.rigs))
    reached = short.get("rms_m", drawn.but(n_spare, "rms_m"))
    return replace(aim, rms_m=rms, drawn_m=reached or None, more=more)


def _recorded(rounds: Sequence[_Round], robust: Robust) -> tuple[RigPlan, PartialPlan]:
    """The plan whose rigs fare best, with what it costs."""
    first = rounds[0]
    best = max(rounds, key=lambda one: one.n_met)
    record = RobustRecord(
        n_drawn=len(best.rigs),
        n_met=best.n_met,
        least=least_met(robust.quantile, len(best.rigs)),
        rounds=rounds.index(best),
        n_projectors_without=len(first.plan.projectors),
        n_cameras_without=len(first.plan.cameras),
        n_met_without=first.n_met,
        missed_by=best.missed_by,
        missed_by_without=first.missed_by,
    )
    document = best.plan.document.changed(robust=record)
    return replace(best.plan, document=document), best.partial
