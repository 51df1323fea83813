"""The plan of projectors and cameras together, after the one of one by one.

First the cheapest of candidates (`solvers.joint`), then poses between them: with one
device left out while the others move, and last to where the smallest slack is widest.
Each is completed and written as any plan is, and taken where its fresh samples meet
every requirement and it is cheaper, or as cheap and wider.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from planning.model.document.input_records import RigRecord
from planning.model.document.joint_records import (
    DeviceCount,
    JointRecord,
    JointScope,
)
from planning.model.errors import InputError
from planning.model.plan import InterruptedPlanError, RigPlan
from planning.model.progress import TIME_IS_UP, Stopwatch
from planning.proofs.device_stock import within_stock
from planning.report.assemble import as_truncated, write_plan
from planning.report.partial_plan import PartialPlan, PlanRequest
from planning.report.summary.shortfall import shortfalls
from planning.scene.draws import DRAWS
from planning.steps.stages import bounded_cameras, one_device_more, polished
from solvers.joint.joint_cover import JointSolution, solve_joint

from .completed import Costs, with_cameras_for, with_devices
from .moves import one_device_fewer, wider_slack
from .offer import JointOffer, devices_of, joint_offer
from .slack import slack_at_share
from .tables import JointTables

Keep = Callable[[RigPlan], None]
Planned = Callable[[PlanRequest, Stopwatch, Keep | None], tuple[RigPlan, PartialPlan]]
Found = Literal["two stages", "candidates", "poses"]
# Covers that the joint program may solve, counted work of each, and times that a
# device is left out.
_COVERS, _WORK, _FEWER = 400, 1e8, 3
# Slack that is worth other poses.
_GAIN = 5e-3


def check_joint(request: PlanRequest) -> None:
    """Refuse what a joint plan can't be asked together with.

    Raises:
        InputError: It names both, and what to do.
    """
    wishes, rig = request.wishes, request.rig
    others = (
        (request.evaluates, "an evaluation", "nothing is sought there"),
        (
            wishes.survive > 0,
            "survive = 1",
            "what may be lost is planned in two stages",
        ),
        ((wishes.views or 1) > 1, f"views = {wishes.views}", "it measures by one pair"),
        (wishes.robust is not None, "robust", "drawn rigs are of a two-stage plan"),
        (wishes.pattern == "none", "pattern = 'none'", "there are no projectors"),
        (request.ranges is not None, "ranges", "its margins know nothing of them"),
        (
            request.cameras_by == "paper",
            "cameras_by = 'paper'",
            "the paper's route is of given projectors",
        ),
        (bool(rig.table.existing), "existing devices", "all are sought together"),
        (rig.head is not None, "a [head]", "its devices come together anyway"),
        (rig.turntable is not None, "a [turntable]", "its pairs are of turned parts"),
    )
    for asked, what, why in others:
        if asked:
            raise InputError(f"joint with {what}: {why}; leave one of them out")
    for kind in ("projector", "camera"):
        if any(model.body is not None for model in rig.models(kind)):
            raise InputError(
                f"joint: rig {rig.name!r} gives a {kind} a body, and devices aren't "
                f"moved together among each other's bodies; leave [{kind}.body] out"
            )
    tables = [m.table for k in ("projector", "camera") for m in rig.models(k)]
    if len({table.cost is None for table in tables}) > 1:
        raise InputError(
            f"joint: rig {rig.name!r} states the cost of some devices and not of "
            f"others; write cost for each model, or for none"
        )


def jointly(planned: Planned) -> Planned:
    """Return what plans devices together as well, where that is asked."""

    def made(
        request: PlanRequest, clock: Stopwatch, keep: Keep | None
    ) -> tuple[RigPlan, PartialPlan]:
        if not request.wishes.joint:
            return planned(request, clock, keep)
        check_joint(request)
        plan, partial = planned(request, clock, keep)
        if plan.document.truncated:
            return plan, partial
        if keep is not None:
            # What there is if the process ends while devices are moved.
            keep(as_truncated(plan))
        joint = _Joint(request, clock, plan, partial, _slack(plan, partial))
        try:
            return joint.run(), joint.partial
        except KeyboardInterrupt:
            raise InterruptedPlanError(as_truncated(joint.plan)) from None
        except TIME_IS_UP:
            clock.extend()
            return as_truncated(joint.plan), joint.partial

    return made


def _slack(plan: RigPlan, partial: PartialPlan) -> float | None:
    """The slack that the required share has at least, of fresh samples; None: less."""
    areas, required = plan.coverage.target, plan.requirements
    target = partial.scene.target_samples(DRAWS.joint_margins)
    tables = JointTables.of(partial.scene, target, plan.projectors, plan.cameras)
    share = required.coverage * areas.reachable_by_cameras_m2 / areas.area_m2
    best = tables.best(range(len(plan.projectors)), range(len(plan.cameras)))
    slack = slack_at_share(best, int(share * len(target)))
    return max(slack, 0.0) if slack > -1.0 else None


@dataclass(eq=False)
class _Joint:
    """The best plan so far, and how it came about."""

    request: PlanRequest
    clock: Stopwatch
    plan: RigPlan
    partial: PartialPlan
    slack: float | None
    found: Found = "two stages"

    def __post_init__(self) -> None:
        self.costs = Costs(RigRecord(**self.request.rig.to_document()))
        self.two_stage = self._count()

    def run(self) -> RigPlan:
        """Return the plan with its record."""
        with self.clock.stage("joint", "joint: projectors and cameras together"):
            offer = joint_offer(self.partial)
            solution = solve_joint(
                offer.problem(self.costs.rig),
                known=offer.own,
                seed=self.request.seed,
                n_covers=_COVERS,
                budget=_WORK,
            )
            self.clock.say(
                f"  cost {solution.cost:g} for {self.two_stage.cost:g} of two stages; "
                f"at least {solution.lower_bound:g} over the candidates"
            )
        self._by_candidates(offer, solution)
        self._by_poses(offer)
        before = self.slack
        self._widened(offer)
        record = self._record(offer, solution, before)
        document = self.plan.document.changed(
            joint=record, timings_s=dict(self.clock.seconds)
        )
        return replace(self.plan, document=document)

    def _by_candidates(self, offer: JointOffer, solution: JointSolution) -> None:
        """Complete the program's answer, if it is cheaper than the two stages'."""
        below = self.two_stage.cost * (1.0 - 1e-9)
        if not solution.cost < below:
            return
        devices = devices_of(
            offer.tables, solution.projectors.tolist(), solution.cameras.tolist()
        )
        stock = self.plan.requirements.stock_of
        kinds = zip(("projector", "camera"), devices, strict=True)
        if not all(within_stock(some, stock(kind)) for kind, some in kinds):
            return
        partial = with_cameras_for(self.partial, *devices, self.costs, below)
        while partial and self.costs.both(partial.projectors, partial.cameras) < below:
            partial = polished(partial, self.clock)
            plan = self._take(partial, "candidates")
            if plan is self.plan:
                return
            # Fresh samples may fall short of a cover that is enough for its own.
            partial = one_device_more(partial, plan, self.clock, partial.axes)

    def _by_poses(self, offer: JointOffer) -> None:
        """Leave a device out and move the others, as long as that does."""
        for _ in range(_FEWER):
            with self.clock.stage("joint_moves", "joint: one device fewer, all moved"):
                devices = one_device_fewer(self.partial, offer, self.costs)
                if devices is None:
                    return
                partial = with_devices(self.partial, *devices)
            if partial is None or self._take(partial, "poses") is not self.plan:
                return

    def _widened(self, offer: JointOffer) -> None:
        """Move devices of both kinds to where the smallest slack is widest."""
        with self.clock.stage("joint_margins", "joint: widest margins of both kinds"):
            devices = wider_slack(self.partial, offer)
            partial = devices and with_devices(self.partial, *devices)
        if partial:
            self._take(partial, self.found)

    def _take(self, partial: PartialPlan, found: Found) -> RigPlan:
        """Take a plan that meets every requirement and is cheaper, or wider.

        Returns:
            The plan, which is then the best one, or isn't.
        """
        plan = write_plan(partial, self.clock)
        missed, slack = shortfalls(plan), _slack(plan, partial)
        cost = self._cost_of(plan)
        before = self._cost_of(self.plan)
        wider = (slack or 0.0) > (self.slack or 0.0) + _GAIN
        cheaper = cost < before * (1.0 - 1e-9)
        if missed or not (cheaper or (wider and cost <= before * (1.0 + 1e-9))):
            why = missed[0] if missed else "neither cheaper nor wider"
            self.clock.say(f"  not taken: {why}")
            return plan
        self.clock.say(
            f"  cost {before:g} -> {cost:g}, slack {_percent(self.slack)} -> "
            f"{_percent(slack)}"
        )
        partial = bounded_cameras(partial, self.clock)
        plan = write_plan(partial, self.clock)
        self.plan, self.partial, self.slack, self.found = plan, partial, slack, found
        return plan

    def _cost_of(self, plan: RigPlan) -> float:
        return self.costs.both(plan.projectors, plan.cameras)

    def _count(self) -> DeviceCount:
        return DeviceCount(
            projectors=len(self.plan.projectors),
            cameras=len(self.plan.cameras),
            cost=self._cost_of(self.plan),
        )

    def _record(
        self, offer: JointOffer, solution: JointSolution, before: float | None
    ) -> JointRecord:
        return JointRecord(
            two_stage=self.two_stage,
            joint=self._count(),
            found=self.found,
            over=JointScope(
                projectors=len(offer.tables.projectors),
                cameras=len(offer.tables.cameras),
                samples=len(offer.tables.target),
            ),
            needed=solution.cost,
            lower_bound=solution.lower_bound,
            status="optimal"
            if solution.lower_bound >= solution.cost * (1.0 - 1e-9)
            else "feasible",
            proof=solution.proof,
            margin_before=before,
            margin=self.slack,
        )


def _percent(slack: float | None) -> str:
    return "none" if slack is None else f"{100.0 * slack:.1f} %"
