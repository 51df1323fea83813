"""Parts of a batch here and on a dask cluster: the same plans; a worker is killed.

Usage: python -m benchmarks.plans.batch [N]   (ringrig[cluster] installed, from a
    checkout)

N parts (12) are small variants of the sample head, planned with few candidates and
coded pixels. First one after the other here; then on a LocalCluster of two workers;
then again, and one worker is killed when two parts have ended; then the batch itself is
killed when three have, and begun again. Plans are compared byte for byte apart from
`created`, `command`, `timings_s` and `cost`.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from geometry.shapes.sample_head.head_shape import HeadShape
from planning.cli.batch.ledger import read_rows
from planning.cli.other_commands import write_sample
from planning.model.plan import RigPlan
from planning.verify.verification import verify_plan

_PARTS = 12
_RIG = """
base = "default"
name = "few candidates"
[placement]
n_candidate_projectors = 40
n_candidate_cameras = 40
n_reference_projectors = 600
n_reference_cameras = 400
"""
_ASKED = (
    *("--max-projectors", "6", "--pattern", "dense", "--cameras-by", "cover"),
    *("--no-check", "--no-report", "--no-patterns", "--no-cache"),
)
_VOLATILE = ("created", "command", "timings_s", "cost")
_PLAN = "from planning.cli.main import main; main()"


def main(words: list[str]) -> int:
    """Print the table; return 1 if a plan differs or is lost."""
    from distributed import LocalCluster

    n = int(words[0]) if words else _PARTS
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        (place / "few.toml").write_text(_RIG)
        (place / "parts").mkdir()
        for k in range(n):
            shape = HeadShape.of_family(0, k)
            write_sample(place / "parts" / f"{k + 1:02}.obj", shape=shape, n_faces=1500)
        print("| run | seconds | whole plans | same as one by one | exit |")
        print("|---|---|---|---|---|")
        well = _row("one by one", place, "serial", n, ("--jobs", "1", "--threads", "1"))
        with LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as cluster:
            there = ("--scheduler", cluster.scheduler_address)
            well &= _row("2 dask workers", place, "dask", n, there)

            def worker_dies(out: Path, batch: subprocess.Popen[str]) -> None:
                _wait(out, 2, batch)
                with cluster.get_client() as client:
                    pids = list(client.run(os.getpid).values())
                os.kill(pids[0], signal.SIGKILL)

            what = "2 dask workers, one killed"
            well &= _row(what, place, "killed", n, there, worker_dies)

        def batch_dies(out: Path, batch: subprocess.Popen[str]) -> None:
            _wait(out, 3, batch)
            batch.kill()

        here = ("--jobs", "2", "--threads", "1")
        _row("batch killed", place, "again", n, here, batch_dies)
        well &= _row("begun again", place, "again", n, here)
    return int(not well)


def _row(
    what: str,
    place: Path,
    folder: str,
    n: int,
    words: tuple[str, ...],
    disturb: Callable[[Path, subprocess.Popen[str]], None] = lambda out, batch: None,
) -> bool:
    """Run a batch; tell how many plans are whole, and the same as the first run's."""
    out, begin = place / folder, time.monotonic()
    command = ["batch", str(place / "parts"), "-o", str(out), *_ASKED, *words]
    command += ["--rig", str(place / "few.toml"), "--quiet"]
    batch = subprocess.Popen(
        [sys.executable, "-c", _PLAN, *command],
        stdout=subprocess.DEVNULL,
        text=True,
    )
    disturb(out, batch)
    code = batch.wait()
    seconds = time.monotonic() - begin
    whole = same = 0
    for row in read_rows(out).values():
        plan = RigPlan.load(out / row.folder / "plan.json")
        whole += not verify_plan(plan, check_pixels=False).failures
        same += _content(out / row.folder) == _content(place / "serial" / row.folder)
    print(f"| {what} | {seconds:.0f} | {whole} of {n} | {same} | {code} |", flush=True)
    return whole == same == n


def _wait(out: Path, count: int, batch: subprocess.Popen[str]) -> None:
    """Wait until so many parts have ended."""
    while batch.poll() is None and len(read_rows(out)) < count:
        time.sleep(0.2)


def _content(folder: Path) -> tuple[object, bytes]:
    document = json.loads((folder / "plan.json").read_text())
    kept = {key: value for key, value in document.items() if key not in _VOLATILE}
    return kept, (folder / "surface.npz").read_bytes()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
