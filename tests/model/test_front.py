"""Which points of a front no other dominates, and what a bound of samples says."""

import pytest

from planning.cli.lines.front_lines import front_lines
from planning.model.front import Front, FrontPoint, marked
from planning.model.words import percent


def point(p, c, measured, sigma, **others):
    return FrontPoint(
        **{
            "projectors": p,
            "cameras": c,
            "lit_m2": 1.0,
            "measured_m2": measured,
            "reachable_by_cameras_m2": 1.0,
            "at_most_m2": 1.0,
            "at_most_of_these_m2": None,
            "sigma_median_m": sigma,
            "sigma_p95_m": sigma,
            "frames": 1,
            "pixels": 1,
            "meets": False,
            "on_front": False,
            "lights": (),
            "views": (),
            "axes": None,
        }
        | others
    )


def front(*points, samples=400, area=1.0):
    return Front(
        area_m2=area,
        reachable_by_projectors_m2=area,
        samples=samples,
        fresh_samples=100,
        projector_candidates=1,
        camera_candidates=1,
        asked={},
        points=points,
    )


def on_front(*points, area=1.0):
    return [one.count for one in marked(points, area) if one.on_front]


def test_a_point_as_good_with_fewer_devices_dominates():
    few, many = point(1, 2, 0.8, 2e-4), point(1, 3, 0.8, 2e-4)
    assert on_front(few, many) == [(1, 2)]
    assert on_front(few, point(2, 1, 0.8, 2e-4)) == [(1, 2), (2, 1)]


def test_more_devices_stay_for_coverage_or_for_accuracy():
    few = point(1, 2, 0.8, 2e-4)
    assert on_front(few, point(1, 3, 0.802, 3e-4)) == [(1, 2), (1, 3)]
    assert on_front(few, point(1, 3, 0.8, 1.98e-4)) == [(1, 2), (1, 3)]


def test_what_prints_alike_is_alike():
    few = point(1, 2, 0.8, 2e-4)
    assert on_front(few, point(1, 3, 0.8004, 1.997e-4)) == [(1, 2)]
    # Shares are of the target, whatever its area.
    assert on_front(few, point(1, 3, 0.8004, 2e-4), area=0.1) == [(1, 2), (1, 3)]


def test_a_mark_never_contradicts_what_is_printed():
    """Halves of the last digit are rounded as they are printed."""
    for n in range(6, 12_000, 12):
        few, many, fine = n / 12_000, (n + 1) / 12_000, n / 12e6
        better = on_front(point(2, 3, few, 2e-4), point(2, 4, many, 2e-4))
        assert len(better) == len({percent(few), percent(many)})
        finer = on_front(point(2, 3, few, fine + 1e-9), point(2, 4, few, fine))
        told = {f"{1e3 * (fine + 1e-9):.3f}", f"{1e3 * fine:.3f}"}
        assert len(finer) == len(told)


def test_points_of_equal_figures_and_counts_dont_drop_each_other():
    one = point(1, 2, 0.8, 2e-4)
    assert on_front(one, one) == [(1, 2), (1, 2)]


def test_a_rig_that_measures_nothing_is_on_no_front():
    assert on_front(point(1, 1, 0.0, None)) == []


def test_a_bound_of_samples_is_raised_by_two_standard_errors_and_is_no_more_than_all():
    half, nearly = point(1, 1, 0.4, 1e-4, at_most_m2=1.0), point(1, 2, 0.4, 1e-4)
    among = front(half, nearly, samples=400, area=2.0)
    assert among.at_most_share(half) == pytest.approx(0.5 + 2.0 * 0.5 / 20.0)
    assert among.at_most_share(nearly.changed(at_most_m2=1.999)) == 1.0


def test_what_falls_short_of_what_is_asked_is_rounded_down():
    asked = {name: 0.95 for name in ("dominant_coverage", "coverage", "min_reachable")}
    one = front(point(1, 2, 0.94996, 2e-4)).changed(
        asked=asked | {"region_coverage": 0.0}, reachable_by_projectors_m2=0.94996
    )
    _, target, _, row, *_ = front_lines(one, "ball", [])
    assert "(94.9 %) can be" in target
    assert "   94.9 %   " in row


def test_points_are_found_by_their_counts():
    among = front(point(1, 2, 0.4, 1e-4), point(2, 1, 0.5, 1e-4))
    found = among.point(2, 1)
    assert found is not None
    assert found.measured_m2 == 0.5
    assert among.point(2, 2) is None
