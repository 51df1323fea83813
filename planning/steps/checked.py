"""A plan with what its check found, and what it misses."""

from collections.abc import Callable
from dataclasses import replace

from planning.model.plan import InterruptedPlanError, RigPlan
from planning.model.progress import TIME_IS_UP, Stopwatch
from planning.report.assemble import as_truncated
from planning.report.entries.cost_entry import cost_record
from planning.report.partial_plan import PartialPlan
from planning.report.summary.shortfall import shortfalls
from planning.verify.verdict import Verification
from planning.verify.verification import verify_plan

from .best_kept import Keep

Checked = Callable[[RigPlan, Verification], None]


def with_check(plan: RigPlan, verification: Verification, clock: Stopwatch) -> RigPlan:
    """Return the plan with the record of its check, false claims among the failures."""
    check, record = verification.reconstruction, None
    if check is not None:
        false = verification.audit.failures
        record = check.record()
        record = record.changed(
            failures=(*false, *record.failures),
            passed=record.passed and not false,
            plan=plan.digest,
            asked=plan.document.coverage.asked,
        )
    greedy = plan.document.certificates.cameras.greedy_count
    (member,) = plan.document.members
    document = plan.document.changed(
        reconstruction=record,
        members=(member.changed(reconstruction=record),),
        timings_s=dict(clock.seconds),
        cost=cost_record(
            plan.document.rig,
            plan.document.projectors,
            plan.document.cameras,
            n_before=greedy,
            stages=clock.processor,
            scan=None if check is None else check.seconds,
        ),
    )
    return replace(plan, document=document)


def axes_may_help(plan: RigPlan, partial: PartialPlan) -> bool:
    """Whether only the check isn't passed, and centred ring axes weren't asked for."""
    if partial.axes == "free" or partial.request.ring_axis != "auto":
        return False
    check, alone = plan.document.reconstruction, {"reconstruction": None}
    if check is None or check.passed:
        return False
    return not shortfalls(RigPlan(plan.document.changed(**alone), plan.surface))


def missed_by(plan: RigPlan, *, check: bool) -> tuple[str, ...]:
    """Return what of the requirements a plan misses, and the check if it was wanted."""
    missed = shortfalls(plan)
    if check and plan.document.reconstruction is None:
        missed += ("the check wasn't made: the time limit came first",)
    return missed


def checked_plan(
    plan: RigPlan,
    threads: int,
    clock: Stopwatch,
    keep: Keep | None,
    checked: Checked | None,
) -> RigPlan:
    """Audit the kept plan and reconstruct it from pixels, with foreign code.

    Raises:
        InterruptedPlanError: If the check is interrupted; it carries the plan as it is.
    """
    cut = as_truncated(plan)
    clock.extend()
    try:
        if keep is not None:
            keep(plan)
        with clock.stage("check", "check: audit, then reconstruction from pixels"):
            # Who planned has just proved the bounds; who receives the plan hasn't.
            verification = verify_plan(
                plan, threads=threads, progress=clock.say_in_time, proofs=False
            )
    except KeyboardInterrupt:
        raise InterruptedPlanError(cut) from None
    except TIME_IS_UP:
        return cut
    if checked is not None:
        checked(plan, verification)
    return with_check(plan, verification, clock)
