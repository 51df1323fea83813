"""Cameras that make drawn rigs surer, against rigs that are off by each error."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.little_work import draw_fewer

from planning.cameras import surer_cameras as searching
from planning.cameras.pair_errors import PairErrors
from planning.cameras.surer_cameras import Aim, surer_cameras
from planning.model.devices.calibration_errors import AS_PLANNED, CalibrationErrors
from planning.model.document.certificates import CountArea
from planning.proofs.candidate_certificate import PlannedStage, counted
from planning.report.tolerance.built_case import BuiltCase
from planning.report.tolerance.drawn_rigs import deviations_of
from planning.report.tolerance.tolerance import draw, question_of
from planning.scene.measuring.camera_views import CandidateViews, camera_views
from planning.scene.measuring.measured import lit_samples

_OFF = CalibrationErrors(np.radians(0.02), 5e-5, 2e-4, 0.3)
_SMALL = 1e-2


@pytest.fixture(scope="module", params=["diverging", "parallel"])
def plan(request, handmade):
    def stated(document):
        document["coverage"]["samples"] = 400
        document["requirements"]["triangulation"] |= {
            "calibration": vars(_OFF),
            "accuracy_of": "noise",
        }

    with pytest.MonkeyPatch.context() as patch:
        draw_fewer(patch, region_claims=30, surer=400)
        yield handmade.tampered(handmade.build_plan(request.param), stated)


@pytest.fixture(scope="module")
def case(plan):
    return BuiltCase.of(plan, threads=1).shared()


@pytest.fixture(scope="module")
def errors(plan, case):
    samples = lit_samples(case.scene, plan.projectors, case.target)
    views = camera_views(case.scene, plan.cameras, samples.target)
    limits = plan.requirements.triangulation
    return PairErrors.of(limits, plan.projectors, samples, views)


@pytest.mark.long
def test_each_error_does_what_a_rig_does_that_is_off_by_it(plan, case, errors):
    best = errors.sigma.argmin(axis=1)
    at = errors.place[np.arange(len(best)), best]
    at = at[at >= 0]
    outcome = case.planned
    some = np.flatnonzero(outcome.measured)
    assert len(at) == len(some) > 50
    parts = (errors.noise**2, errors.by_projector**2, errors.by_camera**2)
    total = parts[0][at] + sum(part[at].sum(axis=1) for part in parts[1:])
    assert np.sqrt(total) == pytest.approx(outcome.sigma[some], rel=1e-9)
    n_p, sizes = len(plan.projectors), deviations_of(_OFF)
    nothing = np.zeros((len(case.target), 3))

    def rig_error(kind, column):
        unknown = np.zeros((len(case.rig.devices), 9))
        rows = range(n_p) if kind == 0 else range(n_p, len(unknown))
        unknown[list(rows), column] = _SMALL * sizes[column]
        return case.errors(outcome, case.rig, unknown, nothing)[some] / _SMALL

    for kind, vectors in enumerate((errors.by_projector, errors.by_camera)):
        # Turns and displacements are told about the world's axes, not the device's.
        for own, drawn in ((slice(0, 3), (3, 4, 5)), (slice(3, 6), (0, 1, 2))):
            exact = sum(rig_error(kind, column) ** 2 for column in drawn)
            told = np.sum(vectors[at, own] ** 2, axis=1)
            assert told == pytest.approx(exact, rel=2e-3, abs=1e-16)
        focal = np.abs(rig_error(kind, 6))
        assert np.abs(vectors[at, 6]) == pytest.approx(focal, rel=2e-3, abs=1e-9)


def test_the_quantile_is_that_of_drawn_rigs(plan, case, errors):
    rigs = draw(case, question_of(plan, AS_PLANNED, None, None), range(70), threads=1)
    every = range(len(plan.cameras))
    for quantile in (0.5, 0.9):
        drawn = np.quantile([rig.rms_m for rig in rigs], quantile)
        assert errors.of_rigs(every, quantile) == pytest.approx(drawn, rel=0.1)


def _on_its_samples(case, projectors, cameras):
    """Errors over the samples that cameras are sought on."""
    target = case.scene.target_samples(searching.DRAWS.surer)
    samples = lit_samples(case.scene, projectors, target)
    views = camera_views(case.scene, cameras, samples.target)
    limits = case.scene.requirements.triangulation
    return PairErrors.of(limits, projectors, samples, views)


def test_cameras_are_added_until_the_aim_is_reached(plan, case):
    scene, projectors, cameras = case.scene, plan.projectors, plan.cameras[:1]
    before = _on_its_samples(case, projectors, cameras)
    alone = before.of_rigs([0], 0.95)
    around = scene.candidates(cameras).around(cameras, 40)[::3]
    views = CandidateViews(scene.among(()), (*plan.cameras, *around))
    stage = SimpleNamespace(cover=SimpleNamespace(candidates=views))

    def found(rms, more=0.0, most=None, drawn=None):
        required = replace(scene.requirements, max_cameras=most)
        return surer_cameras(
            replace(scene, requirements=required),
            *(projectors, stage, cameras),
            *(Aim(0.95, rms, drawn, more), 20),
        )

    assert found(1.01 * alone) == cameras
    surer = found(0.95 * alone)
    after = _on_its_samples(case, projectors, surer)
    assert after.of_rigs(range(len(surer)), 0.95) <= 0.95 * alone
    measured = after.measured(range(len(surer))).sum()
    assert measured >= before.measured([0]).sum()
    # As far as drawn rigs exceed what is predicted, less is aimed at.
    again = found(0.95 * alone / (1.0 - searching._RMS_SPARE), drawn=alone)
    assert [c.world_from_device.tolist() for c in again] == [
        c.world_from_device.tolist() for c in surer
    ]
    assert len(found(0.1 * alone, most=2)) == 2
    # No camera is kept that the aim is reached without.
    for k in range(len(surer)):
        others = [c for c in range(len(surer)) if c != k]
        fewer = after.measured(others).sum() < before.measured([0]).sum()
        assert fewer or after.of_rigs(others, 0.95) > 0.95 * alone
    # Where nothing is asked of errors, more of the surface may be.
    wider = found(None, more=0.1)
    seen = _on_its_samples(case, projectors, wider).measured(range(len(wider)))
    assert seen.sum() >= 1.1 * before.measured([0]).sum()


def test_a_count_beyond_the_cover_is_no_proof(handmade):
    proof = handmade.build_plan().document.certificates.cameras
    area = proof.best_area
    row = CountArea(
        count=proof.count, value_m2=area.value_m2, upper_bound_m2=area.upper_bound_m2
    )
    more = row.changed(count=proof.count + 1)
    proof = proof.changed(by_count=(row, more), one_fewer=None, given=proof.count)
    cover = {n: ("C",) * n for n in (proof.count, proof.count + 1)}
    before, n = PlannedStage(cover, proof), proof.count + 3
    after = counted(before, ("D",) * n, 1.0)
    assert after.certificate.status == "feasible"
    assert after.certificate.count == after.certificate.needed.count == n
    assert after.certificate.candidates == proof.candidates
    assert after.certificate.best_area.upper_bound_m2 == 1.0
    assert after.certificate.by_count == (row,)
    # What the best of fewer cover may be more: they are planned for something else.
    assert after.by_count == {n: ("D",) * n}
    # What is reachable is told of other samples: what was found is reachable, too.
    best = counted(before, ("D",) * n, 0.5 * row.value_m2).certificate.best_area
    assert best.upper_bound_m2 == best.value_m2 == row.value_m2
    same = counted(before, ("D",) * proof.count, 1.0)
    assert same.certificate == proof
    assert same.by_count[proof.count][0] == "D"
