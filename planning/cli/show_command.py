"""What `plan show`, `compare` and `report` do with plans as written: words, a page."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import click
import numpy as np

from geometry.parallel import n_threads
from planning.model.plan import RigPlan
from planning.model.words import labelled, percent, printable
from planning.report.page.page import PAGE, is_page, pages_of, write_page
from planning.report.summary.sections import SECTIONS
from planning.verify.audit.devices.camera_figures import (
    CameraFigures,
    Spread,
    camera_figures,
)

from .console import print_json, writable_file
from .lines.comparison import compared, comparison_lines

# Beside what the plan says: recomputed from its poses.
_CAMERAS = "cameras"


def show_command(options: Mapping[str, Any]) -> int:
    """Print the sections that were asked for; places and cameras if none was."""
    plan = RigPlan.load(options["plan_file"])
    names = [section.name for section in SECTIONS]
    names.insert(1, _CAMERAS)
    chosen = [name for name in names if options[name] or options["all"]]
    if options["as_json"]:
        _check_json(chosen)
        print_json(_document(plan, chosen, options["threads"]))
        return 0
    for name in chosen or (names[0], _CAMERAS):
        lines = _section(plan, name, options["threads"])
        if not lines and not options["all"]:
            lines = [f"{name.upper()}: the plan has nothing of it", ""]
        if lines:
            click.echo("\n".join(map(printable, lines)))
    return 0


def _check_json(chosen: Sequence[str]) -> None:
    """Refuse sections whose figures `plan.json` holds already."""
    words = [name for name in chosen if name not in (_CAMERAS, "regions")]
    if words:
        raise click.UsageError(
            f"--json goes with --cameras and --regions: the figures of --{words[0]} "
            f"stand in plan.json"
        )


def _document(
    plan: RigPlan, chosen: Sequence[str], threads: int | None
) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if "regions" in chosen:
        found["regions"] = plan.to_document()["regions"]
    if _CAMERAS in chosen or not chosen:
        figures = camera_figures(plan, threads=threads or n_threads())
        found["cameras"] = [asdict(camera) for camera in figures]
    return found


def _section(plan: RigPlan, name: str, threads: int | None) -> list[str]:
    if name != _CAMERAS:
        return next(one for one in SECTIONS if one.name == name).told(plan)
    figures = camera_figures(plan, threads=threads or n_threads())
    lines = [line for camera in figures for line in _camera_lines(camera)]
    return ["CAMERAS: what each sees of the target, and how well.", *lines, ""]


def compare_command(options: Mapping[str, Any]) -> int:
    """Print two plans side by side."""
    files = options["first"], options["second"]
    plans = [RigPlan.load(file) for file in files]
    rows = compared(*plans)
    if options["as_json"]:
        found = [asdict(row) | {"differs": row.differs} for row in rows]
        print_json({"plans": [str(file) for file in files], "rows": found})
        return 0
    names = str(files[0].parent), str(files[1].parent)
    click.echo("\n".join(map(printable, comparison_lines(rows, names))))
    return 0


def report_command(options: Mapping[str, Any]) -> int:
    """Write a plan's page, and those of a family's members; `-o` names a page alone.

    What isn't a page stays, unless `-o` names it.

    Raises:
        OSError: If one can't be written.
    """
    plan, alone = RigPlan.load(options["plan_file"]), options["output"]
    pages = pages_of(plan, options["plan_file"].parent / PAGE)
    if alone is not None:
        pages = {alone: plan}
    for path in pages:
        if alone is None and path.exists() and not is_page(path):
            raise FileExistsError(f"{path} isn't of a plan; choose another with -o")
        if not path.parent.is_dir():
            raise FileNotFoundError(f"{path.parent} is no folder; make it first")
    for path, shown in pages.items():
        threads = options["threads"] or n_threads()
        with writable_file(path):
            write_page(shown, path, threads=threads, linked=alone is None)
    if options["as_json"]:
        print_json({"files": [str(path) for path in pages]})
    else:
        click.echo("\n".join(f"written to {path}" for path in pages))
    return 0


def _camera_lines(camera: CameraFigures) -> Iterator[str]:
    pixel, distance = camera.pixel_m, camera.distance_m
    filled = f"the object fills {percent(camera.filled)} of the image"
    near, far = camera.sharp_m
    sharp = f"sharp from {1e3 * near:.0f} to {1e3 * far:.0f} mm"
    if pixel is None or distance is None:
        yield from labelled(camera.id, [f"measures nothing; {filled}; {sharp}"])
        return
    low, middle, high = (1e3 * length for length in distance)
    angles = [
        f"triangulates with {name} {_degrees(spread)}"
        for name, spread in camera.triangulation.items()
    ]
    yield from labelled(
        camera.id,
        [
            f"{1e3 * pixel:.3f} mm per pixel at {middle:.0f} mm, the median of what it "
            f"measures; {filled}",
            f"measures from {low:.0f} to {high:.0f} mm, {sharp}",
            *angles,
        ],
    )


def _degrees(spread: Spread | None) -> str:
    if spread is None:
        return "nothing"
    low, middle, high = np.degrees(spread)
    return f"at {middle:.1f} degrees ({low:.1f} to {high:.1f})"
