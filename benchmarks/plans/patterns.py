"""Eight meshes by every kind of scanner: counts, bounds, coverage, check and audit.

Usage: python -m benchmarks.plans.patterns [NAME or KIND ...]   (ringrig installed,
    from a checkout)

Plans meshes of `../shared/data/meshes` (those named, if any, by the kinds of scanner
named, if any: rings, dense, none, head, turntable), each in the unit or size
that `tests/support/shared_meshes.py` states: by rings and by coded pixels with as many
projectors as it takes, by cameras alone, by poses of one sensor head, and before a
turntable of 24 angles about the axis that points up. Rigs are `default` but for the
head. Counts stand beside what is proved of the candidates and of all poses; the audit's
column is the number of false claims, then the largest difference of an area in points.
"""

import sys
import tempfile
from pathlib import Path

from support import shared_meshes
from support.shared_meshes import SharedMesh

from planning.model.plan import RigPlan

from .main_job import Run, audited, run

_MESHES = (
    *("face_scan_james.obj", "mediapipe_canonical_face_model.obj"),
    *("snowden_bust_lo.obj", "tm_ADIS16480.STL", "tm_counter.unitsmm.STL"),
    *("tm_reference.obj", "vtk_bunny.ply", "vtk_horse.ply"),
)
_HEAD = "zivid-2plus-m60"
_MANY = ("--max-projectors", "12")
_KINDS = ("rings", "dense", "none", "head", "turntable")
_AXES = {"x": "[1, 0, 0]", "y": "[0, 1, 0]", "z": "[0, 0, 1]"}
_COLUMNS = (
    *("mesh", "by", "exit", "count", "least: candidates", "least: all poses"),
    *("lit", "measured", "wall [s]", "check", "rms [mm]", "missing", "audit"),
)


def main(names: list[str]) -> int:
    """Print the table; return 1 if a run ended undocumented, or a claim is false."""
    print("| " + " | ".join(_COLUMNS) + " |")
    print("|" + len(_COLUMNS) * "---|")
    well = True
    with tempfile.TemporaryDirectory() as folder:
        for mesh in shared_meshes.MESHES:
            if mesh.name not in (set(names) - set(_KINDS) or _MESHES):
                continue
            for kind in [k for k in _KINDS if k in names] or _KINDS:
                done = run(mesh.path, (*mesh.words, *_words(kind, mesh, Path(folder))))
                cells, false = _row(done)
                well &= done.code in (0, 1, 4) and not false
                print(f"| {mesh.name} | {kind} | {' | '.join(cells)} |", flush=True)
    return int(not well)


def _words(kind: str, mesh: SharedMesh, folder: Path) -> tuple[str, ...]:
    """Return what the command line is told of the kind of scanner."""
    if kind == "none":
        return ("--pattern", "none")
    if kind == "head":
        return ("--rig", _HEAD, "--max-heads", "12")
    if kind == "turntable":
        up = mesh.words[mesh.words.index("--up") + 1] if "--up" in mesh.words else "z"
        rig = folder / f"table-{up}.toml"
        rig.write_text(
            'base = "default"\n[turntable]\npoint_mm = [0, 0, 0]\n'
            f"axis = {_AXES[up]}\nsteps = 24\n"
        )
        return ("--rig", str(rig), "--max-projectors", "2")
    return (*_MANY, "--pattern", kind)


def _row(done: Run) -> tuple[list[str], int]:
    """Return the cells of a run, and how many claims of its plan are false."""
    plan = done.plan
    if plan is None:
        return [str(done.code), *5 * [""], f"{done.wall:.1f}", done.said, *3 * [""]], 0
    areas, check = plan.coverage.target, plan.document.reconstruction
    false, difference = audited(plan)
    seen = ("none", "", "")
    if check is not None:
        rms = check.accuracy_rms_m
        seen = (
            "passed" if check.passed else "failed",
            "none" if rms is None else f"{1e3 * rms:.3f}",
            f"{check.predicted_missing or 0.0:.2%}",
        )
    lit = "-"
    if plan.projectors:
        lit = f"{areas.lit_m2 / areas.reachable_by_projectors_m2:.1%}"
    measured = f"{areas.measured_m2 / areas.reachable_by_cameras_m2:.1%}"
    cells = [str(done.code), *_counts(plan), lit, measured, f"{done.wall:.1f}", *seen]
    return [*cells, f"{false}; {difference:.2f}"], false


def _counts(plan: RigPlan) -> tuple[str, str, str]:
    """Return the count, its bound over the candidates and that over all poses."""
    told = plan.document.stations
    if told is not None and told.count is not None:
        one, count = told.stations[0], told.count
        name = "head poses"
        if told.kind == "turntable":
            name = f"steps of {len(one.projectors)} + {len(one.cameras)}"
        every = "-" if count.everywhere is None else str(count.everywhere)
        return f"{count.count} {name}", str(count.lower_bound), every
    proofs = plan.document.certificates
    both = [p for p in (proofs.projectors, proofs.cameras) if p is not None]
    return (
        " + ".join(str(proof.count) for proof in both),
        " + ".join(str(proof.needed.lower_bound) for proof in both),
        " + ".join(
            "-" if p.continuous is None else str(p.continuous.lower_bound) for p in both
        ),
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
