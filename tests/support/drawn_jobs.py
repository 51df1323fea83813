"""Honest jobs drawn from a seed and a number: small meshes, a rig, what is asked.

Nothing is damaged here: every word and table is one that the documents allow. What they
ask for together may still be refused, or be out of reach.
"""

import json
from dataclasses import dataclass, field
from random import Random
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.sample_head.head_shape import HeadShape
from geometry.shapes.sample_head.sample_head import sample_head
from support import curved_shapes, plain_shapes
from support.drawn_rigs import draw_rig

# What a job is about, and how often of a hundred.
_KINDS = {
    **{"rings": 36, "parallel": 12, "dense": 12, "none": 12},
    **{"head": 7, "turntable": 6, "family": 8, "evaluate": 7},
}


@dataclass
class Job:
    """What is written, and the words of the command.

    Attributes:
        kind: What the job is about.
        words: Of the command line; names of files are those of `files`.
        files: Text by name.
        little: Whether it is little work, and not the least.
        checked: Whether the plan is checked from pixels.
        proofs: Whether bounds over all poses are derived again.
        replanned: Whether the whole plan is planned again.
    """

    kind: str
    words: list[str] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)
    little: bool = False
    checked: bool = False
    proofs: bool = False
    replanned: bool = False


def draw_job(seed: int, number: int, *, outside: bool = False) -> Job:
    """Return the job of a number, the same every time.

    For the `outside` meshes are made hollow, and what doesn't lie inside is asked for.
    """
    random = Random(f"{seed} {number}{' outside' * outside}")
    kind = random.choices(list(_KINDS), list(_KINDS.values()))[0]
    job = Job(kind)
    meshes = [_hollow(random, _mesh(random)) if outside else _mesh(random)]
    if kind == "family":
        meshes.append(_alike(random, meshes[0]))
    for k, mesh in enumerate(meshes):
        job.files[f"part-{k}.obj"] = _as_obj(mesh)
        job.words += ["--mesh", f"part-{k}.obj"]
    tables = draw_rig(random, kind)
    job.files["rig.toml"] = "".join(f"{k} = {_toml(v)}\n" for k, v in tables.items())
    job.words += ["--rig", "rig.toml"]
    own = 0.25 if kind != "evaluate" and len(meshes) == 1 else 0.0
    if outside:
        job.words += ["--target", "outside"]
    else:
        _draw_target(random, job, meshes[0], own)
    if kind == "evaluate":
        job.words = ["evaluate", *job.words]
        job.words += ["--poses", "poses.csv"]
        job.files["poses.csv"] = _poses(random)
    else:
        _draw_words(random, job)
    job.little, job.checked = random.random() < 0.15, random.random() < 0.12
    job.proofs, job.replanned = random.random() < 0.06, random.random() < 0.06
    job.words += [] if job.checked else ["--no-check"]
    job.words += ["--seed", str(random.randrange(1000))]
    return job


def _mesh(random: Random) -> TriangleMesh:
    """A shape of 60 to 260 mm at its longest, turned and stretched."""
    rng = np.random.default_rng(random.randrange(2**32))
    mesh = random.choice([_curved, _plain, _bumpy, _head, _open])(random, rng)
    vertices = mesh.vertices
    if random.random() < 0.5:
        vertices = vertices @ Rotation.random(random_state=rng).as_matrix().T
    if random.random() < 0.3:
        vertices = vertices * rng.uniform(0.6, 1.4, 3)
    vertices = vertices - vertices.mean(axis=0)
    size = np.ptp(vertices, axis=0).max()
    vertices *= 1e-3 * random.uniform(60.0, 260.0) / size
    if random.random() < 0.3:
        vertices += rng.uniform(-0.3, 0.3, 3)
    return TriangleMesh(vertices, mesh.faces)


def _hollow(random: Random, mesh: TriangleMesh) -> TriangleMesh:
    """The mesh with an inner wall, and often a mouth through both."""
    middle, wall = mesh.vertices.mean(axis=0), random.uniform(0.01, 0.1) * mesh.radius
    # Not smaller about the middle: a plane through it would be its own inner wall.
    normals = np.zeros_like(mesh.vertices)
    each = mesh.face_areas[:, None] * mesh.face_normals
    np.add.at(normals, mesh.faces.ravel(), np.repeat(each, 3, axis=0))
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    inner = mesh.vertices - wall * normals
    axis = np.array([random.gauss(0.0, 1.0) for _ in range(3)])
    mouth = random.choice([0.0, random.uniform(15.0, 70.0)])
    parts: list[TriangleMesh] = []
    for vertices, faces in ((mesh.vertices, mesh.faces), (inner, mesh.faces[:, ::-1])):
        towards = vertices[faces].mean(axis=1) - middle
        lengths = np.linalg.norm(towards, axis=1) * np.linalg.norm(axis)
        kept = towards @ axis <= lengths * np.cos(np.radians(mouth))
        parts.append(TriangleMesh(vertices, faces[kept]))
    return TriangleMesh.joined(parts)


def _alike(random: Random, mesh: TriangleMesh) -> TriangleMesh:
    """The same mesh, a little larger or smaller along each axis."""
    factors = [random.uniform(0.9, 1.1) for _ in range(3)]
    return TriangleMesh(mesh.vertices * factors, mesh.faces)


def _curved(random: Random, rng: np.random.Generator) -> TriangleMesh:
    shape = curved_shapes.SHAPES[random.choice(list(curved_shapes.SHAPES))]
    make = shape.regular if random.random() < 0.5 else shape.irregular
    return make(random.choice([320, 600, 1200]))


def _plain(random: Random, rng: np.random.Generator) -> TriangleMesh:
    box = plain_shapes.box(tuple(rng.uniform(0.5, 1.5, 3)), divisions=6)
    rod = plain_shapes.cylinder(random.uniform(0.1, 0.5), 1.0, around=24, along=6)
    if random.random() < 0.5:
        return random.choice([box, rod])
    moved = TriangleMesh(rod.vertices + rng.uniform(-0.8, 0.8, 3), rod.faces)
    return plain_shapes.joined(box, moved)


def _bumpy(random: Random, rng: np.random.Generator) -> TriangleMesh:
    """A ball whose radius waves along a few directions."""
    ball = curved_shapes.SHAPES["sphere"].regular(1280)
    ways = ball.vertices / np.linalg.norm(ball.vertices, axis=1)[:, None]
    radius = np.ones(len(ways))
    for _ in range(random.randint(1, 5)):
        height, waves = random.uniform(0.02, 0.15), rng.uniform(-6.0, 6.0, 3)
        radius += height * np.sin(ways @ waves + random.uniform(0.0, 6.0))
    return TriangleMesh(ways * radius[:, None], ball.faces)


def _head(random: Random, rng: np.random.Generator) -> TriangleMesh:
    shape = HeadShape.random(random.randrange(1000))
    return sample_head(shape, n_faces=1500, open_neck=True)


def _open(random: Random, rng: np.random.Generator) -> TriangleMesh:
    """A sheet that waves."""
    sheet = plain_shapes.grid(1.0, random.uniform(0.4, 1.0), divisions=(20, 16))
    points = sheet.vertices.copy()
    waves = rng.uniform(-8.0, 8.0, 2)
    points[:, 2] = random.uniform(0.0, 0.15) * np.sin(points[:, :2] @ waves)
    return TriangleMesh(points, sheet.faces)


def _as_obj(mesh: TriangleMesh) -> str:
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in 1e3 * mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    return "\n".join([*lines, ""])


def _draw_target(random: Random, job: Job, mesh: TriangleMesh, own: float) -> None:
    """Ask for the target: its regions, all, or chosen faces or weights by a share."""
    way = random.choice([0, 1, 2])
    middles = mesh.vertices[mesh.faces].mean(axis=1) - mesh.vertices.mean(axis=0)
    if random.random() < own:
        if way == 0:
            heights = mesh.vertices @ [random.uniform(-1.0, 1.0) for _ in range(3)]
            heights -= heights.min()
            job.files["weights.txt"] = "".join(f"{h:.6f}\n" for h in heights)
            job.words += ["--weight", "weights.txt"]
        else:
            chosen = np.flatnonzero(middles[:, way] > 0.0)
            job.files["faces.txt"] = "".join(f"{face}\n" for face in chosen)
            job.words += ["--select", "faces.txt"]
    elif way:
        job.words += ["--target", "surface"]


def _draw_words(random: Random, job: Job) -> None:
    kind = job.kind

    def with_(odds: float, *words: object) -> None:
        drawn = random.random() < odds
        job.words += [str(word) for word in words] if drawn else []

    share, floor = round(random.uniform(0.4, 0.98), 2), random.choice([0, 0.3, 0.8])
    if kind == "none":
        job.words += ["--pattern", "none"]
    elif kind == "head":
        job.words += ["--max-heads", str(random.randint(1, 6))]
    else:
        job.words += ["--max-projectors", str(random.choice([1, 2, 3, 4, 5]))]
    if kind != "head":
        with_(0.3, "--max-cameras", random.choice([1, 2, 3, 4, 6]))
    if kind == "dense":
        job.words += ["--pattern", "dense"]
    if kind in ("rings", "family"):
        with_(0.2, "--ring-axis", random.choice(["centred", "free", "auto"]))
    with_(0.3, "--coverage", share)
    with_(0.2, "--dominant-coverage", share)
    with_(0.4, "--min-reachable", random.choice([0.1, 0.3, 0.6]))
    with_(0.02 if kind == "family" else 0.3, "--region-coverage", floor)
    with_(0.2, "--accuracy", random.choice([0.1, 0.5, 1.0]))
    with_(0.2, "--accuracy-of", "noise")
    with_(0.15, "--up", random.choice(["x", "-y", "y", "-z"]))
    with_(0.03, "--prove")
    if kind == "none":
        with_(0.2, "--views", random.choice([2, 3]))
    if kind in ("rings", "parallel", "dense"):
        _draw_more(random, job)
    if kind == "family":
        with_(0.7, "--cameras-by", "cover")
        with_(0.3, "--family-quantile", 0.5)
        with_(0.3, "--align", random.choice(["axes", "icp"]))


def _draw_more(random: Random, job: Job) -> None:
    """Ask for one of the harder things, and by which route cameras are chosen."""
    harder = {
        **{"": 40, "survive": 12, "views": 15, "joint": 12, "fixed": 12, "paper": 8},
        # Rigs are drawn by the thousand for it.
        "robust": 1,
    }
    what = random.choices(list(harder), list(harder.values()))[0]
    words = {
        **{"": [], "survive": ["--survive", "1"], "joint": ["--joint"]},
        **{"fixed": ["--fixed", "poses.csv"], "robust": ["--robust", "0.8"]},
        **{"paper": ["--cameras-by", "paper"]},
        "views": ["--views", random.choice(["2", "2", "3"])],
    }
    job.words += words[what]
    if what == "fixed":
        job.files["poses.csv"] = _poses(random)
    # The default looks at the paper's route, too, which takes long.
    if what != "paper" and random.random() < 0.65:
        job.words += ["--cameras-by", "cover"]


def _poses(random: Random) -> str:
    """Devices that stand there, about a metre away, looking at the origin."""
    rows = ["name,kind,x_mm,y_mm,z_mm,aim_x_mm,aim_y_mm,aim_z_mm,roll_deg"]
    kinds = ["projector", "camera", *random.choices(["projector", "camera"], k=2)]
    for k, kind in enumerate(kinds[: random.randint(1, 4)]):
        way = np.array([random.gauss(0.0, 1.0) for _ in range(3)])
        way *= random.uniform(950.0, 1150.0) / np.linalg.norm(way)
        place = ",".join(f"{x:.1f}" for x in way)
        rows.append(f"own {k},{kind},{place},0,0,0,{random.choice(['', 0, 90])}")
    return "\n".join([*rows, ""])


def _toml(value: Any) -> str:
    """A value as TOML has it in a line."""
    if isinstance(value, dict):
        inside = ", ".join(f"{key} = {_toml(one)}" for key, one in value.items())
        return f"{{{inside}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return json.dumps(value)
