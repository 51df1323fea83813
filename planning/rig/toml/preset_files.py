"""The files that come with the program: rigs, and what tables of a rig may name."""

import difflib
import tomllib
from importlib.resources import files
from typing import Any

from planning.model.errors import RigError

_PACKAGE = "planning.rig"
_PRESETS = "presets"


def preset_names() -> tuple[str, ...]:
    """Return the names that `load_rig` takes without a file."""
    return names_in()


def preset_text(name: str) -> str:
    """Return the file of a preset.

    Raises:
        RigError: If there is none of this name.
    """
    known = preset_names()
    if name not in known:
        raise RigError(
            f"rig {name}: no such preset; {near(name, known)} A file's name ends in "
            f".toml"
        )
    return _text(f"{name}.toml")


def figures_of(folder: str, name: str) -> dict[str, Any]:
    """Return what `from` or `sensor` names: a table, described by its name."""
    table = tomllib.loads(_text(folder, f"{name}.toml"))
    return {**table, "description": f"{name}: {table['description']}"}


def devices_of(kind: str) -> dict[str, Any]:
    """Return the catalogue's tables of `projectors`, `cameras` or `lenses`."""
    return tomllib.loads(_text("devices", f"{kind}.toml"))


def names_in(*folder: str) -> tuple[str, ...]:
    """Return the names of the presets in a folder."""
    place = files(_PACKAGE).joinpath(_PRESETS, *folder)
    names = (entry.name for entry in place.iterdir())
    return tuple(sorted(name[:-5] for name in names if name.endswith(".toml")))


def near(name: str, known: tuple[str, ...]) -> str:
    """Say which name may have been meant, or all that there are."""
    within = [each for each in known if name and name.lower() in each.lower()]
    close = difflib.get_close_matches(name, known, n=1) or within[:1]
    return f"did you mean {close[0]}?" if close else f"there are: {', '.join(known)}."


def _text(*path: str) -> str:
    file = files(_PACKAGE).joinpath(_PRESETS, *path)
    return file.read_text(encoding="utf-8")
