"""The JSON Schema of rig files, for editors: from the tables, in the reference's words.

Words and units are those of `docs/reference/rig-files.md`; the schema is shipped beside
the presets, since that page isn't.
"""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from planning.rig.rig_tables import RigTable

from .laying import DEVICES
from .preset_files import names_in, preset_names

_TABLES = {
    "camera": "CameraTable",
    "projector": "ProjectorTable",
    "parallel_projector": "ParallelTable",
}
# What a file lays over a base or a device needs no key of its own.
_LAID = (
    *("CameraTable", "ProjectorTable", "ParallelTable", "FocusTable"),
    *("CalibrationTable", "PhotometryTable", "HeadTable"),
)
_UNITS = {
    "mm": "mm",
    "um": "um",
    "deg": "degrees",
    "px": "pixels",
    "percent": "percent",
    "hz": "1/s",
    "ms": "ms",
    "lux": "lx",
    "e": "electrons",
}
_NAMED = {
    "device": "a name of `plan rigs devices`; of a camera with + and its lens or focal "
    "length: basler/acA2440-75um + 16mm. Keys beside it replace its figures",
    "calibration": "a file of OpenCV with camera_matrix, distortion_coefficients and "
    "the image's size, beside this one; replaces focal length, principal point and "
    "distortion",
    "base": "the preset that this file is laid over (`plan rigs`)",
    "from": "the calibration that keys beside it are laid over (`plan rigs`)",
    "sensor": "the sensor that keys beside it are laid over (`plan rigs`)",
    "camera": "the cameras: a name of `plan rigs devices`, a table, or a list",
    "projector": "the projectors, of diverging light: a name, a table, or a list",
    "parallel_projector": "the projectors of parallel light: a table or a list",
    "model": "of an existing device: the name of one of a list of models",
    "focus": "the lens is set to one distance; what blurs little is sharp",
    "f_number": "focal length over the width of the aperture",
    "body": "the housing, a box that moves with the device",
    "mount": "where a device is fastened, and what it can be set to there",
    "placement": "where devices stand, and how many poses are tried",
    "rings": "the ring pattern",
    "dense": "what tells every pixel of a projector, with --pattern dense",
    "workspace": "where devices may stand",
    "limits": "when a point counts as lit, seen and measurable",
    "photometry": "light: how bright rings come out in the images",
    "requirements": "what share of the target a plan must reach",
    "check": "what the reconstruction from pixels must reach",
    "existing": "devices that stand already, and stay",
    "obstacle": "what stands in the way of light and views",
    "head": "one rigid body with its projectors and cameras",
    "stated": "what the head's maker states; nothing is planned with it",
    "turntable": "turns the part, while devices stand",
    "stations": "poses of the head, which is carried between them",
    "kind": "of the model of [projector] or of [camera]",
    "normal": "of a mounting plane: out of it, towards the object or away",
    "sources": "for each figure what was read where, or assumed: and why",
}
# What a key means in one table alone.
_OF_TABLE = {
    ("HeadTable", "projector"): "its projectors, and where they stand in it",
    ("HeadTable", "camera"): "its cameras, and where they stand in it",
    ("HeadDeviceTable", "name"): "of this device within the head",
    ("HeadDeviceTable", "roll_deg"): "with position_mm and aim_mm: clockwise as the "
    "device sees it, 0 with the image upright, which is the head's -y",
    (
        "HeadDeviceTable",
        "model",
    ): "which of a list of models; the first if absent",
}
_KEY = re.compile(r"`(\w+)`")
_CELLS = re.compile(r"(?<!\\)\|")
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")


def rig_schema(page: str) -> str:
    """Return the schema as text, with the words of the reference page."""
    schema = RigTable.model_json_schema()
    tables: dict[str, Any] = {"": schema, **schema["$defs"]}
    for name in _LAID:
        tables[name].pop("required", None)
    for name in ("CameraTable", "ProjectorTable"):
        tables[name]["properties"]["calibration"] = {"type": "string"}
    tables["CalibrationTable"]["properties"]["from"] = _one_of(names_in("calibrations"))
    tables["PhotometryTable"]["properties"]["sensor"] = _one_of(names_in("sensors"))
    schema["properties"]["base"] = _one_of(preset_names())
    del schema["required"]
    schema["anyOf"] = [{"required": ["base"]}, {"required": ["name", "camera"]}]
    words = _words(page)
    for name, table in tables.items():
        section = _section(name, schema)
        for key, entry in table.get("properties", {}).items():
            _without_null(entry)
            for noise in ("title", "default")[: 2 if "$ref" in entry else 1]:
                entry.pop(noise, None)
            found = words.get((section, key)) or words.get(("", key), "")
            text = _OF_TABLE.get((name, key)) or _NAMED.get(key) or found
            unit = _UNITS.get(key.rpartition("_")[2], "") if "_" in key else ""
            entry["description"] = (f"{text} [{unit}]" if unit else text).strip()
    for role in DEVICES:
        entry, one = schema["properties"][role], {"$ref": f"#/$defs/{_TABLES[role]}"}
        entry.pop("$ref", None)
        named = [] if role == "parallel_projector" else [{"type": "string"}]
        one_of = [*named, one]
        entry["anyOf"] = [
            *one_of,
            {"type": "array", "minItems": 1, "items": {"anyOf": one_of}},
        ]
        del schema["properties"][f"more_{role}s"]
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return json.dumps({**head, **schema, "title": "ringrig rig file"}, indent=1) + "\n"


def _one_of(names: tuple[str, ...]) -> dict[str, Any]:
    return {"type": "string", "enum": [*names]}


def _without_null(entry: dict[str, Any]) -> None:
    """TOML has no null: an absent key is what a table calls None."""
    if entry.get("default", 0) is None:
        del entry["default"]
    kinds = [kind for kind in entry.get("anyOf", []) if kind != {"type": "null"}]
    if len(kinds) == 1:
        del entry["anyOf"]
        entry.update(kinds[0])
    elif kinds:
        entry["anyOf"] = kinds


def _section(table: str, schema: Mapping[str, Any]) -> str:
    """The rig file's name of a table: the first key that refers to it."""
    for key, entry in schema["properties"].items():
        if f'$defs/{table}"' in json.dumps(entry):
            return key
    return ""


def _words(page: str) -> dict[tuple[str, str], str]:
    """Return what rows of the page say of keys, by table; of "" whichever is first."""
    words: dict[tuple[str, str], str] = {}
    for tables, cells, meaning in _rows(page):
        text, keys = _plain(cells[meaning]), _KEY.findall(cells[0])
        # A row of several keys may explain them in their order.
        parts = text.split("; ")
        texts = parts if len(parts) == len(keys) else [text] * len(keys)
        for key, text in zip(keys, texts, strict=True):
            for table in (*tables, ""):
                words.setdefault((table, key), text)
    return words


def _rows(page: str) -> Iterator[tuple[list[str], list[str], int]]:
    """Yield each row below a heading: tables of the heading, cells, which explains."""
    tables, meaning = list[str](), None
    for line in page.splitlines():
        if line.startswith("#"):
            tables = re.findall(r"`\[+(\w+)[\].]", line)
        cells = [cell.strip() for cell in _CELLS.split(line)[1:-1]]
        if not line.startswith("|"):
            meaning = None
        elif meaning is None:
            meaning = cells.index("meaning") if "meaning" in cells else len(cells) - 1
        elif meaning < len(cells) and not line.startswith("|-"):
            yield tables, cells, meaning


def _plain(text: str) -> str:
    return _LINK.sub(r"\1", text).replace("`", "").replace("\\|", "|").replace("**", "")
