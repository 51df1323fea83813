"""Every rig that comes with the program plans an object of the sizes that it states.

The sample head, scaled to the middle of the sizes (geometric mean) in the preset's
description; six projectors at most, cameras as needed, no check from pixels. Printed
are devices, what is measured of what can be and of the whole target, the predicted
standard deviation with what the calibration leaves, and what was missed.

    PYTHONPATH=.:tests python -m benchmarks.rigs.preset_rigs [NAME ...]
"""

import json
import math
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from planning.rig.toml.preset_files import preset_names
from planning.rig.toml.preset_lists import list_presets

_MOST = 6
_SIZES = re.compile(r"from (\d+) to (\d+) mm")


def sizes_mm(description: str) -> tuple[float, float] | None:
    """Return the smallest and the largest object that a preset is for."""
    found = _SIZES.search(description)
    return None if found is None else (float(found[1]), float(found[2]))


def row(name: str, description: str) -> str:
    """Plan with a preset; return its line of the table."""
    sizes = sizes_mm(description)
    assert sizes is not None, name
    size = float(f"{math.sqrt(sizes[0] * sizes[1]):.2g}")
    with tempfile.TemporaryDirectory() as folder:
        words = ["plan", "--mesh", "face.obj", "--size-mm", f"{size:g}"]
        words += ["--max-projectors", str(_MOST), "--rig", name, "--no-check"]
        words += ["--threads", "1", "--json", "--quiet", "--no-patterns"]
        begin = time.monotonic()
        # `plan` itself, so that the exit code is the user's.
        run = subprocess.run(
            [sys.executable, "-c", "from planning.cli.main import main; main()"]
            + [*words[1:], "-o", str(Path(folder) / "out")],
            capture_output=True,
            text=True,
            check=False,
        )
        seconds = time.monotonic() - begin
    if run.returncode not in (0, 1):
        return f"| {name} | {size:g} | exit {run.returncode}: {run.stderr.strip()} |"
    plan = json.loads(run.stdout)
    target = plan["coverage"]["target"]
    measured, reachable, area = (
        target[key] for key in ("measured_m2", "reachable_by_cameras_m2", "area_m2")
    )
    sigma = plan["coverage"]["sigma"]
    missed = "; ".join(plan["missed"]) or "nothing"
    return (
        f"| {name} | {sizes[0]:g} to {sizes[1]:g}, {size:g} "
        f"| {len(plan['projectors'])} + {len(plan['cameras'])} "
        f"| {measured / reachable:.1%} | {measured / area:.1%} "
        f"| {1e3 * sigma['median_m']:.3f} | {run.returncode} | {missed} "
        f"| {seconds:.0f} |"
    )


def main(names: list[str]) -> None:
    """Print the table, a rig as soon as it is planned."""
    print(
        "| rig | objects, planned [mm] | projectors + cameras | measured of reachable "
        "| of the target | sigma, median [mm] | exit | missed | s |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for preset in list_presets():
        # Heads have a table of their own, `benchmarks.plans.heads`.
        if preset.name in (names or preset_names()) and "head" not in preset.devices:
            print(row(preset.name, preset.description), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
