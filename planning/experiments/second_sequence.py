"""A second sequence of rings, midway between those of the first.

The paper's future work: "sampling density determination given the density of previous
light sources". Finer rings in one sequence would come too near each other in the
images; a second sequence doubles the density and keeps their distance.
"""

from dataclasses import dataclass, replace

import numpy as np

from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.scanner import Scanner

from .point_errors import MeasuredErrors, measured
from .run import Outcome, observable


@dataclass(frozen=True, eq=False)
class Doubled:
    """What a second sequence adds.

    Attributes:
        first: All points of the first sequence.
        both: All points of both; rings are numbered outwards through both.
    """

    first: MeasuredErrors
    both: MeasuredErrors


def midway(radii: Array) -> Array:
    """Return radii midway between the rings, the first between centre and ring."""
    return 0.5 * (np.concatenate([[0.0], radii[:-1]]) + radii)


def second_sequence(scanner: Scanner) -> Scanner:
    """Return a rig whose projectors draw their rings midway between its own."""
    shifted = [
        replace(one, pattern=replace(one.pattern, radii=midway(one.pattern.radii)))
        for one in scanner.projectors
    ]
    return replace(scanner, projectors=tuple(shifted))


def joined_sequences(first: Cloud, second: Cloud) -> Cloud:
    """Return both clouds with their rings numbered outwards, the second's before."""
    return Cloud.join(
        [
            replace(first, ring=(2 * first.ring + 1).astype(np.int16)),
            replace(second, ring=(2 * second.ring).astype(np.int16)),
        ]
    )


def double_density(outcome: Outcome, *, seed: int = 0, threads: int = 2) -> Doubled:
    """Measure an experiment's object again, with rings between those of before.

    Args:
        outcome: What the first sequence gave.
        seed: Of the first sequence; the second's noise is another.
        threads: Worker threads; the result doesn't depend on them.
    """
    experiment = outcome.experiment
    second = reconstruct(
        second_sequence(experiment.scanner),
        seed=seed + 1,
        threads=threads,
        photometry=outcome.photometry,
    )
    cloud = joined_sequences(outcome.reconstruction.everything, second.everything)
    samples, _ = observable(experiment, seed)
    both = measured("both sequences", cloud, experiment.mesh, samples, experiment.gap_m)
    return Doubled(outcome.union, both)
