"""Draw the pictures of the documentation from one plan of the sample.

Usage: python -m benchmarks.house.doc_pictures [NAME ...]     (from a checkout's root)

Plans `face.obj` with the default rig, simulates its images and
measures them, and writes `docs/images/NAME.png` for each name (all, if none is given).
"""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from PIL import Image

from benchmarks.pictures import (
    front_pictures,
    light_pictures,
    measured_pictures,
    page_pictures,
    paper_figures,
    paper_pictures,
    triangle_figure,
    word_pictures,
)
from benchmarks.pictures.drawing import save
from benchmarks.pictures.job import IMAGES, Job

PICTURES: dict[str, Callable[[Job], Image.Image]] = {
    "ranges_body": measured_pictures.ranges,
    "missed": light_pictures.misses,
    "captured_frames": measured_pictures.images,
    "cloud_sigma": measured_pictures.cloud,
    "cloud_errors": measured_pictures.errors,
    "deviation": measured_pictures.deviation,
    "turned": measured_pictures.turned,
    "outside": light_pictures.outside,
    "shadows": light_pictures.shadows,
    "candidates": light_pictures.candidates,
    "seams": paper_pictures.seams,
    "false_projection": paper_figures.false_projection,
    "overlap": paper_figures.overlap,
    "triangle": triangle_figure.triangle,
    "rings": light_pictures.rings,
    "covers": light_pictures.covers,
    "cells": light_pictures.cells,
    "openness": light_pictures.openness,
    "cost": paper_pictures.cost,
    "pareto": front_pictures.pareto,
    "lit": word_pictures.lit,
    "seen": word_pictures.seen,
    "measured": word_pictures.measured,
    "reachable": word_pictures.reachable,
    "assigned": word_pictures.assigned,
    "report_rig": page_pictures.rig,
    "report_triangle": page_pictures.triangle,
}


def main() -> int:
    """Write the pictures."""
    names = sys.argv[1:] or list(PICTURES)
    with tempfile.TemporaryDirectory() as folder:
        job = Job(Path(folder))
        for name in names:
            picture = PICTURES[name](job)
            save(picture, IMAGES / f"{name}.png")
            print(f"{name}: {picture.width} x {picture.height}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
