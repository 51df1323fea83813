"""Bounds over the candidates, derived again: what it takes, and whether others agree.

Usage: python -m benchmarks.plans.proofs [--plans N] [--few] [--poses] [--only NAME ...]
    [--least SECONDS]   (ringrig installed, from a checkout)

Plans the sample, heads of `plan sample --variant`, and the shared meshes where they are
present, in both lights, N plans in all (20); with --few, few candidates are offered.
Prints of each bound: how many are needed at least; the nodes
and multipliers of its certificate, the bytes of the file; seconds of the finder (stage
of the plan) and of the checker; whether the plan with the bound raised by one is
refused; and what HiGHS (scipy.optimize.milp) and, where `ortools` is installed, CP-SAT
find on the matrix of the checker with one device fewer, each in ten times what
`solve_cover` takes on it, at least so many seconds (2).

With --poses the bounds over all poses instead: processor seconds of the checker, what
became of the bound, and of one raised by one with a file that says so.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
from support import shared_meshes, small_job

from benchmarks.machine import machine
from geometry.arrays import Mask
from planning.model.plan import RigPlan
from planning.proofs.selection import cover_problem
from planning.verify.audit.audit_case import AuditCase, DeviceKind, examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.proofs.frozen_samples import (
    covered_by_candidates,
    drawn_again,
)
from planning.verify.audit.proofs.poses.pose_claims import audit_pose_proofs
from planning.verify.audit.proofs.proof_claims import audit_proofs
from solvers import solve_cover

from .other_solvers import by_cp_sat, by_highs

ROOT = Path(__file__).resolve().parents[2]
_RUN = [sys.executable, "-c", "from planning.cli.main import main; main()"]
_OPTIONS = ["--max-projectors", "8", "--cameras-by", "cover"]
_UNCHECKED = ["--no-check", "--no-report", "--quiet", "--no-patterns"]
_HEAD = (
    *("mesh", "light", "devices", "at least", "status", "nodes", "multipliers"),
    *("bytes", "finder [s]", "checker [s]", "raised by one", "required"),
    *("HiGHS, one fewer", "CP-SAT, one fewer"),
)
_HEAD_OF_POSES = (
    *("mesh", "light", "devices", "at least", "status", "by", "finder [s]"),
    *("checker [s]", "derived", "raised by one"),
)
_STAGES = {"projector": "bounds", "camera": "camera_bounds"}


def main() -> int:
    """Print the table; return 1 if a bound doesn't hold or a raised one does."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--plans", type=int, default=20)
    options.add_argument("--few", action="store_true")
    options.add_argument("--poses", action="store_true")
    options.add_argument("--only", nargs="+", metavar="NAME")
    options.add_argument("--least", type=float, default=2.0)
    given = options.parse_args()
    print(f"{machine()}\n")
    head, rows = _HEAD, partial(_rows, least_s=given.least)
    if given.poses:
        head, rows = _HEAD_OF_POSES, _pose_rows
    print(f"| {' | '.join(head)} |\n|{len(head) * '---|'}", flush=True)
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        few = Path(folder, "few.toml") if given.few else None
        if few is not None:
            few.write_text(small_job.RIG)
        jobs = (
            job
            for job in _jobs(Path(folder))
            if given.only is None or job[0] in given.only
        )
        for name, words, light in islice(jobs, given.plans):
            out = Path(folder, "plan")
            command = [*_RUN, *words, *_OPTIONS, *_UNCHECKED, "--light", light]
            command += ["-o", str(out), *(["--rig", str(few)] if few else [])]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode not in (0, 1):
                last = done.stderr.strip().splitlines()[-1:]
                print(f"| {name} | {light} | no plan: {' '.join(last)} |", flush=True)
                continue
            for row, holds in rows(RigPlan.load(out / "plan.json")):
                print(f"| {name} | {light} | {' | '.join(row)} |", flush=True)
                wrong += not holds
    return int(wrong > 0)


def _jobs(folder: Path) -> Iterator[tuple[str, list[str], str]]:
    def meshes() -> Iterator[tuple[str, list[str]]]:
        yield "face.obj", ["--mesh", str(ROOT / "face.obj")]
        for seed in range(1, 5):
            head = folder / f"head{seed}.obj"
            words = ["sample", "--variant", str(seed), "--faces", "8000"]
            made = [*_RUN, *words, "-o", str(head)]
            subprocess.run(made, check=True, capture_output=True)
            yield (
                f"head {seed}",
                [
                    "--mesh",
                    str(head),
                ],
            )
        for mesh in shared_meshes.MESHES if shared_meshes.FOLDER.is_dir() else ():
            yield mesh.path.name, ["--mesh", str(mesh.path), *mesh.words]

    for name, words in meshes():
        for light in ("diverging", "parallel"):
            yield name, words, light


def _rows(plan: RigPlan, least_s: float) -> Iterator[tuple[list[str], bool]]:
    """Yield the cells of each bound, and whether it does what it should."""
    case = examine(plan, seed=plan.document.seed, threads=1, n_samples=2000)
    size = 0 if plan.proof is None else len(plan.proof.content)
    for kind in case.kinds:
        claims, findings = kind.proof, AuditFindings()
        least, status = claims.needed.lower_bound, claims.candidates.status
        begun = time.perf_counter()
        audit_proofs(_alone(case, kind), findings)
        took = time.perf_counter() - begun
        row = [f"{claims.count} {kind.name}s", str(least), status]
        stage = plan.document.timings_s.get(f"{kind.name}s", 0.0)
        if plan.proof is None or status != "proved":
            yield [*row, *("-" for _ in _HEAD[5:])], True
            continue
        proof = plan.proof.proofs[kind.name]
        raised = _refused(case, kind)
        samples = drawn_again(case, kind.name, proof.draws, proof.faces)
        covers = covered_by_candidates(case, kind.name, samples)
        required = int(np.ceil(kind.share * int(covers.any(axis=1).sum()) - 1e-9))
        asked = covers, required, least - 1, max(least_s, _limit(covers, required))
        others = by_highs(*asked), by_cp_sat(*asked)
        yield (
            [
                *row,
                *("looked at" if least <= 3 else str(len(proof.nodes)),),
                *(str(len(proof.multipliers)), str(size)),
                *(f"{stage:.1f}", f"{took:.1f}"),
                *("refused" if raised else "NOT REFUSED", str(required), *others),
            ],
            raised and not findings.failures and "SMALLER" not in " ".join(others),
        )


def _pose_rows(plan: RigPlan) -> Iterator[tuple[list[str], bool]]:
    """Yield the cells of each bound over all poses, and whether it does what it should.

    None may be false, and none that was raised by one beyond what devices of the plan
    refute may be derived.
    """
    case = examine(plan, seed=plan.document.seed, threads=1, n_samples=2000)
    for kind in case.kinds:
        table = kind.proof.continuous
        if table is None:
            continue
        begun = time.process_time()
        derived, false = _everywhere(_alone(case, kind))
        took = time.process_time() - begun
        raised, _ = _everywhere(_raised(case, kind))
        enough = table.lower_bound == kind.proof.needed.count
        yield (
            [
                *(f"{kind.proof.count} {kind.name}s", str(table.lower_bound)),
                *(table.status, table.proof.replace("|", "/")),
                f"{plan.document.timings_s.get(_STAGES[kind.name], 0.0):.1f}",
                *(f"{took:.1f}", "FALSE" if false else derived),
                raised,
            ],
            not false and not (enough and raised.startswith("proved")),
        )


def _everywhere(case: AuditCase) -> tuple[str, bool]:
    """Say what became of the one bound over all poses, and whether it is false."""
    findings = AuditFindings()
    bounds = audit_pose_proofs(case, findings, lambda _: None)
    words = [bound.line.split(" over all poses is ")[1] for bound in bounds]
    short = [w if w.startswith("claimed") else w.split(",")[0] for w in words]
    trusted = any(b.trusted for b in bounds) and short[0] == "proved"
    area = " but for its area" if trusted else ""
    return (short[0] + area if short else "FALSE"), bool(findings.failures)


def _raised(case: AuditCase, kind: DeviceKind) -> AuditCase:
    """The case with a bound, and its certificate, of one device more."""
    claims, file = kind.proof, case.plan.proof
    assert claims.continuous is not None
    least = claims.continuous.lower_bound + 1
    table = claims.continuous.changed(lower_bound=least)
    over_poses = {} if file is None else dict(file.over_poses)
    if kind.name in over_poses:
        proof = over_poses[kind.name]
        over_poses[kind.name] = replace(proof, n_devices=proof.n_devices + 1)
    made = None if file is None else type(file).of(file.proofs, over_poses)
    edited = replace(case, plan=replace(case.plan, proof=made))
    return _alone(edited, replace(kind, proof=claims.changed(continuous=table)))


def _alone(case: AuditCase, kind: DeviceKind) -> AuditCase:
    """The case with one kind of device."""
    alone = replace(case)
    alone.__dict__["kinds"] = (kind,)
    return alone


def _refused(case: AuditCase, kind: DeviceKind) -> bool:
    """Whether the audit refuses a bound, and its file, of one device more."""
    claims, file = kind.proof, case.plan.proof
    assert file is not None
    needed = claims.needed.changed(lower_bound=claims.needed.lower_bound + 1)
    more = replace(kind, proof=claims.changed(needed=needed))
    proofs = file.proofs
    proof = proofs[kind.name]
    proofs = proofs | {kind.name: replace(proof, n_sets=proof.n_sets + 1)}
    for made in (file, type(file).of(proofs)):
        findings = AuditFindings()
        edited = replace(case, plan=replace(case.plan, proof=made))
        audit_proofs(_alone(edited, more), findings)
        if not findings.failures:
            return False
    return True


def _limit(covers: Mask, required: int) -> float:
    """Ten times what our own solver takes on a matrix [s]."""
    begun = time.perf_counter()
    solve_cover(cover_problem(covers, required), heaviest=False)
    return 10.0 * (time.perf_counter() - begun)


if __name__ == "__main__":
    sys.exit(main())
