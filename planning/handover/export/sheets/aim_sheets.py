"""Aiming sheets: where three landmarks of the object must appear in each device."""

import csv
import io
from functools import partial
from typing import BinaryIO

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from geometry.arrays import Array
from planning.handover.export.exported_rig import Content, ExportedDevice, ExportedRig
from planning.handover.export.mount_tables import reference_point

from .landmarks import Landmarks

_COLUMNS = (
    *("device", "kind", "landmark", "u_px", "v_px"),
    *("x_mm", "y_mm", "z_mm", "distance_mm"),
)
# Of marks and letters, as a share of the image's height.
_MARK = 1.0 / 60.0


class AimSheets:
    """`ID.png` and `ID.txt` a device, `aim.csv`."""

    name = "aim"
    what = "aiming sheets"
    notes = (
        "ID.png: an image of the device's size with a cross-hair in its middle and "
        "marks L1 to L3. Lay it over a camera's live image and turn the camera "
        "until the landmarks lie under the marks; let a projector show it and turn "
        "that until the marks fall onto the landmarks. ID.txt: pixels (the centre "
        "of the top-left one is (0, 0)), places of the landmarks in mm, distances "
        "to the datum points. aim.csv: the same of all devices with all digits."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return nothing: it holds all that plans do."""
        return []

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return images, texts and the table."""
        files: dict[str, Content] = {}
        landmarks = Landmarks(rig)
        rows: list[list[str]] = []
        for device in rig.devices:
            places = landmarks.vertices[landmarks.seen_by(device)]
            pixels = device.project(places)
            files[f"{device.id}.png"] = partial(_draw, device, pixels)
            files[f"{device.id}.txt"] = _sheet(device, rig, places, pixels).encode()
            far = np.linalg.norm(places - device.world_from_device[:3, 3], axis=1)
            figures = np.column_stack([pixels, 1e3 * places, 1e3 * far])
            rows += [
                [device.id, device.kind, f"L{k}", *map(repr, row)]
                for k, row in enumerate(figures.tolist(), 1)
            ]
        text = io.StringIO()
        text.write(f"# frame: {rig.frame.words}\n")
        csv.writer(text, lineterminator="\n").writerows([_COLUMNS, *rows])
        return files | {"aim.csv": text.getvalue().encode()}


def _sheet(
    device: ExportedDevice, rig: ExportedRig, places: Array, pixels: Array
) -> str:
    width, height = device.model.resolution
    what, point = reference_point(device)
    act = "must appear at" if device.kind == "camera" else "are lit by the mark at"
    lines = [
        f"{device.id}, {device.kind}, {width} x {height} px",
        f"frame: {rig.frame.words}",
        "",
        f"landmarks        {act} u, v [px]          x, y, z [mm]",
        *(
            f"L{k}       {u:14.1f} {v:9.1f}     {_mm(place)}"
            for k, ((u, v), place) in enumerate(zip(pixels, places, strict=True), 1)
        ),
    ]
    if len(places) < 3:
        lines.append(f"only {len(places)} of 3 are in sight")
    lines += ["", f"{what} at {_mm(point)} mm, from there to the datum points:"]
    for k, datum in enumerate(rig.datums, 1):
        far = 1e3 * np.linalg.norm(datum - point)
        lines.append(f"D{k}       {far:10.2f} mm     at {_mm(datum)}")
    return "\n".join(lines) + "\n"


def _mm(place: Array) -> str:
    return " ".join(f"{1e3 * value + 0.0:10.2f}" for value in place)


def _draw(device: ExportedDevice, pixels: Array, file: BinaryIO) -> None:
    width, height = device.model.resolution
    image = Image.new("L", (width, height), 0)
    pen = ImageDraw.Draw(image)
    mark = max(4, round(_MARK * height))
    line = max(1, round(0.1 * mark))
    across, down = width // 2, height // 2
    pen.line([(0, down), (width - 1, down)], fill=128, width=line)
    pen.line([(across, 0), (across, height - 1)], fill=128, width=line)
    font = ImageFont.load_default(1.5 * mark)
    # Pillow cuts decimals off: whole pixels, the nearest.
    for k, (u, v) in enumerate(np.rint(pixels).tolist(), 1):
        pen.ellipse([u - mark, v - mark, u + mark, v + mark], outline=255, width=line)
        pen.line([(u - 2 * mark, v), (u + 2 * mark, v)], fill=255, width=line)
        pen.line([(u, v - 2 * mark), (u, v + 2 * mark)], fill=255, width=line)
        pen.text((u + 1.2 * mark, v + 1.2 * mark), f"L{k}", fill=255, font=font)
    pen.text((mark, mark), device.id, fill=255, font=font)
    image.save(file, format="PNG", compress_level=1)
