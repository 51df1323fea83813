"""Each device of a plan with `--survive 1` is taken away, and the rest is checked.

A mesh is planned, by default the README's `face.obj`, and what the plan costs beside
the one without is printed. Then for each device the others, read from the written plan
as `plan evaluate --poses plan.json:NAMES` reads them, are a rig that stands: its areas
are claimed anew with its own denominators, its plan is written, read and verified as
`plan verify` does it, by the audit and from rendered pixels. Printed are what the first
plan said is left of what can be lit and measured, what the evaluation says, the check,
and the verdict: no requirement missed, no claim false.

    PYTHONPATH=. python -m benchmarks.plans.survival [--views K] [MESH]
"""

import sys
import tempfile
import time
from pathlib import Path

from geometry.parallel import n_threads
from planning import load_mesh, load_rig, plan_rig
from planning.model.document.survival_records import LossRecord
from planning.model.plan import RigPlan
from planning.report.summary.shortfall import shortfalls
from planning.report.tolerance.survival_lines import (
    counted_words,
    lit_share,
    measured_share,
    survival_cost,
)
from planning.rig.mounted import read_mounted
from planning.verify.verification import verify_plan

ROOT = Path(__file__).parents[2]
# Projectors at most, which no sample needs.
_MANY = 8


def main(words: list[str]) -> None:
    """Print the table, a device as soon as it was taken away."""
    views = int(words[words.index("--views") + 1]) if "--views" in words else None
    rest = words[2:] if views else words
    mesh = load_mesh(Path(rest[0]) if rest else ROOT / "face.obj")
    rig, begin = load_rig("default"), time.monotonic()
    plan = plan_rig(
        mesh, rig, max_projectors=_MANY, survive=1, views=views, on_miss="return"
    )
    seconds = time.monotonic() - begin
    record, asked = plan.document.survival, plan.requirements.survival
    assert record is not None
    assert asked is not None
    print(
        f"{rest[0] if rest else 'face.obj'}: {survival_cost(record, asked)}; "
        f"{'; '.join(counted_words(plan))}; planned and checked in {seconds:.0f} s "
        f"with {n_threads()} threads\n"
    )
    print(
        "| lost | left, as the plan says: lit, measured | the rest evaluated: lit, "
        "measured | check: rms, p95 [mm], missing | false claims | verdict |"
    )
    print("|---" * 6 + "|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.json"
        plan.save(path)
        print(row(record.losses[0], plan), flush=True)
        for loss in record.losses[1:]:
            others = [
                device.id
                for device in (*plan.projectors, *plan.cameras)
                if device.id != loss.lost
            ]
            left = plan_rig(
                mesh,
                rig,
                max_projectors=None,
                views=views,
                fixed=read_mounted(path, rig, others),
                check=True,
                on_miss="return",
            )
            written = Path(folder) / f"without-{loss.lost}" / "plan.json"
            left.save(written)
            print(row(loss, RigPlan.load(written)), flush=True)


def row(loss: LossRecord, plan: RigPlan) -> str:
    """Return a line of the table: what a loss leaves, verified."""
    verified = verify_plan(plan, threads=n_threads())
    check, areas = plan.document.reconstruction, plan.coverage.target
    lit = areas.lit_m2 / areas.reachable_by_projectors_m2
    measured = areas.measured_m2 / areas.reachable_by_cameras_m2
    fold = plan.document.survival
    if fold is not None:
        # K-fold, where that is asked for.
        measured = measured_share(fold.losses[0])
    assert check is not None
    missed = (*shortfalls(plan), *verified.unmet)
    figures = (
        f"{1e3 * (check.accuracy_rms_m or 0.0):.3f}, "
        f"{1e3 * (check.accuracy_p95_m or 0.0):.3f}, "
        f"{100 * (check.predicted_missing or 0.0):.2f} %"
    )
    verdict = "passes" if check.passed and verified.passed and not missed else "FAILS"
    return (
        f"| {loss.lost or 'none'} | {100 * lit_share(loss):.1f} %, "
        f"{100 * measured_share(loss):.1f} % | {100 * lit:.1f} %, "
        f"{100 * measured:.1f} % | {figures} | {len(verified.failures)} | {verdict}"
        f"{''.join(f'; {one}' for one in missed)} |"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
