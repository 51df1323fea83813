import json
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm
from support.little_work import draw_fewer

from planning.model.devices.calibration_errors import (
    AS_PLANNED,
    PERFECT,
    CalibrationErrors,
    Mounting,
)
from planning.model.errors import InputError
from planning.report.tolerance import tolerance as tolerance_module
from planning.report.tolerance.asked import Asked, Figures
from planning.report.tolerance.built_case import BuiltCase
from planning.report.tolerance.drawn_rigs import (
    CONFIRMING,
    DRAWN,
    Deviates,
    bounds_of,
    deviations_of,
)
from planning.report.tolerance.loosest import loosest
from planning.report.tolerance.sensitivities import first_order, sensitivities
from planning.report.tolerance.studies import StudyFile
from planning.report.tolerance.tolerance import draw, question_of, tolerance_of
from planning.report.tolerance.tolerance_lines import tolerance_lines

_OFF = CalibrationErrors(angle=1e-4, position_m=5e-5)
_LOOSE = Mounting(position_m=2e-3, angle=4e-3, focal=5e-3)


@pytest.fixture(scope="module", autouse=True)
def _fewer_of_regions():
    with pytest.MonkeyPatch.context() as patch:
        draw_fewer(patch, region_claims=30)
        yield


@pytest.fixture(scope="module")
def plan(handmade):
    def with_fewer_samples(document):
        document["coverage"]["samples"] = 150

    return handmade.tampered(handmade.build_plan(), with_fewer_samples)


@pytest.fixture(scope="module")
def case(plan):
    return BuiltCase.of(plan, _OFF, threads=1)


def test_as_planned_all_is_as_the_plan_claims(plan, case):
    nothing = np.zeros((len(case.rig.devices), 9))
    errors = case.errors(
        case.planned, case.rig, nothing, np.zeros((len(case.target), 3))
    )
    figures = case.figures(case.planned, errors)
    areas = plan.coverage.target
    assert figures.lit == pytest.approx(
        areas.lit_m2 / areas.reachable_by_projectors_m2, abs=0.08
    )
    assert figures.coverage == pytest.approx(
        areas.measured_m2 / areas.reachable_by_cameras_m2, abs=0.08
    )
    assert figures.completeness == 1.0
    assert figures.rms_m < 1e-12
    everywhere = case.figures(case.planned, np.zeros(len(case.target)))
    assert everywhere.completeness == 1.0
    beyond = case.figures(case.planned, np.full(len(case.target), 1.0))
    assert beyond.completeness == 0.0


def test_points_of_exact_rigs_have_their_edge_noise(plan):
    case = BuiltCase.of(plan, PERFECT, threads=1)
    rigs = draw(case, question_of(plan, AS_PLANNED, PERFECT, 0), range(20), threads=1)
    rms = np.sqrt(np.mean([rig.rms_m**2 for rig in rigs]))
    assert rms == pytest.approx(case.predicted_rms_m(), rel=0.06)
    assert all(rig.p95_m == pytest.approx(1.96 * rms, rel=0.4) for rig in rigs)


def test_drawn_rigs_are_judged_by_what_was_asked_not_by_what_was_planned(
    handmade, plan, case
):
    required = plan.requirements

    def tighten(document):
        names = ("dominant_coverage", "coverage", "region_coverage")
        asked = {name: getattr(required, name) for name in names}
        asked |= {"quantile": 0.95, "mounting": {}}
        asked["max_sigma_m"] = required.triangulation.max_sigma_m
        document["requirements"]["robust"] = asked
        document["requirements"]["triangulation"]["max_sigma_m"] = 1e-6

    tight = BuiltCase.of(handmade.tampered(plan, tighten), _OFF, threads=1)
    assert np.array_equal(tight.planned.measured, case.planned.measured)


def test_errors_over_many_rigs_are_those_that_first_order_predicts(plan, case):
    question = question_of(plan, AS_PLANNED, _OFF, 3)
    rigs = draw(case, question, range(80), threads=1)
    rms = np.sqrt(np.mean([rig.rms_m**2 for rig in rigs]))
    assert rms == pytest.approx(case.predicted_rms_m(), rel=0.1)
    assert {rig.coverage for rig in rigs} == {rigs[0].coverage}


def test_a_projector_turned_away_lights_nothing_and_a_longer_lens_sees_less(case):
    by = np.zeros((len(case.rig.devices), 7))
    by[: len(case.rig.projectors), 4] = np.pi
    assert not case.outcome(case.rig.moved(by)).lit.any()
    by = np.zeros_like(by)
    by[len(case.rig.projectors) :, 6] = 8.0
    seen = case.outcome(case.rig.moved(by)).measured.sum()
    assert 0 < seen < 0.5 * case.planned.measured.sum()


def test_devices_move_along_their_own_axes_and_those_that_stand_stay(case):
    first, *others = case.rig.cameras
    rig = replace(case.rig, cameras=(replace(first, existing="C"), *others))
    by = np.zeros((len(rig.devices), 7))
    by[:, 2] = 0.01
    moved = rig.moved(by)
    for old, new in zip(rig.devices, moved.devices, strict=True):
        step = new.world_from_device[:3, 3] - old.world_from_device[:3, 3]
        along = 0.0 if old.existing else 0.01
        assert step == pytest.approx(along * old.world_from_device[:3, 2], abs=1e-12)
    projector = moved.projectors[0]
    ring = projector.world_from_ring[:3, 3] - rig.projectors[0].world_from_ring[:3, 3]
    assert ring == pytest.approx(0.01 * projector.world_from_device[:3, 2], abs=1e-12)


def test_deviates_have_the_stated_spread():
    rigs = [Deviates.drawn(5, 1, seed=1, stream=0, index=k) for k in range(400)]
    mounted = np.array([rig.mounted for rig in rigs]) * bounds_of(_LOOSE)
    assert np.abs(mounted).max(axis=(0, 1)) == pytest.approx(
        bounds_of(_LOOSE), rel=0.01
    )
    unknown = np.array([rig.unknown for rig in rigs]) * deviations_of(_OFF)
    rms = np.sqrt((unknown**2).sum(axis=2).mean())
    turns = np.sqrt((unknown[..., 3:6] ** 2).sum(axis=2).mean())
    assert turns == pytest.approx(_OFF.angle, rel=0.05)
    assert rms**2 - turns**2 == pytest.approx(_OFF.position_m**2, rel=0.1)


def test_a_rig_is_the_same_whatever_is_drawn_beside_it(plan, case):
    question = question_of(plan, _LOOSE, _OFF, 0)
    together = draw(case, question, range(6), threads=3)
    assert [draw(case, question, [k], threads=1)[0] for k in (4, 1)] == [
        together[4],
        together[1],
    ]
    assert len(set(together)) == 6
    assert draw(case, replace(question, seed=1), [4], threads=1) != [together[4]]


def _run(plan, question, folder, n, **options):
    file = StudyFile(folder / "tolerance.json", question)
    return tolerance_of(plan, question, n=n, file=file, threads=1, **options)


def test_a_longer_study_goes_on_from_a_shorter_one(plan, tmp_path, monkeypatch):
    question = question_of(plan, Mounting(angle=4e-3), _OFF, None)
    looked_at = Counter()
    drawn = Deviates.drawn.__func__

    def counted(cls, *sizes, **how):
        looked_at[how["stream"], how["index"]] += 1
        return drawn(cls, *sizes, **how)

    monkeypatch.setattr(Deviates, "drawn", classmethod(counted))
    monkeypatch.setattr(tolerance_module, "loosest", lambda *_, **__: None)
    first = _run(plan, question, tmp_path, 3)
    other = replace(question, mounting=AS_PLANNED)
    _run(plan, other, tmp_path, 2)
    looked_at.clear()
    longer = _run(plan, question, tmp_path, 5)
    assert sorted(index for _, index in looked_at) == [3, 4]
    assert longer.rigs[:3] == first.rigs
    assert longer.sensitivities == first.sensitivities
    whole = tolerance_of(plan, question, n=5, threads=2)
    assert whole.to_document() == longer.to_document()
    assert len(StudyFile(tmp_path / "tolerance.json", other).study.rigs) == 2
    gone = StudyFile(tmp_path / "tolerance.json", replace(question, plan="another"))
    assert gone.study.rigs == ()
    gone.save(gone.study)
    assert StudyFile(tmp_path / "tolerance.json", other).study.rigs == ()


def test_what_is_drawn_stays_when_a_run_is_interrupted(plan, tmp_path, monkeypatch):
    question = question_of(plan, AS_PLANNED, _OFF, None)
    real = BuiltCase.drawn
    left = iter(range(5))

    def until_interrupted(self, *what):
        if next(left, None) is None:
            raise KeyboardInterrupt
        return real(self, *what)

    monkeypatch.setattr(BuiltCase, "drawn", until_interrupted)
    cut = _run(plan, question, tmp_path, 50)
    assert cut.interrupted
    assert len(cut.rigs) == 4
    assert "INTERRUPTED" in tolerance_lines(cut)[0]
    assert len(StudyFile(tmp_path / "tolerance.json", question).study.rigs) == 4


@pytest.mark.parametrize("value", ['"0.5"', "NaN", "[]"])
def test_rigs_that_are_no_numbers_are_refused(plan, tmp_path, value):
    question = question_of(plan, AS_PLANNED, None, 0)
    path = tmp_path / "tolerance.json"
    _run(plan, question, tmp_path, 2)
    document = json.loads(path.read_text())
    document["studies"][0]["rigs"][1][0] = json.loads(value)
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="not a file of drawn rigs; move it"):
        StudyFile(path, question)


def test_another_file_is_left_alone(plan, tmp_path):
    path = tmp_path / "tolerance.json"
    path.write_text(json.dumps({"format": "mine"}))
    with pytest.raises(InputError, match="not a file of drawn rigs; move it"):
        StudyFile(path, question_of(plan, AS_PLANNED, None, None))
    assert json.loads(path.read_text()) == {"format": "mine"}


@pytest.mark.parametrize("quantile", [0.8, 0.95])
def test_loosest_mounting_is_the_quantile_of_what_each_rig_bears(quantile):
    # A rig is good if its first device stands within 1 mm of its place along x.
    def drawn(mounting, deviates):
        off = abs(mounting.position_m * deviates.mounted[0, 0])
        return Figures(1.0, float(off <= 1e-3), 1.0, 1.0, 0.0, 0.0)

    one = SimpleNamespace(devices=[None])
    case = SimpleNamespace(rig=one, target=[], drawn=drawn, calibration=PERFECT)
    asked = Asked(0.9, 0.9, 0.5, 0.9, None)
    for stated in (0.7e-3, 4e-3):
        found = loosest(
            case, asked, Mounting(stated), quantile, n=400, seed=0, threads=1
        )
        # |u| is uniform: the share that is good at a bound b is 1 mm / b.
        assert found.mounting.position_m == pytest.approx(1e-3 / quantile, rel=0.08)
        assert found.n_met >= quantile * found.n_rigs == quantile * 800
    for seed in range(8):
        found = loosest(case, asked, Mounting(1e-3), quantile, n=40, seed=seed)
        # Of the drawn rigs, and of the others.
        for stream in (DRAWN, CONFIRMING):
            good = sum(_good_rigs(drawn, found.mounting, 40, seed, stream))
            assert good >= quantile * 40
        assert found.scale > 0.0
    never = Asked(0.9, 1.1, 0.5, 0.9, None)
    assert loosest(case, never, Mounting(1e-3), 0.5, n=8, seed=0).scale == 0.0
    always = Asked(0.9, 0.0, 0.5, 0.9, None)
    assert loosest(case, always, Mounting(1e-3), 0.5, n=8, seed=0).largest_tried


def _good_rigs(drawn, mounting, n, seed, stream):
    for index in range(n):
        rig = Deviates.drawn(1, 0, seed=seed, stream=stream, index=index)
        yield drawn(mounting, rig).coverage


@pytest.mark.parametrize("quantile", [0.8, 0.95])
def test_where_no_mounting_will_do_a_calibration_does(quantile):
    # A rig's error is what its first device is turned by.
    class Case(SimpleNamespace):
        def calibrated(self, scale):
            return Case(**vars(self) | {"calibration": _OFF.times(scale)})

        def drawn(self, mounting, deviates):
            off = abs(self.calibration.angle * deviates.unknown[0, 3])
            return Figures(1.0, 1.0, 1.0, 1.0, off, off)

    one = SimpleNamespace(devices=[None])
    case = Case(rig=one, target=[], calibration=_OFF)
    asked = Asked(0.9, 0.9, 0.5, 0.9, 0.5 * _OFF.angle)
    found = loosest(case, asked, Mounting(1e-3), quantile, n=400, seed=0, threads=1)
    assert found.scale == 0.0
    expected = 0.5 / norm.ppf(0.5 + 0.5 * quantile)
    assert found.of_calibration == pytest.approx(expected, rel=0.1)
    assert found.calibration == _OFF.times(found.of_calibration)
    assert found.n_met >= quantile * 800


def test_what_is_asked_is_missed_by_name():
    good = Figures(0.9, 0.95, 0.5, 0.9, 3e-4, 1.0)
    asked = Asked(0.9, 0.95, 0.5, 0.9, 3e-4)
    assert asked.missed(good) == ()
    for name, value in (
        ("lit", 0.89),
        ("coverage", 0.94),
        ("worst_region", 0.49),
        ("completeness", 0.89),
        ("rms_m", 3.1e-4),
        ("rms_m", None),
    ):
        assert asked.missed(replace(good, **{name: value})) == (name,)
    assert replace(asked, rms_m=None).missed(replace(good, rms_m=1.0)) == ()


def test_noise_alone_is_no_limit_of_a_drawn_rig(plan):
    required = plan.requirements
    limits = required.triangulation
    assert Asked.of(required).rms_m == limits.max_sigma_m
    noise = replace(required, triangulation=replace(limits, accuracy_of="noise"))
    assert Asked.of(noise).rms_m is None


def test_sensitivities_are_those_of_errors_planted_one_by_one(plan, case):
    found = sensitivities(case, _LOOSE, threads=1)
    assert len(found) == 7 * len(case.rig.devices)
    by_name = {(one.device, one.direction): one for one in found}
    size = deviations_of(_OFF)[3]
    # Independent errors add up by squares; noise and principal points aside.
    every = sum(
        (one.rms_m / np.radians(0.1) * size) ** 2
        for one in found
        if one.direction in ("tilt", "pan", "roll")
    )
    every += sum(
        (one.rms_m / 1e-3 * deviations_of(_OFF)[0]) ** 2
        for one in found
        if one.direction in ("across", "up", "along")
    )
    noise = BuiltCase.of(plan, PERFECT, threads=1).predicted_rms_m()
    total = np.sqrt(every + noise**2)
    assert total == pytest.approx(case.predicted_rms_m(), rel=0.03)
    assert all(one.coverage >= 0.0 for one in by_name.values())
    assert max(one.coverage for one in by_name.values()) > 0.0
    expected = first_order(case, found, _LOOSE)
    assert expected.coverage_deviation > 0.0
    turns = {3: "tilt", 4: "pan", 5: "roll"}
    names = [device.id for device in case.rig.devices]
    row, column = max(
        ((row, column) for row in range(len(names)) for column in turns),
        key=lambda at: abs(by_name[names[at[0]], turns[at[1]]].slope),
    )
    by = np.zeros((len(names), 7))
    by[row, column] = _LOOSE.angle
    own = slice(0, case.n_target)
    there, back = (
        case.outcome(case.rig.moved(sign * by)).measured[own].sum() for sign in (1, -1)
    )
    whole, steps = case.by_cameras[own].sum(), _LOOSE.angle / np.radians(0.1)
    turn = by_name[names[row], turns[column]]
    assert turn.slope
    assert turn.bend
    before = case.planned.measured[own].sum()
    assert turn.slope == pytest.approx((there - back) / whole / (2.0 * steps))
    assert turn.bend == pytest.approx((there + back - 2.0 * before) / whole / steps**2)
    alone = first_order(case, [turn], _LOOSE)
    # The variance of a uniform deviate is a third of its bound's square.
    variance = steps**2 / 3.0
    assert alone.coverage_deviation == pytest.approx(abs(turn.slope) * variance**0.5)
    assert alone.coverage_shift == pytest.approx(0.5 * turn.bend * variance)
    none = first_order(case, found, AS_PLANNED)
    assert none.coverage_deviation == none.near_limits == 0.0
