"""Pictures of the paper's sections: seams and eq. (8) of a plan."""

import numpy as np
from PIL import Image, ImageDraw

from planning.report.drawing.panel import INK, Panel, font
from planning.report.drawing.picture_view import BACKGROUND, SUPERSAMPLING

from .drawing import (
    BLUE,
    CLAY,
    GREEN,
    PINK,
    UP,
    finished,
    shaded,
    view_of,
)
from .job import Job


def seams(job: Job) -> Image.Image:
    """Neighbouring cameras, and the seam point E at which (10) is tightest."""
    cameras = {camera.id: camera for camera in job.plan.cameras}
    places = np.array([c.world_from_device[:3, 3] for c in cameras.values()])
    view = view_of(np.concatenate([places, job.mesh.vertices]), UP, (640, 560))
    panel = Panel(shaded(job.caster, CLAY).shade(view), view)
    for row in job.plan.document.baselines:
        first, second = (cameras[k].world_from_device[:3, 3] for k in row.cameras)
        seam = np.array(row.E)
        panel.polyline(np.stack([first, second]), GREEN, width=2.0)
        for place in (first, second):
            panel.polyline(np.stack([place, seam]), BLUE, width=1.0)
        panel.dot(seam, PINK, radius=4.0)
    for name, camera in cameras.items():
        panel.label(camera.world_from_device[:3, 3], name, BLUE, size=15.0)
    panel.scale_bar(size=13.0)
    return finished(panel)


def cost(job: Job) -> Image.Image:
    """The terms of eq. (8) in seconds."""
    entry = job.plan.document.cost.model_dump()
    pixels = entry["pixels"]
    terms = {
        **{name: pixels * entry[name] for name in ("t1", "t2")},
        **{name: float(entry[name]) for name in ("t3", "t4", "t5")},
    }
    unit, longest = SUPERSAMPLING, max(terms.values())
    picture = Image.new("RGB", (640 * unit, 40 * unit * len(terms)), BACKGROUND)
    draw = ImageDraw.Draw(picture)
    for row, (name, seconds) in enumerate(terms.items()):
        y, end = (40 * row + 20) * unit, (70 + 480 * seconds / longest) * unit
        draw.text((60 * unit, y), name, INK, font=font(15.0), anchor="rm")
        draw.rectangle((70 * unit, y - 12 * unit, end, y + 12 * unit), fill=BLUE)
        text = (end + 8 * unit, y)
        draw.text(text, f"{seconds:.1f} s", INK, font=font(15.0), anchor="lm")
    return picture.resize((640, 40 * len(terms)), Image.Resampling.BOX)
