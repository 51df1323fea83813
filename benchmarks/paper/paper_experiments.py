"""The paper's section VII, simulated with ground truth: box and face.

    python -m benchmarks.paper.paper_experiments >
        benchmarks/paper/results/paper_experiments.md

Prints, as the tables of docs/use/experiments.md: errors and completeness of each cloud
for the lens as printed and one that fits, in parallel and diverging light; what becomes
of each ring; a second, shifted sequence; rings labelled by a prior mesh in single
images; ambient light and lens distortion; and the planner's own single viewpoint on the
sample.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from support.reconstruction_rigs import single

from benchmarks.machine import machine
from geometry.files.readers import load_mesh
from planning.experiments.ground_truth import (
    Errors,
    MeasuredErrors,
    judged_labels,
    prior_mesh,
)
from planning.experiments.run import DARK, Outcome, double_density, run_experiment
from planning.experiments.setups import (
    FACE_RADII_M,
    box_experiment,
    face_experiment,
)
from planning.experiments.table import setup_lines
from planning.model.plan import RequirementError
from planning.pipeline import plan_rig
from planning.rig.rig import load_rig
from planning.verify.reconstruction.check.accuracy import measure_accuracy
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.single_shot.single_shot import shoot_rig

_MM = 1e3
MAKERS = (box_experiment, face_experiment)
SAMPLE = Path(__file__).resolve().parents[2] / "face.obj"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table in Markdown."""
    print("| " + " | ".join(head) + " |")
    print("|---" * len(head) + "|")
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print()


def numbers(errors: Errors) -> list[str]:
    """Points, rms, p95 and bias [mm], share of outliers, rms of the rest [mm]."""
    if errors.rms_m is None:
        return ["0", *("",) * 5]
    return [
        str(errors.n),
        f"{_MM * errors.rms_m:.3f}",
        f"{_MM * (errors.p95_m or 0.0):.3f}",
        f"{_MM * (errors.bias_m or 0.0):+.4f}",
        f"{100 * (errors.outliers or 0.0):.2f} %",
        f"{_MM * (errors.rest_m or 0.0):.3f}",
    ]


NUMBERS = ["points", "rms", "p95", "bias", "> 1 mm", "rms of the rest"]
CLOUD = [*NUMBERS, "complete at half a gap", "at one"]


def cloud_row(one: MeasuredErrors) -> list[str]:
    """Return a row of `CLOUD`."""
    return [*numbers(one.errors), *(f"{share:.3f}" for share in one.complete)]


def every_cloud() -> dict[tuple[str, str], Outcome]:
    """Print errors of every cloud; return the outcomes in parallel light."""
    print("## Errors and completeness\n")
    print("Lengths in mm; completeness of what is lit inside the outermost ring and")
    print("seen. `of`: share of the whole surface that this is.\n")
    kept: dict[tuple[str, str], Outcome] = {}
    rows: list[list[str]] = []
    for make in MAKERS:
        for variant in ("printed", "fits"):
            for light in ("parallel", "diverging"):
                outcome = run_experiment(make(light=light, variant=variant), threads=1)
                name = outcome.experiment.name
                what = [name, variant, light, f"{outcome.visible:.3f}"]
                rows += [[*what, one.name, *cloud_row(one)] for one in outcome.clouds]
                if light == "parallel":
                    kept[name, variant] = outcome
    table(["object", "lens", "light", "of", "viewpoints", *CLOUD], rows)
    for outcome in kept.values():
        print("\n".join(f"    {line}" for line in setup_lines(outcome.experiment)))
        print()
    return kept


def rings(outcomes: dict[tuple[str, str], Outcome]) -> None:
    """Print what becomes of each ring of the first projector."""
    print("## Rings of P1, parallel light\n")
    print("Shares of the circumference that landed; P2's mirror them.\n")
    rows: list[list[str]] = []
    for (name, variant), outcome in outcomes.items():
        for ring in outcome.outcomes:
            if ring.projector != "P1":
                continue
            rows.append(
                [
                    name,
                    variant,
                    f"{_MM * outcome.experiment.radii_m[ring.ring]:.1f}",
                    f"{ring.on_object:.3f}",
                    *(f"{share:.3f}" for share in ring.seen.values()),
                    *(f"{share:.3f}" for share in ring.measured.values()),
                    f"{ring.measured_by_any:.3f}",
                    *numbers(outcome.errors_of(ring)),
                ]
            )
    head = ["object", "lens", "radius", "landed", "seen by C1", "C2"]
    head += ["measured by C1", "C2", "by any"]
    table([*head, *NUMBERS], rows)


def second_sequences(outcomes: dict[tuple[str, str], Outcome]) -> None:
    """Print what a second sequence adds."""
    print("## A second sequence, its rings where the first leaves most error\n")
    rows: list[list[str]] = []
    for (name, variant), outcome in outcomes.items():
        both = double_density(outcome, threads=1)
        rows.append([name, variant, "first", *cloud_row(outcome.union)])
        rows.append([name, variant, "both", *cloud_row(both)])
    table(["object", "lens", "sequences", *CLOUD], rows)


def prior_labels() -> None:
    """Print how labels by a prior mesh compare with the truth."""
    print("## Rings told apart by a prior mesh, in single images\n")
    print("P1 with C1, lens that fits, parallel light; the prior is moved back by 5/6")
    print("of the tolerance. Shares of the points of lines that were found.\n")
    rows: list[list[str]] = []
    for name, radii in (
        ("3 (1, 2, 4 inches)", FACE_RADII_M),
        ("31 (4 mm apart)", np.linspace(0.004, 0.124, 31)),
    ):
        experiment = face_experiment(variant="fits", radii_m=radii)
        plan = single(experiment)
        for tolerance in (0.0012, 0.0024, 0.006, 0.012, 0.024):
            prior = prior_mesh(experiment.mesh, tolerance)
            shots = shoot_rig(
                plan, prior, tolerance_m=tolerance, photometry=DARK, seed=0
            )
            count = judged_labels(plan, shots)
            cloud = Cloud.join([Cloud.empty(), *(s.decoded.cloud for s in shots)])
            far = measure_accuracy(cloud, experiment.mesh).distances
            shares = (
                f"{100 * part / count.n:.2f} %"
                for part in (
                    count.right,
                    count.ambiguous,
                    count.off_prior,
                    count.stray,
                    count.wrong,
                )
            )
            off = f"{_MM * tolerance / 1.2:.0f}"
            rows.append(
                [name, off, f"{_MM * tolerance:.1f}", str(count.n), *shares]
                + numbers(Errors.of(far))
            )
    head = ["rings", "prior off by", "tolerance", "line points", "right"]
    head += ["ambiguous", "off the prior", "on no ring", "wrong"]
    table([*head, *NUMBERS], rows)


def nuisances() -> None:
    """Print what ambient light and lens distortion cost."""
    print("## Ambient light, lens distortion\n")
    print("Box, lens that fits, parallel light, all points.\n")
    rows: list[list[str]] = []
    for ambient in (0.0, 0.05, 0.2, 0.5, 1.0, 2.0):
        light = replace(DARK, ambient=ambient)
        outcome = run_experiment(
            box_experiment(variant="fits"), photometry=light, threads=1
        )
        rows.append([f"ambient {ambient:g}", *cloud_row(outcome.union)])
    for k1 in (-0.2, 0.2):
        bent = box_experiment(variant="fits", distortion=k1)
        outcome = run_experiment(bent, threads=1)
        rows.append([f"k1 = {k1:g}, known", *cloud_row(outcome.union)])
    straight = box_experiment(variant="fits")
    for k1 in (-0.02, -0.2):
        bent = box_experiment(variant="fits", distortion=k1)
        found = reconstruct(
            straight.scanner, seed=0, threads=1, photometry=DARK, truth=bent.scanner
        )
        far = measure_accuracy(found.everything, straight.mesh).distances
        rows.append([f"k1 = {k1:g}, taken for 0", *numbers(Errors.of(far)), "", ""])
    table(["what", *CLOUD], rows)


def planned() -> None:
    """Print the planner's own single viewpoint, and what more of each gives."""
    print("## The planner's single viewpoint on the sample\n")
    print("`plan --mesh face.obj --max-projectors 1 --max-cameras 1`, default rig.\n")
    mesh = load_mesh(SAMPLE, unit="mm")
    rows: list[list[str]] = []
    for n in (1, 2):
        try:
            plan = plan_rig(
                mesh, load_rig("default"), max_projectors=n, max_cameras=n, seed=0
            )
        except RequirementError as error:
            plan = error.plan
        target = plan.to_document()["coverage"]["target"]
        check = plan.to_document()["reconstruction"]
        rows.append(
            [
                f"{len(plan.projectors)} and {len(plan.cameras)}",
                f"{100 * target['lit_m2'] / target['area_m2']:.1f} %",
                f"{100 * target['measured_m2'] / target['area_m2']:.1f} %",
                str(check["n_points"]),
                str(check["n_merged"]),
                f"{_MM * check['accuracy_rms_m']:.3f}",
                f"{_MM * check['accuracy_p95_m']:.3f}",
                f"{_MM * check['accuracy_bias_m']:+.4f}",
            ]
        )
    head = ["projectors, cameras", "target lit", "measured", "points", "merged"]
    table([*head, "rms", "p95", "bias"], rows)


def main() -> None:
    """Print every table."""
    print("# Section VII of the paper, simulated\n")
    print("Command: `python -m benchmarks.paper.paper_experiments`\n")
    print(f"{machine()}\n")
    outcomes = every_cloud()
    rings(outcomes)
    second_sequences(outcomes)
    prior_labels()
    nuisances()
    planned()


if __name__ == "__main__":
    main()
