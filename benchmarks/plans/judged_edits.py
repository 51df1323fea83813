"""How an edited plan file ends: refused, found, passed, or crashed."""

import copy
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

from planning import RigPlan
from planning.cli.checks.planned_again import PlannedAgain
from planning.cli.declared.asked_again import asked_again
from planning.model.document.check_records import ReconstructionRecord
from planning.model.document.request_records import asked_digest
from planning.model.errors import PlanningError
from planning.report.made_again import again_or_why_not, made_again
from planning.verify.audit.audit import first_false
from planning.verify.audit.audit_case import examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.counts.table_claims import audit_limits
from planning.verify.audit.figure_claims import contradictions
from planning.verify.audit.request_claims import audit_request
from planning.verify.held_figures import EXACTLY, WHOLLY, hold_claims, hold_figures
from planning.verify.no_claims import NO_CLAIM, is_under
from planning.verify.reconstruction.render.photometry import assumed_light
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.trust import is_trusted
from planning.verify.verification import verify_plan

from .edited import KeyPath, put

# What is rendered beside the surface; what samples and claims that come out again
# depend on, too, of a rig with one model of either kind.
_RENDERED = {"projectors", "cameras", "seed"}
_SEEN = {*_RENDERED, "requirements"}
_AGAIN = {*_SEEN, "marginal", "ring_axes", "surface"}


class Judge:
    """Judges edited plans by the figures of one check of the plan as made."""

    def __init__(self, plan: RigPlan) -> None:
        found = verify_plan(plan, again=again_or_why_not)
        assert found.passed, found.failures
        assert found.claims_held == found.compared == EXACTLY, found.summary()
        assert found.reconstruction is not None
        self._plan, self.document = plan, plan.to_document()
        self._case, self._made = found.audit.case, made_again(plan, threads=1)
        self._fresh = found.reconstruction.record()

    @cached_property
    def _whole(self) -> Mapping[str, Any]:
        """The plan made again from its words."""
        plan = self._plan
        whole = PlannedAgain(plan, asked_again(plan), quiet=True)(plan, 1)
        assert hold_claims(plan, lambda *_: whole, 1) == ((), WHOLLY)
        return whole

    def differs_planned_again(self, path: KeyPath, value: object) -> bool:
        """Whether `plan verify --replan` finds another value at a place."""
        edited = copy.deepcopy(self.document)
        put(edited, path, value)
        plan = self._forged(edited)
        return bool(hold_claims(plan, lambda *_: self._whole, 1)[0])

    def reads_the_same(self, path: KeyPath, value: object) -> bool:
        """Whether a plan with another value at a place is read as the plan as made."""
        edited = copy.deepcopy(self.document)
        put(edited, path, value)
        read = RigPlan.from_document(edited, self._plan.surface)
        return read.document == self._plan.document

    def edited(self, path: KeyPath, value: object) -> str:
        """How the plan ends with another value at a place, and wherever it is again."""
        edited = copy.deepcopy(self.document)
        put(edited, path, value)
        if path[0] in ("coverage", "reconstruction"):
            put(edited, ("members", 0, *path), value)
        excused = excuse(".".join(map(str, path))) != "passed"
        return self.judged(edited, str(path[0]), quick=excused)

    def judged(
        self, edited: dict[str, Any], section: str, *, quick: bool = False
    ) -> str:
        """How a plan file ends that was edited there: refused, found, passed, crashed.

        As in `verify_plan`, but what is quick comes first, or alone, and what the
        section has no part in isn't done again.
        """
        try:
            plan = self._forged(edited)
            here, made = plan.document.surface, self._plan.document.surface
            if (here.sha256, here.path) != (made.sha256, made.path):
                return "refused"
            here, made = (p.document.certificates.proof for p in (plan, self._plan))
            # A file of another name isn't there, and told as believed.
            if here and made and here.sha256 != made.sha256:
                return "refused"
            found = any(self._false(plan, section, quick=quick))
            return "found" if found else "passed"
        except PlanningError:
            return "refused"
        except Exception as error:
            return f"crashed: {type(error).__name__}: {error}"

    def _false(self, plan: RigPlan, section: str, *, quick: bool) -> Iterator[object]:
        """Yield what of a plan is false, check by check."""
        document = plan.document
        yield document.reconstruction is None
        room = assumed_light(Scanner.of(plan)).ambient
        yield contradictions(document.reconstruction, room, plan.digest)
        fresh, seed = self._fresh, document.seed
        if section not in _RENDERED:
            yield hold_figures(plan, fresh, seed)[0]
        if section not in _SEEN:
            whole = replace(self._case.estimator, n_claimed=document.coverage.samples)
            case = replace(self._case, plan=plan, estimator=whole)
            yield first_false(case, quick=quick)
        else:
            # What compares parts of the plan alone needs no samples.
            findings, case = AuditFindings(), replace(self._case, plan=plan)
            for audit_claims in (audit_request, audit_limits):
                audit_claims(case, findings)
            yield findings.failures
            yield first_false(examine(plan, seed=seed, threads=1), quick=quick)
        if quick:
            return
        made = self._made if section not in _AGAIN else None
        yield hold_claims(plan, lambda one, n: made or again_or_why_not(one, n), 1)[0]
        if section in _RENDERED:
            yield hold_figures(plan, self._again(plan), seed)[0]

    def _forged(self, edited: dict[str, Any]) -> RigPlan:
        """The plan with all its digests made anew, where they still stand."""
        plan = RigPlan.from_document(edited, self._plan.surface)
        read = plan.document
        digest = asked_digest(read.request, read.requirements, read.rig)
        for path in (
            *(("coverage",), ("certificates",), ("reconstruction",)),
            *(("members", 0, "coverage"), ("members", 0, "reconstruction")),
        ):
            _renew(edited, (*path, "asked"), self.document, digest)
        plan = RigPlan.from_document(edited, self._plan.surface)
        for path in (("reconstruction",), ("members", 0, "reconstruction")):
            _renew(edited, (*path, "plan"), self.document, plan.digest)
        return RigPlan.from_document(edited, self._plan.surface)

    @staticmethod
    def _again(plan: RigPlan) -> ReconstructionRecord:
        pixels = verify_plan(plan).reconstruction
        assert pixels is not None
        return pixels.record()


def _renew(edited: Any, path: tuple[Any, ...], made: Any, digest: str) -> None:  # noqa: ANN401
    """Replace a digest that wasn't itself edited."""
    for key in path[:-1]:
        if not isinstance(edited, dict | list) or (
            isinstance(edited, dict) and key not in edited
        ):
            return
        edited, made = edited[key], made[key]
    if isinstance(edited, dict) and edited.get(path[-1]) == made.get(path[-1]):
        edited[path[-1]] = digest


def excuse(key: str) -> str:
    """Why an edit may pass: no claim, or taken on trust; "passed": it mayn't."""
    key = key.removeprefix("members.0.")
    if is_under(key, NO_CLAIM):
        return "no claim"
    return "on trust" if is_trusted(key) else "passed"
