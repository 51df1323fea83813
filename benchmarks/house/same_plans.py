"""Record what is planned for a fixed list of jobs, and compare two such records.

Usage: python -m benchmarks.house.same_plans record OUT.json [--python PYTHON] [NAME
    ...]
       python -m benchmarks.house.same_plans compare BEFORE.json AFTER.json
       (a checkout; `record` plans with the ringrig that PYTHON imports, by default
       the one beside this script)

The jobs: the sample, the sample in a room with housings and existing devices, a body
known by its ranges, and from `../shared/data/meshes` the face scan (both lights, and by
the paper's route), bust, three machined parts, bunny and horse, each with at most three
projectors and without the check from pixels, so that what is compared is the plan.

A record holds for each job the exit code, poses (metres), ring axes, ring radii,
counts, bounds, areas, what is missed, and the wall time. `compare` prints a table with
the largest difference of each and returns 1 if a count rose or a requirement is newly
missed.
"""

import argparse
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "data" / "meshes"
JOBS: dict[str, tuple[str, ...]] = {
    "face_scan_james.obj": (),
    "face_scan_james.obj, parallel": ("--light", "parallel"),
    "face_scan_james.obj, paper's route": ("--cameras-by", "paper"),
    "snowden_bust_lo.obj": ("--unit", "in"),
    "tm_ADIS16480.STL": ("--unit", "m"),
    "tm_counter.unitsmm.STL": (),
    "tm_fixed_top.ply": (),
    "vtk_bunny.ply": ("--unit", "m", "--up", "y"),
    "vtk_horse.ply": ("--size-mm", "300"),
}
ROOM = """
base = "default"
name = "room with housings"

[projector.body]
size_mm = [335, 96, 252]
centre_mm = [0, 0, -140]

[camera.body]
size_mm = [60, 60, 150]
centre_mm = [0, 0, -50]

[workspace]
shape = "box"
min_mm = [-2000, -1500, -400]
max_mm = [2000, 1500, 1800]

[[workspace.keep_out]]
name = "robot"
centre_mm = [900, 0, 300]
size_mm = [800, 600, 1200]
turn_deg = [0, 0, 30]

[[existing]]
name = "wall projector"
kind = "projector"
position_mm = [0, -1150, 150]
aim_mm = [0, 0, 0]

[[existing]]
name = "wall camera"
kind = "camera"
position_mm = [250, -1120, 100]
aim_mm = [0, 0, 0]
"""


def main() -> int:
    """Record or compare, as the words say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    record = verbs.add_parser("record")
    record.add_argument("out", type=Path)
    record.add_argument("--python", default=sys.executable)
    record.add_argument("names", nargs="*")
    compare = verbs.add_parser("compare")
    compare.add_argument("before", type=Path)
    compare.add_argument("after", type=Path)
    words = parser.parse_args()
    if words.verb == "compare":
        return _compare(
            *(json.loads(p.read_text()) for p in (words.before, words.after))
        )
    machine = (
        f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, "
        f"python {platform.python_version()}"
    )
    jobs: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        offered = dict(_jobs(Path(folder)))
        if unknown := set(words.names) - set(offered):
            parser.error(f"no such job: {', '.join(sorted(unknown))}")
        for name, arguments in offered.items():
            if not words.names or name in words.names:
                jobs[name] = _planned(words.python, arguments, Path(folder, "out"))
                print(f"{name}: {jobs[name]['wall_s']:.0f} s", file=sys.stderr)
                text = json.dumps({"machine": machine, "jobs": jobs}, indent=1)
                words.out.write_text(text + "\n")
    return 0


def _jobs(folder: Path) -> Iterator[tuple[str, list[str]]]:
    sample = ["--mesh", str(ROOT / "face.obj")]
    yield "face.obj", sample
    (folder / "room.toml").write_text(ROOM)
    yield "face.obj, room and bodies", [*sample, "--rig", str(folder / "room.toml")]
    (folder / "ranges.csv").write_text(range_observations())
    yield "ranges", ["--ranges", str(folder / "ranges.csv")]
    for name, words in JOBS.items():
        path = SHARED / name.split(",")[0]
        if path.exists():
            yield name, ["--mesh", str(path), *words]
        else:
            print(f"{name}: skipped, {path.name} is absent", file=sys.stderr)


def range_observations() -> str:
    """Twelve points of a ball of 90 mm, seen from two views, ranged from one."""
    lines = ["point,x_mm,y_mm,z_mm,dx,dy,dz,sigma_deg,range_mm,sigma_mm"]
    for index in range(12):
        height = 1.0 - (2 * index + 1) / 12
        turn = index * math.pi * (3.0 - math.sqrt(5.0))
        level = math.sqrt(1.0 - height * height)
        normal = (level * math.cos(turn), level * math.sin(turn), height)
        point = [90.0 * x for x in normal]
        for lean in (-0.2, 0.2):
            far = [1000.0 * x for x in normal]
            view = [far[0] - lean * far[1], far[1] + lean * far[0], far[2] + 150 * lean]
            ray = [p - v for p, v in zip(point, view, strict=True)]
            length = math.hypot(*ray)
            measured = f"{length:.4f},1" if lean > 0 else ","
            row = ",".join(f"{x:.6f}" for x in (*view, *(r / length for r in ray)))
            lines.append(f"p{index},{row},0.02,{measured}")
    return "\n".join(lines) + "\n"


def _planned(python: str, arguments: list[str], out: Path) -> dict[str, Any]:
    code = (
        "import sys; sys.path[:0] = ['.']; from planning.cli.main import main; main()"
    )
    words = [*arguments, "--max-projectors", "3", "--no-check", "--no-patterns"]
    begin = time.perf_counter()
    done = subprocess.run(
        [python, "-c", code, *words, "--quiet", "--json", "-o", str(out)],
        capture_output=True,
        text=True,
        check=False,
    )
    wall = time.perf_counter() - begin
    record: dict[str, Any] = {"exit": done.returncode, "wall_s": round(wall, 2)}
    if done.returncode not in (0, 1):
        return record | {"said": done.stderr.strip().splitlines()[-1:]}
    plan = json.loads(done.stdout)
    proofs = plan["certificates"]
    return record | {
        "projectors": [p["world_from_device"] for p in plan["projectors"]],
        "cameras": [c["world_from_device"] for c in plan["cameras"]],
        "rings": [p["world_from_ring"] for p in plan["projectors"]],
        "radii": [p["ring_radii"] for p in plan["projectors"]],
        "bounds": {kind: _bounds(proofs[kind]) for kind in ("projectors", "cameras")},
        "areas": {part: plan["coverage"][part] for part in ("target", "surface")},
        "n_missed": len(plan["missed"]),
        "timings_s": plan["timings_s"],
    }


def _bounds(proof: dict[str, Any]) -> list[int | None]:
    everywhere = proof["continuous"]
    return [
        proof["count"],
        proof["candidates"]["lower_bound"],
        None if everywhere is None else everywhere["lower_bound"],
    ]


_HEAD = (
    "job",
    "exit",
    "projectors [count, candidates, all poses]",
    "cameras",
    "poses [mm]",
    "ring axes [mm]",
    "areas [points]",
    "seconds before / after (ratio)",
)


def _compare(before: dict[str, Any], after: dict[str, Any]) -> int:
    print(f"before: {before['machine']}\nafter: {after['machine']}\n")
    print(f"| {' | '.join(_HEAD)} |\n|{len(_HEAD) * '---|'}")
    worse = 0
    for name, old in before["jobs"].items():
        new = after["jobs"].get(name)
        if new is None:
            continue
        row = [name, _pair(old["exit"], new["exit"])]
        if "bounds" in old and "bounds" in new:
            for kind in ("projectors", "cameras"):
                row.append(_pair(old["bounds"][kind], new["bounds"][kind]))
                worse += len(new[kind]) > len(old[kind])
            moved = max(_moved(old[k], new[k]) for k in ("projectors", "cameras"))
            row += [_number(moved), _number(_moved(old["rings"], new["rings"]))]
            row.append(_number(_area_points(old["areas"], new["areas"])))
            worse += new["n_missed"] > old["n_missed"]
        else:
            row += ["", "", "", "", ""]
        ratio = new["wall_s"] / old["wall_s"]
        row.append(f"{old['wall_s']:.1f} / {new['wall_s']:.1f} ({ratio:.2f})")
        worse += new["exit"] > old["exit"]
        print(f"| {' | '.join(row)} |")
    return int(worse > 0)


def _pair(old: object, new: object) -> str:
    return str(old) if old == new else f"**{old} -> {new}**"


def _number(value: float) -> str:
    return "same" if value == 0 else f"{value:.3g}"


def _moved(old: list[Any], new: list[Any]) -> float:
    """Largest change of a matrix entry, times 1000: mm of position."""
    if len(old) != len(new):
        return math.inf
    entries = zip(_flat(old), _flat(new), strict=True)
    return 1e3 * max((abs(a - b) for a, b in entries), default=0.0)


def _flat(value: list[Any]) -> Iterator[float]:
    for item in value:
        if isinstance(item, list):
            yield from _flat(item)
        else:
            yield item


def _area_points(old: dict[str, Any], new: dict[str, Any]) -> float:
    """Largest change of an area, in percent of the part that it belongs to."""
    return max(
        100.0 * abs(value - new[part][key]) / areas["area_m2"]
        for part, areas in old.items()
        for key, value in areas.items()
    )


if __name__ == "__main__":
    sys.exit(main())
