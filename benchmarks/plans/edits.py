"""Edit every kind of leaf of a plan file: what `plan verify` refuses, finds, lets by.

Usage: python -m benchmarks.plans.edits [--seed 0] [--only KEY,...] [PLAN]   (ringrig
    installed, from a checkout)

Plans a sample head of 1,500 faces with few candidates (or takes PLAN, a folder that
this code made), checked from pixels. A kind is a key with numbers of lists wildcarded
(`regions.*.area_m2`). Of each kind leaves are drawn, and edited in six ways or more:
numbers by a per mille, by a tenth, by one, times 500, to 0, to their negative; words,
truths and lists to others; and any of them to null, to another type, or left out. What
stands in a plan twice, coverage and check as the member's, is edited twice; then every
digest is made anew, as a forger would, who isn't the check's author. Devices are also
moved by 0.02 mm and turned by 0.002 degrees, ring frames alike.

Each edited plan is read, audited, and its claims are computed again; what passes so far
and moves something that is seen is rendered and decoded, as `plan verify` does with
every plan. Of other edits the figures of the check, the samples and, where they can't
matter, the claims that come out again are those of the plan as made; and of what is no
claim the slowest audits are left out. Prints for each section how many edits were
refused when read (exit 3), found (exit 1), passed, or crashed; then each kind of which
one passed. `planning.verify.no_claims` says what is no claim, each with its reason, and
`planning.verify.trust` what verify tells is taken on trust. A key left out that is read
as the value it had, since that is its default, is *the same* plan to every reader.
Returns 1 where another passes, or anything crashes.
"""

import argparse
import copy
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import machine
from planning import RigPlan
from planning.cli.checks.planned_again import PlannedAgain
from planning.cli.declared.asked_again import asked_again
from planning.cli.other_commands import write_sample
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
from planning.verify.trust import is_trusted
from planning.verify.verification import verify_plan

from .edited import KeyPath, edits, leaves, moved, put
from .speed import RUN

_RIG = """
base = "default"
name = "few candidates"
[placement]
n_candidate_projectors = 60
n_candidate_cameras = 60
n_reference_projectors = 600
n_reference_cameras = 400
"""
# What is rendered beside the surface; what samples and claims that come out again
# depend on, too, of a rig with one model of either kind.
_RENDERED = {"projectors", "cameras", "seed"}
_SEEN = {*_RENDERED, "requirements"}
_AGAIN = {*_SEEN, "marginal", "ring_axes", "surface"}


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("plan", nargs="?", type=Path)
    asked = parser.parse_args()
    only = tuple(asked.only.split(","))
    rng, begin = np.random.default_rng(asked.seed), time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        folder = asked.plan or _made(Path(name))
        judge = Judge(RigPlan.load(folder / "plan.json"))
        kinds: dict[str, list[tuple[KeyPath, Any]]] = defaultdict(list)
        for path, value in leaves(judge.document):
            kinds[_kind(path)].append((path, value))
        ended: dict[str, Counter[str]] = defaultdict(Counter)
        let_by: dict[str, list[str]] = defaultdict(list)
        for kind, of_kind in kinds.items():
            if not kind.startswith(only):
                continue
            path, value = of_kind[int(rng.integers(len(of_kind)))]
            for what, other in edits(value):
                how = judge.edited(path, other)
                print(f"{kind}: {what}: {how}", file=sys.stderr)
                if how == "passed" and judge.reads_the_same(path, other):
                    how = "the same"
                elif how == "passed":
                    how = _excused(".".join(map(str, path)))
                if how == "on trust" and judge.differs_planned_again(path, other):
                    how = "replanned"
                _note(ended, let_by, kind, f"{what}: {how}", how)
        for kind, what, edited in moved(judge.document):
            if kind.startswith(only):
                how = judge.judged(edited, "projectors")
                _note(ended, let_by, kind, f"{what}: {how}", how)
    n = sum(map(len, kinds.values()))
    print(
        f"{machine()}; {n} leaves of {len(kinds)} kinds, seed {asked.seed}, "
        f"{time.perf_counter() - begin:.0f} s\n"
    )
    return int(_print(ended, let_by))


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
        excused = _excused(".".join(map(str, path))) != "passed"
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
        document, limits = plan.document, plan.requirements.check
        yield document.reconstruction is None
        yield contradictions(document.reconstruction, limits, plan.digest)
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


def _made(folder: Path) -> Path:
    (folder / "few.toml").write_text(_RIG)
    write_sample(folder / "head.obj", n_faces=1500)
    words = ["--mesh", str(folder / "head.obj"), "--rig", str(folder / "few.toml")]
    words += ["--max-projectors", "6", "-o", str(folder / "plan"), "--quiet"]
    subprocess.run([*RUN, *words, "--no-report", "--no-patterns"], check=False)
    return folder / "plan"


def _kind(path: KeyPath) -> str:
    return ".".join("*" if isinstance(key, int) else key for key in path)


def _excused(key: str) -> str:
    key = key.removeprefix("members.0.")
    if is_under(key, NO_CLAIM):
        return "no claim"
    return "on trust" if is_trusted(key) else "passed"


def _note(
    ended: dict[str, Counter[str]],
    let_by: dict[str, list[str]],
    kind: str,
    words: str,
    how: str,
) -> None:
    ended[kind.split(".")[0]][how.split(":")[0]] += 1
    if how not in ("refused", "found", "replanned", "the same"):
        let_by[kind].append(words)


def _print(ended: dict[str, Counter[str]], let_by: dict[str, list[str]]) -> bool:
    kinds = "refused", "found", "replanned", "the same", "no claim", "on trust"
    kinds += "passed", "crashed"
    print(f"| section | {' | '.join(kinds)} |\n{(len(kinds) + 1) * '|---'}|")
    total = Counter[str]()
    for section, counts in ended.items():
        total += counts
        print(f"| {section} | {' | '.join(str(counts[kind]) for kind in kinds)} |")
    print(f"| all | {' | '.join(str(total[kind]) for kind in kinds)} |\n")
    for kind, ways in let_by.items():
        print(f"{kind}: {'; '.join(ways)}")
    return bool(total["passed"] or total["crashed"])


if __name__ == "__main__":
    sys.exit(main())
