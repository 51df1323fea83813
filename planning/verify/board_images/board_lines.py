"""Planned images of a board in words, and as the file that is written."""

import json
from typing import Any

import numpy as np

from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.plan import RigPlan
from planning.model.words import labelled

from .chosen_images import BoardPlan
from .information import BoardImage


def board_lines(plan: RigPlan, found: BoardPlan) -> list[str]:
    """Return what to hold where, what it leaves, and what isn't counted."""
    board, ids = found.board, _ids(plan)
    size = " x ".join(f"{1e3 * side:.4g}" for side in board.size_m)
    across, down = board.marks
    told = [
        f"{len(found.images)} of a flat board in the object's place: {across} x {down} "
        f"marks, {size} mm between the outermost, each found within "
        f"{found.mark_px:g} px rms in images and on panels",
        "middle [mm in mesh axes], azimuth and elevation that the marks face [deg], "
        "marks by device (about there will do):",
        *(_image_line(k, image, ids) for k, image in enumerate(found.images, 1)),
    ]
    leaves = [
        f"{1e3 * found.left_m:.3f} mm rms of points' errors; edge noise included 95 % "
        f"of what is measured is within {1e3 * found.p95_m:.3f} mm, within "
        f"{1e3 * found.p95_without_m:.3f} with any one image set aside "
        f"(limit {1e3 * found.limit_m:g})"
    ]
    stated, share = plan.requirements.triangulation.calibration, found.stated_share
    if stated is not None and share is not None:
        as_much = CalibrationErrors(*(share * value for value in vars(stated).values()))
        leaves.append(
            f"{share:.2f} times what the plan counts on; as much as [calibration] "
            f"{_words(as_much)}"
        )
    leaves += [
        "by itself each device is known less well, but errors that go together move "
        "points by no more than that:",
        *(f"{name}: {_words(found.left_of(k))}" for k, name in enumerate(ids)),
    ]
    apart = [
        "lens distortion beyond k1, a board that isn't as it is taken to be, what "
        "moves afterwards: allow for it by --mark-px, and measure a known part"
    ]
    if not found.suffices:
        alone = float(np.quantile(found.points.noise_m, 0.95))
        leaves.append(
            "NOT ENOUGH: a larger board (--board), or more devices that see it together"
            if alone <= found.limit_m
            else f"NOT ENOUGH: 95 % is within {1e3 * alone:.3f} mm by edge noise "
            f"alone, which no board changes: a larger --accuracy, or another plan"
        )
    return [
        *labelled("IMAGES", told),
        *labelled("LEAVE", leaves),
        *labelled("WITHOUT", apart),
    ]


def board_document(plan: RigPlan, found: BoardPlan) -> dict[str, Any]:
    """Return the same in metres, radians and pixels."""
    ids = _ids(plan)
    return {
        "format": "ringrig-calibration-images",
        "version": 1,
        "plan": plan.digest,
        "board": {"size_m": list(found.board.size_m), "marks": list(found.board.marks)},
        "mark_px": found.mark_px,
        "limit_m": found.limit_m,
        "images": [
            {
                "world_from_board": np.round(image.world_from_board, 9).tolist(),
                "marks": dict(zip(ids, image.marks.tolist(), strict=True)),
            }
            for image in found.images
        ],
        "left": {
            "rms_m": found.left_m,
            "p95_m": found.p95_m,
            "p95_without_one_m": found.p95_without_m,
            "of_stated": found.stated_share,
            "devices": {name: vars(found.left_of(k)) for k, name in enumerate(ids)},
            "suffices": found.suffices,
        },
    }


def board_file(plan: RigPlan, found: BoardPlan) -> bytes:
    """Return the content of the file."""
    return (json.dumps(board_document(plan, found), indent=1) + "\n").encode("ascii")


def _ids(plan: RigPlan) -> list[str]:
    return [device.id for device in (*plan.projectors, *plan.cameras)]


def _image_line(k: int, image: BoardImage, ids: list[str]) -> str:
    middle = 1e3 * image.world_from_board[:3, 3]
    x, y, z = image.world_from_board[:3, 2]
    azimuth, elevation = np.degrees([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))])
    place = " ".join(f"{value:8.1f}" for value in middle)
    has = ", ".join(
        f"{name} {n}" for name, n in zip(ids, image.marks.tolist(), strict=True) if n
    )
    return f"{k:3} {place}   {azimuth:7.1f} {elevation:6.1f}   {has}"


def _words(errors: CalibrationErrors) -> str:
    figures = (
        (np.degrees(errors.angle), "angle_deg"),
        (1e3 * errors.position_m, "position_mm"),
        (1e2 * errors.focal, "focal_percent"),
        (errors.principal_px, "principal_px"),
    )
    return ", ".join(f"{name} = {value:.2g}" for value, name in figures if value)
