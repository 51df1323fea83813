"""Time and memory of reading a large scan, its curvature and its regions.

Usage: python -m benchmarks.meshes.large_mesh [DATA]   (ringrig installed)

DATA is the folder with the shared meshes, `../shared/data` by default. Runs in a
process of its own, so that the peak is that of these steps alone; prints a table.
"""

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.machine import machine

ROOT = Path(__file__).resolve().parents[2]
NAME = "colin27_head_1mm.ply.gz"


def main() -> int:
    """Print the table; return 0."""
    if sys.argv[1:2] == ["--measure"]:
        return _measure(Path(sys.argv[2]))
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "data"
    path = data / "meshes" / NAME
    if not path.is_file():
        print(f"{path.name} isn't there")
        return 1
    run = [sys.executable, "-m", __spec__.name, "--measure", str(path)]
    done = subprocess.run(run, capture_output=True, text=True, check=True)
    print(f"{machine()}\n")
    rows, note = json.loads(done.stdout)
    print(f"{NAME}: {note}\n\n| step | wall [s] | CPU [s] | peak memory so far [GB] |")
    print("|---|---|---|---|")
    for name, wall, cpu, peak in rows:
        print(f"| {name} | {wall:.1f} | {cpu:.1f} | {peak:.2f} |")
    total = [sum(row[k] for row in rows) for k in (1, 2)]
    print(f"| together | {total[0]:.1f} | {total[1]:.1f} | {rows[-1][3]:.2f} |")
    return 0


def _measure(path: Path) -> int:
    rows: list[tuple[str, float, float, float]] = []
    marks = [time.perf_counter(), time.process_time()]

    def mark(name: str) -> None:
        now = [time.perf_counter(), time.process_time()]
        # Linux counts kilobytes, macOS bytes.
        unit = 1.0 if sys.platform == "darwin" else 1024.0
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9
        rows.append((name, now[0] - marks[0], now[1] - marks[1], peak))
        marks[:] = now

    from geometry.curvature.curvature import principal_curvatures
    from geometry.files.readers import load_mesh
    from geometry.regions.regions import dominant_regions

    mark("import")
    mesh = load_mesh(path)
    mark("read, repair, orient")
    field = principal_curvatures(mesh)
    mark("curvature")
    found = dominant_regions(mesh, field)
    mark("dominant regions")
    note = (
        f"{len(mesh.faces):,} faces, {len(found)} regions, "
        f"{100 * found.dominant_share:.1f} % dominant"
    )
    json.dump((rows, note), sys.stdout)
    return 0


if __name__ == "__main__":
    sys.exit(main())
