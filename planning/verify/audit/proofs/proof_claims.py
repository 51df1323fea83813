"""Bounds over the candidates: derived again from the plan, its mesh and `proof.npz`.

Samples are drawn again, by the streams that the file names: so whoever wrote it chose
a seed and no sample. What candidates cover is decided by the audit's predicates. The
certificate alone is taken from the file, and holds or doesn't.
"""

import time

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.mesh.sampling import sample_surface
from geometry.parallel import mapped
from planning.model.document.certificates import Certificate
from planning.model.proofs import CoverProof
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import AuditSamples, samples_on
from planning.verify.audit.predicates.audit_devices import AuditCamera
from planning.verify.audit.predicates.predicates import LIT, MEASURED, light_steps
from planning.verify.audit.predicates.recompute import light_of_plan, pairs_with
from planning.verify.audit.predicates.reference_devices import (
    reference_cameras,
    reference_projectors,
)

from .refutation import RefutedProofError, refute

# Of the size of the mesh: how far a sample may lie from where it is drawn again.
_NEAR = 1e-9
# Draws of one proof, and samples of all: more is no file of ours.
_MOST_DRAWS, _MOST_SAMPLES = 16, 100_000


def audit_proofs(case: AuditCase, findings: AuditFindings) -> tuple[str, ...]:
    """Derive every bound over candidates again; return a line on each.

    A bound that the plan calls proved and that doesn't follow is a false claim; but
    where `proof.npz` isn't there, it is only said that nothing was derived.
    """
    record, lines = case.plan.document.certificates.proof, list[str]()
    present = record is not None and case.plan.proof is not None
    for kind in case.kinds:
        claims, name = kind.proof, f"{kind.name}s"
        least = claims.needed.lower_bound
        told = f"{name}: at least {least} over the candidates is"
        if claims.candidates.status != "proved":
            if not least:
                continue
            lines.append(f"{told} claimed, without a certificate")
            continue
        below = findings.at(f"certificates.{name}.candidates.status")
        if record is None:
            below.fail("", "'proved' is claimed, and no proof is named")
            continue
        if not present:
            lines.append(f"{told} claimed: {record.path} isn't beside the plan")
            continue
        begun = time.perf_counter()
        try:
            words = _derived(case, kind.name, claims, kind.share)
        except RefutedProofError as error:
            below.fail("", f"{least} are claimed to be proved, but {error}")
            continue
        took = time.perf_counter() - begun
        lines.append(f"{told} proved, derived again in {took:.1f} s: {words}")
    return tuple(lines)


def _derived(case: AuditCase, kind: str, claims: Certificate, share: float) -> str:
    """Return how a bound was derived; else raise why it can't be."""
    assert case.plan.proof is not None
    proof = case.plan.proof.proofs.get(kind)
    if proof is None:
        raise RefutedProofError("the file has no certificate of it")
    least = max(claims.needed.lower_bound, claims.candidates.lower_bound)
    if proof.n_sets + 1 < least:
        raise RefutedProofError(f"the certificate is of {proof.n_sets + 1}")
    covers = covered_by_candidates(case, kind, proof)
    if len(proof.stand_in) != covers.shape[1]:
        raise RefutedProofError(
            f"it is of {len(proof.stand_in)} candidates, there are {covers.shape[1]}"
        )
    required = int(np.ceil(share * int(covers.any(axis=1).sum()) - 1e-9))
    refute(covers, proof, required)
    n = proof.n_sets
    how = "all looked at" if n <= 2 else f"nodes: {len(proof.nodes)}"
    return (
        f"no {n} of {covers.shape[1]} poses cover {required} of {len(covers)} samples "
        f"({how})"
    )


def covered_by_candidates(case: AuditCase, kind: str, proof: CoverProof) -> Mask:
    """Return which sample each reference pose lights, or measures, (n, m).

    Raises:
        RefutedProofError: If the samples aren't those that their draws give.
    """
    plan, samples = case.plan, _drawn_again(case, proof)
    threads = case.shadow.caster.threads
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


def _drawn_again(case: AuditCase, proof: CoverProof) -> AuditSamples:
    """Return the samples, which must be what the streams give that are named."""
    plan, surface = case.plan, case.plan.surface
    within = surface.target_faces(plan.requirements.target)
    points, faces = list[Array](), list[Ints]()
    counts = proof.draws[:, 0]
    if not (
        1 <= len(counts) <= _MOST_DRAWS
        and np.all((counts >= 1) & (counts <= _MOST_SAMPLES))
        and counts.sum() <= _MOST_SAMPLES
        and np.all(proof.draws[:, 1:] >= 0)
        and np.all(proof.draws[:, 2] >= 1)
        and len(np.unique(proof.draws[:, 1])) == len(counts)
    ):
        raise RefutedProofError("its draws can't be made again")
    for count, stream, every in proof.draws.tolist():
        mixed = np.random.SeedSequence([plan.document.seed, stream])
        seed = int(mixed.generate_state(1)[0])
        drawn = sample_surface(surface.mesh, count, seed=seed, within=within)
        points.append(drawn.points[::every])
        faces.append(drawn.faces[::every])
    at, of = np.concatenate(points), np.concatenate(faces)
    near = _NEAR * float(np.ptp(surface.mesh.bounds, axis=0).max())
    if not (
        np.array_equal(of, proof.faces) and np.all(np.abs(at - proof.points) <= near)
    ):
        raise RefutedProofError("its samples aren't those that its draws give")
    return samples_on(surface, at, of, np.ones(len(of), dtype=bool))
