"""The front of three meshes, and points of it taken, beside plans from nothing.

The front is of up to three projectors and four cameras. Then some of its points (all,
with `--all`) are taken, as `plan --take` does, and as many devices are planned from
nothing. Printed are the seconds of each (no check from pixels, no pictures), and
measured shares of the target: as the front said, as the taken plan claims on samples of
its own, and as the plan from nothing does, which stops at the fewest devices that meet
what is asked. A taken point may claim less than the front said by the sampling error
alone: two standard errors of both draws.

    PYTHONPATH=. python -m benchmarks.plans.pareto [--all] [MESH ...] > FILE
"""

import io
import sys
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from geometry.files.readers import load_mesh
from geometry.parallel import n_threads
from planning.cli.lines.front_lines import front_lines
from planning.model.front import Front, FrontPoint
from planning.model.plan import RigPlan
from planning.pipeline import plan_rig
from planning.rig.rig import load_rig
from planning.rig.wishes import Wishes
from planning.steps.front.kept_front import FRONT_FILE, KeptFront, read_front
from planning.steps.front.plan_front import plan_front
from planning.steps.front.taken_point import TakenPoint

ROOT = Path(__file__).parents[2]
MESHES = ROOT.parent / "shared" / "data" / "meshes"
UNITS = {"vtk_bunny.ply": "m", "tm_reference.obj": "mm"}
PROJECTORS, CAMERAS = 3, 4
POINTS = ((2, 3), (3, 3))


def main(words: list[str]) -> int:
    """Print each mesh's front and its points; return 1 where one claims too little."""
    every = tuple(product(range(1, PROJECTORS + 1), range(1, CAMERAS + 1)))
    counts = every if "--all" in words else POINTS
    paths = [Path(word) for word in words if word != "--all"]
    paths = paths or [ROOT / "face.obj", *(MESHES / name for name in UNITS)]
    print(f"`python -m benchmarks.plans.pareto`, {n_threads()} threads\n")
    return int(any([_compared(path, counts) for path in paths]))


def _compared(path: Path, counts: Sequence[tuple[int, int]]) -> bool:
    """Print what a mesh gives; say whether any taken point claims too little."""
    mesh = load_mesh(path, unit=UNITS.get(path.name))
    rig, begin = load_rig("default"), time.monotonic()
    wishes = Wishes(max_projectors=PROJECTORS, max_cameras=CAMERAS)
    front = plan_front(mesh, rig, wishes)
    seconds = time.monotonic() - begin
    print(f"## {path.name}\n\n```")
    print("\n".join(front_lines(front.front, path.name, [])))
    print(f"```\n\nThe front took {seconds:.1f} s.\n")
    print(
        "| P, C | taken [s] | from nothing [s] | front | taken | from nothing | "
        "95 % within [mm]: front, taken, from nothing |"
    )
    print("|---|---|---|---|---|---|---|", flush=True)
    spent, short = np.zeros(2), False
    kept = _read_again(front)
    for count in counts:
        point = kept.front.point(*count)
        if point is None:
            continue
        begin = time.monotonic()
        taken = plan_rig(
            mesh,
            rig,
            take=TakenPoint(kept, point),
            check=False,
            on_miss="return",
        )
        middle = time.monotonic()
        anew = plan_rig(
            mesh,
            rig,
            max_projectors=count[0],
            max_cameras=count[1],
            check=False,
            on_miss="return",
        )
        seconds_of = middle - begin, time.monotonic() - middle
        spent += seconds_of
        sharp = [1e3 * p for p in (point.sigma_p95_m, _p95(taken), _p95(anew)) if p]
        low = _claims_less(kept.front, point, taken)
        short |= low
        print(
            f"| {count[0]}, {count[1]} | {seconds_of[0]:.1f} | {seconds_of[1]:.1f} | "
            f"{100.0 * point.measured_m2 / kept.front.area_m2:.1f} % | "
            f"{_words(taken)}{' TOO LITTLE' * low} | {_words(anew)} with "
            f"{len(anew.projectors)}, {len(anew.cameras)} | "
            f"{', '.join(f'{mm:.3f}' for mm in sharp)} |",
            flush=True,
        )
    verdict = "A taken point claims too little." if short else "No claim is too small."
    print(
        f"\nTogether: {seconds:.0f} s for the front, {spent[0]:.0f} s taken, "
        f"{spent[1]:.0f} s from nothing. {verdict}\n",
        flush=True,
    )
    return short


def _read_again(front: KeptFront) -> KeptFront:
    """The front as its file holds it."""
    with TemporaryDirectory() as folder:
        text = io.BytesIO()
        front.write(text)
        (Path(folder) / FRONT_FILE).write_bytes(text.getvalue())
        return read_front(Path(folder))


def _share(plan: RigPlan) -> float:
    areas = plan.coverage.target
    return areas.measured_m2 / areas.area_m2


def _p95(plan: RigPlan) -> float | None:
    return None if plan.coverage.sigma is None else plan.coverage.sigma.p95_m


def _words(plan: RigPlan) -> str:
    return f"{100.0 * _share(plan):.1f} %"


def _claims_less(front: Front, point: FrontPoint, plan: RigPlan) -> bool:
    """Whether a plan claims less than its point, by more than both draws' errors."""
    said = point.measured_m2 / front.area_m2
    draws = 1.0 / front.fresh_samples + 1.0 / plan.coverage.samples
    error = np.sqrt(said * (1.0 - said) * draws)
    return bool(_share(plan) < said - 2.0 * error)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
