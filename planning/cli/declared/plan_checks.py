"""Which options of `plan` exclude each other."""

import glob
import os
from typing import Any

import click


def check_options(options: dict[str, Any]) -> None:
    """Join the meshes that were given, and refuse options that exclude each other.

    Raises:
        click.UsageError: It names them.
    """
    options["meshes"] += options.pop("files")
    _check_source(options)
    _check_target(options)
    check_each(options)


def check_each(options: dict[str, Any]) -> None:
    """Refuse options that exclude each other whatever is measured.

    Raises:
        click.UsageError: It names them.
    """
    if options["unit"] and options["size_mm"] is not None:
        raise click.UsageError("give --unit or --size-mm, not both")
    if options["max_heads"] is not None:
        for name in ("max_projectors", "max_cameras"):
            if options[name] is not None:
                raise click.UsageError(
                    f"give --max-heads or --{name.replace('_', '-')}, not both"
                )
    if options["pattern"] in ("dense", "none"):
        _check_without_rings(options)


def _check_source(options: dict[str, Any]) -> None:
    meshes, ranges = options["meshes"], options["ranges"]
    if ranges is None and not meshes:
        raise click.UsageError("give --mesh FILE, or --ranges FILE.csv without a mesh")
    if ranges is not None:
        _check_ranges(options)
        return
    if not all(meshes):
        raise click.UsageError("--mesh '' names no file")
    options["meshes"] = meshes = tuple(one for given in meshes for one in _files(given))
    if len(meshes) == 1:
        return
    if options["size_mm"] is not None:
        raise click.UsageError(
            f"--size-mm with {len(meshes)} meshes would make all as large: give --unit"
        )
    if options.get("poses"):
        raise click.UsageError(
            f"an evaluation is of one mesh, and there are {len(meshes)}: give one"
        )


def _files(given: str) -> list[str]:
    """Return the meshes of a folder, or those that a pattern matches, or the file.

    Raises:
        click.UsageError: If a folder or a pattern holds none.
    """
    # `plan --help` needs no readers.
    from geometry.files.archives import is_mesh_name
    from geometry.files.formats import SUPPORTED

    # os.path answers for names that the system refuses; Path raises.
    if os.path.isdir(given):
        names = sorted(os.listdir(given))
        found = [os.path.join(given, name) for name in names if is_mesh_name(name)]
    elif os.path.exists(given) or not glob.has_magic(given):
        return [given]
    else:
        found = sorted(one for one in glob.glob(given) if is_mesh_name(one))
    if not found:
        raise click.UsageError(
            f"--mesh {given}: no mesh there; files must end in .{', .'.join(SUPPORTED)}"
            f", perhaps with .gz, .bz2 or .zip"
        )
    return found


def check_projectors(options: dict[str, Any]) -> None:
    """Refuse a plan without a number of projectors, or with one and none to count."""
    most = options["max_projectors"]
    if options["pattern"] == "none":
        if most:
            raise click.UsageError(
                f"--max-projectors {most} with --pattern none, which has no projector: "
                f"leave it out"
            )
        if options["max_heads"] is not None:
            raise click.UsageError(
                "--max-heads with --pattern none: heads have projectors; leave one out"
            )
        options["max_projectors"] = 0
    elif most is None:
        if options["max_heads"] is None:
            raise click.UsageError(
                "give --max-projectors N, or --max-heads N of a [head]"
            )
    elif most < 1:
        raise click.UsageError(
            f"Invalid value for '--max-projectors': {most} is not in the range x>=1."
        )


def check_watch(options: dict[str, Any]) -> None:
    """Take the rig file to watch for the rig.

    Raises:
        click.UsageError: If there is another, no file, or one JSON object is wanted.
    """
    if options["rig_name"] != "default":
        raise click.UsageError("give --rig or --watch, not both")
    if options["as_json"]:
        raise click.UsageError("--json is of one plan, and --watch makes several")
    if not os.path.isfile(options["watch"]):
        raise click.UsageError(
            f"--watch {options['watch']!r} isn't a file; `plan rigs new` writes one"
        )
    options["rig_name"] = options["watch"]


def _check_without_rings(options: dict[str, Any]) -> None:
    """Refuse what is said of rings where there are none, and what isn't built."""
    pattern = options["pattern"]
    if options["ring_axis"] is not None:
        raise click.UsageError(
            f"--ring-axis is of rings, and --pattern {pattern} has none: leave it out"
        )


def _check_ranges(options: dict[str, Any]) -> None:
    if not options["ranges"]:
        raise click.UsageError("--ranges '' names no file")
    if options["meshes"]:
        raise click.UsageError(
            "give --mesh or --ranges, not both: a mesh says where the object is, and "
            "placing a mesh by observations isn't built"
        )
    for name, why in (
        ("unit", "the file is in millimetres"),
        ("size_mm", "the file is in millimetres"),
        ("select", "the body of ranges has no faces to select"),
        ("weight", "the body of ranges has no vertices to weigh"),
    ):
        if options[name] is not None:
            raise click.UsageError(f"--{name.replace('_', '-')} with --ranges: {why}")
    if options["target"] not in (None, "surface"):
        raise click.UsageError(
            f"--target {options['target']} with --ranges: a sphere has no dominant "
            "region and no inside; the target is its whole surface"
        )


def _check_target(options: dict[str, Any]) -> None:
    chosen = [name for name in ("select", "weight") if options[name] is not None]
    if len(chosen) == 2:
        raise click.UsageError("give --select or --weight, not both")
    if chosen and options["target"] in ("surface", "outside"):
        raise click.UsageError(
            f"give --target {options['target']} or --{chosen[0]}, not both"
        )
    if chosen and not options[chosen[0]]:
        raise click.UsageError(f"--{chosen[0]} '' names no file")
