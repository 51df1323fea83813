"""Runs an experiment: one viewpoint, several, merged, and held to the truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.mesh.sampling import SurfaceSamples, sample_surface
from planning.verify.reconstruction.arrays import Mask
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.reconstruct import conclude, reconstruct
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import Progress
from planning.verify.reconstruction.single_shot.single_shot import (
    decoded_pairs,
    shoot_rig,
)

from .one_image import LabelCount, Prior, judged_labels
from .point_errors import MeasuredErrors, measured
from .ring_outcomes import RingOutcome, lit_and_seen, ring_outcomes
from .setups import Experiment

# The paper assumes that there is no light but the projectors'.
DARK = Photometry(ambient=0.0)
_SAMPLES = 20_000


@dataclass(frozen=True, eq=False)
class Outcome:
    """What an experiment gave, held to the truth.

    Attributes:
        experiment: What was run.
        photometry: Light and sensor.
        reconstruction: From rendered images, all pairs of devices.
        samples: Of the surface that could be measured.
        visible: Share of the whole surface that these are.
        single: The first projector and the first camera alone.
        viewpoints: Each camera alone, under all projectors.
        union: All points.
        merged: Those that stay where redundancy is removed.
        outcomes: What became of each ring.
        labels: Of single images; None: rings were told apart by a sequence.
    """

    experiment: Experiment
    photometry: Photometry
    reconstruction: Reconstruction
    samples: SurfaceSamples
    visible: float
    single: MeasuredErrors
    viewpoints: tuple[MeasuredErrors, ...]
    union: MeasuredErrors
    merged: MeasuredErrors
    outcomes: tuple[RingOutcome, ...]
    labels: LabelCount | None

    @property
    def clouds(self) -> tuple[MeasuredErrors, ...]:
        """Every cloud that was held to the truth, from few devices to all."""
        return (self.single, *self.viewpoints, self.union, self.merged)

    @property
    def stays(self) -> Mask:
        """Which of all points stay where redundancy is removed, shape (n,)."""
        return np.isin(_keys(self.union.cloud), _keys(self.merged.cloud))


def run_experiment(
    experiment: Experiment,
    *,
    photometry: Photometry = DARK,
    seed: int = 0,
    threads: int = 2,
    prior: Prior | None = None,
    progress: Progress | None = None,
) -> Outcome:
    """Render, decode, triangulate and merge an experiment, and hold it to the truth.

    Args:
        experiment: What to run.
        photometry: Light and sensor; no ambient light by default, as in the paper.
        seed: Of the pixel noise and the samples.
        threads: Worker threads; the result doesn't depend on them.
        prior: What is known of the object: rings are then labelled by it, in a single
            image of each camera under each projector; None: by a coded sequence.
        progress: Called with the pairs done and their total.
    """
    scanner, labels = experiment.scanner, None
    if prior is None:
        found = reconstruct(
            scanner,
            seed=seed,
            threads=threads,
            photometry=photometry,
            progress=progress,
        )
    else:
        shots = shoot_rig(
            scanner,
            prior.mesh,
            tolerance_m=prior.tolerance_m,
            photometry=photometry,
            seed=seed,
            progress=progress,
        )
        pairs = decoded_pairs(shots)
        found = conclude(scanner, pairs, seed=seed, photometry=photometry)
        labels = judged_labels(scanner, shots)
    samples, visible = observable(experiment, seed)
    everything, merged = found.everything, found.merged.cloud
    names = [camera.id for camera in scanner.cameras]
    first = f"{scanner.projectors[0].id} with {names[0]}"
    by_one = (everything.camera == 0) & (everything.projector == 0)
    gap_m = experiment.gap_m
    mesh = experiment.mesh
    viewpoints = tuple(
        measured(
            f"{name}, all projectors",
            everything.take(everything.camera == c),
            mesh,
            samples,
            gap_m,
        )
        for c, name in enumerate(names)
    )
    return Outcome(
        experiment,
        photometry,
        found,
        samples,
        visible,
        measured(first, everything.take(by_one), mesh, samples, gap_m),
        viewpoints,
        measured("all points", everything, mesh, samples, gap_m),
        measured("merged", merged, mesh, samples, gap_m),
        ring_outcomes(scanner, everything),
        labels,
    )


def observable(experiment: Experiment, seed: int) -> tuple[SurfaceSamples, float]:
    """Return samples of what could be measured, and their share of the surface."""
    samples = sample_surface(experiment.mesh, _SAMPLES, seed=seed)
    able = lit_and_seen(experiment.scanner, samples.points, samples.normals)
    return samples.take(able), float(np.mean(able))


def _keys(cloud: Cloud) -> NDArray[np.void]:
    """What tells a point from every other, as one value that compares exactly."""
    devices = np.column_stack([cloud.projector, cloud.camera, cloud.ring])
    rows = np.ascontiguousarray(np.column_stack([devices, cloud.pixels]))
    return rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).ravel()
