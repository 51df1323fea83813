"""A rig file from a few answers: what isn't answered is chosen, and said."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from geometry.devices import PinholeModel
from planning.rig import optics
from planning.rig.devices.edge_optics import finest_view_m
from planning.rig.devices.rig_devices import drawn_edges, pinhole_device
from planning.rig.rig_tables import CameraTable, PinholeTable, ProjectorTable

from .catalogue import FARTHEST_MM, LensEntry, device_table, split_camera
from .fitting_optics import BALL, NEAREST, PLAY, check_range, fitting_mm, least_mm

_STOPS = (2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 22.0)
# Closed further, diffraction blurs more than the depth of field wins.
_CLOSED = 11.0
_MOST_BLUR_PX = 12
_PROJECTOR_STOP, _PROJECTOR_BLUR_PX = 2.0, 5.0
# Position that a dot sheet leaves at 1 m. Its angle, 0.0075 degrees, moves points by
# 1.3e-4 of the distance; two and a half times that is what many rigs can keep.
_SHEET_MM, _SIGMA_MM, _SIGMA_SHARE = 0.04, 0.3, 2.5 * 1.3e-4
_STATED = "stated to `plan rigs new`"
_FITS = "assumed: so that the object's depth is sharp"


@dataclass
class Answers:
    """What a user knows; None: choose. Lengths in mm, sizes in pixels."""

    object_mm: float
    projector: str | None = None
    throw_ratio: float | None = None
    projector_px: tuple[int, int] = (1920, 1080)
    offset_percent: float = 0.0
    camera: str | None = None
    camera_count: int | None = None
    more_cameras: Sequence[tuple[str, int | None]] = ()
    sensor_px: tuple[int, int] | None = None
    pixel_um: float = 3.45
    focal_mm: float | None = None
    distance_mm: float | None = None
    name: str = "my rig"


@dataclass
class _Device:
    """A device table as it will be written, and what it stands for."""

    written: dict[str, Any]
    table: dict[str, Any]
    stops: Sequence[float] = (_STOPS[0], _STOPS[-1])
    sources: dict[str, str] = field(default_factory=dict[str, str])

    def model(self, kind: type[PinholeTable]) -> PinholeModel:
        return pinhole_device(kind.model_validate(self.table), "device")


def new_rig(answers: Answers) -> tuple[str, list[str]]:
    """Return the text of a rig file, and what was chosen for the user, a line each.

    Raises:
        ValueError: If a device isn't known, or no lens shows the object.
        RigError: If a device can't be.
    """
    chosen: list[str] = []
    radius = BALL * answers.object_mm
    projector = _projector(answers)
    beam = projector.model(ProjectorTable)
    optics_of = {"projector": beam}
    if answers.focal_mm or "+" in (answers.camera or ""):
        lens = _camera(answers, 0.0, [])
        optics_of["cameras"] = lens.model(CameraTable)
    distance = answers.distance_mm or least_mm(optics_of, radius, chosen)
    near, far = distance * (1.0 - PLAY), distance * (1.0 + PLAY) + radius
    check_range(optics_of, near, far)
    _focus_projector(projector, near, far, focused := [])
    table = ProjectorTable.model_validate(projector.table)
    finest_m = finest_view_m(drawn_edges(table, beam), beam, 1e-3 * distance)
    camera = _camera(answers, distance, chosen, finest_m)
    chosen += focused
    _focus_camera(camera, near, far, chosen)
    cameras = [_of_count(camera, answers.camera_count)]
    for name, count in answers.more_cameras:
        like = replace(answers, camera=name)
        other = _camera(like, distance, told := [f"of {name}:"], finest_m)
        _focus_camera(other, near, far, told)
        chosen.append(" ".join(told))
        cameras.append(_of_count(other, count))
    return _text(answers, distance, projector, cameras, chosen), chosen


def _of_count(device: _Device, count: int | None) -> _Device:
    if count is not None:
        device.written = {**device.written, "count": count}
    return device


def _projector(answers: Answers) -> _Device:
    if answers.throw_ratio is None:
        name = answers.projector or ""
        return _Device({"device": name}, device_table("projector", name, {}))
    written = {
        "name": f"a projector of throw ratio {answers.throw_ratio:g}",
        "resolution_px": [*answers.projector_px],
        "throw_ratio": answers.throw_ratio,
        "vertical_offset_percent": answers.offset_percent,
        "range_mm": [100.0, FARTHEST_MM],
    }
    sources = dict.fromkeys((*written,)[1:4], _STATED)
    sources["range_mm"] = "assumed: its focus reaches wherever it stands; check"
    return _Device(written, dict(written), sources=sources)


def _camera(
    answers: Answers, distance: float, chosen: list[str], finest_m: float = 0.0
) -> _Device:
    if answers.sensor_px is None:
        camera, lens = split_camera(answers.camera or "")
        device = answers.camera or ""
        if lens is None:
            focal = answers.focal_mm or fitting_mm(
                (camera.resolution_px, camera.pixel_um),
                answers.object_mm,
                distance,
                finest_m,
                chosen,
            )
            device = f"{device.strip()} + {focal:g}mm"
        stops = lens.f_numbers if isinstance(lens, LensEntry) else _STOPS
        table = device_table("camera", device, {})
        return _Device({"device": device}, table, (stops[0], stops[-1]))
    size = [*answers.sensor_px]
    focal = answers.focal_mm or fitting_mm(
        (size, answers.pixel_um), answers.object_mm, distance, finest_m, chosen
    )
    written = {
        "name": f"a camera of {size[0]} x {size[1]} px with a {focal:g} mm lens",
        "resolution_px": size,
        "pixel_um": answers.pixel_um,
        "focal_mm": focal,
        "range_mm": [NEAREST * focal, FARTHEST_MM],
    }
    sources = dict.fromkeys((*written,)[1:4], _STATED)
    sources["range_mm"] = "assumed: from ten focal lengths on"
    return _Device(written, dict(written), sources=sources)


def _focus_projector(
    device: _Device, near: float, far: float, chosen: list[str]
) -> None:
    pixel_um = device.table.get("pixel_um")
    if pixel_um is None:
        chosen.append("of the projector no depth of field: its panel isn't known")
        return
    focal = device.model(ProjectorTable).focal_px * pixel_um * 1e-3
    need, distance = _stop(focal, _PROJECTOR_BLUR_PX * pixel_um, near, far)
    blur = max(1.0, math.ceil(1.1 * need / _PROJECTOR_STOP))
    _write_focus(device, distance, _PROJECTOR_STOP, _PROJECTOR_BLUR_PX * blur)
    chosen.append(
        f"the projector at f/{_PROJECTOR_STOP:g}, focused at {distance:.0f} mm, with "
        f"edges blurred by up to {_PROJECTOR_BLUR_PX * blur:g} px"
    )


def _focus_camera(device: _Device, near: float, far: float, chosen: list[str]) -> None:
    pixel_um, focal = device.table["pixel_um"], device.table["focal_mm"]
    most = min(_CLOSED, device.stops[1])
    need, distance = _stop(focal, pixel_um, near, far)
    # What a stop must be falls as the blur that is let pass.
    blur = min(max(1, math.ceil(1.05 * need / most)), _MOST_BLUR_PX)
    need /= blur
    stop = next((s for s in _STOPS if s >= 1.05 * need and s >= device.stops[0]), most)
    _write_focus(device, distance, stop, float(blur))
    chosen.append(
        f"the cameras at f/{stop:g}, focused at {distance:.0f} mm, with up to {blur} "
        f"px of blur at the ends of the object's depth"
    )


def _stop(focal: float, blur_um: float, near: float, far: float) -> tuple[float, float]:
    stop, distance = optics.least_stop(
        1e-3 * focal, 1e-6 * blur_um, 1e-3 * near, 1e-3 * far
    )
    return stop, 1e3 * distance


def _write_focus(device: _Device, distance: float, stop: float, blur: float) -> None:
    device.written["focus"] = device.table["focus"] = {
        "distance_mm": float(f"{distance:.0f}"),
        "f_number": stop,
        "blur_px": blur,
    }
    device.sources |= {f"focus.{key}": _FITS for key in device.written["focus"]}


def _text(
    answers: Answers,
    distance: float,
    projector: _Device,
    cameras: Sequence[_Device],
    chosen: list[str],
) -> str:
    sheet = float(f"{_SHEET_MM * min(1.0, distance / 1e3):.2g}")
    lines = [
        "# Written by `plan rigs new`; every key: docs/reference/rig-files.md.",
        "# For completion: plan schema --of rig > rig.schema.json, and on top, as a",
        "# line of its own: #:schema ./rig.schema.json",
        "",
        f"name = {json.dumps(answers.name)}",
        f'description = "for objects up to {answers.object_mm:g} mm"',
        "",
        "# A name of `plan rigs devices`, or figures of your own.",
        *_table("projector", projector),
        '# K and distortion as measured by OpenCV: calibration = "camera.yml"',
        *(
            line
            for camera in cameras
            for line in _table("camera", camera, listed=len(cameras) > 1)
        ),
        "# From device to surface. Rooms, floors and mounting planes: [workspace];",
        "# without it devices may stand anywhere about the object.",
        "[placement]",
        f"standoff_mm = {distance:.1f}",
        f"standoff_play_mm = {float(f'{PLAY * distance:.3g}')}",
        "",
        "# What your calibration will leave; position in proportion to the distance.",
        "[calibration]",
        'from = "dot-sheet"',
        f"position_mm = {sheet}",
        "",
        "[calibration.sources]",
        'position_mm = "assumed: that of the dot sheet at 1 m, in proportion"',
        "",
    ]
    sigma = math.ceil(10.0 * _SIGMA_SHARE * distance) / 10.0
    if sigma > _SIGMA_MM + 0.1:
        lines += [
            "# From so far away a calibration leaves more.",
            "[limits]",
            f"max_sigma_mm = {sigma}",
            "",
            "[check]",
            f"max_rms_mm = {sigma / 2:.2g}",
            f"max_p95_mm = {sigma * 1.5:.2g}",
            f"max_bias_mm = {sigma / 8:.2g}",
            "",
        ]
        chosen.append(
            f"a sigma up to {sigma:g} mm counts as measured, not {_SIGMA_MM:g}: from "
            f"so far away a calibration leaves more (max_sigma_mm)"
        )
    return "\n".join(lines)


def _table(name: str, device: _Device, *, listed: bool = False) -> list[str]:
    lines = [f"[[{name}]]" if listed else f"[{name}]"]
    tables = {}
    for key, value in device.written.items():
        if isinstance(value, dict):
            tables[key] = value
        else:
            lines.append(f"{key} = {json.dumps(value)}")
    if device.sources:
        tables["sources"] = {
            f'"{key}"' if "." in key else key: value
            for key, value in device.sources.items()
        }
    for key, table in tables.items():
        lines += ["", f"[{name}.{key}]"]
        lines += [f"{inner} = {json.dumps(value)}" for inner, value in table.items()]
    return [*lines, ""]
