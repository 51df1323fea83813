"""Bounds over the candidates: derived again from the plan, its mesh and `proof.npz`.

Samples are drawn again, as many as the plan says or more, of the streams that are a
kind's own: so whoever wrote it chose a seed and no sample. What candidates cover is
decided by the audit's predicates. The certificate alone is taken from the file, and
holds or doesn't.
"""

import time

import numpy as np

from planning.model.document.certificates import Certificate
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings

from .frozen_samples import covered_by_candidates, drawn_again
from .refutation import RefutedProofError, refute


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
    samples = drawn_again(case, kind, proof.draws, proof.faces, proof.points)
    covers = covered_by_candidates(case, kind, samples)
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
