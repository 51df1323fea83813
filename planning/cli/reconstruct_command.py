"""`plan reconstruct`: a cloud from rendered or captured images, held against the plan.

Exit: 0 reconstructed within the limits of the check, 1 a limit is missed or the cloud
is smaller than asked, 2 unwritable, 3 a bad plan, calibration or folder of captures.
"""

import json
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

from geometry.mesh.sampling import SurfaceSamples
from planning.model.errors import CapturesError
from planning.model.plan import RigPlan
from planning.model.progress import Report
from planning.verify.audit.coverage.prediction import predict_measured
from planning.verify.reconstruction.captures.calibration_file import calibrated
from planning.verify.reconstruction.captures.captured import (
    reconstruct_captured,
    reconstruct_rendered,
)
from planning.verify.reconstruction.captures.captures import CaptureFolder
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.cloud_file import (
    CloudFile,
    LengthUnit,
    remove_cloud,
)
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.reconstruction.single_shot.single_shot import (
    reconstruct_single_shot,
)

from .console import cores, reporter
from .reconstruct_summary import summary
from .writable import writable

CLOUD = "cloud.ply"
# How near the object is taken to lie to the mesh that labels single images.
_PRIOR_MM = 1.0


def reconstruct_command(options: Mapping[str, Any]) -> int:
    """Reconstruct, write the cloud, print the result; return the exit code."""
    path = Path(options["plan_file"])
    report = reporter(quiet=options["quiet"])
    plan = RigPlan.load(path)
    scanner = Scanner.of(plan)
    folder = Path(options["output"] or path.parent)
    if options["captures"] is not None:
        CaptureFolder(options["captures"], scanner).require()
    with ExitStack() as kept:
        for needed in (folder, options["save_captures"]):
            if needed is not None:
                kept.enter_context(writable(needed))
        try:
            found = _reconstruct(plan, scanner, options, report)
        except CapturesError:
            remove_cloud(folder / CLOUD)
            raise
        file = _save(plan, found, folder / CLOUD)
    _print(plan, found, file, folder / CLOUD, as_json=options["as_json"])
    return 0 if found.passed else 1


def _reconstruct(
    plan: RigPlan,
    scanner: Scanner,
    options: Mapping[str, Any],
    report: Report | None,
) -> Reconstruction:
    seed = options["seed"]
    seed = plan.document.seed if seed is None else seed
    threads = options["threads"] or cores()
    mounted = options["calibration"]
    mounted = None if mounted is None else calibrated(scanner, mounted)
    _say(report, "predicting what the plan's poses measure")
    expected = _expected(plan, seed, threads)

    def progress(done: int, total: int) -> None:
        _say(report, f"pair {done} of {total}")

    if options["single_shot"]:
        return reconstruct_single_shot(
            scanner,
            expected,
            tolerance_m=1e-3 * (options["prior_mm"] or _PRIOR_MM),
            seed=seed,
            progress=progress,
        )
    if options["captures"] is not None:
        folder = CaptureFolder(options["captures"], scanner)
        return reconstruct_captured(
            folder, expected, believed=mounted, threads=threads, progress=progress
        )
    place = options["save_captures"]
    return reconstruct_rendered(
        scanner,
        expected,
        seed=seed,
        threads=threads,
        truth=mounted,
        believed=mounted,
        save=None if place is None else CaptureFolder(place, scanner),
        progress=progress,
    )


def _expected(plan: RigPlan, seed: int, threads: int) -> Expected:
    found = predict_measured(plan, seed=seed, threads=threads)
    inside = found.samples
    samples = SurfaceSamples(
        inside.points, inside.normals, inside.faces, float(inside.weights[0])
    )
    return Expected(samples, found.measured, found.by_pair)


def _save(plan: RigPlan, found: Reconstruction, path: Path) -> CloudFile | None:
    """Write the cloud; without points none, and none of an earlier run stays."""
    if not found.n_merged:
        remove_cloud(path)
        return None
    file = CloudFile.of(found.merged, LengthUnit.of(plan.document.meshes[0]))
    file.save(path)
    return file


def _print(
    plan: RigPlan,
    found: Reconstruction,
    file: CloudFile | None,
    path: Path,
    *,
    as_json: bool,
) -> None:
    if not as_json:
        click.echo(summary(plan, found, file, path))
        return
    document = found.to_document() | {
        "pairs": [vars(pair) for pair in found.pairs],
        "cloud": None if file is None else str(path),
        "unit": None if file is None else file.unit.name,
        "colour_range": None if file is None else list(file.limits),
    }
    click.echo(json.dumps(document, indent=1, allow_nan=False))


def _say(report: Report | None, line: str) -> None:
    if report is not None:
        report(line)
