"""Plan the parts of docs/gallery.md, and write the page and its pictures.

Usage: python -m benchmarks.pictures.gallery [NAME ...]     (from a checkout's root)

Without names every part is planned; with names only their sections are replaced. Real
parts come from ../shared/data/meshes, and are skipped where it is absent; shapes are
written to build/gallery. The folders NAME-plan, reports included, stay for looking.
"""

import re
import shlex
import subprocess
import sys
from dataclasses import dataclass

from PIL import Image

from geometry.files.interchange import to_trimesh
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import box, cylinder, sphere

from .drawing import save
from .job import IMAGES, ROOT

PAGE, GALLERY = ROOT / "docs" / "gallery.md", IMAGES / "gallery"
SHAPES = ROOT / "build" / "gallery"
_REAL = "../shared/data/meshes/"
_SHOWN = ("OK", "NOT", "MEASURED", "EXACT", "FEWEST", "MISSED", "HELPS", "CHECK")
_SIZE = (800, 500)
_HEAD = """# Ten planned parts

Written by `python -m benchmarks.pictures.gallery`: what each command printed, without
tables and warnings, and what it drew, smaller. A part that misses something stands
here as well: see [when it says MISSED](howto/missed.md). Each command also writes
`NAME-plan/report.html`, the [report](use/report.md) to turn and to click. The head
comes along; ball, box and cylinder are written by the script; the others are published
meshes, not part of this project.
"""


@dataclass(frozen=True)
class Part:
    """A section of the page: what the part is, and what `plan` is told."""

    title: str
    mesh: str
    words: str
    why: str


PARTS = (
    Part("Head", "face.obj", "--max-projectors 3", "The sample, with the default rig."),
    Part(
        "Ball",
        "build/gallery/ball.stl",
        "--max-projectors 5 --rig desktop-pico",
        "80 mm. Its curvature is the same everywhere, so all of it is the target.",
    ),
    Part(
        "Box",
        "build/gallery/box.stl",
        "--max-projectors 5 --rig desktop-pico",
        "120 x 80 x 50 mm. What is curved about a box is its edges.",
    ),
    Part(
        "Cylinder",
        "build/gallery/cylinder.stl",
        "--max-projectors 5 --rig desktop-pico --target surface",
        "60 mm wide and 100 mm high, all around.",
    ),
    Part(
        "Horse",
        _REAL + "vtk_horse.ply",
        "--unit m --max-projectors 4",
        "A statuette of 183 mm: legs stand in each other's light.",
    ),
    Part(
        "Bunny",
        _REAL + "vtk_bunny.ply",
        "--unit m --up y --max-projectors 4",
        "156 mm, open below, and stored inside out.",
    ),
    Part(
        "Scan",
        _REAL + "face_scan_james.obj",
        "--up y --max-projectors 3",
        "A scan of a face, open behind: what another scanner saw is a mesh, too.",
    ),
    Part(
        "Housing",
        _REAL + "tm_ADIS16480.STL",
        "--unit m --max-projectors 5 --rig desktop-pico",
        "An inertial sensor of 47 mm, with cavities that no light reaches.",
    ),
    Part(
        "Ring",
        _REAL + "tm_fixed_top.ply",
        "--max-projectors 5 --rig desktop-pico",
        "A machined ring of 120 mm, with slots.",
    ),
    Part(
        "Blade",
        _REAL + "vtk_turbineblade.ply",
        "--size-mm 120 --max-projectors 5 --rig desktop-pico",
        "A turbine blade: 199,034 triangles.",
    ),
)


def section(part: Part) -> str:
    """Plan a part; return its section of the page."""
    words = ["plan", "--mesh", part.mesh, *shlex.split(part.words)]
    code = "from planning.cli.main import main; main()"
    run = [sys.executable, "-c", code, *words[1:], "--quiet"]
    done = subprocess.run(run, cwd=ROOT, check=False, capture_output=True, text=True)
    print(shlex.join(words), done.stdout, done.stderr, sep="\n", flush=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{part.title} ended with {done.returncode}")
    name = part.title.lower()
    folder = re.sub(r"\.\w+$", "", part.mesh.rpartition("/")[2]) + "-plan"
    picture = Image.open(ROOT / folder / "rig.png")
    save(picture.resize(_SIZE, Image.Resampling.LANCZOS), GALLERY / f"{name}.png")
    return "\n".join(
        [
            f"## {part.title}\n",
            f"{part.why}\n",
            f"![The planned rig and what it measures](images/gallery/{name}.png)\n",
            f"```\n{shlex.join(words)}\n\n{_shown(done.stdout)}\n```\n",
        ]
    )


def _shown(summary: str) -> str:
    """Return the verdict and the lines that say how much, how well, how few."""
    kept, lines = False, []
    for line in summary.splitlines():
        if not line.startswith(" "):
            kept = line.startswith(_SHOWN)
        elif "position x, y, z" in line:
            kept = False
        if kept:
            lines.append(line)
    return "\n".join(lines)


def main() -> int:
    """Replace sections of the page."""
    SHAPES.mkdir(parents=True, exist_ok=True)
    shapes: dict[str, TriangleMesh] = {
        "ball": sphere(0.04, subdivisions=5),
        "box": box((0.12, 0.08, 0.05)),
        "cylinder": cylinder(0.03, 0.1),
    }
    for name, shape in shapes.items():
        to_trimesh(shape).apply_scale(1e3).export(SHAPES / f"{name}.stl")
    text = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    sections = {s.split("\n")[0][3:]: s for s in re.split(r"\n(?=## )", text)[1:]}
    for part in PARTS:
        if part.title in (sys.argv[1:] or [p.title for p in PARTS]):
            if (ROOT / part.mesh).exists():
                sections[part.title] = section(part)
            else:
                print(f"{part.title}: {part.mesh} isn't there")
        ordered = [sections[p.title] for p in PARTS if p.title in sections]
        PAGE.write_text("\n".join([_HEAD, *ordered]), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
