"""Runs an experiment: one viewpoint, several, merged, and held to the truth."""

from dataclasses import dataclass

import numpy as np

from geometry.mesh.sampling import SurfaceSamples, sample_surface
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.density.second_sequence import (
    both_sequences,
    numbered,
    second_sequence,
)
from planning.verify.reconstruction.reconstruct import conclude, reconstruct
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import Progress
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.reconstruction.single_shot.single_shot import shoot_rig

from .ground_truth import (
    Errors,
    LabelCount,
    MeasuredErrors,
    judged_labels,
    measured,
    prior_mesh,
)
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
        clouds: Held to the truth: of the first projector and the first camera alone; of
            each camera, under all projectors; all points; those that stay merged.
        outcomes: What became of each ring.
        labels: Of single images; None: rings were told apart by a sequence.
    """

    experiment: Experiment
    photometry: Photometry
    reconstruction: Reconstruction
    samples: SurfaceSamples
    visible: float
    clouds: tuple[MeasuredErrors, ...]
    outcomes: tuple[RingOutcome, ...]
    labels: LabelCount | None

    @property
    def union(self) -> MeasuredErrors:
        """All points."""
        return self.clouds[-2]

    @property
    def merged(self) -> MeasuredErrors:
        """Those that stay where redundancy is removed."""
        return self.clouds[-1]

    def errors_of(self, ring: RingOutcome) -> Errors:
        """Return the errors of all points of a ring."""
        cloud = self.union.cloud
        ids = [projector.id for projector in self.experiment.scanner.projectors]
        of_ring = cloud.projector == ids.index(ring.projector)
        return Errors.of(self.union.distances[of_ring & (cloud.ring == ring.ring)])


def run_experiment(
    experiment: Experiment,
    *,
    photometry: Photometry = DARK,
    seed: int = 0,
    threads: int | None = None,
    tolerance_m: float | None = None,
    progress: Progress | None = None,
) -> Outcome:
    """Render, decode, triangulate and merge an experiment, and hold it to the truth.

    With a tolerance [m], rings are labelled in a single image of each camera under each
    projector, by a mesh that is off by no more; without one, by a coded sequence.
    """
    scanner, labels = experiment.scanner, None
    if tolerance_m is None:
        result = reconstruct(
            scanner,
            seed=seed,
            threads=threads,
            photometry=photometry,
            progress=progress,
        )
    else:
        shots = shoot_rig(
            scanner,
            prior_mesh(experiment.mesh, tolerance_m),
            tolerance_m=tolerance_m,
            photometry=photometry,
            seed=seed,
            progress=progress,
        )
        pairs = [(shot.index, shot.decoded) for shot in shots]
        result = conclude(scanner, pairs, seed=seed, photometry=photometry)
        labels = judged_labels(scanner, shots)
    samples = sample_surface(experiment.mesh, _SAMPLES, seed=seed)
    able = lit_and_seen(scanner, samples.points, samples.normals)
    samples = samples.take(able)
    everything = result.everything

    first = f"{scanner.projectors[0].id} with {scanner.cameras[0].id}"
    by_one = (everything.camera == 0) & (everything.projector == 0)
    clouds = {first: everything.take(by_one)}
    for c, camera in enumerate(scanner.cameras):
        clouds[f"{camera.id}, all projectors"] = everything.take(everything.camera == c)
    clouds |= {"all points": everything, "merged": result.merged.cloud}
    return Outcome(
        experiment,
        photometry,
        result,
        samples,
        float(np.mean(able)),
        tuple(
            measured(name, cloud, experiment.mesh, samples, experiment.gap_m)
            for name, cloud in clouds.items()
        ),
        ring_outcomes(scanner, everything),
        labels,
    )


def double_density(
    outcome: Outcome,
    second: Scanner | None = None,
    *,
    seed: int = 0,
    threads: int | None = None,
) -> MeasuredErrors:
    """Measure an experiment's object again, with rings between those of before.

    The paper's future work: "sampling density determination given the density of
    previous light sources". Finer rings in one sequence would come too near each other
    in the images; a second sequence doubles the density and keeps their distance.
    Returns all points of both; rings are numbered outwards through both sequences. The
    seed is the first sequence's; the second's noise is another. Without `second`, the
    rig with the rings to measure with, these follow from the first points.
    """
    experiment, first = outcome.experiment, outcome.union.cloud
    rig = second or second_sequence(experiment.scanner, first)
    again = reconstruct(
        rig, seed=seed + 1, threads=threads, photometry=outcome.photometry
    )
    _, (before, after) = both_sequences(experiment.scanner, rig)
    cloud = Cloud.join([numbered(first, before), numbered(again.everything, after)])
    return measured(
        "both sequences", cloud, experiment.mesh, outcome.samples, experiment.gap_m
    )
