"""How honest jobs end: planned by the command, then verified from what it wrote."""

import contextlib
import signal
import sys
import traceback
from collections.abc import Generator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from geometry.mesh.mesh import MeshError
from planning.cli.checks.planned_again import PlannedAgain
from planning.cli.declared.asked_again import asked_again
from planning.cli.main import commands
from planning.model.errors import PlanningError
from planning.model.plan import RigPlan
from planning.report.made_again import again_or_why_not
from planning.scene.draws import DRAWS
from planning.verify.audit.audit_case import N_SAMPLES, examine
from planning.verify.verification import Verification, verify_plan
from support.drawn_jobs import Job
from support.little_work import (
    bound_roughly,
    draw_fewer,
    offer_fewer,
    work_least,
    work_little,
)

# A plan of little work that computes for longer hangs, however busy the machine is.
_LONGEST_S = 400
# Told again, for a library that calls back may swallow it.
_AGAIN_S = 20
_INTERRUPTED = 130
_AXES, _CLAIMS, _COVERED = DRAWS.axes.count, DRAWS.claims.count, 1000


class _TooLongError(Exception):
    """It hangs; no OSError, which plans may survive."""


def outcome(job: Job, folder: Path) -> str:
    """Return how a job ends in a folder of its own, in a word and what there is to say.

    `met` and `short` were verified; `refused` was told in one line, or in a line of its
    own for each fault, `where: what`. Else it `escaped`.
    """
    for file, text in job.files.items():
        (folder / file).write_text(text)
    (folder / "words.txt").write_text(" ".join(job.words) + "\n")
    try:
        with contextlib.chdir(folder), _limited(), _working_little(job):
            return _ended(job)
    except (PlanningError, MeshError, click.ClickException) as error:
        # Usage is told by click in other words.
        faults = getattr(error, "message", str(error)).strip().splitlines()
        told = len(faults) == 1 or all(": " in fault for fault in faults)
        return f"{'refused' if told else 'escaped: lines'}: {' | '.join(faults)}"
    except Exception as error:
        traceback.print_exc()
        return f"escaped: {type(error).__name__}: {error}"


def _ended(job: Job) -> str:
    """Plan, then verify what was written."""
    words = [*job.words, "--quiet", "--debug", "--no-report", "--no-patterns"]
    words += ["--threads", "1", "-o", "plan"]
    before = signal.getsignal(signal.SIGINT), sys.argv[1:]
    try:
        # A plan records its command from there, and is planned again from it.
        sys.argv[1:] = words
        result = CliRunner().invoke(commands, words, standalone_mode=False)
    finally:
        signal.signal(signal.SIGINT, before[0])
        sys.argv[1:] = before[1]
    error = result.exception
    if result.exit_code == _INTERRUPTED:
        raise KeyboardInterrupt
    if error is not None and not isinstance(error, SystemExit):
        raise error
    if result.exit_code not in (0, 1):
        return f"escaped: exit {result.exit_code}: {result.stderr}"
    try:
        found = _verified(job)
    except PlanningError as refused:
        return f"escaped: the plan isn't read: {refused}"
    if not found.passed:
        return f"escaped: false: {' | '.join(found.failures)}"
    if bool(result.exit_code) != bool(found.unmet):
        return f"escaped: exit {result.exit_code}, but unmet: {found.unmet}"
    return ("met", "short: " + " | ".join(found.unmet))[result.exit_code]


def _verified(job: Job) -> Verification:
    """Return what `plan verify` finds of the plan from its files."""
    plan = RigPlan.load("plan/plan.json")
    again = again_or_why_not
    if job.replanned:
        again = PlannedAgain(plan, asked_again(plan, None, None), quiet=True)
    return verify_plan(
        plan,
        check_pixels=job.checked,
        threads=1,
        again=again,
        over_poses=job.proofs,
    )


@contextlib.contextmanager
def _working_little(job: Job) -> Generator[None]:
    """Work little, or still less."""
    with pytest.MonkeyPatch.context() as patch:
        if job.little:
            work_little(patch)
        else:
            work_least(patch)
            bound_roughly(patch)
            # How far light reaches is held to a twentieth: few samples don't tell,
            # whoever draws them; nor do an audit's many bear with a plan's few. Nor do
            # covers of fewer than the audit takes them to be chosen on.
            draw_fewer(patch, axes=_AXES, claims=_CLAIMS)
            draw_fewer(patch, projectors=_COVERED, cameras=_COVERED)
            patch.setitem(examine.__kwdefaults__, "n_samples", N_SAMPLES)
            offer_fewer(patch, 80, 60)
        # A run that was cut ends itself, not this process.
        patch.setattr("planning.cli.console.leave", sys.exit)
        yield


@contextlib.contextmanager
def _limited() -> Generator[None]:
    """Raise in what hangs."""

    def late(*_: object) -> None:
        raise _TooLongError(f"computed for more than {_LONGEST_S} s")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, _LONGEST_S, _AGAIN_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
