"""What `plan show` and `plan report` do with a plan as written: words, or a page."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import click
import numpy as np

from geometry.parallel import n_threads
from planning.model.plan import RigPlan
from planning.model.words import labelled, percent
from planning.report.page.page import PAGE, is_page, write_page
from planning.report.summary.device_lines import device_lines, gap_lines, mount_lines
from planning.report.summary.region_lines import region_table
from planning.report.summary.zone_lines import zone_lines
from planning.verify.audit.devices.camera_figures import (
    CameraFigures,
    Spread,
    camera_figures,
)

from .console import print_json


def show_command(options: Mapping[str, Any]) -> int:
    """Print places in the axes of the mesh, devices, and what each camera sees."""
    plan = RigPlan.load(options["plan_file"])
    if options["regions"]:
        if options["as_json"]:
            print_json({"regions": plan.to_document()["regions"]})
        else:
            click.echo("\n".join(region_table(plan)))
        return 0
    cameras = camera_figures(plan, threads=options["threads"] or n_threads())
    if options["as_json"]:
        print_json({"cameras": [asdict(camera) for camera in cameras]})
        return 0
    lines = [*zone_lines(plan), *device_lines(plan), *gap_lines(plan)]
    lines += [*mount_lines(plan), ""]
    lines += [line for camera in cameras for line in _camera_lines(camera)]
    click.echo("\n".join(lines))
    return 0


def report_command(options: Mapping[str, Any]) -> int:
    """Write a plan's page; what isn't a page stays, unless `-o` names it.

    Raises:
        OSError: If it can't be written.
    """
    plan = RigPlan.load(options["plan_file"])
    path = options["output"] or options["plan_file"].parent / PAGE
    if options["output"] is None and path.exists() and not is_page(path):
        raise FileExistsError(f"{path} isn't of a plan; choose another with -o")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path.parent} is no folder; make it first")
    write_page(plan, path, threads=options["threads"] or n_threads())
    if options["as_json"]:
        print_json({"files": [str(path)]})
    else:
        click.echo(f"written to {path}")
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
