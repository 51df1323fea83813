"""What `plan sample`, `calibrate` and `cache` do."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from geometry.files.archives import is_mesh_name
from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from geometry.shapes.sample_head.head_shape import HeadShape
from geometry.shapes.sample_head.sample_head import (
    DEFAULT_FACES,
    head_as_obj,
    sample_head,
)
from planning.cache.cache import VARIABLE, cache_folder
from planning.cache.entries import FolderEntries
from planning.model.errors import InputError
from planning.model.files import write_atomically
from planning.model.plan import RigPlan
from planning.model.words import count_words, shell_word
from planning.verify.board_images.board import board_for
from planning.verify.board_images.board_lines import (
    board_document,
    board_file,
    board_lines,
)
from planning.verify.board_images.chosen_images import plan_images

from .console import print_json, reporter, writable, writable_file


def calibrate_command(options: Mapping[str, Any]) -> int:
    """Choose images of a board, write and print them; return 1 if they don't do."""
    plan = RigPlan.load(options["plan_file"])
    plan.require_projectors("`plan calibrate`")
    across, down = _pair(options["marks"], "--marks", "12x9", (2.0, 100.0))
    if across % 1.0 or down % 1.0:
        raise click.UsageError(f"--marks {options['marks']} must be whole numbers")
    radius_m = plan.requirements.workspace.object_radius_m
    board = board_for(radius_m, (int(across), int(down)))
    if options["board"] is not None:
        width, height = _pair(options["board"], "--board", "300x225", (1e-3, 1e5))
        board = replace(board, size_m=(1e-3 * width, 1e-3 * height))
    limit_m = plan.requirements.triangulation.max_sigma_m
    if options["accuracy"] is not None:
        limit_m = 1e-3 * options["accuracy"]
    if limit_m is None:
        raise click.UsageError("the plan has no largest sigma; give --accuracy MM")
    path = options["output"] or options["plan_file"].parent / "calibration-images.json"
    with writable_file(path):
        found = plan_images(
            plan,
            board,
            mark_px=options["mark_px"],
            limit_m=limit_m,
            threads=options["threads"] or n_threads(),
            report=reporter(quiet=options["quiet"]),
        )
        write_atomically(path, lambda file: file.write(board_file(plan, found)))
    if options["as_json"]:
        print_json(board_document(plan, found))
    else:
        click.echo("\n".join([*board_lines(plan, found), f"files    {path}"]))
    return 0 if found.suffices else 1


def _pair(
    text: str, option: str, example: str, ends: tuple[float, float]
) -> tuple[float, float]:
    low, high = ends
    try:
        first, second = (float(part) for part in text.split("x"))
    except ValueError:
        first = second = math.nan
    if not (low <= first <= high and low <= second <= high):
        raise click.UsageError(
            f"{option} {text} must be two numbers from {low:g} to {high:g}: {example}"
        )
    return first, second


def sample_command(output: Path, faces: int, variant: int | None) -> int:
    """Write the sample head."""
    shape = HeadShape() if variant is None else HeadShape.random(variant)
    with writable_file(output):
        write_sample(output, shape=shape, n_faces=faces)
    click.echo(f"wrote {output}: a head in millimetres, face along -y, up z")
    return 0


def sample_family_command(folder: Path, faces: int, count: int, seed: int) -> int:
    """Write a family of heads, from child to adult."""
    digits = max(2, len(str(count)))
    names = [f"head-{k + 1:0{digits}}.obj" for k in range(count)]
    done = 0
    try:
        with writable(folder):
            for done, name in enumerate(names):
                shape = HeadShape.of_family(seed, done)
                write_sample(folder / name, shape=shape, n_faces=faces)
    except KeyboardInterrupt:
        if not done:
            raise
        told = f"interrupted; {folder} has {done} of {count_words(count, 'head')}"
        raise KeyboardInterrupt(told) from None
    there = {path.name for path in folder.iterdir() if is_mesh_name(path.name)}
    others = len(there - {*names})
    beside = f" and {count_words(others, 'other')} there" if others else ""
    click.echo(
        f"wrote {folder}: {count_words(count, 'head')} in millimetres, from child to "
        f"adult; `plan --mesh {shell_word(folder)} --max-projectors 5` plans one rig "
        f"for all{beside}"
    )
    return 0


def cache_command(*, clear: bool) -> int:
    """Say where the cache is and what it holds, or drop it."""
    folder = cache_folder()
    if folder is None:
        click.echo(f"{VARIABLE} is empty: nothing is kept for later runs")
        return 0
    if folder.exists() and not folder.is_dir():
        raise InputError(
            f"{VARIABLE} names {folder}, which is no folder: name one, or none at all"
        )
    entries = FolderEntries(folder)
    count, size = entries.size()
    held = f"{count_words(count, 'answer')}, {1e-6 * size:.1f} MB"
    if clear:
        entries.clear()
        click.echo(f"{folder}: {held}, now cleared")
    else:
        limit = f"{1e-6 * entries.limit_bytes:.0f} MB at most"
        click.echo(f"{folder}: {held}, {limit}; `plan cache clear` drops it")
    return 0


def write_sample(
    path: str | Path, *, shape: HeadShape | None = None, n_faces: int = DEFAULT_FACES
) -> TriangleMesh:
    """Write a sample head as an OBJ file in millimetres, the same bytes every time.

    Args:
        path: Where the file goes; its folder must exist.
        shape: Proportions of the head; default an average adult.
        n_faces: Least number of faces of the closed head.

    Returns:
        The mesh, in metres, before its coordinates were rounded to 0.1 um.

    Raises:
        MeshError: If `n_faces` is out of range.
        OSError: If the file can't be written.
    """
    mesh = sample_head(shape, n_faces=n_faces, open_neck=True)
    text = head_as_obj(mesh)
    write_atomically(Path(path), lambda file: file.write(text.encode("ascii")))
    return mesh
