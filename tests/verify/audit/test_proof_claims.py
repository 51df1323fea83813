"""`proof.npz` beside a plan: derived again, and edits are refused."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.cover_proofs import certificate

from geometry.mesh.sampling import sample_surface
from planning.model.document.certificates import ProofRecord
from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.model.proofs import CoverProof, ProofFile
from planning.report.summary.proof_lines import proof_lines
from planning.verify.audit.audit_case import AuditCase, examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.proofs.frozen_samples import (
    covered_by_candidates,
    drawn_again,
)
from planning.verify.audit.proofs.proof_claims import audit_proofs

_KINDS = ("projector", "camera")


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def case(handmade, request) -> AuditCase:
    """A small plan by hand, with the certificates that are true of it."""
    plan = handmade.build_plan(request.param)
    for kind in _KINDS:
        plan = with_bound(plan, kind, n_samples=300)
    case = examine(plan, seed=1, n_samples=1000, threads=1)
    proofs: dict[str, CoverProof] = {}
    for kind in case.kinds:
        stream = 100 if kind.name == "projector" else 200
        drawn = _drawn(plan, 300, stream)
        samples = drawn_again(case, kind.name, drawn.draws, drawn.faces)
        covers = covered_by_candidates(case, kind.name, samples)
        required = int(np.ceil(kind.share * covers.any(axis=1).sum() - 1e-9))
        fewest = next(n for n in range(20) if not certificate(covers, n, required))
        made = certificate(covers, fewest - 1, required)
        assert made is not None
        proofs[kind.name] = replace(
            made, draws=drawn.draws, points=drawn.points, faces=drawn.faces
        )
        plan = with_bound(
            plan,
            kind.name,
            needed=kind.proof.needed.changed(lower_bound=fewest),
            candidates=kind.proof.candidates.changed(
                lower_bound=fewest, status="proved"
            ),
        )
    file = ProofFile.of(proofs)
    record = ProofRecord(path="proof.npz", sha256=file.sha256)
    certificates = plan.document.certificates.changed(proof=record)
    document = plan.document.changed(certificates=certificates)
    return replace(case, plan=replace(plan, document=document, proof=file))


def _drawn(plan: RigPlan, count: int, stream: int) -> CoverProof:
    """Return samples as a planner draws them, and no certificate."""
    seed = np.random.SeedSequence([plan.document.seed, stream]).generate_state(1)[0]
    within = plan.surface.target_faces(plan.requirements.target)
    samples = sample_surface(plan.surface.mesh, count, seed=int(seed), within=within)
    none = np.zeros(0, dtype=np.int64)
    table = np.zeros((0, count), dtype=np.uint8)
    draws = np.array([[count, stream, 1]])
    return CoverProof(
        *(draws, samples.points, samples.faces, 0, none, table, none, none, none)
    )


def held(case: AuditCase, plan: RigPlan) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what is said of the bounds of a plan, and what is false."""
    findings = AuditFindings()
    lines = audit_proofs(replace(case, plan=plan), findings)
    return lines, findings.failures


def with_bound(plan: RigPlan, kind: str, **changes: object) -> RigPlan:
    """Return a plan with other claims of a kind."""
    proofs = plan.document.certificates
    claims = getattr(proofs, f"{kind}s")
    return replace(
        plan,
        document=plan.document.changed(
            certificates=proofs.changed(**{f"{kind}s": claims.changed(**changes)})
        ),
    )


def with_proof(
    plan: RigPlan, kind: str, edit: Callable[[CoverProof], CoverProof]
) -> RigPlan:
    assert plan.proof is not None
    proofs = dict(plan.proof.proofs)
    proofs[kind] = edit(proofs[kind])
    return replace(plan, proof=ProofFile.of(proofs))


def test_both_bounds_are_derived_again(case) -> None:
    lines, false = held(case, case.plan)
    assert not false
    assert len(lines) == 2
    for line, kind in zip(lines, case.kinds, strict=True):
        least = kind.proof.needed.lower_bound
        assert line.startswith(f"{kind.name}s: at least {least} over the candidates is")
        assert f"no {least - 1} of {len(kind.poses)} poses cover" in line


@pytest.mark.parametrize("kind", _KINDS)
def test_a_bound_raised_by_one_is_refused(case, kind) -> None:
    (claims,) = (k.proof for k in case.kinds if k.name == kind)
    needed = claims.needed.changed(lower_bound=claims.needed.lower_bound + 1)
    raised = with_bound(case.plan, kind, needed=needed)
    _, false = held(case, raised)
    assert len(false) == 1
    assert f"certificates.{kind}s.candidates.status" in false[0]
    # Nor with a certificate that says it is of so many.
    edited = with_proof(raised, kind, lambda p: replace(p, n_sets=p.n_sets + 1))
    _, false = held(case, edited)
    assert len(false) == 1


_EDITS: dict[str, Callable[[CoverProof], CoverProof]] = {
    "samples": lambda p: replace(p, points=p.points + [0.0, 0.0, 1e-5]),
    "its samples": lambda p: replace(p, faces=p.faces[::-1].copy()),
    "samples aren't": lambda p: replace(p, draws=p.draws + [0, 1, 0]),
    "aren't those": lambda p: replace(p, draws=p.draws + [50, 0, 0]),
    "made again": lambda p: replace(p, draws=p.draws * [1, 1, 0]),
    "can't be made": lambda p: replace(p, draws=np.concatenate([p.draws, p.draws])),
    "are of streams": lambda p: replace(p, draws=p.draws + [0, 13, 0]),
    "candidates, there are": lambda p: replace(p, stand_in=p.stand_in[:1] * 0),
}


@pytest.mark.parametrize("kind", _KINDS)
@pytest.mark.parametrize("words", _EDITS)
def test_each_field_that_was_edited_is_refused(case, kind, words) -> None:
    lines, false = held(case, with_proof(case.plan, kind, _EDITS[words]))
    assert len(lines) == len(false) == 1
    assert words in false[0]


@pytest.mark.parametrize("kind", _KINDS)
def test_a_proof_of_fewer_samples_than_the_certificate_is_refused(case, kind) -> None:
    _, false = held(case, with_bound(case.plan, kind, n_samples=300))
    assert not false
    _, false = held(case, with_bound(case.plan, kind, n_samples=301))
    assert len(false) == 1
    assert "it is of 300 samples, not of 301" in false[0]


def test_a_certificate_that_is_missing_is_refused(case) -> None:
    proofs = case.plan.proof.proofs
    only = replace(case.plan, proof=ProofFile.of({"camera": proofs["camera"]}))
    _, false = held(case, only)
    assert len(false) == 1
    assert "certificates.projectors" in false[0]
    unnamed = case.plan.document.certificates.changed(proof=None)
    document = case.plan.document.changed(certificates=unnamed)
    _, false = held(case, replace(case.plan, document=document))
    assert len(false) == 2


def test_without_the_file_bounds_are_claimed(case, tmp_path) -> None:
    case.plan.save(tmp_path / "plan.json")
    (tmp_path / "proof.npz").unlink()
    lines, false = held(case, RigPlan.load(tmp_path / "plan.json"))
    assert not false
    assert len(lines) == 2
    assert all("is claimed: proof.npz isn't beside the plan" in line for line in lines)


def test_what_has_no_certificate_is_called_claimed(case) -> None:
    bound = case.plan.document.certificates.cameras.candidates
    plan = with_bound(case.plan, "camera", candidates=bound.changed(status="claimed"))
    lines, false = held(case, plan)
    assert not false
    assert "claimed, without a certificate" in lines[1]
    told = "\n".join(proof_lines(plan))
    assert "CLAIMED" in told or "BOUND" in told


def test_the_file_comes_back_the_same(case, tmp_path) -> None:
    case.plan.save(tmp_path / "plan.json")
    loaded = RigPlan.load(tmp_path / "plan.json")
    assert loaded.proof is not None
    assert loaded.proof.content == case.plan.proof.content
    assert ProofFile.of(loaded.proof.proofs).content == loaded.proof.content
    content = bytearray(loaded.proof.content)
    content[-1] ^= 1
    (tmp_path / "proof.npz").write_bytes(content)
    with pytest.raises(PlanFileError, match="SHA-256"):
        RigPlan.load(tmp_path / "plan.json")


def test_damaged_files_are_refused_in_one_line(case, tmp_path) -> None:
    proofs, path = case.plan.proof.proofs, tmp_path / "proof.npz"
    whole = ProofFile.of(proofs).content
    ends = replace(proofs["camera"], group_ends=np.zeros(0, np.int64))
    floats = replace(ends, multipliers=ends.multipliers.astype(float))
    damaged = {
        "not a readable": whole[: len(whole) // 2],
        "not a readable ": b"nothing",
        "is missing, or of another kind": ProofFile.of({"camera": floats}).content,
    }
    for words, content in damaged.items():
        path.write_bytes(content)
        with pytest.raises(PlanFileError, match=words) as told:
            ProofFile.load(path, ProofFile(content).sha256)
        assert "\n" not in str(told.value)
        assert told.value.exit_code == 3
