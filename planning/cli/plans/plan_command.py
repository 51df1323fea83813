"""What `plan --mesh` and `plan --ranges` do."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from planning.cache.cache import NO_CACHE, Cache
from planning.cli.console import print_json, progress, reporter, writable
from planning.cli.lines.object_lines import optics_lines, size_lines
from planning.model.errors import InputError
from planning.model.plan import InterruptedPlanError, RequirementError, RigPlan
from planning.model.progress import Report, Stopwatch
from planning.pipeline import plan_rig
from planning.report.entries.range_entries import ranges_lines
from planning.report.summary.brief import brief
from planning.report.summary.summary import summary
from planning.rig.mounted import Mounted, read_mounted, split_fixed
from planning.rig.rig import Rig, load_rig
from planning.scene.interest import Interest, read_selection, read_weight
from planning.scene.ranges.ranged_body import RangedBody, read_ranges
from planning.steps.checked import missed_by
from planning.steps.recalled_mesh import recalled_mesh

from .kept_fronts import front_folder, taken_point
from .saved_plans import SavedPlans

# Options that `plan_rig` takes as they are.
_ASKED = (
    "max_projectors",
    "max_cameras",
    "max_heads",
    "target",
    "dominant_coverage",
    "coverage",
    "min_reachable",
    "region_coverage",
    "accuracy_mm",
    "accuracy_of",
    "up",
    "ring_axis",
    "robust",
    "views",
    "survive",
    "joint",
    "pattern",
    "align",
    "family_quantile",
    "seed",
    "prove",
    "cameras_by",
)
# Of a time limit: the rest is for the interpreter, which begins and ends beside it.
_OURS = 0.95


def plan_command(options: Mapping[str, Any], command: Sequence[str]) -> int:
    """Plan, write the output folder, print the result; return the exit code."""
    begin = click.get_current_context().obj
    return planned_once(options, command, cache_of(options), begin=begin)[0]


def cache_of(options: Mapping[str, Any]) -> Cache:
    """Return what earlier runs left, unless it isn't wanted."""
    report = reporter(quiet=options["quiet"])
    return NO_CACHE if options["no_cache"] else Cache.on_disk(report=report)


def planned_once(
    options: Mapping[str, Any],
    command: Sequence[str],
    cache: Cache,
    *,
    begin: float | None = None,
    news: Callable[[RigPlan], Iterable[str]] = lambda plan: (),
    show: bool = True,
) -> tuple[int, RigPlan]:
    """Plan, write the output folder and print the result.

    Args:
        options: Of the command line.
        command: Its words.
        cache: What was answered before.
        begin: When the time limit began, on the monotonic clock [s]; None: now.
        news: Returns lines about a plan that stands, before it is checked.
        show: Whether the result is printed.

    Returns:
        The exit code, and the plan that stands.
    """
    clock = timed(options, begin)
    path = Path(options["ranges"] or options["meshes"][0])
    several = len(options["meshes"]) > 1
    evaluates = options["max_projectors"] is None and options["max_heads"] is None
    result = "evaluation" if evaluates else "plan"
    result = f"family-{result}" if several else result
    folder = options["output"] or Path(f"{path.name.split('.')[0]}-{result}")
    take = None
    if options["take"] is not None:
        folder = front_folder(options, path)
        take = taken_point(options["take"], folder)
    threads = options["threads"] or n_threads()
    check, interrupted = not options["no_check"], False
    with writable(folder), progress(quiet=options["quiet"]) as report:
        saved = SavedPlans(folder, report, patterns=not options["no_patterns"])

        told: set[str] = set()

        def tell(plan: RigPlan) -> None:
            if plan.digest not in told:
                told.add(plan.digest)
                for line in news(plan):
                    report(line)

        def keep(plan: RigPlan) -> None:
            saved.keep(plan)
            tell(plan)

        with clock.ticking():
            rig = load_rig(options["rig_name"], light=options["light"])
            fixed = read_fixed(options["fixed"], rig)
            surface, interest = (
                (_family(options, rig, report, cache), None)
                if several
                else read_object(path, options, rig, report, cache)
            )
        try:
            plan = plan_rig(
                surface,
                rig,
                fixed=fixed,
                take=take,
                select=interest,
                threads=threads,
                check=check,
                time_limit=clock.remaining,
                progress=report,
                command=("plan", *command),
                keep=keep,
                checked=saved.checked,
                cache=cache,
                **{name: options[name] for name in _ASKED},
            )
        except RequirementError as error:
            plan = error.plan
        except InterruptedPlanError as error:
            plan, interrupted = error.plan, True
        plan = saved.finish(plan, clock)
        tell(plan)
        if not options["no_report"] and not interrupted:
            saved.write_page(plan, clock, threads)
    missed = () if interrupted else missed_by(plan, check=check)
    if show:
        _print_result(options, plan, saved.files, missed)
    if interrupted:
        return InterruptedPlanError.exit_code, plan
    return RequirementError.exit_code if missed else 0, plan


def _print_result(
    options: Mapping[str, Any],
    plan: RigPlan,
    files: Sequence[str],
    missed: Sequence[str],
) -> None:
    if options["as_json"]:
        ours = {"files": list(files), "missed": list(missed)}
        print_json(plan.to_document() | ours)
    else:
        words = summary if options["verbose"] else brief
        click.echo(words(plan, files, missed))


def timed(options: Mapping[str, Any], begin: float | None) -> Stopwatch:
    """Return the clock of a command that began then on the monotonic clock [s]."""
    limit = options["time_limit"]
    limit = None if limit is None else _OURS * limit
    return Stopwatch(time_limit=limit, begin=begin)


def read_fixed(words: str | None, rig: Rig) -> Mounted | None:
    """Read devices that stay where they are: all of a file, or those that are named."""
    if words is None:
        return None
    path, names = split_fixed(words)
    return read_mounted(path, rig, names)


def read_object(
    path: Path,
    options: Mapping[str, Any],
    rig: Rig,
    report: Report,
    cache: Cache = NO_CACHE,
) -> tuple[TriangleMesh | RangedBody, Interest | None]:
    """Read what is to be measured, and which part of it is the user's own target."""
    report(f"reading {path}")
    if options["ranges"] is not None:
        body = read_ranges(path)
        for line in ranges_lines(body):
            report(line)
        return body, None
    mesh = recalled_mesh(path, cache, unit=options["unit"], size_mm=options["size_mm"])
    interest, chosen = _interest(options, mesh)
    for line in (*size_lines(mesh), *optics_lines(rig, mesh), *chosen):
        report(line)
    return mesh, interest


def _family(
    options: Mapping[str, Any], rig: Rig, report: Report, cache: Cache
) -> list[TriangleMesh]:
    """Read the meshes of a family, and say what each is."""
    for name in ("select", "weight"):
        if options[name] is not None:
            raise InputError(f"--{name} is of one mesh: leave it out, or plan one")
    meshes: list[TriangleMesh] = []
    for path in options["meshes"]:
        report(f"reading {path}")
        meshes.append(
            recalled_mesh(Path(path), cache, unit=options["unit"], size_mm=None)
        )
        for line in size_lines(meshes[-1]):
            report(line)
    for line in optics_lines(rig, TriangleMesh.joined(meshes)):
        report(line)
    return meshes


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
