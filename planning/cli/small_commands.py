"""What `plan rigs`, `plan schema` and `plan sample` do."""

from importlib.resources import files
from pathlib import Path

import click

from geometry.shapes.sample_head.sample_head import HeadShape
from planning.rig.rig import list_presets

from .sample import write_sample


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
