"""Bounds over all poses of a plan: derived again, and forged ones aren't."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from geometry.mesh.sampling import sample_surface
from planning.model.document.certificates import ContinuousProof, ProofRecord
from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.model.proofs import PoseProof, ProofFile
from planning.verify.audit.audit_case import AuditCase, examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.predicates.predicates import LIT, light_steps
from planning.verify.audit.proofs.frozen_samples import (
    covered_by_candidates,
    drawn_again,
)
from planning.verify.audit.proofs.poses.device_cells import device_cells, lit_by_plan
from planning.verify.audit.proofs.poses.pose_claims import PoseBound, audit_pose_proofs
from planning.verify.audit.proofs.poses.skies import SkyMaps
from planning.verify.trust import OVER_POSES, taken_on_trust

_KINDS = ("projector", "camera")
_STREAMS = {"projector": 100, "camera": 200}
_N = 300
_NARROW: Any = np.full(3, 127, dtype=np.int8)


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def case(handmade, request) -> AuditCase:
    """A small plan by hand, of which it is true that one device isn't enough."""

    def ask_for_nearly_all(document: dict[str, Any]) -> None:
        document["requirements"] |= {"coverage": 0.95, "dominant_coverage": 0.95}
        for kind in ("projectors", "cameras"):
            document["certificates"][kind]["n_samples"] = _N

    plan = handmade.tampered(handmade.build_plan(request.param), ask_for_nearly_all)
    case = examine(plan, seed=1, n_samples=1000, threads=1)
    proofs = {kind.name: _proof(case, kind.name) for kind in case.kinds}
    for kind in case.kinds:
        plan = with_bound(plan, kind.name, **vars(_claim(case, kind.name)))
    return replace(case, plan=with_file(plan, proofs))


def _proof(case: AuditCase, kind: str) -> PoseProof:
    """That one device is too few, by multipliers that are all alike."""
    plan, stream = case.plan, _STREAMS[kind]
    seed = np.random.SeedSequence([plan.document.seed, stream]).generate_state(1)[0]
    within = plan.surface.target_faces(plan.requirements.target)
    drawn = sample_surface(plan.surface.mesh, _N, seed=int(seed), within=within)
    draws = np.array([[_N, stream, 1]])
    return PoseProof(draws, drawn.faces, 1, np.ones(_N, dtype=np.int64))


def _claim(case: AuditCase, kind: str) -> ContinuousProof:
    proof = _proof(case, kind)
    samples = drawn_again(case, kind, proof.draws, proof.faces)
    covers = covered_by_candidates(case, kind, samples)
    lit = np.any(lit_by_plan(case, kind, samples), axis=0)
    return ContinuousProof(
        lower_bound=2,
        status="survived",
        proof="multipliers of the rows",
        occlusion=True,
        n_samples=int(lit.sum()),
        n_reached=int(covers.any(axis=1).sum()),
        n_cells=0,
        one_fewer_upper_bound_m2=None,
        certificate="offered",
    )


def with_file(plan: RigPlan, proofs: dict[str, PoseProof]) -> RigPlan:
    file = ProofFile.of({}, proofs)
    record = ProofRecord(path="proof.npz", sha256=file.sha256)
    certificates = plan.document.certificates.changed(proof=record)
    document = plan.document.changed(certificates=certificates)
    return replace(plan, document=document, proof=file)


def with_bound(plan: RigPlan, kind: str, **changes: object) -> RigPlan:
    """Return a plan with other words about a kind's bound over all poses."""
    proofs = plan.document.certificates
    claims = getattr(proofs, f"{kind}s")
    bound = claims.continuous
    made = (
        ContinuousProof.model_validate(changes)
        if bound is None
        else bound.changed(**changes)
    )
    claims = claims.changed(continuous=made)
    certificates = proofs.changed(**{f"{kind}s": claims})
    return replace(plan, document=plan.document.changed(certificates=certificates))


def held(
    case: AuditCase, plan: RigPlan
) -> tuple[dict[str, PoseBound], tuple[str, ...]]:
    """Return what became of each bound of a plan, and what is false."""
    findings = AuditFindings()
    bounds = audit_pose_proofs(replace(case, plan=plan), findings, lambda _: None)
    return {b.line.split("s:")[0]: b for b in bounds}, findings.failures


def with_proof(plan: RigPlan, kind: str, **changes: object) -> RigPlan:
    assert plan.proof is not None
    proofs = dict(plan.proof.over_poses)
    proofs[kind] = replace(proofs[kind], **changes)
    return with_file(plan, proofs)


def test_a_bound_is_derived_again_from_its_multipliers(case) -> None:
    bounds, false = held(case, case.plan)
    assert not false
    line = bounds["projector"].line
    assert line.startswith("projectors: at least 2 over all poses is proved")
    assert "no 1 anywhere cover" in line
    assert f"of {_N} samples" in line
    assert not bounds["projector"].trusted
    # What isn't known over the smallest cells is no false claim.
    assert bounds["camera"].line.startswith("cameras: at least 2 over all poses is")


def test_a_bound_raised_by_one_is_false(case) -> None:
    _, false = held(case, with_bound(case.plan, "projector", lower_bound=3))
    assert len(false) == 1
    assert "certificates.projectors.continuous.certificate" in false[0]
    assert "the certificate is of 2" in false[0]


def test_what_existing_devices_cover_is_free(handmade, case) -> None:
    pose = case.plan.projectors[0].world_from_device.tolist()

    def stand(document: dict[str, Any]) -> None:
        document["projectors"][0] |= {"existing": True, "name": "wall"}
        one = {"name": "wall", "kind": "projector", "world_from_device": pose}
        document["requirements"]["existing"] = [one]

    proof = case.plan.proof.over_poses["projector"]
    samples = drawn_again(case, "projector", proof.draws, proof.faces)
    reached = covered_by_candidates(case, "projector", samples).any(axis=1)
    limits = case.plan.requirements.projector
    # Whatever its rings, of which some may be too narrow.
    ringless = replace(case.projectors[0], radii=np.array([np.inf]))
    free = reached & (light_steps(ringless, samples, limits, case.shadow) == LIT)
    required = int(np.ceil(0.95 * reached.sum() - 1e-9)) - int(free.sum())
    assert 0 < free.sum() < required + free.sum()
    plan = with_file(
        handmade.tampered(case.plan, stand), {"projector": replace(proof, n_devices=0)}
    )
    bounds, false = held(case, with_bound(plan, "projector", lower_bound=2))
    assert "camera" in false[0]
    words = f"{required} of {_N} samples are left to cover"
    assert words in bounds["projector"].line
    # It alone is in every plan.
    bounds, _ = held(case, with_bound(plan, "projector", lower_bound=1))
    assert bounds["projector"].line.endswith("proved: so many stand already")


@pytest.mark.parametrize("turned", [False, True])
def test_what_a_turntable_turns_is_seen_from_all_around(handmade, case, turned) -> None:
    """Where devices stand in the room they see no sample, but at other steps."""
    step = {"id": "T1", "world_from_station": np.eye(4).tolist(), "angle": 0.0}
    step |= {"projectors": ["P1", "P2"], "cameras": ["C1", "C2"]}
    table = {"kind": "turntable", "stations": [step]}
    proof = case.plan.proof.over_poses["projector"]
    normals = case.plan.surface.mesh.face_normals[proof.faces]
    behind = (-normals.mean(axis=0)).tolist()

    def behind_it(document: dict[str, Any]) -> None:
        space = document["requirements"]["workspace"]
        space |= {"axis": behind, "half_angle": 0.1}
        if turned:
            document["stations"] = table

    plan = with_bound(
        handmade.tampered(case.plan, behind_it), "projector", lower_bound=10
    )
    more = {"projector": replace(proof, n_devices=9)}
    bounds, false = held(
        case, with_file(with_bound(plan, "camera", certificate="none"), more)
    )
    assert not false
    assert ("is claimed" in bounds["projector"].line) is turned


@pytest.mark.long
@pytest.mark.parametrize("kind", _KINDS)
def test_forged_ones_are_never_called_proved(case, kind) -> None:
    # The plan's own devices are two of a kind; reference poses with them cover all.
    forged = with_proof(case.plan, kind, n_devices=9)
    bounds, false = held(case, with_bound(forged, kind, lower_bound=10))
    assert not false
    assert "over all poses is claimed" in bounds[kind].line
    assert bounds[kind].trusted


@pytest.mark.parametrize("kind", _KINDS)
def test_where_a_single_pose_costs_too_much_no_map_is_drawn(
    case, kind, monkeypatch
) -> None:
    def never(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(SkyMaps, "of", never)
    forged = with_proof(case.plan, kind, n_devices=9)
    bounds, false = held(case, with_bound(forged, kind, lower_bound=10))
    assert not false
    assert bounds[kind].line.endswith(
        "left some open, and a pose there costs more than that"
    )


def test_a_pose_in_the_middle_of_a_cell_serves_no_more_than_the_cell(case) -> None:
    some, every = np.arange(60), np.ones((1, 60), dtype=bool)
    made = device_cells(case, "projector", case.samples.take(some), every, shadows=True)
    cells = made.roots
    for _ in range(6):
        cells = cells.halves(made.object_m).take(np.arange(0, 2 * len(cells.low_m), 2))
    inside = made.at_middles(cells, some)
    may = np.ones(inside.shape, dtype=bool)
    held_by = made.of(some, lambda _: None, None).serve(cells, may)
    assert inside.any()
    assert held_by[inside].all()
    assert not np.array_equal(inside, held_by)


@pytest.mark.long
def test_multipliers_of_others_prove_nothing(case) -> None:
    rng = np.random.default_rng(3)
    for made in (np.zeros(_N, np.int64), 1 << rng.integers(0, 40, _N)):
        plan = with_proof(case.plan, "projector", multipliers=made, n_devices=3)
        bounds, false = held(case, with_bound(plan, "projector", lower_bound=4))
        assert not false
        assert "over all poses is claimed" in bounds["projector"].line


@pytest.mark.long
def test_less_area_than_can_be_derived_stays_claimed(case) -> None:
    whole = case.estimator.target_m2
    needed = case.plan.document.certificates.projectors.needed.count
    assert needed == 2
    # All samples but a few more than are required: one device covers no more.
    plan = with_bound(case.plan, "projector", one_fewer_upper_bound_m2=0.999 * whole)
    bounds, _ = held(case, plan)
    assert "proved" in bounds["projector"].line
    assert not bounds["projector"].trusted
    plan = with_bound(case.plan, "projector", one_fewer_upper_bound_m2=0.1 * whole)
    bounds, false = held(case, plan)
    assert not false
    assert "what one fewer covers is claimed" in bounds["projector"].line
    assert (
        "projectors fewer covers at most, over all poses" in bounds["projector"].trusted
    )


def test_what_is_taken_of_a_part_of_a_draw_counts_for_nothing(case) -> None:
    """A fifth of the samples would lie on the first thousandth of the surface."""
    proof, plan = case.plan.proof.over_poses["projector"], case.plan
    seed = np.random.SeedSequence([plan.document.seed, 101]).generate_state(1)[0]
    within = plan.surface.target_faces(plan.requirements.target)
    more = sample_surface(plan.surface.mesh, 50_000, seed=int(seed), within=within)
    some = _N + _N // 5
    changes = {
        "draws": np.array([[_N, 100, 1], [50_000, 101, 1]]),
        "faces": np.concatenate([proof.faces, more.faces]),
        "multipliers": np.ones(some, dtype=np.int64),
    }
    forged = with_proof(plan, "projector", **changes)
    bounds, false = held(case, with_bound(forged, "projector", n_samples=some))
    assert not false
    assert f"of {_N} samples" in bounds["projector"].line


_EDITS: dict[str, dict[str, object]] = {
    "samples aren't": {"draws": np.array([[_N, 101, 1]])},
    "less than 250": {"draws": np.array([[_N, 100, 2]])},
    "made again": {"draws": np.array([[_N, 100, 0]])},
    "of its 200 samples": {"multipliers": np.ones(200, dtype=np.int64)},
}


@pytest.mark.long
@pytest.mark.parametrize("words", _EDITS)
def test_another_set_of_samples_is_refused(case, words) -> None:
    bounds, false = held(case, with_proof(case.plan, "projector", **_EDITS[words]))
    assert "projector" not in bounds
    assert len(false) == 1
    assert words in false[0]


def test_sums_of_narrow_numbers_do_not_wrap() -> None:
    file = ProofFile.of(
        {}, {"camera": PoseProof(np.zeros((1, 3), int), np.zeros(3, int), 1, _NARROW)}
    )
    read = ProofFile(file.content).over_poses["camera"].multipliers
    assert read.dtype == np.int64
    assert int(read.sum()) == 3 * 127
    unsigned = _NARROW.astype(np.uint64).view(np.uint64)
    with pytest.raises(PlanFileError, match="of another kind"):
        _ = ProofFile.of(
            {},
            {"camera": PoseProof(np.zeros((1, 3), int), np.zeros(3, int), 1, unsigned)},
        ).over_poses


def test_a_certificate_that_is_missing_is_refused(case) -> None:
    only = {"camera": case.plan.proof.over_poses["camera"]}
    _, false = held(case, with_file(case.plan, only))
    assert len(false) == 1
    assert "has no certificate" in false[0]
    unnamed = case.plan.document.certificates.changed(proof=None)
    document = case.plan.document.changed(certificates=unnamed)
    _, false = held(case, replace(case.plan, document=document))
    assert len(false) == 2


def test_what_has_no_certificate_is_taken_on_trust(case) -> None:
    plan = with_bound(case.plan, "projector", certificate="none")
    bounds, false = held(case, plan)
    assert not false
    assert bounds["projector"].line.endswith("claimed, without a certificate")
    told = taken_on_trust(plan, None, "", "", tuple(bounds.values()))
    assert "the bound on projectors over all poses: claimed" in told
    assert OVER_POSES not in told
    # Where none was tried, the option is named.
    assert OVER_POSES in taken_on_trust(plan, None, "", "")


def test_the_file_comes_back_the_same(case, tmp_path) -> None:
    case.plan.save(tmp_path / "plan.json")
    loaded = RigPlan.load(tmp_path / "plan.json")
    assert loaded.proof is not None
    again = ProofFile.of(loaded.proof.proofs, loaded.proof.over_poses)
    assert again.content == case.plan.proof.content


@pytest.mark.parametrize(
    "changes",
    [
        {"multipliers": -np.ones(_N, dtype=np.int64)},
        {"multipliers": np.full(_N, 1 << 60)},
        {"multipliers": np.ones(_N + 1, dtype=np.int64)},
        {"n_devices": -1},
    ],
)
def test_numbers_that_sum_to_nothing_sensible_are_refused(case, changes) -> None:
    with pytest.raises(PlanFileError, match="don't fit"):
        replace(case.plan.proof.over_poses["projector"], **changes)


def test_shadows_count_only_where_all_devices_stand_outside(handmade, case) -> None:
    samples, every = case.samples.take(np.arange(20)), np.ones((1, 20), dtype=bool)

    def n_stages(case: AuditCase, *, shadows: bool = True) -> int:
        made = device_cells(case, "projector", samples, every, shadows=shadows)
        assert made.stages[0] is None
        return len(made.stages)

    def come_near(document: dict[str, Any]) -> None:
        workspace = document["requirements"]["workspace"]
        workspace["projector_radius_m"] = [0.04, 1.1]

    assert n_stages(case) == 4
    assert n_stages(case, shadows=False) == 1
    assert n_stages(replace(case, plan=handmade.tampered(case.plan, come_near))) == 1
