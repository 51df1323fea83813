"""One table laid over another: what is written replaces what it stands for."""

from typing import Any

DEVICES = ("projector", "parallel_projector", "camera")
# What a file takes whole by its name, and else key by key with what it replaces.
NAMED_WHOLE = (*DEVICES, "head")
# Tables that may name a preset: by which key, and where those are.
PRESETS = {
    "calibration": ("from", "calibrations"),
    "photometry": ("sensor", "sensors"),
}
# Ways to say one thing: a figure laid over a base replaces the base's other ways.
_SAME = (
    ("focal_px", "focal_mm", "throw_ratio"),
    ("principal_point_px", "vertical_offset_percent"),
)
# The two ways to say a head's volume, of several keys each.
_BOX, _FRUSTUM = {"volume_mm"}, {"near_mm", "far_mm", "near_size_mm", "far_size_mm"}


def lay_over(base: dict[str, Any], tables: dict[str, Any]) -> dict[str, Any]:
    """Return a preset's tables with a file's laid over them, key by key.

    A device or head that the file names is taken whole from the file; without a name
    its figures replace those of the preset, whose sources for them no longer hold.
    """
    merged = {**base}
    for key, value in tables.items():
        old = base.get(key)
        if not (isinstance(value, dict) and isinstance(old, dict)):
            merged[key] = value
        elif key in PRESETS:
            merged[key] = lay_figures_over(old, value)
        elif key not in NAMED_WHOLE:
            merged[key] = {**old, **value}
        else:
            merged[key] = value if "name" in value else lay_device_over(old, value)
    return merged


def lay_device_over(base: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Return a device with some of its figures replaced."""
    replaced = {key for key in given if not isinstance(given[key], dict)}
    replaced |= {key for group in _SAME if replaced & set(group) for key in group}
    replaced |= _FRUSTUM if replaced & _BOX else set()
    replaced |= _BOX if replaced & _FRUSTUM else set()
    device = {key: value for key, value in base.items() if key not in replaced}
    focus = given.get("focus")
    if isinstance(focus, dict):
        replaced |= {f"focus.{key}" for key in focus}
        device["focus"] = {**base.get("focus", {}), **focus}
    whole = tuple(f"{key}." for key in ("body", "mount", "stated") if key in given)
    older, newer = base.get("sources", {}), given.get("sources", {})
    sources: object = older
    if isinstance(older, dict):
        replaced |= {key for key in older if key.startswith(whole)}
        sources = {k: v for k, v in older.items() if k not in replaced}
    # Nor is a focus that isn't a table passed over.
    laid = ("sources", "focus") if isinstance(focus, dict) else ("sources",)
    device |= {key: given[key] for key in given if key not in laid}
    # Sources that aren't a table are refused later, as they were written.
    if not isinstance(newer, dict):
        sources = newer
    elif isinstance(sources, dict):
        sources = {**sources, **newer}
    return {**device, "sources": sources}


def lay_figures_over(base: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Return a calibration laid over another: what it replaces has no source."""
    if set(given) & {"from", "sensor"}:
        return given
    kept = {k: v for k, v in base.get("sources", {}).items() if k not in given}
    newer = given.get("sources", {})
    sources = {**kept, **newer} if isinstance(newer, dict) else newer
    # One that is changed isn't what it is called any more.
    unnamed = {"description": ""} if set(given) - {"sources"} else {}
    return {**base, **unnamed, **given, "sources": sources}
