"""What was merged is held against the object and the limits."""

from collections.abc import Callable

from geometry.mesh.sampling import sample_surface
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import Spent
from planning.verify.reconstruction.scanner import Scanner

from .accuracy import (
    Completeness,
    Expected,
    held_against,
    measure_completeness,
    share_of,
)
from .merge import Merged
from .result import PairCount, Reconstruction

_DEFAULT_SAMPLES = 20_000

# From failures, and from what is missing, to failures with their causes.
Explain = Callable[[tuple[str, ...], Completeness], tuple[str, ...]]


def fresh_samples(plan: Scanner, seed: int) -> Expected:
    """Points of the target that nobody says anything of."""
    mesh, target = plan.mesh, plan.target
    return Expected(sample_surface(mesh, _DEFAULT_SAMPLES, seed=seed, within=target))


def judged(
    plan: Scanner,
    everything: Cloud,
    merged: Merged,
    pairs: tuple[PairCount, ...],
    expected: Expected,
    *,
    photometry: Photometry | None,
    spent: Spent,
    nothing: str,
    explain: Explain = lambda failures, _: failures,
) -> Reconstruction:
    """Return the reconstruction; `nothing` is the failure of no point at all."""
    completeness = measure_completeness(
        everything, merged.cloud, expected.within(plan.target), plan.limits.check.tau_m
    )
    accuracy, failures, inside = held_against(merged.cloud, plan, completeness, nothing)
    if accuracy is not None and failures:
        failures = explain(failures, completeness)
    return Reconstruction(
        everything,
        merged,
        accuracy,
        completeness,
        pairs,
        photometry,
        failures,
        spent.seconds,
        inside_fraction=share_of(inside),
    )
