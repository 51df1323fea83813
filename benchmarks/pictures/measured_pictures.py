"""Pictures of what is measured: images, clouds, errors, deviations, ranges."""

import json

import numpy as np
from PIL import Image

from benchmarks.house.same_plans import range_observations
from benchmarks.pixels.other_objects import beside, dented, expected_of, with_object
from geometry.rays.proximity import closest_points
from geometry.rays.rays import RayCaster
from planning import read_ranges
from planning.report.drawing.panel import Panel
from planning.verify.reconstruction.captures.captured import reconstruct_rendered
from planning.verify.reconstruction.captures.captures import CaptureFolder
from planning.verify.reconstruction.scanner import Scanner

from .drawing import (
    ABOVE,
    BLUE,
    CLAY,
    FRONT,
    ORANGE,
    SIDE,
    SIZE,
    beside_each_other,
    finished,
    points_on,
    shaded,
    signed_colours,
    view_of,
)
from .job import Job, command, read_cloud


def ranges(job: Job) -> Image.Image:
    """Observed points, sight lines and the least-squares sphere."""
    text = range_observations()
    path = job.folder / "observations.csv"
    path.write_text(text)
    body = read_ranges(path).mesh
    rows = [line.split(",") for line in text.splitlines()[1:]]
    views = 1e-3 * np.array([row[1:4] for row in rows], dtype=float)
    rays = np.array([row[4:7] for row in rows], dtype=float)
    view = view_of(np.concatenate([body.vertices, 0.25 * views]), ABOVE, (640, 480))
    caster = RayCaster(body)
    panel = Panel(shaded(caster, CLAY).shade(view), view, caster)
    for origin, ray in zip(views, rays, strict=True):
        hit = origin + ray * (np.linalg.norm(origin) - 0.09)
        ends = np.stack([hit - 0.2 * ray, hit])
        panel.polyline(ends, ORANGE, width=1.0)
        panel.dot(hit, BLUE, radius=3.0)
    panel.scale_bar(size=13.0)
    return finished(panel)


def images(job: Job) -> Image.Image:
    """A camera's images under its projector: white, and one frame of the code."""
    folder = sorted((job.captures / "C1").iterdir())[0]
    frames = sorted(folder.iterdir())
    chosen = (frames[0], frames[len(frames) // 2])
    pictures = [Image.open(path).convert("L") for path in chosen]
    box = pictures[0].point(lambda level: 255 * (level > 40)).getbbox()
    return beside_each_other(
        *(p.crop(box).resize(SIZE).convert("RGB") for p in pictures)
    )


def cloud(job: Job) -> Image.Image:
    """The measured cloud, coloured by its predicted standard deviation."""
    points, colours = job.cloud
    return beside_each_other(
        *(points_on(job, points, colours, side) for side in (FRONT, SIDE))
    )


def errors(job: Job) -> Image.Image:
    """Signed distance of each point from the surface, blue inside, red outside."""
    points, _ = job.cloud
    signed = closest_points(job.mesh, points).distances
    colours = signed_colours(signed, 6e-5)
    return beside_each_other(
        *(points_on(job, points, colours, side) for side in (FRONT, SIDE))
    )


def deviation(job: Job) -> Image.Image:
    """The map of a head without a piece of 3 cm that stood 10 mm beside its place."""
    truth = with_object(job.plan, beside(dented(job.mesh)))
    scanner, folder = Scanner.of(job.plan), job.folder / "dented"
    save = CaptureFolder(folder, scanner)
    stood = Scanner.of(truth)
    reconstruct_rendered(scanner, expected_of(job.plan), seed=0, truth=stood, save=save)
    words = ["--captures", str(folder), "--deviation-limits", "0.5", "--quiet"]
    command("reconstruct", str(job.folder / "plan.json"), *words, "-o", str(folder))
    points, colours = read_cloud(folder / "deviation.ply")
    there = RayCaster(dented(job.mesh))
    sides = (FRONT, SIDE)
    return beside_each_other(
        *(points_on(job, points, colours, side, there) for side in sides)
    )


def turned(job: Job) -> Image.Image:
    """The same errors where the calibration has C1 turned by 0.02 degrees."""
    camera = job.plan.cameras[0]
    pose, turn = camera.world_from_device.copy(), np.radians(0.02)
    about_y = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, 1]]
    u, _, vt = np.linalg.svd(pose[:3, :3] @ about_y)
    pose[:3, :3] = u @ vt
    devices = [{"id": camera.id, "world_from_device": pose.tolist()}]
    path = job.folder / "turned.json"
    head = {"format": "ringrig-calibration", "version": 1, "devices": devices}
    path.write_text(json.dumps(head))
    out = job.folder / "turned"
    words = ["--captures", str(job.captures), "--calibration", str(path)]
    plan = str(job.folder / "plan.json")
    command("reconstruct", plan, *words, "-o", str(out), "--quiet")
    points, _ = read_cloud(out / "cloud.ply")
    signed = closest_points(job.mesh, points).distances
    colours = signed_colours(signed, 1e-3)
    return beside_each_other(
        *(points_on(job, points, colours, side) for side in (FRONT, SIDE))
    )
