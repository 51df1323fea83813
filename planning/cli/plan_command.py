"""What `plan --mesh` and `plan --ranges` do."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import click

from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from planning.model.plan import InterruptedPlanError, RequirementError, RigPlan
from planning.model.progress import Report
from planning.pipeline import evaluate_rig, plan_rig
from planning.report.drawing.face_colours import face_status
from planning.report.drawing.picture_view import save_picture
from planning.report.drawing.rig_picture import draw_rig
from planning.report.entries.range_entries import ranges_lines
from planning.report.summary.summary import summary
from planning.rig.mounted import read_mounted, split_fixed
from planning.rig.rig import Rig, load_rig
from planning.scene.interest import Interest, read_selection, read_weight
from planning.scene.ranges.ranged_body import read_ranges
from planning.verify.reconstruction.pattern_files import write_patterns
from planning.verify.reconstruction.scanner import Scanner

from .console import print_json, reporter, writable
from .output_folder import OWNED, exchanged, uninterrupted

# Options that are taken as they are: by both, and where devices are sought.
_ASKED = (
    "target",
    "dominant_coverage",
    "coverage",
    "min_reachable",
    "accuracy_mm",
    "up",
    "seed",
)
_PLANNED = ("max_projectors", "max_cameras", "prove", "cameras_by")


def plan_command(options: Mapping[str, Any], command: Sequence[str]) -> int:
    """Plan, write the output folder, print the result; return the exit code."""
    begin = time.monotonic()
    report = reporter(quiet=options["quiet"])
    path = Path(options["ranges"] or options["meshes"][0])
    result = "plan" if options["poses"] is None else "evaluation"
    folder = options["output"] or Path(f"{path.name.split('.')[0]}-{result}")
    with writable(folder):
        rig = load_rig(options["rig_name"], light=options["light"])
        make = _maker(options, rig)
        report(f"reading {path}")
        interest = None
        if options["ranges"] is not None:
            surface = read_ranges(path)
            progress = ranges_lines(surface)
        else:
            surface = load_mesh(path, unit=options["unit"], size_mm=options["size_mm"])
            interest, chosen = _interest(options, surface)
            progress = [*_size_lines(surface), *chosen]
        for line in progress:
            report(line)
        missed: tuple[str, ...] = ()
        code = 0
        saved: list[RigPlan] = []

        def keep(plan: RigPlan) -> None:
            with uninterrupted():
                _save(plan, folder, report, patterns=not options["no_patterns"])
                saved.append(plan)
            report(f"written to {folder}, NOT CHECKED yet")

        try:
            plan = make(
                surface,
                select=interest,
                threads=options["threads"] or n_threads(),
                check=not options["no_check"],
                time_limit=_remaining(options["time_limit"], begin),
                progress=report,
                command=("plan", *command),
                keep=keep,
                **{name: options[name] for name in _ASKED},
            )
        except RequirementError as error:
            plan, missed, code = error.plan, error.shortfalls, error.exit_code
        except InterruptedPlanError as error:
            plan, code = error.plan, error.exit_code
        # The work is done: a second Ctrl-C must not lose it.
        with suppress(KeyboardInterrupt), uninterrupted():
            if saved:
                plan.save(folder / "plan.json")
            else:
                _save(plan, folder, report, patterns=not options["no_patterns"])
    files = [str(folder / name) for name in OWNED if (folder / name).exists()]
    if options["as_json"]:
        print_json(plan.to_document() | {"files": files, "missed": list(missed)})
    else:
        click.echo(summary(plan, files, missed))
    return code


def _maker(options: Mapping[str, Any], rig: Rig) -> Callable[..., RigPlan]:
    """What plans with the rig, around fixed devices or not, or evaluates devices."""
    if options["poses"] is not None:
        devices = read_mounted(options["poses"], rig)
        return partial(evaluate_rig, rig=rig, devices=devices)
    fixed = None
    if options["fixed"] is not None:
        path, names = split_fixed(options["fixed"])
        fixed = read_mounted(path, rig, names)
    asked = {name: options[name] for name in _PLANNED}
    return partial(plan_rig, rig=rig, fixed=fixed, **asked)


def _interest(
    options: Mapping[str, Any], mesh: TriangleMesh
) -> tuple[Interest | None, list[str]]:
    """Read the user's own target, by faces or by weight, and say what it holds."""
    if options["select"] is not None:
        interest = read_selection(options["select"], mesh)
    elif options["weight"] is not None:
        interest = read_weight(options["weight"], mesh)
    else:
        return None, []
    share = mesh.face_areas[interest.chosen].sum() / mesh.area
    lines = [
        f"{interest.source}: {interest.chosen.sum()} of {len(mesh.faces)} "
        f"triangles are the target, {share:.1%} of the area"
    ]
    if interest.n_removed:
        lines.append(f"  {interest.n_removed} chosen faces were removed by repair")
    return interest, lines


def _remaining(limit: float | None, begin: float) -> float | None:
    """What is left of a time limit; reading the mesh counts too."""
    if limit is None:
        return None
    return max(limit - (time.monotonic() - begin), 1e-9)


def _size_lines(mesh: TriangleMesh) -> list[str]:
    source = mesh.source
    if source is None:
        return []
    x, y, z = (mesh.bounds[1] - mesh.bounds[0]) * 1e3
    return [
        f"{source.path}: {x:.1f} x {y:.1f} x {z:.1f} mm (unit {source.unit}), "
        f"{len(mesh.faces)} faces",
        *(f"  repaired: {repair.kind}, {repair.count}" for repair in source.repairs),
    ]


def _save(plan: RigPlan, folder: Path, report: Report, *, patterns: bool) -> None:
    """Write all files of a plan; those of an older plan in the folder go."""
    with exchanged(folder) as fresh:
        plan.save(fresh / "plan.json")
        report("drawing")
        picture = draw_rig(plan, face_status=face_status(plan))
        save_picture(picture, fresh / "rig.png", plan.digest)
        if patterns:
            write_patterns(Scanner.of(plan), fresh)
