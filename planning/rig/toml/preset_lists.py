"""What comes with the program, to be listed: rigs, calibrations, sensors, devices."""

from collections.abc import Iterator
from dataclasses import dataclass

from planning.model.light.photometry_table import SensorTable
from planning.model.table_types import SourcedTable
from planning.rig.rig_tables import CalibrationTable
from planning.rig.tables.head_tables import HeadDeviceTable

from .catalogue import catalogue
from .laying import DEVICES
from .preset_files import figures_of, names_in, preset_names
from .rig_files import read_rig


@dataclass(frozen=True)
class Figure:
    """One figure of a device, by its dotted key, and where it was read."""

    device: str
    key: str
    value: object
    source: str


@dataclass(frozen=True)
class Preset:
    """A rig that comes with the program; its devices' names are by table."""

    name: str
    description: str
    devices: dict[str, str]
    figures: tuple[Figure, ...]


def list_presets() -> tuple[Preset, ...]:
    """Return the rigs that come with the program, by name."""
    return tuple(_preset(name) for name in preset_names())


def list_calibrations() -> tuple[Preset, ...]:
    """Return what `from` of `[calibration]` takes, each with its figures."""
    return tuple(_of_table("calibrations", CalibrationTable))


def list_sensors() -> tuple[Preset, ...]:
    """Return what `sensor` of `[photometry]` takes, each with its figures."""
    return tuple(_of_table("sensors", SensorTable))


def list_devices(kind: str) -> tuple[Preset, ...]:
    """Return `projectors`, `cameras` or `lenses` of the catalogue, with figures."""
    return tuple(
        Preset(name, f"{entry.name}: {entry.description}", {}, _figures("", entry))
        for name, entry in catalogue(kind).items()
    )


def _of_table(
    folder: str, kind: type[CalibrationTable] | type[SensorTable]
) -> Iterator[Preset]:
    for name in names_in(folder):
        table = kind.model_validate(figures_of(folder, name))
        yield Preset(name, table.description, {}, _figures("", table))


def _preset(name: str) -> Preset:
    table = read_rig(name)
    devices: dict[str, str] = {}
    figures: list[Figure] = []
    for role in DEVICES:
        device = getattr(table, role)
        if device is not None:
            devices[role] = device.name
            figures += _figures(role, device)
    if table.head is not None:
        devices["head"] = table.head.name
        figures += _figures("head", table.head)
    if table.calibration.description:
        devices["calibration"] = table.calibration.description
    return Preset(name, table.description, devices, tuple(figures))


def _figures(role: str, table: SourcedTable) -> tuple[Figure, ...]:
    figures: list[Figure] = []
    for key in table.figures():
        value: object = table
        for part in key.split("."):
            value = getattr(value, part)
        if isinstance(value, list):
            value = [_plain(each) for each in value]
        figures.append(Figure(role, key, value, table.sources.get(key, "assumed")))
    return tuple(figures)


def _plain(value: object) -> object:
    """A device of a head as what was written of it."""
    if not isinstance(value, HeadDeviceTable):
        return value
    return value.model_dump(exclude_unset=True)
