"""What a rig file only names: its base, devices, calibrations, presets of tables."""

import tomllib
from pathlib import Path
from typing import Any

from planning.model.errors import RigError

from .catalogue import device_table
from .laying import DEVICES, PRESETS, lay_device_over, lay_figures_over, lay_over
from .opencv_file import read_intrinsics
from .preset_files import figures_of, names_in, near, preset_names, preset_text

# Of a file whose base isn't known nothing is missing for certain.
WHOLE_FILE = ""


class Named:
    """Puts what a rig file names in its place; what can't be found is a fault.

    Attributes:
        faults: One line each, without the file.
        broken: Tables of which more faults would only follow from these.
    """

    def __init__(self, folder: Path) -> None:
        self.faults: list[str] = []
        self.broken: set[str] = set()
        self._folder = folder
        # Sizes of calibrated images that the base's device must have, with the file.
        self._calibrated: dict[str, tuple[str, list[int]]] = {}

    def resolved(self, tables: dict[str, Any]) -> dict[str, Any]:
        """Return tables that name nothing any more."""
        tables = self._with_devices(self._parted(tables))
        # A preset may itself be laid over another.
        while (base := tables.pop("base", None)) is not None:
            if not isinstance(base, str) or base not in preset_names():
                self.broken.add(WHOLE_FILE)
                hint = near(str(base), preset_names())
                self.faults.append(f"base = {base!r} must name a preset; {hint}")
                break
            below = self._with_devices(tomllib.loads(preset_text(base)))
            self._check_base(below)
            tables = lay_over(below, tables)
        for key in PRESETS:
            if isinstance(table := tables.get(key), dict):
                tables[key] = self._with_preset(key, table)
        return tables

    def _parted(self, tables: dict[str, Any]) -> dict[str, Any]:
        """Part lists of devices into the first and more; these name nothing then."""
        tables = dict(tables)
        for role in DEVICES:
            if not isinstance(given := tables.get(role), list):
                continue
            if not given:
                self.faults.append(f"[[{role}]] is an empty list; write a device")
                self.broken.add(role)
            tables[role], *more = given or [{}]
            tables[f"more_{role}s"] = [
                self._named(role, entry, f"{role}[{place}]")
                for place, entry in enumerate(more, 1)
            ]
        return tables

    def _named(self, role: str, given: object, where: str) -> object:
        """Return one table of devices that names nothing any more."""
        if isinstance(given, str):
            given = {"device": given}
        if not isinstance(given, dict) or not {"device", "calibration"} & {*given}:
            return given
        try:
            return self._device(role, given, where)
        except (ValueError, RigError) as error:
            self.faults.append(f"[{where}] {error}")
            self.broken.add(where)
            return given

    def _with_devices(self, tables: dict[str, Any]) -> dict[str, Any]:
        tables = dict(tables)
        for role in DEVICES:
            if role in tables:
                tables[role] = self._named(role, tables[role], role)
        return tables

    def _device(self, role: str, given: dict[str, Any], where: str) -> dict[str, Any]:
        table: dict[str, Any] = {}
        if (device := given.get("device")) is not None:
            table = device_table(role, device, given)
        file = given.get("calibration")
        table = lay_device_over(
            table, {k: v for k, v in given.items() if k != "calibration"}
        )
        if file is None:
            return table
        if role == "parallel_projector" or not isinstance(file, str):
            raise ValueError(
                f"calibration = {file!r} must be the name of a file of a camera or a "
                f"projector of diverging light"
            )
        intrinsics = read_intrinsics(self._folder / file)
        size = table.get("resolution_px")
        if size is None:
            self._calibrated[where] = file, intrinsics.resolution_px
        else:
            _check_size(file, intrinsics.resolution_px, size)
        return lay_device_over(table, intrinsics.figures())

    def _check_base(self, below: dict[str, Any]) -> None:
        for role, (file, size) in list(self._calibrated.items()):
            if role in below:
                del self._calibrated[role]
                try:
                    _check_size(file, size, below[role]["resolution_px"])
                except ValueError as error:
                    self.faults.append(f"[{role}] {error}")

    def _with_preset(self, key: str, given: dict[str, Any]) -> dict[str, Any]:
        """Return a table laid over the preset that it names, if it names one."""
        given, (word, folder) = dict(given), PRESETS[key]
        if (name := given.pop(word, None)) is None:
            return given
        known = names_in(folder)
        if name not in known:
            self.broken.add(key)
            self.faults.append(
                f"[{key}] {word} = {name!r} must be one of {', '.join(known)}"
            )
            return given
        preset = figures_of(folder, name)
        laid = lay_figures_over(preset, given)
        # A sensor's figures are a few of its table's; they keep its name.
        if folder == "sensors" and not set(given) & set(preset):
            laid["description"] = preset["description"]
        return laid


def _check_size(file: str, calibrated: list[int], size: object) -> None:
    if size != calibrated:
        raise ValueError(
            f"{file} is of images of {calibrated[0]} x {calibrated[1]} px, the device "
            f"has resolution_px = {size}; calibrate at that size, or write "
            f"resolution_px = {calibrated} if that is what you take"
        )
