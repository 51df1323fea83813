"""Devices and time of the planner, beside what a user would write.

Usage: python -m benchmarks.plans.beside_greedy [NAME ...]   (ringrig installed, from a
    checkout)

On the sample and the shared meshes (those named, if any), with the default rig, 90 % to
be lit and 95 % to be measured: projectors and cameras of the plan, its wall time from
the prepared object to chosen cameras, and whether fresh samples confirm it; then a
greedy cover on trimesh's visibility matrix, and scipy's MILP on the same with at most
60 s a program (`by_hand.py`): their devices, wall time, and the shares that `plan
evaluate` finds they light and measure. Where those are less than was asked, the greedy
goes on by a device that is missed until they aren't, as a user would, to 12 of a kind
or until its matrix knows of none that adds anything: "no" then stands before what it
ended with. Last come the medians of devices saved, against those that meet what is
asked and, of the plans that do, against what it ended with as well; and of the ratios
of times: to the first greedy cover's, to that of going on, with the evaluations, and to
the MILP's. Returns 1 if a plan takes more devices than a greedy cover that meets what
is asked.
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.bounds.continuous_bounds import jobs
from benchmarks.machine import machine
from geometry.curvature.refinement import cut_for_curvature
from geometry.mesh.mesh import TriangleMesh
from planning import load_mesh, load_rig, plan_rig, read_mounted
from planning.model.plan import RigPlan
from planning.model.progress import Stopwatch
from planning.report.partial_plan import PlanRequest, Prepared
from planning.rig.rig import Rig
from planning.rig.wishes import Wishes
from planning.steps.prepare import prepared

from .by_hand import ByHand, by_milp, greedy

_MOST, _LIMIT_S = 12, 60.0
_LIT, _MEASURED = 0.90, 0.95
_OURS = "projectors", "projector_poses", "cameras"
_HEAD = (
    *("mesh", "plan", "met", "wall [s]", "greedy", "lit, measured", "wall [s]"),
    *("greedy until met", "wall [s]", "MILP", "lit, measured", "wall [s]"),
)
_PEERS = "greedy's", "greedy's until met, with the evaluations that tell it", "MILP's"


@dataclass(frozen=True, eq=False)
class Judge:
    """Evaluates devices with the planner's own limits."""

    mesh: TriangleMesh
    rig: Rig
    ready: Prepared
    up: str | None
    folder: Path

    def shares(self, hand: ByHand, devices: tuple[list[int], list[int]]) -> list[float]:
        """Return what is lit and measured, of what can be."""
        aim = 1e3 * np.array(self.ready.scene.requirements.workspace.centre)
        scale = 1e3 * hand.places
        rows = ["name,kind,x_mm,y_mm,z_mm,aim_x_mm,aim_y_mm,aim_z_mm"]
        for kind, chosen in zip(("projector", "camera"), devices, strict=True):
            for k, place in enumerate(scale[chosen]):
                where = ",".join(f"{x:.3f}" for x in (*place, *aim))
                rows.append(f"{kind[0]}{k},{kind},{where}")
        path = self.folder / "poses.csv"
        path.write_text("\n".join(rows) + "\n")
        plan = plan_rig(
            self.mesh,
            self.rig,
            up=self.up,
            fixed=read_mounted(path, self.rig),
            check=False,
            on_miss="return",
        )
        return shares(plan)


def shares(plan: RigPlan) -> list[float]:
    """Return what a plan lights and measures, of what can be."""
    areas = plan.coverage.target
    return [
        areas.lit_m2 / areas.reachable_by_projectors_m2,
        areas.measured_m2 / max(areas.reachable_by_cameras_m2, 1e-12),
    ]


def met(found: list[float]) -> tuple[bool, bool]:
    """Whether enough is lit, and measured."""
    return found[0] >= _LIT, found[1] >= _MEASURED


def main() -> int:
    """Print the table."""
    print(f"{machine()}\n\n| {' | '.join(_HEAD)} |\n|{len(_HEAD) * '---|'}")
    rows: list[_Row] = []
    with tempfile.TemporaryDirectory() as name:
        for path, options, up in jobs(sys.argv[1:]):
            mesh = load_mesh(path, **options)
            rows.append(_row(path.name, mesh, up, Path(name)))
    fair = [row for row in rows if row.ended_met]
    for some, what in (
        (fair, "the greedy cover where that meets what is asked"),
        (
            [row for row in rows if row.met],
            "what the greedy cover ended with, of plans that meet what is asked",
        ),
    ):
        saved = [1.0 - row.ours / row.ended for row in some]
        if saved:
            print(
                f"\nDevices saved against {what}: {median(saved):.0%} in the median of "
                f"{len(saved)}, from {min(saved):.0%} to {max(saved):.0%}."
            )
    for k, peer in enumerate(_PEERS):
        ratios = [row.times[k] for row in rows]
        no_more = sum(ratio <= 1.0 for ratio in ratios)
        print(
            f"\nWall time of the plan's cover by the {peer}: {median(ratios):.2f} in "
            f"the median, no more on {no_more} of {len(ratios)}."
        )
    return int(any(row.ours > row.ended for row in fair))


@dataclass(frozen=True)
class _Row:
    """Devices of a plan and of the greedy cover as it ended, and who met what is asked.

    `times` are the plan's time by those of its peers.
    """

    ours: int
    met: bool
    ended: int
    ended_met: bool
    times: tuple[float, float, float]


def _row(name: str, mesh: TriangleMesh, up: str | None, folder: Path) -> _Row:
    """Print a row of the table, and return it."""
    rig = load_rig("default")
    plan = plan_rig(
        mesh, rig, up=up, max_projectors=_MOST, check=False, on_miss="return"
    )
    ours = len(plan.projectors), len(plan.cameras)
    timings = plan.document.timings_s
    wall = sum(timings[key] for key in _OURS)
    cut, _ = cut_for_curvature(mesh)
    clock = Stopwatch(None)
    wishes = Wishes(max_projectors=_MOST, up=up)
    ready = prepared(PlanRequest(cut, rig, wishes), clock)
    judge = Judge(mesh, rig, ready, up, folder)
    hand = ByHand.of(ready, rig.n_projector_poses)
    begin = time.monotonic()
    lights = _taken(greedy(hand.lights, _LIT))
    views = _taken(greedy(hand.measures(lights), _MEASURED))
    greedy_s = hand.seconds + time.monotonic() - begin
    begin = time.monotonic()
    first = judge.shares(hand, (lights, views))
    ended, ended_met = _until_met(judge, hand, (lights, views), first)
    until_s = greedy_s + time.monotonic() - begin
    begin = time.monotonic()
    milp_lights = by_milp(hand.lights, _LIT, _LIMIT_S)
    milp_views = None
    if milp_lights is not None:
        milp_views = by_milp(hand.measures(milp_lights), _MEASURED, _LIMIT_S)
    milp_s = hand.seconds + time.monotonic() - begin
    exact = "none in time", "", f"{milp_s:.0f}"
    if milp_lights is not None and milp_views is not None:
        found = judge.shares(hand, (milp_lights, milp_views))
        exact = f"{len(milp_lights)} + {len(milp_views)}", _words(found), exact[2]
    ours_met, no = all(met(shares(plan))), "" if ended_met else "no: "
    cells = (
        *(name, f"{ours[0]} + {ours[1]}", "yes" if ours_met else "NO"),
        *(f"{wall:.1f}", f"{len(lights)} + {len(views)}", _words(first)),
        *(f"{greedy_s:.1f}", f"{no}{ended[0]} + {ended[1]}", f"{until_s:.1f}"),
        *exact,
    )
    print(f"| {' | '.join(cells)} |", flush=True)
    times = wall / greedy_s, wall / until_s, wall / milp_s
    return _Row(sum(ours), ours_met, sum(ended), ended_met, times)


def _until_met(
    judge: Judge,
    hand: ByHand,
    devices: tuple[list[int], list[int]],
    found: list[float],
) -> tuple[tuple[int, int], bool]:
    """With how many devices the greedy cover ends, and whether they meet what is asked.

    It ends when they do, or when there is none to be added.
    """
    n_lights, n_views = (len(some) for some in devices)
    lights = [best for best, _ in greedy(hand.lights, 1.0)]
    while not all(enough := met(found)):
        more = n_lights + (not enough[0]), n_views + enough[0]
        views = [b for b, _ in greedy(hand.measures(lights[: more[0]]), 1.0)]
        if more[0] > len(lights) or more[1] > len(views) or max(more) > _MOST:
            return (n_lights, n_views), False
        n_lights, n_views = more
        found = judge.shares(hand, (lights[:n_lights], views[:n_views]))
    return (n_lights, n_views), True


def _taken(order: Iterator[tuple[int, bool]]) -> list[int]:
    taken: list[int] = []
    for best, enough in order:
        taken.append(best)
        if enough:
            break
    return taken


def _words(found: list[float]) -> str:
    return ", ".join(f"{share:.1%}" for share in found)


if __name__ == "__main__":
    sys.exit(main())
