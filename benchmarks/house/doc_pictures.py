"""Draw the pictures of the documentation from one plan of the sample.

Usage: python -m benchmarks.house.doc_pictures [NAME ...]     (from a checkout's root)

Plans `face.obj` with the default rig, simulates its images and
measures them, and writes `docs/images/NAME.png` for each name (all, if none is given).
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from benchmarks.house.same_plans import range_observations
from benchmarks.pixels.other_objects import beside, dented, expected_of, with_object
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import inverse, transform
from geometry.rays.proximity import closest_points
from geometry.rays.rays import RayCaster
from geometry.shapes.primitives import sphere
from planning import RigPlan, read_ranges
from planning.report.drawing.panel import INK, Panel, font
from planning.report.drawing.picture_view import (
    BACKGROUND,
    SUPERSAMPLING,
    PictureView,
    fitted,
)
from planning.report.drawing.shader import Shader
from planning.verify.reconstruction.captures.captured import reconstruct_rendered
from planning.verify.reconstruction.captures.captures import CaptureFolder
from planning.verify.reconstruction.scanner import Scanner

Colours = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"
FRONT, SIDE, ABOVE = (-0.45, -1.0, 0.2), (0.8, -0.7, 0.15), (-0.5, -0.8, 0.55)
UP = (0.0, 0.0, 1.0)
CLAY, DARK = (214, 205, 196), (92, 92, 100)
BLUE, ORANGE, PINK, GREEN = (0, 90, 160), (200, 80, 0), (240, 40, 140), (46, 132, 74)
SIZE = (420, 480)
_PALETTE = 160


class Job:
    """The sample, planned and measured once; parts are made when they are asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @cached_property
    def plan(self) -> RigPlan:
        """The plan of the README's command."""
        mesh = ["--mesh", str(ROOT / "face.obj"), "--max-projectors", "3"]
        _command(*mesh, "--quiet", "-o", str(self.folder))
        return RigPlan.load(self.folder / "plan.json")

    @property
    def mesh(self) -> TriangleMesh:
        """The surface as planned."""
        return self.plan.surface.mesh

    @cached_property
    def caster(self) -> RayCaster:
        """Rays over the surface."""
        return RayCaster(self.mesh)

    @cached_property
    def captures(self) -> Path:
        """Images that the cameras would take; a cloud is measured from them."""
        self.plan.save(self.folder / "plan.json")
        folder = self.folder / "captures"
        words = ["--save-captures", str(folder), "-o", str(self.folder), "--quiet"]
        _command("reconstruct", str(self.folder / "plan.json"), *words)
        return folder

    @cached_property
    def cloud(self) -> tuple[Colours, Colours]:
        """Points [m] and their colours, from `cloud.ply`."""
        assert self.captures
        return read_cloud(self.folder / "cloud.ply")


def main() -> int:
    """Write the pictures."""
    names = sys.argv[1:] or list(PICTURES)
    with tempfile.TemporaryDirectory() as folder:
        job = Job(Path(folder))
        for name in names:
            picture = PICTURES[name](job)
            palette = picture.convert("RGB").quantize(_PALETTE)
            palette.save(IMAGES / f"{name}.png", optimize=True)
            print(f"{name}: {picture.width} x {picture.height}")
    return 0


def ranges(job: Job) -> Image.Image:
    """Observed points, sight lines and the least-squares sphere."""
    text = range_observations()
    path = job.folder / "observations.csv"
    path.write_text(text)
    body = read_ranges(path).mesh
    rows = [line.split(",") for line in text.splitlines()[1:]]
    views = 1e-3 * np.array([row[1:4] for row in rows], dtype=float)
    rays = np.array([row[4:7] for row in rows], dtype=float)
    view = _view(np.concatenate([body.vertices, 0.25 * views]), ABOVE, (640, 480))
    caster = RayCaster(body)
    panel = Panel(_shaded(caster, CLAY).shade(view), view, caster)
    for origin, ray in zip(views, rays, strict=True):
        hit = origin + ray * (np.linalg.norm(origin) - 0.09)
        ends = np.stack([hit - 0.2 * ray, hit])
        panel.polyline(ends, ORANGE, width=1.0)
        panel.dot(hit, BLUE, radius=3.0)
    panel.scale_bar(size=13.0)
    return _finished(panel)


def misses(job: Job) -> Image.Image:
    """What two projectors don't light: what a missed requirement looks like."""
    lit = np.any([_lit(job, p) for p in job.plan.projectors[:2]], axis=0)
    target = job.plan.surface.target_faces("dominant")
    colours = _by(lit & target, (120, 190, 235), CLAY)
    colours[target & ~lit] = (120, 0, 80)
    return _beside(*(_drawn(job, colours, side) for side in (FRONT, SIDE)))


def images(job: Job) -> Image.Image:
    """A camera's images under its projector: white, and one frame of the code."""
    folder = sorted((job.captures / "C1").iterdir())[0]
    frames = sorted(folder.iterdir())
    chosen = (frames[0], frames[len(frames) // 2])
    pictures = [Image.open(path).convert("L") for path in chosen]
    box = pictures[0].point(lambda level: 255 * (level > 40)).getbbox()
    return _beside(*(p.crop(box).resize(SIZE).convert("RGB") for p in pictures))


def cloud(job: Job) -> Image.Image:
    """The measured cloud, coloured by its predicted standard deviation."""
    points, colours = job.cloud
    return _beside(*(_points(job, points, colours, side) for side in (FRONT, SIDE)))


def errors(job: Job) -> Image.Image:
    """Signed distance of each point from the surface, blue inside, red outside."""
    points, _ = job.cloud
    signed = closest_points(job.mesh, points).distances
    colours = _signed(signed, 6e-5)
    return _beside(*(_points(job, points, colours, side) for side in (FRONT, SIDE)))


def deviation(job: Job) -> Image.Image:
    """The map of a head without a piece of 3 cm that stood 10 mm beside its place."""
    truth = with_object(job.plan, beside(dented(job.mesh)))
    scanner, folder = Scanner.of(job.plan), job.folder / "dented"
    save = CaptureFolder(folder, scanner)
    stood = Scanner.of(truth)
    reconstruct_rendered(scanner, expected_of(job.plan), seed=0, truth=stood, save=save)
    words = ["--captures", str(folder), "--deviation-limits", "0.5", "--quiet"]
    _command("reconstruct", str(job.folder / "plan.json"), *words, "-o", str(folder))
    points, colours = read_cloud(folder / "deviation.ply")
    there = RayCaster(dented(job.mesh))
    sides = (FRONT, SIDE)
    return _beside(*(_points(job, points, colours, side, there) for side in sides))


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
    _command("reconstruct", plan, *words, "-o", str(out), "--quiet")
    points, _ = read_cloud(out / "cloud.ply")
    signed = closest_points(job.mesh, points).distances
    colours = _signed(signed, 1e-3)
    return _beside(*(_points(job, points, colours, side) for side in (FRONT, SIDE)))


def outside(job: Job) -> Image.Image:
    """How freely each face sees out: the share of rays from it that meet nothing."""
    colours = _ramp(2.5 * _freedom(job) - 1.5, (120, 60, 40), (250, 240, 200))
    return _beside(*(_drawn(job, colours, side) for side in (FRONT, SIDE)))


def shadows(job: Job) -> Image.Image:
    """P1's light: lit, facing away, or in shadow."""
    projector = job.plan.projectors[0]
    ray = job.mesh.face_centroids - projector.world_from_device[:3, 3]
    facing = np.einsum("ij,ij->i", job.mesh.face_normals, ray) < 0.0
    colours = _by(facing, (250, 214, 120), CLAY)
    colours[facing & ~_lit(job, projector)] = PINK
    return _beside(*(_drawn(job, colours, side) for side in (FRONT, SIDE)))


def candidates(job: Job) -> Image.Image:
    """Candidate poses of projectors about the object, and those that were taken."""
    surface, plan = job.plan.surface, job.plan
    places = surface.reference_projectors[:, :3, 3]
    view = _view(places, ABOVE, (640, 560))
    panel = Panel(_shaded(job.caster, CLAY).shade(view), view, job.caster)
    for place in places:
        panel.dot(place, (185, 185, 190), radius=2.0)
    for projector in plan.projectors:
        place = projector.world_from_device[:3, 3]
        ends = np.stack([place, job.mesh.centre])
        panel.polyline(ends, ORANGE, width=1.5)
        panel.dot(place, ORANGE, radius=5.0)
        panel.label(place, projector.id, ORANGE, size=15.0)
    panel.scale_bar(size=13.0)
    return _finished(panel)


def seams(job: Job) -> Image.Image:
    """Neighbouring cameras, and the seam point E at which (10) is tightest."""
    cameras = {camera.id: camera for camera in job.plan.cameras}
    places = np.array([c.world_from_device[:3, 3] for c in cameras.values()])
    view = _view(np.concatenate([places, job.mesh.vertices]), UP, (640, 560))
    panel = Panel(_shaded(job.caster, CLAY).shade(view), view)
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
    return _finished(panel)


def rings(job: Job) -> Image.Image:
    """A frame of P1's code, and its rings where they fall on the object."""
    assert job.plan
    frames = sorted((job.folder / "patterns").rglob("*P1*/*.png"))
    frames = frames or sorted((job.folder / "patterns").rglob("P1*.png"))
    frame = Image.open(frames[2 * len(frames) // 3]).convert("RGB").resize((640, 480))
    projector = job.plan.projectors[0]
    local = transform(inverse(projector.world_from_ring), job.mesh.face_centroids)
    radius = np.hypot(local[:, 0], local[:, 1]) / local[:, 2]
    ring = np.searchsorted(projector.ring_radii, radius)
    colours = _by(ring % 2 == 0, (250, 214, 120), (150, 110, 60))
    colours[~_lit(job, projector)] = CLAY
    return _beside(frame, _drawn(job, colours, FRONT))


def covers(job: Job) -> Image.Image:
    """By how many of forty candidate projectors each face could be lit."""
    places = job.plan.surface.reference_projectors[:, :3, 3]
    chosen = places[:: max(len(places) // 40, 1)]
    count = sum(_lit_from(job, place).astype(float) for place in chosen)
    share = (count - count.min()) / np.ptp(count)
    colours = _ramp(share, (60, 40, 90), (250, 230, 120))
    return _beside(*(_drawn(job, colours, side) for side in (FRONT, SIDE)))


def cells(job: Job) -> Image.Image:
    """Cells of directions: six faces of a cube, each cut at equal angles."""
    ball = sphere(0.1, subdivisions=6)
    colours = _ramp(_cell_of(ball.face_centroids, 8) % 7 / 6.0, BLUE, (235, 235, 240))
    return _picture(RayCaster(ball), colours, ball.vertices, FRONT, SIZE)


def openness(job: Job) -> Image.Image:
    """Where a point beside the nose is open: the directions that meet nothing."""
    mesh = job.mesh
    beside_nose = np.abs(mesh.face_centroids - mesh.centre) < [0.03, 1.0, 0.03]
    front = beside_nose.all(axis=1) & (mesh.face_normals[:, 1] < -0.2)
    spot = int(np.argmin(np.where(front, _freedom(job), np.inf)))
    ball = sphere(0.1, subdivisions=5)
    rays = ball.face_centroids / np.linalg.norm(ball.face_centroids, axis=1)[:, None]
    start = np.repeat(mesh.face_centroids[spot][None], len(rays), axis=0)
    shut = _blocked(job, start + 1e-4 * mesh.face_normals[spot], rays, np.inf)
    colours = _by(~shut, (250, 214, 120), DARK)
    marked = _by(np.arange(len(mesh.faces)) == spot, PINK, CLAY)
    near = np.linalg.norm(mesh.face_centroids - mesh.face_centroids[spot], axis=1)
    marked[near < 3e-3] = PINK
    ball_view = _picture(RayCaster(ball), colours, ball.vertices, FRONT, SIZE)
    return _beside(_drawn(job, marked, FRONT), ball_view)


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


PICTURES: dict[str, Callable[[Job], Image.Image]] = {
    "ranges_body": ranges,
    "missed": misses,
    "captured_frames": images,
    "cloud_sigma": cloud,
    "cloud_errors": errors,
    "deviation": deviation,
    "turned": turned,
    "outside": outside,
    "shadows": shadows,
    "candidates": candidates,
    "seams": seams,
    "rings": rings,
    "covers": covers,
    "cells": cells,
    "openness": openness,
    "cost": cost,
}


def read_cloud(path: Path) -> tuple[Colours, Colours]:
    """Return points [m] and colours (n, 3) of a binary cloud in millimetres."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = [line.split() for line in head.decode("ascii").splitlines()]
    count = next(int(w[2]) for w in lines if w[:2] == ["element", "vertex"])
    kinds = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4"}
    kinds |= {"float32": "<f4", "uint8": "u1", "ushort": "<u2", "short": "<i2"}
    fields = [(w[2], kinds[w[1]]) for w in lines if w[0] == "property"]
    data = np.frombuffer(body, dtype=np.dtype(fields), count=count)
    points = np.stack([data[name] for name in "xyz"], axis=1)
    colours = np.stack([data[name] for name in ("red", "green", "blue")], axis=1)
    return 1e-3 * points.astype(float), colours.astype(float)


def _command(*words: str) -> None:
    code = "from planning.cli.main import main; main()"
    run = [sys.executable, "-c", code, *words]
    done = subprocess.run(run, cwd=ROOT, check=False, stdout=subprocess.DEVNULL)
    # A cloud that misses a limit is written, and is what one picture shows.
    if done.returncode not in (0, 1):
        raise SystemExit(f"plan {' '.join(words)} ended with {done.returncode}")


def _freedom(job: Job) -> NDArray[np.float64]:
    """The share of rays, spread as light would be, that leave each face unhindered."""
    mesh, rng = job.mesh, np.random.default_rng(0)
    free = np.zeros(len(mesh.faces))
    for _ in range(32):
        ray = rng.normal(size=mesh.face_normals.shape)
        ray = mesh.face_normals + ray / np.linalg.norm(ray, axis=1)[:, None]
        free += ~_blocked(job, mesh.face_centroids, ray, np.inf)
    return free / 32.0


def _lit(job: Job, projector: object) -> NDArray[np.bool_]:
    return _lit_from(job, projector.world_from_device[:3, 3])  # type: ignore[attr-defined]


def _lit_from(job: Job, place: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether light from a place meets each face within 60 degrees, unshadowed."""
    ray = place - job.mesh.face_centroids
    length = np.linalg.norm(ray, axis=1)
    facing = np.einsum("ij,ij->i", job.mesh.face_normals, ray) > 0.5 * length
    return facing & ~_blocked(job, job.mesh.face_centroids, ray / length[:, None], 9.0)


def _blocked(
    job: Job, starts: NDArray[np.float64], rays: NDArray[np.float64], reach: float
) -> NDArray[np.bool_]:
    reach = min(reach, 4.0 * job.mesh.reach + 10.0)
    rays = rays / np.linalg.norm(rays, axis=1)[:, None]
    lifted = starts + 1e-5 * rays
    if len(starts) == len(job.mesh.faces):
        lifted = lifted + 1e-5 * job.mesh.face_normals
    return job.caster.occluded(lifted, rays, np.full(len(rays), reach))


def _cell_of(points: NDArray[np.float64], n: int) -> NDArray[np.int64]:
    """Cell of each direction on a cube cut at n equal angles an edge."""
    axis = np.argmax(np.abs(points), axis=1)
    main_part = np.take_along_axis(points, axis[:, None], axis=1)
    sides = np.stack([(axis + 1) % 3, (axis + 2) % 3], axis=1)
    angles = np.arctan(np.take_along_axis(points, sides, axis=1) / main_part)
    cell = np.clip(np.floor((angles / (np.pi / 4) + 1.0) * n / 2), 0, n - 1).astype(int)
    face = 2 * axis + (main_part[:, 0] > 0)
    return (face * n + cell[:, 0]) * n + cell[:, 1]


def _by(
    where: NDArray[np.bool_], yes: tuple[int, int, int], no: tuple[int, int, int]
) -> Colours:
    return np.where(where[:, None], np.array(yes, float), np.array(no, float))


def _ramp(
    share: NDArray[np.float64], low: tuple[int, ...], high: tuple[int, ...]
) -> Colours:
    ends = np.array([low, high], dtype=float)
    return ends[0] + np.clip(share, 0.0, 1.0)[:, None] * (ends[1] - ends[0])


def _signed(values: NDArray[np.float64], limit: float) -> Colours:
    share = np.clip(values / limit, -1.0, 1.0)
    colours = _ramp(np.abs(share), (250, 250, 215), (220, 40, 30))
    inside = share < 0
    colours[inside] = _ramp(-share[inside], (250, 250, 215), (60, 90, 230))
    return colours


def _view(
    points: NDArray[np.float64], direction: tuple[float, ...], size: tuple[int, int]
) -> PictureView:
    fine = (size[0] * SUPERSAMPLING, size[1] * SUPERSAMPLING)
    return fitted(points, direction, UP, fine, margin_px=0.08 * min(fine))


def _shaded(caster: RayCaster, colour: tuple[int, int, int]) -> Shader:
    n = len(caster.mesh.faces)
    return Shader(caster, np.tile(np.array(colour, dtype=float), (n, 1)))


def _drawn(job: Job, colours: Colours, direction: tuple[float, ...]) -> Image.Image:
    points = job.mesh.corners.reshape(-1, 3)
    return _picture(job.caster, colours, points, direction, SIZE)


def _picture(
    caster: RayCaster,
    colours: Colours,
    points: NDArray[np.float64],
    direction: tuple[float, ...],
    size: tuple[int, int],
) -> Image.Image:
    image = Shader(caster, colours).shade(_view(points, direction, size))
    return image.resize(size, Image.Resampling.BOX)


def _points(
    job: Job,
    points: NDArray[np.float64],
    colours: Colours,
    direction: tuple[float, ...],
    there: RayCaster | None = None,
) -> Image.Image:
    """Points on the dark object; those behind it are left out."""
    caster = there or job.caster
    view = _view(job.mesh.corners.reshape(-1, 3), direction, SIZE)
    picture = np.asarray(_shaded(caster, DARK).shade(view)).copy()
    ray = np.broadcast_to(view.to_viewer, points.shape)
    reach = np.full(len(points), 4.0 * job.mesh.reach)
    hidden = caster.occluded(points + 2e-3 * ray, ray, reach)
    pixels = np.rint(view.project(points[~hidden])).astype(int)
    for shift in ((0, 0), (1, 0), (0, 1), (1, 1)):
        u, v = np.clip(pixels + shift, 0, np.array(view.size) - 1).T
        picture[v, u] = colours[~hidden].astype(np.uint8)
    return Image.fromarray(picture).resize(SIZE, Image.Resampling.BOX)


def _finished(panel: Panel) -> Image.Image:
    size = tuple(side // SUPERSAMPLING for side in panel.view.size)
    return panel.image.resize(size, Image.Resampling.BOX)


def _beside(*pictures: Image.Image) -> Image.Image:
    width = sum(picture.width for picture in pictures)
    sheet = Image.new("RGB", (width, max(p.height for p in pictures)), BACKGROUND)
    left = 0
    for picture in pictures:
        sheet.paste(picture, (left, 0))
        left += picture.width
    return sheet


if __name__ == "__main__":
    sys.exit(main())
