"""What `plan verify`, `plan rigs`, `plan schema` and `plan sample` do."""

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import click
import numpy as np

from geometry.files.readers import UNITS, load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.sample_head.head_shape import HeadShape
from geometry.shapes.sample_head.sample_head import (
    DEFAULT_FACES,
    head_as_obj,
    sample_head,
)
from planning.model.files import write_atomically
from planning.model.plan import RigPlan
from planning.rig.rig import list_presets
from planning.verify.verification import verify_plan

from .console import cores, print_json, reporter


def verify_command(options: Mapping[str, Any]) -> int:
    """Audit and check a plan; return 0 if every claim holds, 1 if not."""
    report = reporter(quiet=options["quiet"])
    plan = RigPlan.load(options["plan_file"])
    mesh = None
    if options["mesh"] is not None:
        mesh = _same_scale(options["mesh"], plan)
    truth = None if options["truth"] is None else RigPlan.load(options["truth"])
    seed = {} if options["seed"] is None else {"seed": options["seed"]}
    found = verify_plan(
        plan,
        mesh,
        truth=truth,
        threads=options["threads"] or cores(),
        progress=report,
        **seed,
    )
    if options["as_json"]:
        print_json(found.to_document())
    else:
        click.echo(found.summary())
    return 0 if found.passed else 1


def _same_scale(path: Path, plan: RigPlan) -> TriangleMesh:
    """Read a mesh in the unit of the plan's, or at its size where a size was given."""
    unit = plan.document.meshes[0].unit
    if unit in UNITS:
        return load_mesh(path, unit=unit)
    size = np.ptp(plan.surface.mesh.bounds, axis=0).max()
    return load_mesh(path, size_mm=1e3 * float(size))


def rigs_command() -> int:
    """Print the presets with the source of every number."""
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
    path: str | Path,
    *,
    shape: HeadShape | None = None,
    n_faces: int = DEFAULT_FACES,
    open_neck: bool = True,
) -> TriangleMesh:
    """Write a sample head as an OBJ file in millimetres, the same bytes every time.

    Args:
        path: Where the file goes; its folder must exist.
        shape: Proportions of the head; default an average adult.
        n_faces: Least number of faces of the closed head.
        open_neck: As in `sample_head`.

    Returns:
        The mesh, in metres, before its coordinates were rounded to 0.1 um.

    Raises:
        MeshError: If `n_faces` is out of range.
        OSError: If the file can't be written.
    """
    mesh = sample_head(shape, n_faces=n_faces, open_neck=open_neck)
    text = head_as_obj(mesh, "open at the neck" if open_neck else "closed")
    write_atomically(Path(path), lambda file: file.write(text.encode("ascii")))
    return mesh
