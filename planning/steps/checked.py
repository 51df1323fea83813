"""A plan with what its check found."""

from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.report.entries.cost_entry import cost_record
from planning.verify.verification import Verification


def with_check(
    plan: RigPlan, verification: Verification, clock: Stopwatch
) -> RigPlan:
    """Return the plan with the record of its check, false claims among the failures."""
    check, record = verification.reconstruction, None
    if check is not None:
        false = verification.audit.failures
        record = check.record()
        record = record.changed(
            failures=(*false, *record.failures), passed=record.passed and not false
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
    return RigPlan(document, plan.surface)
