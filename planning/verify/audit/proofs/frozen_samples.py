"""The samples of a proof, drawn again, and what candidates cover of them."""

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.sampling import sample_surface
from geometry.parallel import mapped
from planning.model.proofs import sizes_of
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_samples import AuditSamples, samples_on
from planning.verify.audit.predicates.audit_devices import AuditCamera
from planning.verify.audit.predicates.predicates import LIT, MEASURED, light_steps
from planning.verify.audit.predicates.recompute import light_of_plan, pairs_with
from planning.verify.audit.predicates.reference_devices import (
    reference_cameras,
    reference_projectors,
)

from .refutation import RefutedProofError

# Of the size of the mesh: how far a sample may lie from where it is drawn again.
_NEAR = 1e-9
# Draws of one proof, and samples of all: more is no file of ours.
_MOST_DRAWS, _MOST_SAMPLES = 16, 100_000
# Of one draw: fewer don't speak of a surface, and could be picked.
_FEWEST_SAMPLES = 250
# The first stream that a cover of each kind is frozen on, and how many later ones may
# have joined: others could be picked.
_FIRST_STREAM, _LATER_STREAMS = {"projector": 100, "camera": 200}, 12


def covered_by_candidates(case: AuditCase, kind: str, samples: AuditSamples) -> Mask:
    """Return which sample each reference pose lights, or measures, (n, m)."""
    plan, threads = case.plan, case.shadow.caster.threads
    limits, columns = plan.requirements, list[Mask]()
    if kind == "projector":
        devices = reference_projectors(plan)
        columns = mapped(
            lambda d: light_steps(d, samples, limits.projector, case.shadow) == LIT,
            devices,
            threads,
        )
        return np.stack(columns, axis=1)
    light, _ = light_of_plan(plan, samples, case.shadow)
    lit = np.flatnonzero((light == LIT).any(axis=0))
    some, lit_by = samples.take(lit), light[:, lit] == LIT

    def measured(camera: AuditCamera) -> Mask:
        steps = pairs_with(camera, case.projectors, some, lit_by, limits, case.shadow)
        return np.any(steps == MEASURED, axis=0)

    columns = mapped(measured, reference_cameras(plan), threads)
    covers = np.zeros((len(samples), len(columns)), dtype=bool)
    covers[lit] = np.stack(columns, axis=1)
    return covers


def drawn_again(
    case: AuditCase,
    kind: str,
    draws: Ints,
    faces: Ints,
    points: Array | None = None,
) -> AuditSamples:
    """Return the samples that draws give, as `CoverProof` has them.

    Raises:
        RefutedProofError: If they don't lie on these faces, or at these points, or are
            of other streams or fewer than the certificate speaks of.
    """
    _require_own(case, kind, draws)
    plan, surface = case.plan, case.plan.surface
    within = surface.target_faces(plan.requirements.target)
    places, owners = list[Array](), list[Ints]()
    for count, stream, every in draws.tolist():
        mixed = np.random.SeedSequence([plan.document.seed, stream])
        seed = int(mixed.generate_state(1)[0])
        drawn = sample_surface(surface.mesh, count, seed=seed, within=within)
        places.append(drawn.points[::every])
        owners.append(drawn.faces[::every])
    at, of = np.concatenate(places), np.concatenate(owners)
    near = _NEAR * float(np.ptp(surface.mesh.bounds, axis=0).max())
    same = np.array_equal(of, faces)
    if not (same and (points is None or np.all(np.abs(at - points) <= near))):
        raise RefutedProofError("its samples aren't those that its draws give")
    return samples_on(surface, at, of, np.ones(len(of), dtype=bool))


def _require_own(case: AuditCase, kind: str, draws: Ints) -> None:
    """Refuse draws that can't be made again, or aren't those of a kind's certificate.

    Raises:
        RefutedProofError: If they aren't.
    """
    counts, streams = draws[:, 0], draws[:, 1]
    if not (
        1 <= len(counts) <= _MOST_DRAWS
        and np.all((counts >= 1) & (counts <= _MOST_SAMPLES))
        and counts.sum() <= _MOST_SAMPLES
        and np.all(draws[:, 1:] >= 0)
        and np.all(draws[:, 2] >= 1)
        and np.all(sizes_of(draws) >= _FEWEST_SAMPLES)
        and len(np.unique(streams)) == len(counts)
    ):
        raise RefutedProofError(
            f"its draws can't be made again, or one gives less than {_FEWEST_SAMPLES}"
        )
    later = streams - _FIRST_STREAM[kind]
    if not np.all((later >= 0) & (later <= _LATER_STREAMS)):
        raise RefutedProofError(
            f"its draws are of streams {streams.tolist()}, {kind}s' begin with "
            f"{_FIRST_STREAM[kind]} and end {_LATER_STREAMS} later"
        )
    claims = getattr(case.plan.document.certificates, f"{kind}s")
    n = int(sizes_of(draws).sum())
    if n < claims.n_samples:
        raise RefutedProofError(f"it is of {n} samples, not of {claims.n_samples}")
