"""The sample, planned and measured once, for the pictures of the documentation."""

import subprocess
import sys
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning import RigPlan

Colours = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"


class Job:
    """The sample, planned and measured once; parts are made when they are asked for."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.folder, self.words = folder, words

    @cached_property
    def plan(self) -> RigPlan:
        """The plan of the README's command, with a word or two more."""
        mesh = ["--mesh", str(ROOT / "face.obj"), "--max-projectors", "3"]
        command(*mesh, *self.words, "--quiet", "-o", str(self.folder))
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
        command("reconstruct", str(self.folder / "plan.json"), *words)
        return folder

    @cached_property
    def cloud(self) -> tuple[Colours, Colours]:
        """Points [m] and their colours, from `cloud.ply`."""
        assert self.captures
        return read_cloud(self.folder / "cloud.ply")


def command(*words: str) -> None:
    """Run a `plan` command; one that misses a requirement has still written."""
    code = "from planning.cli.main import main; main()"
    run = [sys.executable, "-c", code, *words]
    done = subprocess.run(run, cwd=ROOT, check=False, stdout=subprocess.DEVNULL)
    # A cloud that misses a limit is written, and is what one picture shows.
    if done.returncode not in (0, 1):
        raise SystemExit(f"plan {' '.join(words)} ended with {done.returncode}")


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
