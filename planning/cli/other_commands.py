"""What `plan rigs`, `plan schema`, `plan sample` and `plan export` do."""

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import click

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.sample_head.head_shape import HeadShape
from geometry.shapes.sample_head.sample_head import (
    DEFAULT_FACES,
    head_as_obj,
    sample_head,
)
from planning.model.files import write_atomically
from planning.model.plan import RigPlan
from planning.model.words import count_words
from planning.rig.rig_files import list_presets, preset_text
from planning.verify.reconstruction.render.mitsuba.materials import Surface
from planning.verify.reconstruction.render.mitsuba.scene_files import write_scenes
from planning.verify.reconstruction.scanner import Scanner

from .console import given, print_json, reporter, writable


def rigs_command(name: str | None) -> int:
    """Print the presets with the source of every number, or one's file as it is."""
    if name is not None:
        click.echo(preset_text(name), nl=False)
        return 0
    for preset in list_presets():
        click.echo(f"{preset.name}: {preset.description}")
        for role, device in preset.devices.items():
            click.echo(f"  {role}: {device}")
            for figure in preset.figures:
                if figure.device == role:
                    click.echo(f"    {figure.key} = {figure.value}")
                    click.echo(f"        {figure.source}")
    return 0


def schema_command() -> int:
    """Print the JSON Schema of a plan file, as it is shipped."""
    text = files("planning.model").joinpath("plan.schema.json").read_text()
    click.echo(text, nl=False)
    return 0


def sample_command(output: Path, faces: int, variant: int | None) -> int:
    """Write the sample head."""
    shape = HeadShape() if variant is None else HeadShape.random(variant)
    write_sample(output, shape=shape, n_faces=faces)
    click.echo(f"wrote {output}: a head in millimetres, face along -y, up z")
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
    text = head_as_obj(mesh, "open at the neck")
    write_atomically(Path(path), lambda file: file.write(text.encode("ascii")))
    return mesh


def export_command(options: Mapping[str, Any]) -> int:
    """Write a scene for each projector of a plan; print where they are."""
    path, report = Path(options["plan_file"]), reporter(quiet=options["quiet"])
    scanner = Scanner.of(RigPlan.load(path))
    folder = options["output"] or path.parent / options["target"]
    with writable(folder):
        report("drawing the patterns")
        scenes = write_scenes(
            scanner,
            folder,
            Surface(**given(options, "albedo", "texture")),
            **{"ambient": scanner.limits.check.ambient} | given(options, "ambient"),
        )
    if options["as_json"]:
        print_json({"folder": str(folder), "scenes": [str(scene) for scene in scenes]})
    else:
        names = ", ".join(scene.name for scene in scenes)
        cameras = count_words(len(scanner.cameras), "camera")
        click.echo(f"{folder}: {names} with {cameras} each, see README.txt")
    return 0
