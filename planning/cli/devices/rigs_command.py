"""What `plan rigs`, its `show` and `devices`, and `plan schema` print."""

from collections.abc import Iterable, Iterator
from importlib.resources import files

import click

from planning.model.errors import RigError
from planning.rig.toml.preset_files import near, preset_names, preset_text
from planning.rig.toml.preset_lists import (
    Figure,
    Preset,
    list_calibrations,
    list_devices,
    list_presets,
    list_sensors,
)

_KINDS = ("projectors", "cameras", "lenses")
_SCHEMAS = {
    "plan": ("planning.model", "plan.schema.json"),
    "rig": ("planning.rig", "presets/rig.schema.json"),
}


def rigs_command() -> int:
    """Print the presets, a line each."""
    rigs = list_presets()
    width = max(len(rig.name) for rig in rigs)
    lines = [f"{rig.name:<{width}}  {rig.description}" for rig in rigs]
    for what, listed in (
        ("calibrations, for `from` of [calibration]", list_calibrations()),
        ("sensors, for `sensor` of [photometry]", list_sensors()),
    ):
        lines += ["", f"{what}:", *(f"  {each.description}" for each in listed)]
    lines += [
        "",
        "plan rigs show NAME            one as the file that it is, to change",
        "plan rigs show NAME --sources  every number of one with its source",
        "plan rigs devices              projectors, cameras and lenses for rig files",
        "plan rigs new                  a rig file of your own, from a few answers",
    ]
    click.echo("\n".join(lines))
    return 0


def show_rig_command(name: str, *, sources: bool) -> int:
    """Print a preset's file, or every figure of what has that name with its source.

    Raises:
        RigError: If nothing has that name.
    """
    if name in preset_names() and not sources:
        click.echo(preset_text(name), nl=False)
        return 0
    listed = {each.name: each for each in _everything(name)}
    if name not in listed:
        hint = near(name, tuple(listed))
        raise RigError(f"{name}: no such rig, device, calibration or sensor; {hint}")
    click.echo("\n".join(_with_sources(listed[name])))
    return 0


def devices_command(kind: str | None) -> int:
    """Print the catalogue, a line each."""
    for each in (kind,) if kind else _KINDS:
        devices = list_devices(each)
        width = max(len(device.name) for device in devices)
        click.echo(f"{each}:")
        for device in devices:
            price = _value(device.figures, "price")
            more = f", {price}" if price else ""
            read = sum(each.source.startswith("read") for each in device.figures)
            more += f" [{read} of {len(device.figures)} figures read, others assumed]"
            click.echo(f"  {device.name:<{width}}  {device.description}{more}")
    click.echo(
        'in a rig file: projector = "NAME", camera = "NAME + LENS" or "NAME + 16mm"; '
        "plan rigs show NAME prints the sources"
    )
    return 0


def schema_command(of: str) -> int:
    """Print a JSON Schema as it is shipped."""
    package, name = _SCHEMAS[of]
    click.echo(files(package).joinpath(name).read_text(encoding="utf-8"), nl=False)
    return 0


def _everything(name: str) -> Iterator[Preset]:
    # Names of devices have a maker before a slash; the catalogue is for these alone.
    if "/" in name:
        for kind in _KINDS:
            yield from list_devices(kind)
    else:
        yield from (*list_presets(), *list_calibrations(), *list_sensors())


def _with_sources(preset: Preset) -> Iterator[str]:
    yield preset.description
    for role, device in preset.devices.items():
        yield f"{role}: {device}"
        yield from _figure_lines(f for f in preset.figures if f.device == role)
    yield from _figure_lines(f for f in preset.figures if not f.device)


def _figure_lines(figures: Iterable[Figure]) -> Iterator[str]:
    for figure in figures:
        yield f"  {figure.key} = {figure.value}"
        yield f"      {figure.source}"


def _value(figures: Iterable[Figure], key: str) -> object:
    return next((f.value for f in figures if f.key == key), None)
