"""`plan reconstruct`: a cloud from rendered or captured images, held against the plan.

Exit: 0 reconstructed within the limits of the check, 1 a limit is missed or the cloud
is smaller than asked, 2 unwritable, 3 a bad plan, calibration or folder of captures.
"""

import json
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from geometry.parallel import n_threads
from planning.cli.console import print_json, reporter, writable
from planning.cli.lines.deviation_table import deviation_lines
from planning.model.errors import CapturesError
from planning.model.files import write_atomically
from planning.model.plan import RigPlan
from planning.model.progress import Report
from planning.model.words import count_words, percent
from planning.report.summary.check_lines import error_words
from planning.verify.audit.coverage.prediction import predict_measured
from planning.verify.reconstruction.captures.calibration_file import calibrated
from planning.verify.reconstruction.captures.captured import (
    reconstruct_captured,
    reconstruct_rendered,
)
from planning.verify.reconstruction.captures.captures import CaptureFolder
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.cloud_file import (
    CloudFile,
    LengthUnit,
    remove_cloud,
)
from planning.verify.reconstruction.check.deviation import (
    Deviation,
    measure_deviation,
)
from planning.verify.reconstruction.check.result import PairCount, Reconstruction
from planning.verify.reconstruction.pattern_files import check_patterns
from planning.verify.reconstruction.reconstruct import (
    BothSequences,
    reconstruct_twice,
)
from planning.verify.reconstruction.render.countdown import countdown
from planning.verify.reconstruction.render.photometry import assumed_light
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.reconstruction.single_shot.single_shot import (
    reconstruct_single_shot,
)
from planning.verify.verification import bare

CLOUD, DEVIATION, REFINED = "cloud.ply", "deviation.ply", "refined.json"
# How near the object is taken to lie to the mesh that labels single images.
_PRIOR_MM = 1.0


def reconstruct_command(options: Mapping[str, Any]) -> int:
    """Reconstruct, write the cloud, print the result; return the exit code."""
    path = Path(options["plan_file"])
    report = reporter(quiet=options["quiet"])
    plan = RigPlan.load(path)
    plan.require_projectors("`plan reconstruct`")
    scanner = Scanner.of(plan)
    folder = Path(options["output"] or path.parent)
    if options["captures"] is not None:
        CaptureFolder(options["captures"], scanner).require()
        for place in (path.parent, options["captures"]):
            check_patterns(scanner, place)
    with ExitStack() as folders:
        for place in (folder, options["save_captures"]):
            if place is not None:
                folders.enter_context(writable(place))
        folders.enter_context(_images_told(options["save_captures"]))
        try:
            result, twice = _reconstruct(plan, scanner, options, report)
        except CapturesError:
            for name in (CLOUD, DEVIATION):
                remove_cloud(folder / name)
            raise
        unit = LengthUnit.of(plan.document.meshes[0])
        file = save_cloud(result, unit, folder / CLOUD, plan.digest)
        written = {CLOUD: file} if file else {}
        deviation = _deviation(result, scanner, options)
        if deviation is None:
            remove_cloud(folder / DEVIATION)
        else:
            written[DEVIATION] = CloudFile.of_deviation(
                result.merged, deviation, unit, plan.digest
            )
            written[DEVIATION].save(folder / DEVIATION)
        if result.refined is not None:
            rig = json.dumps(result.refined.calibration_file(), indent=1).encode()
            write_atomically(folder / REFINED, lambda file: file.write(rig))
    files = {folder / name: file for name, file in written.items()}
    if options["as_json"]:
        print_json(_document(result, deviation, files) | _sequences(twice))
    else:
        lines = [] if twice is None else _sequence_lines(plan, twice)
        if result.refined is not None:
            lines += [
                *result.refined.lines(),
                f"          written to {folder / REFINED}, as --calibration reads it",
            ]
        click.echo("\n".join([*lines, _summary(plan, result, deviation, files)]))
    return 0 if result.passed else 1


@contextmanager
def _images_told(folder: Path | None) -> Generator[None]:
    """Let an interrupted run say that images are left of it."""
    try:
        yield
    except KeyboardInterrupt:
        if folder is None or not any(folder.iterdir()):
            raise
        told = f"interrupted; {folder} has the images that were rendered before"
        raise KeyboardInterrupt(told) from None


def _deviation(
    result: Reconstruction, scanner: Scanner, options: Mapping[str, Any]
) -> Deviation | None:
    """Hold captured points against the mesh; simulated ones if it is asked for."""
    align, limits = options["align"], options["deviation_limits"]
    wanted = options["captures"] is not None or align or limits
    if not wanted or not result.n_merged:
        return None
    return measure_deviation(result.merged, scanner, align or "best-fit", limits)


def _reconstruct(
    plan: RigPlan,
    scanner: Scanner,
    options: Mapping[str, Any],
    report: Report,
) -> tuple[Reconstruction, BothSequences | None]:
    """Return what was measured, and both sequences if a second one was wanted."""
    seed = options["seed"]
    seed = plan.document.seed if seed is None else seed
    threads = options["threads"] or n_threads()
    mounted = options["calibration"]
    mounted = None if mounted is None else calibrated(scanner, mounted)
    report("predicting what the plan's poses measure")
    predicted = predict_measured(plan, seed=seed, threads=threads)
    expected = Expected(bare(predicted.samples), predicted.measured, predicted.by_pair)
    progress = countdown(report, n_cameras=len(scanner.cameras), threads=threads)
    light = assumed_light(scanner)
    if options["ambient"] is not None:
        light = replace(light, ambient=options["ambient"])
    if options["single_shot"]:
        result = reconstruct_single_shot(
            scanner,
            expected,
            tolerance_m=1e-3 * (options["prior_mm"] or _PRIOR_MM),
            seed=seed,
            photometry=light,
            progress=progress,
        )
        return result, None
    if options["captures"] is not None:
        folder = CaptureFolder(options["captures"], scanner)
        result = reconstruct_captured(
            folder,
            expected,
            believed=mounted,
            mend=options["refine"],
            threads=threads,
            progress=progress,
        )
        return result, None
    if options["second_sequence"]:
        twice = reconstruct_twice(
            scanner,
            expected=expected,
            seed=seed,
            threads=threads,
            mounted=mounted,
            photometry=light,
            progress=progress,
        )
        return twice.both, twice
    place, truth = options["save_captures"], options["truth"]
    result = reconstruct_rendered(
        scanner,
        expected,
        seed=seed,
        threads=threads,
        truth=mounted if truth is None else Scanner.of(RigPlan.load(truth)),
        mend=options["refine"],
        believed=mounted,
        photometry=light,
        save=None if place is None else CaptureFolder(place, scanner),
        progress=progress,
    )
    return result, None


def _sequences(twice: BothSequences | None) -> dict[str, Any]:
    """Where a second sequence's rings lay, and what the first gave alone."""
    if twice is None:
        return {}
    rings = {one.id: one.pattern.radii.tolist() for one in twice.second.projectors}
    return {"first_sequence": twice.first.to_document(), "second_ring_radii": rings}


def _sequence_lines(plan: RigPlan, twice: BothSequences) -> list[str]:
    rings = ", ".join(
        f"{one.id} {len(one.pattern.radii)}" for one in twice.second.projectors
    )
    return [
        "the first sequence alone:",
        *_figures(plan, twice.first),
        f"with a second sequence of as many rings ({rings}), placed where the first "
        f"leaves most error:",
    ]


def save_cloud(
    result: Reconstruction, unit: LengthUnit, path: Path, digest: str = ""
) -> CloudFile | None:
    """Write the cloud; without points none, and none of an earlier run stays."""
    if not result.n_merged:
        remove_cloud(path)
        return None
    file = CloudFile.of(result.merged, unit, digest)
    file.save(path)
    return file


def _document(
    result: Reconstruction, deviation: Deviation | None, files: dict[Path, CloudFile]
) -> dict[str, Any]:
    cloud = next(iter(files.items()), None)
    document = result.to_document() | {
        "remarks": list(result.remarks),
        "pairs": [vars(pair) for pair in result.pairs],
        "cloud": None if cloud is None else str(cloud[0]),
        "unit": None if cloud is None else cloud[1].unit.name,
        "colour_range": None if cloud is None else list(cloud[1].limits),
    }
    if deviation is not None:
        document["deviation"] = deviation.to_document()
    if result.refined is not None:
        document["refined"] = result.refined.to_document()
    return document


def _summary(
    plan: RigPlan,
    result: Reconstruction,
    deviation: Deviation | None,
    files: dict[Path, CloudFile],
) -> str:
    """Return the result in a few lines; the verdict is the last."""
    lines = [_pair_line(pair) for pair in result.pairs]
    lines += _figures(plan, result)
    if not files:
        lines.append("cloud     none was written")
    for path, file in files.items():
        lines += [
            f"{path.stem:<10}{path}: {len(file.rows)} points, positions in "
            f"{file.unit.name}",
            f"colours   {file.scale.column} along the normal: {file.legend}",
        ]
    if deviation is not None:
        lines += deviation_lines(deviation)
    lines += [f"note: {sentence}" for sentence in result.remarks]
    lines += [f"not met: {sentence}" for sentence in result.failures]
    missed = count_words(len(result.failures), "failure")
    lines.append(
        "reconstructed: every limit of the check is kept"
        if result.passed
        else f"NOT reconstructed as planned: {missed}"
    )
    return "\n".join(lines)


def _pair_line(pair: PairCount) -> str:
    left_out = sum(pair.rejected.values())
    return (
        f"{pair.projector} with {pair.camera}: {pair.n_points} points of "
        f"{pair.n_edges} edges, {left_out} left out, {pair.lit_pixels} pixels lit"
    )


def _figures(plan: RigPlan, result: Reconstruction) -> list[str]:
    limits = plan.requirements.check
    if result.accuracy is None:
        return []
    accuracy, complete = result.accuracy, result.completeness
    near = ", ".join(
        f"{share:.1%} within {1e3 * tau:.1f} mm"
        for tau, share in zip(complete.thresholds_m, complete.fractions, strict=True)
    )
    missing = complete.predicted_missing
    lines = [
        f"merged    {result.merging}",
        "accuracy against the mesh: "
        f"{error_words(accuracy.rms_m, accuracy.p95_m, accuracy.bias_m, limits)}, "
        f"max {1e3 * accuracy.max_m:.3f}",
        f"completeness of the target predicted measured: {near}",
    ]
    if missing is not None:
        most = limits.max_predicted_missing
        gone = percent(missing, decimals=2, most=most)
        lines[-1] += f"; {gone} missing ({100 * most:g} %)"
    return lines
