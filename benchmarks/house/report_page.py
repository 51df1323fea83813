"""What report.html costs: time to write, size, and time to its first picture.

    python -m benchmarks.house.report_page face-plan [--faces 1050000]

Of a plan's own surface, and of a sample head of about a million faces under the same
devices. Pictures are drawn by Chromium's software renderer, without a graphics card.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial import KDTree

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.sample_head.sample_head import sample_head
from planning.model.plan import RigPlan
from planning.report.page.page import write_page

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests"))
from support import browser

_RUNS = 3


def main() -> None:
    """Print a table row for each surface."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--faces", type=int, default=1_050_000)
    options = parser.parse_args()
    plan = RigPlan.load(options.folder / "plan.json")
    head = sample_head(n_faces=options.faces, open_neck=True)
    print("| faces | processor [s] | wall [s] | MB | first pictures [ms] |")
    print("|---|---|---|---|---|")
    for shown in (plan, on_mesh(plan, head)):
        print(row(shown), flush=True)


def on_mesh(plan: RigPlan, mesh: TriangleMesh) -> RigPlan:
    """Return a plan on another mesh; regions and T1 are those of the nearest faces."""
    old = plan.surface
    _, near = KDTree(old.mesh.face_centroids).query(mesh.face_centroids)
    member = np.zeros(len(mesh.faces), dtype=np.int64)
    of_faces = {"region": old.region[near], "steep": old.steep[near]}
    return RigPlan(plan.document, replace(old, mesh=mesh, member=member, **of_faces))


def row(plan: RigPlan) -> str:
    """Write the page of a plan, open it, and return its row of the table."""
    n_faces = len(plan.surface.mesh.faces)
    # As a checked run has it; what it says is no matter here.
    error_m = np.random.default_rng(0).normal(0.0, 3e-5, n_faces)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "report.html"
        begin, processor = time.monotonic(), time.process_time()
        write_page(plan, path, threads=2, error_m=error_m)
        seconds = time.process_time() - processor, time.monotonic() - begin
        size = 1e-6 * path.stat().st_size
        ready = [str(first_picture(path)) for _ in range(_RUNS)]
    return (
        f"| {n_faces:,} | {seconds[0]:.2f} | {seconds[1]:.2f} | {size:.2f} | "
        f"{', '.join(ready)} |"
    )


def first_picture(path: Path) -> int:
    """Return when a page's first picture is drawn, from its opening on [ms]."""
    with TemporaryDirectory() as profile, browser.browser(Path(profile)) as opened:
        opened.open(path)
        return int(opened.run("return document.documentElement.dataset.ready"))


if __name__ == "__main__":
    main()
