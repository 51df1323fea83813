"""`plan reconstruct --dense`: Gray-code images of a calibrated pair to a cloud.

Exit: 0 a cloud was written, 1 the images are sound but no point came of them, 2
unwritable, 3 bad images or a bad calibration.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from geometry.files.reading import METRES
from planning.cli.console import print_json, reporter, writable
from planning.verify.reconstruction.captures.gray.gray_captures import (
    GrayCloud,
    read_capture,
    reconstruct_gray,
)
from planning.verify.reconstruction.captures.gray.gray_folder import image_size
from planning.verify.reconstruction.captures.gray.pair_file import read_pair
from planning.verify.reconstruction.check.cloud_file import (
    CloudFile,
    LengthUnit,
    remove_cloud,
)
from planning.verify.reconstruction.decode.dense.dense_limits import DenseLimits

_CLOUD = "cloud.ply"

_PANEL = (1024, 768)
# Rays that run nearly alike meet anywhere [rad].
_LEAST_ANGLE = np.deg2rad(1.0)


def gray_command(options: Mapping[str, Any]) -> int:
    """Decode and triangulate, write the cloud, print what came of it."""
    images, report = options["captures"], reporter(quiet=options["quiet"])
    unit = LengthUnit(options["unit"] or "mm", METRES[options["unit"] or "mm"])
    pair = read_pair(
        options["calibration"],
        camera_size=image_size(images),
        projector_size=options["projector_size"] or _PANEL,
        unit_m=unit.in_m,
    )
    dense = pair.projector.dense
    assert dense is not None
    folder = Path(options["output"] or f"{images.resolve().name}-cloud")
    with writable(folder):
        report(f"reading {len(dense.frames)} images")
        capture = read_capture(images, dense, code_step=options["code_step"] or 1)
        report(f"triangulating {len(capture.read.map.told)} pixels")
        found = reconstruct_gray(capture, pair, DenseLimits(min_angle=_LEAST_ANGLE))
        path, written = folder / _CLOUD, None
        if len(found.merged.cloud):
            file = replace(CloudFile.of(found.merged, unit), axes="the camera")
            file.save(path)
            written = path, file
        else:
            remove_cloud(path)
    if options["as_json"]:
        print_json(_document(found, written))
    else:
        click.echo("\n".join(_lines(found, written)))
    return 0 if written else 1


def _document(
    found: GrayCloud, written: tuple[Path, CloudFile] | None
) -> dict[str, Any]:
    decoded, residual = found.decoded, found.decoded.residual_px
    return {
        "lit_pixels": decoded.lit_pixels,
        "n_points": len(decoded.cloud),
        "rejected": decoded.rejected,
        "residual_px": residual if np.isfinite(residual) else None,
        "notes": list(found.notes),
        "cloud": None if written is None else str(written[0]),
        "unit": None if written is None else written[1].unit.name,
    }


def _lines(found: GrayCloud, written: tuple[Path, CloudFile] | None) -> list[str]:
    decoded = found.decoded
    left_out = {cause: n for cause, n in decoded.rejected.items() if n}
    causes = ", ".join(f"{cause} {n}" for cause, n in left_out.items())
    lines = [
        f"pixels    {decoded.lit_pixels} lit, {len(decoded.cloud)} gave a point; left "
        f"out: {causes or 'none'}",
        f"rays      pass each other by {decoded.residual_px:.2f} px of the projector "
        f"(median)",
    ]
    lines += [f"note: {note}" for note in found.notes]
    if written is None:
        return [*lines, "NOT reconstructed: no pixel gave a point"]
    path, file = written
    return [
        *lines,
        f"cloud     {path}: {len(file.rows)} points in {file.unit.name}, in the "
        f"camera's axes (+x right, +y down, +z ahead)",
        f"colours   {file.scale.column} along the normal: {file.legend}",
    ]
