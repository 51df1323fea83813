"""The written parts of a rig's picture: title, headings, legend."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import ImageDraw

from planning.model.plan import RigPlan

from .draw_marks import INK, PALE, Panel, font
from .draw_views import BACKGROUND, SUPERSAMPLING, Colour


def draw_title(draw: ImageDraw.ImageDraw, plan: RigPlan, size: tuple[int, int]) -> None:
    """Write how many devices, what object and what is measured into a band."""
    extent = 1e3 * np.ptp(plan.surface.mesh.bounds, axis=0)
    counts = (
        _counted(len(plan.projectors), "projector"),
        _counted(len(plan.cameras), "camera"),
    )
    pad, middle = 16 * SUPERSAMPLING, size[1] // 2
    headline = f"{counts[0]}, {counts[1]}"
    draw.text((pad, middle), headline, INK, font=font(24.0), anchor="lm")
    left = pad + draw.textlength(headline, font=font(24.0)) + 1.5 * pad
    name = _mesh_name(plan.document)
    shape = " x ".join(f"{side:.0f}" for side in extent)
    detail = f"{name}{shape} mm (x, y, z)"
    draw.text((left, middle), detail, PALE, font=font(16.0), anchor="lm")
    claim = _coverage_sentence(plan.document)
    draw.text((size[0] - pad, middle), claim, INK, font=font(16.0), anchor="rm")


def _counted(n: int, noun: str) -> str:
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def _mesh_name(document: Mapping[str, Any]) -> str:
    meshes = document.get("meshes") or []
    names = [Path(str(mesh["path"])).name for mesh in meshes if mesh.get("path")]
    shown = names[0] if len(names) == 1 else f"{len(names)} meshes"
    return f"{shown if len(shown) <= 32 else shown[:29] + '...'}, " if names else ""


def _coverage_sentence(document: Mapping[str, Any]) -> str:
    """What the plan claims of the target, with its denominators."""
    areas = (document.get("coverage") or {}).get("target") or {}
    names = ("measured_m2", "reachable_by_cameras_m2", "area_m2")
    if not all(isinstance(areas.get(name), int | float) for name in names):
        return ""
    measured, reachable, area = (1e4 * float(areas[name]) for name in names)
    return (
        f"measured {measured:.0f} of {reachable:.0f} reachable, {area:.0f} sq cm target"
    )


def draw_heading(panel: Panel, text: str) -> None:
    """Name a panel in its upper left corner and keep labels off the name."""
    spot = (14 * SUPERSAMPLING, 10 * SUPERSAMPLING)
    draw = ImageDraw.Draw(panel.image)
    box = draw.textbbox(spot, text, font=font(15.0))
    # Lines of a room may run behind it.
    draw.rectangle(box, fill=BACKGROUND)
    draw.text(spot, text, PALE, font=font(15.0))
    panel.taken.append(box)


def draw_legend(
    draw: ImageDraw.ImageDraw,
    rows: Sequence[tuple[str, Colour]],
    origin: tuple[int, int],
    columns: int,
    line: int,
) -> None:
    """Write a legend of colours in columns.

    Args:
        draw: Of the picture.
        rows: Text and colour of each entry, row by row.
        origin: Width of the picture and top of the legend in fine pixels.
        columns: How many entries stand side by side.
        line: Height of a row in fine pixels.
    """
    width, top = origin
    for k, (text, colour) in enumerate(rows):
        x = 16 * SUPERSAMPLING + (k % columns) * (width // columns)
        y = top + (k // columns) * line
        box = (x, y + 3 * SUPERSAMPLING, x + 14 * SUPERSAMPLING, y + 17 * SUPERSAMPLING)
        draw.rectangle(box, fill=colour)
        spot = (x + 22 * SUPERSAMPLING, y + 10 * SUPERSAMPLING)
        draw.text(spot, text, INK, font=font(14.0), anchor="lm")
