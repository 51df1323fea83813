"""`plan reconstruct --experiment box|face`: section VII of the paper, simulated.

Writes figures, the merged cloud and every number; exit 0, for nothing is asked of the
experiments but to be seen as they are.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
from PIL import Image

from planning.experiments.ground_truth import MeasuredErrors
from planning.experiments.paper_figures import (
    draw_camera_images,
    draw_densities,
    draw_errors,
    draw_redundancy,
    draw_viewpoints,
)
from planning.experiments.point_panels import PanelStage
from planning.experiments.run import DARK, Outcome, double_density, run_experiment
from planning.experiments.setups import Experiment, paper_experiment
from planning.experiments.table import outcome_document, outcome_lines
from planning.model.files import write_atomically
from planning.report.drawing.picture_view import save_picture
from planning.verify.reconstruction.check.cloud_file import LengthUnit
from planning.verify.reconstruction.render.countdown import countdown

from .checks.reconstruct_command import CLOUD, save_cloud
from .console import print_json, reporter, writable

_MM = LengthUnit("mm", 1e-3)
# How near to a prior the object is known to lie, where the user doesn't say.
_PRIOR_MM = 6.0


def experiment_command(options: Mapping[str, Any]) -> int:
    """Run an experiment, write its folder, print its table; return the exit code."""
    experiment = experiment_of(options)
    folder = Path(options["output"] or f"{experiment.name}-experiment")
    photometry = replace(DARK, ambient=options["ambient"] or 0.0)
    seed, threads = options["seed"] or 0, options["threads"] or 2
    report = reporter(quiet=options["quiet"])
    near_mm = options["prior_mm"] or _PRIOR_MM

    with writable(folder):
        outcome = run_experiment(
            experiment,
            photometry=photometry,
            seed=seed,
            threads=threads,
            tolerance_m=1e-3 * near_mm if options["single_shot"] else None,
            progress=countdown(
                report, n_cameras=len(experiment.scanner.cameras), threads=threads
            ),
        )
        both = None
        if options["second_sequence"]:
            report("second sequence")
            both = double_density(outcome, seed=seed, threads=threads)
        report("drawing")
        document, pictures = outcome_document(outcome, both), _pictures(outcome, both)
        files = [folder / name for name in (*pictures, CLOUD, "result.json")]
        for path, picture in zip(files, pictures.values(), strict=False):
            save_picture(picture, path)
        if save_cloud(outcome.reconstruction, _MM, files[-2]) is None:
            del files[-2]
        text = json.dumps(document, indent=1, allow_nan=False) + "\n"
        write_atomically(files[-1], lambda file: file.write(text.encode()))
    names = [str(path) for path in files]
    if options["as_json"]:
        print_json(document | {"files": names})
        return 0
    click.echo("\n".join([*outcome_lines(outcome, both), ""]))
    for name in names:
        click.echo(f"wrote {name}")
    return 0


def experiment_of(options: Mapping[str, Any]) -> Experiment:
    """Return the experiment that was asked for; the paper's own where nothing was."""
    return paper_experiment(
        options["experiment"],
        light=options["light"] or "parallel",
        variant=options["variant"] or "printed",
        distortion=options["distortion"] or 0.0,
    )


def _pictures(outcome: Outcome, both: MeasuredErrors | None) -> dict[str, Image.Image]:
    stage = PanelStage(outcome.experiment.mesh)
    pictures = {
        "cameras.png": draw_camera_images(outcome),
        "viewpoints.png": draw_viewpoints(outcome, stage),
        "redundancy.png": draw_redundancy(outcome, stage),
        "errors.png": draw_errors(outcome, stage),
    }
    if both is not None:
        pictures["densities.png"] = draw_densities(outcome.union, both, stage)
    return pictures
