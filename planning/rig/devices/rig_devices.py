"""Devices of a rig file, turned into optical models in pixels and metres."""

import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import Any, cast

import numpy as np

from geometry.devices import DeviceModel, ParallelModel, PinholeModel
from planning.model.devices.bodies import Body
from planning.model.devices.lens_fault import lens_fault
from planning.model.errors import RigError
from planning.model.light.drawn_edges import DrawnEdges
from planning.model.light.light_budget import LightBudget
from planning.rig import optics
from planning.rig.rig_tables import (
    ParallelTable,
    PinholeTable,
    ProjectorTable,
    RigTable,
)

# Projectors of the shortest throw look 60 degrees or so off their axes.
_FARTHEST_OFF = math.radians(75.0)
_UNSAID = "stated in the rig file, without a source"


def pinhole_device(table: PinholeTable, role: str) -> PinholeModel:
    """Return the model of a camera or a diverging projector, `role` in messages.

    A projector's lens is taken as straight: rings are drawn as if it were.

    Raises:
        RigError: If no distance is sharp, or sharpness has no far end, or its lens
            model folds the image.
    """
    width, height = table.resolution_px
    fx, fy = _focal_px(table)
    if table.principal_point_px is not None:
        cx, cy = table.principal_point_px
    else:
        cx = 0.5 * (width - 1)
        cy = optics.principal_row(height, table.vertical_offset_percent or 0.0)
    k1, k2, p1, p2, k3 = table.distortion
    camera_matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    camera_matrix.setflags(write=False)
    off = math.atan(
        math.hypot((cx - (width - 1) / 2) / fx, (cy - (height - 1) / 2) / fy)
    )
    if not off <= _FARTHEST_OFF:
        raise RigError(
            f"[{role}] the principal point ({cx:g}, {cy:g}) lies "
            f"{math.degrees(off):.1f} degrees off the middle of an image of {width} x "
            f"{height} px, where no lens draws one; at most "
            f"{math.degrees(_FARTHEST_OFF):.0f}, correct principal_point_px or "
            f"vertical_offset_percent"
        )
    device = PinholeModel(
        camera_matrix,
        (width, height),
        _sharp_range(table, math.sqrt(fx * fy), role),
        (k1, k2, p1, p2, k3),
    )
    if fault := lens_fault(device):
        raise RigError(f"[{role}] {fault}")
    straight = isinstance(table, ProjectorTable)
    return replace(device, distortion=(0.0,) * 5) if straight else device


def parallel_device(table: ParallelTable) -> ParallelModel:
    """Return the model of a projector of parallel light."""
    width, height = table.resolution_px
    low, high = table.range_mm
    radius = table.beam_radius_mm
    return ParallelModel(
        (width, height),
        table.pixel_pitch_mm * 1e-3,
        (low * 1e-3, high * 1e-3),
        None if radius is None else radius * 1e-3,
    )


def device_of(table: PinholeTable | ParallelTable, role: str) -> DeviceModel:
    """Return the model of a device of either kind and light, `role` in messages.

    Raises:
        RigError: As of `pinhole_device`.
    """
    if isinstance(table, ParallelTable):
        return parallel_device(table)
    return pinhole_device(table, role)


def drawn_edges(table: PinholeTable | ParallelTable, device: DeviceModel) -> DrawnEdges:
    """Return what blurs the edges that a projector draws; unsaid: its focus doesn't."""
    if isinstance(table, ParallelTable) or table.focus is None:
        return DrawnEdges()
    assert isinstance(device, PinholeModel)
    focal_m = device.focal_px * _pixel_m(table)
    return DrawnEdges(
        focus_m=1e-3 * table.focus.distance_mm,
        aperture_m=focal_m / table.focus.f_number,
    )


def light_budget(
    table: RigTable, projector: PinholeTable | ParallelTable, camera: PinholeModel
) -> LightBudget | None:
    """Return what the rig says of light; None: nothing.

    Raises:
        RigError: If the camera's stop, pixels or exposure aren't stated.
    """
    light, seen = table.photometry, table.camera
    if light is None:
        return None
    if seen.focus is None or seen.pixel_um is None:
        raise RigError(
            "[photometry] needs camera.pixel_um and [camera.focus] with its f_number: "
            "they decide how much light a pixel gets; write them"
        )
    hz = projector.frame_rate_hz
    period, longest = None if hz is None else 1.0 / hz, light.max_exposure_ms
    if longest is None and period is not None:
        # As stated, in whole refreshes.
        stated = 1e-3 * (seen.exposure_ms or 0.0)
        longest = 1e3 * max(round(stated / period), 1) * period
    longest = longest or seen.exposure_ms
    if longest is None:
        raise RigError(
            "[photometry] needs max_exposure_ms, camera.exposure_ms or the projector's "
            "frame_rate_hz: none says how long an exposure may be"
        )
    if period is not None and 1e-3 * longest < period * (1.0 - 1e-9):
        raise RigError(
            f"[photometry] max_exposure_ms = {longest:g} is shorter than a refresh of "
            f"the projector, {1e3 * period:.3g} ms, of which an exposure takes whole "
            f"ones; write a longer one"
        )
    return LightBudget(
        albedo=light.albedos,
        f_number=seen.focus.f_number,
        focal_px=camera.focal_px,
        pixel_m=_pixel_m(seen),
        gain=10.0 ** (light.gain_db / 20.0),
        max_exposure_s=1e-3 * longest,
        period_s=period,
        **{
            name: getattr(light, name)
            for name in (
                *("lumens", "contrast", "room_lux", "lumens_per_watt", "transmission"),
                *("quantum_efficiency", "full_well_e", "read_noise_e", "bits"),
                "min_contrast",
            )
        },
    )


def device_document(
    table: PinholeTable | ParallelTable, device: DeviceModel
) -> dict[str, Any]:
    """Return a device as plain values, with figures as written and their sources."""
    body = Body.of(table.body)
    return {
        "name": table.name,
        **device.to_document(),
        "figures": table.model_dump(
            mode="json",
            exclude={"name", "device", "sources", "count", "cost"},
            exclude_none=True,
            exclude_unset=True,
        ),
        "sources": {key: table.sources.get(key, _UNSAID) for key in table.figures()},
        **({} if body is None else {"body": asdict(body)}),
        **({} if table.count is None else {"count": table.count}),
        **({} if table.cost is None else {"cost": table.cost}),
    }


def device_notes(role: str, table: PinholeTable | ParallelTable) -> Iterator[str]:
    """Yield what a user of a device should know, a sentence each."""
    if isinstance(table, ProjectorTable) and any(table.distortion):
        yield (
            f"{role}: its distortion moves rings by up to {_bent_px(table, role):.1f} "
            f"px at the corners and isn't counted: rings are planned, drawn and "
            f"checked as if it had none; bend the pattern files by it"
        )
    if table.device is None:
        return
    # How it is focused is the user's own choice.
    guessed = [
        key
        for key in table.figures()
        if table.sources.get(key, "").startswith("assumed") and "focus" not in key
    ]
    if guessed:
        yield (
            f"{role} {table.device}: {', '.join(guessed)} assumed, not read; check "
            f"your data sheet"
        )
    if isinstance(table, PinholeTable) and table.focus is None:
        yield (
            f"{role} {table.device}: without [{role}.focus] every distance from "
            f"{(table.range_mm or [0.0])[0]:g} mm on counts as sharp"
        )


def _bent_px(table: ProjectorTable, role: str) -> float:
    """How far distortion moves the corners of an image at most [px]."""
    device = pinhole_device(table, role)
    k1, k2, p1, p2, k3 = table.distortion
    width, height = device.resolution
    corners = np.array([[x, y] for x in (0, width - 1) for y in (0, height - 1)])
    bent = replace(device, distortion=(k1, k2, p1, p2, k3))
    moved = device.project(bent.rays(corners.astype(np.float64))) - corners
    return float(np.linalg.norm(moved, axis=1).max())


def _focal_px(table: PinholeTable) -> tuple[float, float]:
    """Focal lengths in pixels: as stated, f = T w, or f = f_mm / p.

    T is the distance from the optical centre over the image's width. A maker's law
    ``distance = a W - b`` counts from the housing: the optical centre lies b behind it,
    and T = a. A lens in millimetres is taken as focused far away; at 1 m and 12 mm that
    is 1.2 % off, which a calibration replaces.
    """
    if table.focal_px is not None:
        return table.focal_px[0], table.focal_px[1]
    if table.throw_ratio is not None:
        f = table.throw_ratio * table.resolution_px[0]
    else:
        f = cast(float, table.focal_mm) * 1e-3 / _pixel_m(table)
    return f, f


def _pixel_m(table: PinholeTable) -> float:
    return cast(float, table.pixel_um) * 1e-6


def _sharp_range(table: PinholeTable, focal: float, role: str) -> tuple[float, float]:
    """Meet of the distances the lens can be set to and the depth of field it has."""
    low, high = (x * 1e-3 for x in table.range_mm or (0.0, math.inf))
    near, far = _depth_of_field(table, focal, role)
    if not max(low, near) < min(high, far):
        raise RigError(
            f"[{role}] no distance is sharp: the depth of field, {near * 1e3:.0f} to "
            f"{far * 1e3:.0f} mm, and range_mm = {table.range_mm} don't meet; refocus"
        )
    low, high = max(low, near), min(high, far)
    if not math.isfinite(high):
        raise RigError(
            f"[{role}] the depth of field has no far end; write range_mm with the "
            f"farthest distance that is wanted"
        )
    return low, high


def _depth_of_field(
    table: PinholeTable, focal: float, role: str
) -> tuple[float, float]:
    if table.focus is None:
        return 0.0, math.inf
    pixel_m = _pixel_m(table)
    try:
        return optics.depth_of_field(
            focal * pixel_m,
            table.focus.f_number,
            table.focus.blur_px * pixel_m,
            table.focus.distance_mm * 1e-3,
        )
    except ValueError as error:
        raise RigError(f"[{role}.focus] {error}; correct distance_mm") from None
