"""Whole plans of every mesh: what is met on fresh samples, and what the pixels say.

Usage: python -m benchmarks.plans.whole_plans [--max-projectors N] [--cameras-by ROUTE]
       [--light LIGHT] [NAME ...]       (ringrig installed, from a checkout)

Runs the command `plan` on the sample and the shared meshes (those named, if any) with
the default rig, each in the unit or size that `tests/support/shared_meshes.py` states,
the check from pixels included. N is 3 by default. Prints, from `plan.json`:

- projectors, and the bounds over the candidates and over all poses; cameras likewise,
  with what the paper's route needs; the smallest baseline of neighbours;
- lit / reachable by projectors, measured / reachable by cameras, on fresh samples, the
  exit code and false claims that the audit found;
- the check: samples predicted measured that are missing, completeness at one ring gap,
  rms and p95; agreement with the prediction at physical floors on target and surface,
  beside that of a predictor that knows nothing.

What a run misses, and what would help, is listed below the table.
"""

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from support import shared_meshes

from benchmarks.machine import machine

ROOT = Path(__file__).resolve().parents[2]
RUN = [sys.executable, "-c", "from planning.cli.main import main; main()"]
_HEAD = (
    "mesh",
    "projectors (candidates, all poses)",
    "cameras (candidates, all poses)",
    "paper's",
    "smallest baseline [mm]",
    "lit",
    "measured",
    "exit",
    "false claims",
    "missing",
    "complete",
    "rms / p95 [mm]",
    "agreement target",
    "surface",
    "CPU [s]",
)


def main() -> int:
    """Print the table; return 1 if a run ended without a documented exit code."""
    words = sys.argv[1:]
    options = ["--max-projectors", "3"]
    while words and words[0].startswith("--"):
        options += words[:2]
        words = words[2:]
    print(f"{machine()}\n")
    print(f"| {' | '.join(_HEAD)} |\n|{len(_HEAD) * '---|'}")
    missed: list[str] = []
    undocumented = 0
    for name, mesh in _meshes(words):
        with tempfile.TemporaryDirectory() as folder:
            before = _cpu()
            code, said = _run([*mesh, *options, "-o", folder])
            spent = _cpu() - before
            undocumented += code not in (0, 1, 4)
            missed += [f"- {name}: {line}" for line in said]
            path = Path(folder, "plan.json")
            cells = _cells(json.loads(path.read_text())) if path.exists() else {}
        row = {"mesh": name, "exit": str(code), "CPU [s]": f"{spent:.0f}"} | cells
        print(f"| {' | '.join(row.get(key, '') for key in _HEAD)} |", flush=True)
    print("\nWhat is missed:\n\n" + "\n".join(missed or ["nothing"]))
    return int(undocumented > 0)


def _meshes(names: list[str]) -> Iterator[tuple[str, list[str]]]:
    if not names or "face.obj" in names:
        yield "face.obj", ["--mesh", str(ROOT / "face.obj")]
    table = shared_meshes
    for mesh in table.MESHES if table.FOLDER.is_dir() else ():
        if not names or mesh.path.name in names:
            yield mesh.path.name, ["--mesh", str(mesh.path), *mesh.words]


def _run(words: list[str]) -> tuple[int, list[str]]:
    """Return the exit code, and the lines that say what is missed."""
    command = [*RUN, *words, "--quiet", "--no-patterns", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        return done.returncode, done.stderr.strip().splitlines()[-1:]
    document = json.loads(done.stdout)
    check = document["reconstruction"] or {"failures": []}
    return done.returncode, [*document["missed"], *check["failures"]]


def _cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _cells(plan: dict[str, Any]) -> dict[str, str]:
    proofs, target = plan["certificates"], plan["coverage"]["target"]
    cameras = proofs["cameras"]
    routes = cameras.get("routes") or {}
    apart = [row["d"] for row in plan["baselines"]]
    cells = {
        _HEAD[1]: _bounded(len(plan["projectors"]), proofs["projectors"]),
        _HEAD[2]: _bounded(len(plan["cameras"]), cameras),
        "paper's": str(routes.get("paper", "")),
        "smallest baseline [mm]": f"{1e3 * min(apart):.0f}" if apart else "none",
        "lit": _share(target, "lit_m2", "reachable_by_projectors_m2"),
        "measured": _share(target, "measured_m2", "reachable_by_cameras_m2"),
    }
    check = plan["reconstruction"]
    if check is None or check["accuracy_rms_m"] is None:
        return cells
    tables = check["confusion"]
    false = [f for f in check["failures"] if ": claimed" in f]
    return cells | {
        "false claims": str(len(false)),
        "missing": f"{100 * check['predicted_missing']:.2f} %",
        "complete": f"{100 * check['completeness'][1]['fraction']:.2f} %",
        "rms / p95 [mm]": f"{1e3 * check['accuracy_rms_m']:.3f} / "
        f"{1e3 * check['accuracy_p95_m']:.3f}",
        "agreement target": _agreement(tables["target"]["floors"]),
        "surface": _agreement(tables["surface"]["floors"]),
    }


def _bounded(count: int, proof: dict[str, Any]) -> str:
    everywhere = proof["continuous"]
    bound = "-" if everywhere is None else everywhere["lower_bound"]
    needed = proof["needed"]
    more = "" if needed["count"] == count else f", {needed['count']} needed"
    return f"{count} ({needed['lower_bound']}, {bound}){more}"


def _share(areas: dict[str, float], part: str, whole: str) -> str:
    return f"{areas[part] / areas[whole]:.2%}" if areas[whole] else "none"


def _agreement(table: dict[str, float]) -> str:
    alike, without = table["agreement"], table["trivial_agreement"]
    return f"{100 * alike:.1f} % ({100 * without:.1f})"


if __name__ == "__main__":
    sys.exit(main())
