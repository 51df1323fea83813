"""What `plan rigs` and `plan schema` do."""

from importlib.resources import files

import click

from planning.rig.rig_files import list_presets


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
