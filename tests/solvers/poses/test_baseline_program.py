"""The program that slides cameras apart, against closed forms and its own rules."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq
from support.closed_forms import round_body_limit

from geometry.poses import look_at
from planning.cameras.baselines.coverage_triangle import seam_angles
from solvers.poses.baseline_nlp import build_baseline_program
from solvers.poses.baseline_problem import (
    BaselineProblem,
    HalfSpaces,
    KeptPoints,
    PositionShell,
    SeamPoints,
)
from solvers.poses.baseline_program import solve_baseline
from solvers.status import SolveStatus

THETA = np.radians(60.0)
RADIUS, RING = 0.2, 1.0
Z = np.array([0.0, 0.0, 1.0])
NO_SEAMS = SeamPoints(
    np.zeros((0, 2), dtype=np.int64),
    *[np.zeros((0, 3))] * 3,
    np.zeros(0),
    np.zeros((0, 2)),
)
NOTHING_KEPT = KeptPoints(
    np.zeros(0, dtype=np.int64),
    np.zeros((0, 3)),
    np.zeros((0, 3)),
    np.zeros((0, 3)),
)
# No limit of the field: tangents of nearly a right angle.
WIDE = np.array([[-50.0, -50.0], [50.0, 50.0]])


def _on_ring(azimuth, radius=RING):
    return radius * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])


def _problem(centres, **changes):
    values = {
        "centres": np.array(centres, dtype=float),
        "aims": np.zeros((len(centres), 3)),
        "pairs": np.array([[0, 1]]),
        "shell": PositionShell(np.zeros(3), (RING, RING), Z, np.pi, Z),
        "seams": NO_SEAMS,
        "kept": NOTHING_KEPT,
        "rolls": np.zeros(len(centres)),
        "sides": WIDE,
        "max_incidence": THETA,
        "range_m": (0.1, 5.0),
        "min_conditioning": 0.1,
        "max_step": 5.0,
        **changes,
    }
    return BaselineProblem(**values)


def _kept(camera, points, normals, *, rings=None):
    points = np.array(points, dtype=float)
    return KeptPoints(
        np.array(camera, dtype=np.int64),
        points,
        np.array(normals, dtype=float),
        np.zeros_like(points) if rings is None else np.array(rings, dtype=float),
    )


def _round_body(half1, half2, half_fields=(1.5, 1.5)):
    """Cameras at -half1 and half2 about a disc; E is where each part truly ends."""
    eta = round_body_limit(RADIUS, RING, THETA).half_angle
    ends = np.array([eta - half1, half2 - eta])
    normals = np.stack([_on_ring(end, 1.0) for end in ends])
    onward = np.cross(Z, normals) * np.array([[1.0], [-1.0]])
    seams = SeamPoints(
        np.array([[0, 1], [1, 0]]),
        RADIUS * normals,
        normals,
        onward,
        np.zeros(2),
        np.array([half_fields, half_fields[::-1]]),
    )
    return _problem([_on_ring(-half1), _on_ring(half2)], seams=seams)


def test_cameras_round_a_disc_slide_to_the_closed_form():
    limit = round_body_limit(RADIUS, RING, THETA)
    half = 0.97 * limit.half_angle
    solution = solve_baseline(_round_body(half, half))
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL
    # The seam moves with the cameras; first order in that, so close to the limit.
    assert solution.smallest_baseline == pytest.approx(limit.d_max, rel=2e-3)
    np.testing.assert_allclose(np.linalg.norm(solution.centres, axis=1), RING)


def test_cameras_at_the_limit_stay():
    limit = round_body_limit(RADIUS, RING, THETA)
    solution = solve_baseline(_round_body(limit.half_angle, limit.half_angle))
    assert solution.smallest_baseline == pytest.approx(limit.d_max, rel=1e-5)


def test_the_field_holds_a_seam_as_incidence_does():
    """Cameras aim at the axis; E at the end of both fields allows no slide at all."""
    half = 0.5
    start = _round_body(half, half)
    seams = replace(
        start.seams,
        points=np.array([[RADIUS, 0.0, 0.0]] * 2),
        outward=np.array([[1.0, 0.0, 0.0]] * 2),
        onward=np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]),
    )
    ray = np.array([RADIUS, 0.0, 0.0]) - _on_ring(half)
    off_axis = np.arccos(ray @ -_on_ring(half) / np.linalg.norm(ray))
    for spare, gains in ((0.0, False), (0.02, True)):
        # Both orders start with a reserve of camera 1 that it may not spend.
        fields = np.array([[off_axis, off_axis + spare]] * 2)
        problem = replace(start, seams=replace(seams, half_fields=fields))
        solution = solve_baseline(problem)
        assert solution.status is SolveStatus.LOCALLY_OPTIMAL
        gained = solution.smallest_baseline - problem.smallest_baseline
        assert (gained > 1e-4) == gains


def test_kept_incidence_ends_where_the_disc_says():
    """Each camera must keep the same point: the optimum is 2 S sin(eta)."""
    limit = round_body_limit(RADIUS, RING, THETA)
    kept = _kept([0, 1], [[RADIUS, 0, 0]] * 2, [[1, 0, 0]] * 2)
    solution = solve_baseline(_problem([_on_ring(-0.3), _on_ring(0.2)], kept=kept))
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL
    assert solution.smallest_baseline == pytest.approx(limit.d_max, rel=1e-6)


def test_kept_field_and_conditioning_hold_at_the_answer():
    point, ring = np.array([RADIUS, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
    start = [_on_ring(-0.2), _on_ring(0.5)]
    rings = [-ring, ring]  # m.r > 0 for both at the start.
    narrow = np.tan(0.11) * np.array([[-1.0, -1.0], [1.0, 1.0]])

    def in_image(centre):
        local = (point - centre) @ look_at(centre, np.zeros(3), Z)[:3, :3]
        return np.abs(local[:2] / local[2])

    for sides, least in ((narrow, 0.1), (WIDE, 0.3)):
        kept = _kept([0, 1], [point] * 2, [[1, 0, 0]] * 2, rings=rings)
        problem = _problem(start, kept=kept, sides=sides, min_conditioning=least)
        solution = solve_baseline(problem)
        assert solution.status is SolveStatus.LOCALLY_OPTIMAL
        assert solution.smallest_baseline > problem.smallest_baseline
        for centre, m, begin in zip(solution.centres, rings, start, strict=True):
            ray = (point - centre) / np.linalg.norm(point - centre)
            begin_ray = (point - begin) / np.linalg.norm(point - begin)
            widest = np.maximum(sides[1], in_image(begin))
            np.testing.assert_array_less(in_image(centre), 1.001 * widest)
            assert ray @ m >= min(least, begin_ray @ m) - 1e-7
    # Without the field the pair is held by conditioning alone, farther apart.
    assert np.any(in_image(solution.centres[1]) > narrow[1])


@pytest.mark.parametrize("limit", ["sigma", "pitch"])
def test_kept_ring_limits_bind_at_the_answer_and_nowhere_beyond(limit):
    point, normal = np.array([RADIUS, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    m = np.array([-0.9, -0.3, np.sqrt(0.1)])  # m.r falls as the camera goes round.
    start = [_on_ring(-0.35), _on_ring(0.1)]

    def left(centre, coefficient):
        r = (point - centre) / np.linalg.norm(point - centre)
        spread = np.linalg.norm(np.cross(r, np.cross(normal, m)))
        have = r @ m if limit == "sigma" else -normal @ r
        return have - coefficient * np.linalg.norm(point - centre) * spread

    # A limit that the start keeps with a little to spare, coefficient in 1/m.
    coefficient = brentq(lambda q: left(start[0], q) - 0.02, 0.0, 10.0)
    kept = _kept([0], [point], [normal], rings=[m])
    tight = replace(kept, **{limit: np.array([coefficient])})
    problem = _problem(start, kept=kept, min_conditioning=-1.0, max_step=0.6)
    free = solve_baseline(problem)
    held = solve_baseline(replace(problem, kept=tight))
    assert held.status is SolveStatus.LOCALLY_OPTIMAL
    assert left(free.centres[0], coefficient) < -1e-3
    assert left(held.centres[0], coefficient) == pytest.approx(0.0, abs=1e-5)
    assert problem.smallest_baseline < held.smallest_baseline < free.smallest_baseline


def test_what_is_past_a_limit_at_the_start_gets_no_worse():
    point, normal = [RADIUS, 0.0, 0.0], [1.0, 0.0, 0.0]
    steep = _on_ring(1.3)  # Beyond 60 degrees of incidence already.
    kept = _kept([1], [point], [normal])
    solution = solve_baseline(_problem([_on_ring(-0.2), steep], kept=kept))
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL
    assert solution.smallest_baseline > 1.6  # Camera 0 went round on its own.
    to = solution.centres[1] - point
    before = (steep - point)[0] / np.linalg.norm(steep - point)
    assert to[0] / np.linalg.norm(to) >= before - 1e-7


def test_workspace_and_step_bound_the_centres():
    shell = PositionShell(
        np.zeros(3), (0.9, 1.2), np.array([1.0, 0, 0]), 0.6, Z, floor=0.1
    )
    start = [[1.0, -0.1, 0.2], [1.0, 0.1, 0.2]]
    solution = solve_baseline(_problem(start, shell=shell))
    distance = np.linalg.norm(solution.centres, axis=1)
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL
    assert np.all(distance <= 1.2 + 1e-6)
    assert np.all(solution.centres[:, 0] >= np.cos(0.6) * distance - 1e-6)
    assert np.all(solution.centres[:, 2] >= 0.1 - 1e-6)
    # Both go to the rim of the cone at the largest radius, on opposite sides; the
    # floor makes the chord shorter than the cone's diameter.
    rim = np.sqrt((1.2 * np.sin(0.6)) ** 2 - 0.1**2)
    assert solution.smallest_baseline == pytest.approx(2.0 * rim, rel=1e-5)
    short = solve_baseline(_problem(start, shell=shell, max_step=0.05))
    moves = np.linalg.norm(short.centres - np.array(start), axis=1)
    assert np.all(moves <= 0.05 + 1e-6)
    assert short.smallest_baseline == pytest.approx(0.3, abs=2e-3)


def test_the_smallest_of_several_baselines_is_raised():
    """Three cameras in a plane, free to go: the optimum is the equilateral triangle."""
    flat = _kept([], np.zeros((0, 3)), np.zeros((0, 3)))
    centres = [_on_ring(0.0), _on_ring(0.4), _on_ring(2.5)]
    pairs = np.array([[0, 1], [1, 2], [0, 2]])
    problem = _problem(centres, pairs=pairs, kept=flat)
    solution = solve_baseline(problem)
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL
    assert solution.smallest_baseline == pytest.approx(np.sqrt(3.0), rel=1e-5)


def test_elastic_cameras_close_a_hole_at_d_max():
    """1.1 eta to either side of the hole: (10) is violated at both ends, then just met.

    Of what closes the hole the nearest is taken: the baseline ends at 2 S sin(eta).
    """
    limit = round_body_limit(RADIUS, RING, THETA)
    start = _parted(1.1 * limit.half_angle)
    solution = solve_baseline(start)
    assert solution.status is SolveStatus.LOCALLY_OPTIMAL
    d = np.linalg.norm(np.subtract(*solution.centres))
    assert np.linalg.norm(np.subtract(*start.centres)) > 1.05 * limit.d_max
    assert d == pytest.approx(limit.d_max, rel=2e-3)
    np.testing.assert_allclose(solution.slack, 0.0, atol=1e-3)
    # A hole that cameras can't come near enough to leaves what they can't do.
    held = solve_baseline(replace(start, max_step=0.02))
    assert held.slack.sum() > 0.05


def _parted(apart):
    """Cameras at -apart and apart; each part ends at E, where its margin is 0."""
    problem = _round_body(apart, apart)
    normals = problem.seams.outward
    ends = np.array([0, 1, 1, 0]), np.tile(RADIUS * normals, (2, 1))
    kept = _kept(*ends, np.tile(normals, (2, 1)))
    elastic = {"weights": np.ones(2), "reserves": np.zeros(2), "kept": kept}
    return replace(problem, seams=NO_SEAMS, **elastic)


def test_a_camera_that_gains_at_the_end_of_its_part_closes_the_hole_alone():
    """The other is fixed, so that the whole gap is the first one's to close."""
    limit = round_body_limit(RADIUS, RING, THETA)
    solution = solve_baseline(replace(_parted(1.1 * limit.half_angle), fixed=(1,)))
    d = np.linalg.norm(np.subtract(*solution.centres))
    # A sum of cosines is the stricter, the more unequal the angles are.
    assert 0.99 * limit.d_max < d < limit.d_max
    np.testing.assert_allclose(solution.slack, 0.0, atol=1e-3)
    # What the part doesn't end by must be used up first.
    spare = replace(_parted(1.1 * limit.half_angle), reserves=np.full(2, 0.05))
    nearer = np.linalg.norm(np.subtract(*solve_baseline(spare).centres))
    assert nearer < 0.98 * limit.d_max


@pytest.mark.parametrize(("from_", "up"), [((1.0, 0, 0), Z), (Z, (0, 1.0, 0))])
def test_elastic_cameras_roll_to_what_a_wide_image_holds(from_, up):
    """A strip square to the image's long side, which the camera can only turn to.

    Seen from above the shell's up is no up.
    """
    from_, up, side = np.array(from_), np.array(up), np.array([0.2, 0.05])
    problem = _problem(
        RING * from_[None],
        kept=_kept([0, 0], [RADIUS * from_ + z * up for z in (-0.1, 0.1)], [from_] * 2),
        ups=up[None],
        sides=np.array([-side, side]),
        pairs=np.zeros((0, 2), dtype=np.int64),
        weights=np.ones(2),
        # From upright no turn is better than another.
        rolls=np.array([0.3]),
        max_step=0.02,
    )
    solution = solve_baseline(problem)
    # Outside by 0.125 cos(roll) - 0.05.
    assert solution.rolls[0] == pytest.approx(0.8, abs=0.01)
    again = solve_baseline(replace(problem, rolls=solution.rolls))
    np.testing.assert_allclose(again.slack, 0.0, atol=1e-3)


def test_elastic_cameras_turn_to_what_is_outside_their_image():
    """A point 20 degrees off an axis, a field of 10 to either side, no room to move."""
    point = np.array([RADIUS, 0.0, 0.0])
    centre = np.array([RING, 0.0, 0.0])
    aim = centre + (RING - RADIUS) * np.array(
        [-np.cos(np.radians(20.0)), np.sin(np.radians(20.0)), 0.0]
    )
    side = np.tan(np.radians(10.0))
    kept = _kept([0], [point], [[1.0, 0.0, 0.0]])
    problem = _problem(
        [centre],
        aims=aim[None],
        kept=kept,
        sides=side * np.array([[-1.0, -1.0], [1.0, 1.0]]),
        pairs=np.zeros((0, 2), dtype=np.int64),
        shell=PositionShell(np.zeros(3), (RING, RING), Z, 1e-3, Z),
        weights=np.ones(1),
    )
    problem = replace(problem, shell=replace(problem.shell, axis=centre / RING))
    solution = solve_baseline(problem)
    (turned,), (stands,) = solution.aims, solution.centres
    axis = (turned - stands) / np.linalg.norm(turned - stands)
    ray = (point - stands) / np.linalg.norm(point - stands)
    assert np.degrees(np.arccos(axis @ ray)) == pytest.approx(10.0, abs=0.1)
    assert np.linalg.norm(stands - centre) < 2e-3


@pytest.mark.parametrize("heavy", [0, 1])
def test_what_weighs_less_gives_way(heavy):
    """One camera can't see two points that face apart."""
    normals = np.array([_on_ring(-1.2, 1.0), _on_ring(1.2, 1.0)])
    problem = _problem(
        [_on_ring(0.0)],
        kept=_kept([0, 0], RADIUS * normals, normals),
        pairs=np.zeros((0, 2), dtype=np.int64),
        weights=np.where(np.arange(2) == heavy, 5.0, 1.0),
    )
    slack = solve_baseline(problem).slack
    assert slack[heavy] == pytest.approx(0.0, abs=1e-4)
    assert slack[1 - heavy] > 0.1


def test_derivatives_of_the_elastic_program_agree_with_finite_differences():
    problem = replace(_round_body(0.5, 0.6), rolls=np.array([0.3, -0.2]))
    problem = replace(problem, kept=_parted(0.5).kept, seams=NO_SEAMS)
    _check_derivatives(
        replace(problem, weights=np.ones(2), reserves=np.array([0.02, 0.03]))
    )
    turned = replace(problem, weights=np.ones(4), ups=np.array([[0.1, 0.3, 1.0]] * 2))
    _check_derivatives(turned)


def test_derivatives_agree_with_finite_differences():
    kept = _kept(
        [0, 1], [[RADIUS, 0.01, 0.02]] * 2, [[1, 0, 0]] * 2, rings=[[0, 1.0, 0]] * 2
    )
    _check_derivatives(replace(_round_body(0.5, 0.6), kept=kept))


def _check_derivatives(problem):
    program = build_baseline_program(problem)
    both = ca.vertcat(program.objective, program.constraints)
    value = ca.Function("g", [program.x], [both])
    slope = ca.Function("j", [program.x], [ca.jacobian(both, program.x)])
    x = program.start + np.random.default_rng(0).normal(0.0, 0.01, len(program.start))
    exact, step = np.array(slope(x)), 1e-6
    for i, unit in enumerate(np.eye(len(x))):
        change = np.array(value(x + step * unit) - value(x - step * unit)).ravel()
        np.testing.assert_allclose(exact[:, i], change / (2 * step), atol=1e-7)
    given = np.array(ca.densify(program.derivatives["jac_g"](x, [])[1]))
    np.testing.assert_allclose(given, exact[1:], atol=1e-12)
    _check_hessian(program, x)


def _check_hessian(program, x):
    """What is put together from kinds of rows is what CasADi makes of the whole."""
    scale, weights = 0.7, np.random.default_rng(1).normal(size=len(program.low))
    lagrangian = scale * program.objective + ca.dot(weights, program.constraints)
    whole = ca.Function("h", [program.x], [ca.hessian(lagrangian, program.x)[0]])
    given = program.derivatives["hess_lag"](x, [], scale, weights)
    expected = np.triu(np.array(ca.densify(whole(x))))
    np.testing.assert_allclose(np.array(ca.densify(given)), expected, atol=1e-10)


def test_seam_rows_are_what_the_signed_angles_leave():
    """An edge with a turn of 40 degrees; the margins come from `seam_angles`."""
    turn, halves = np.radians(40.0), (0.45, 0.6)
    normals = np.array([[0.0, 1.0, 0.0]]), np.array([[np.sin(turn), np.cos(turn), 0.0]])
    seams = SeamPoints(
        np.array([[0, 1]]),
        np.zeros((1, 3)),
        normals[0],
        np.array([[1.0, 0.0, 0.0]]),
        np.array([turn]),
        np.array([halves]),
    )
    start = np.array([[-0.3, 0.9, 0.0], [0.8, 0.7, 0.0]])
    aims = np.array([[-0.2, 0.0, 0.0], [0.2, -0.1, 0.0]])
    problem = _problem(start, aims=aims, seams=seams)

    def margins(centres):
        axes = (aims - centres) / np.linalg.norm(aims - centres, axis=1, keepdims=True)
        angles = seam_angles(
            np.zeros((1, 3)),
            np.array([1.0, 0.0, 0.0]),
            centres=tuple(centres),
            axes=tuple(axes),
            normals=normals,
        )
        left1 = THETA - angles.iota1[0], halves[0] - angles.beta1[0]
        left2 = THETA - angles.iota2[0], halves[1] - angles.beta2[0]
        return left1, left2

    program = build_baseline_program(problem)
    g = ca.Function("g", [program.x], [program.constraints])
    moved = start + np.array([[-0.1, 0.05, 0.0], [0.15, 0.02, 0.0]])
    rows = np.array(g(np.append(moved.ravel(), 1.0))).ravel()[-4:]
    reserve = min(margins(start)[0])
    left1, left2 = margins(moved)
    expected = [a - reserve + b for a in left1 for b in left2]
    assert reserve > 0.05
    np.testing.assert_allclose(rows, expected)


def test_the_start_is_feasible_and_stated_once():
    program = build_baseline_program(_round_body(0.5, 0.6))
    g = ca.Function("g", [program.x], [program.constraints])
    at_start = np.array(g(program.start)).ravel()
    assert np.all(at_start >= program.low - 1e-12)
    assert np.all(at_start <= program.high + 1e-12)
    assert program.start[-1] == pytest.approx(2 * np.sin(0.55))


def test_the_same_problem_gives_the_same_answer():
    first, second = (solve_baseline(_round_body(0.7, 0.9)) for _ in range(2))
    np.testing.assert_array_equal(first.centres, second.centres)


def test_a_failed_solve_is_an_answer_without_a_point():
    nowhere = PositionShell(
        np.zeros(3), (RING, RING), Z, 0.1, Z
    )  # No start lies in the cone.
    hopeless = _problem([_on_ring(0.0), _on_ring(0.5)], shell=nowhere, max_step=0.01)
    solution = solve_baseline(hopeless)
    assert solution.status is SolveStatus.UNKNOWN
    assert not solution.status.has_point
    np.testing.assert_array_equal(solution.centres, hopeless.centres)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"pairs": np.zeros((0, 2), dtype=np.int64)}, "pairs must be"),
        ({"pairs": np.array([[0, 2]])}, "indices must lie in 0 to 1"),
        ({"pairs": np.array([[-1, 0]])}, "indices must lie in 0 to 1"),
        ({"aims": np.zeros((1, 3))}, "centres and aims"),
        ({"aims": np.stack([_on_ring(0.0)] * 2)}, "coincides"),
        ({"max_step": np.nan}, "max_step"),
        ({"max_step": 0.0}, "max_step"),
    ],
)
def test_guards(changes, message):
    with pytest.raises(ValueError, match=message):
        _problem([_on_ring(0.0), _on_ring(0.5)], **changes)


def test_a_half_space_holds_its_camera_alone():
    """Two cameras on a ring slide apart; camera 1 may go only to y = 0.3."""
    held = HalfSpaces(np.array([1]), np.array([[0.0, -1.0, 0.0]]), np.array([-0.3]))
    start = _problem([_on_ring(-0.1), _on_ring(0.1)], max_step=0.6)
    free = solve_baseline(start).centres
    solution = solve_baseline(replace(start, half_spaces=held))
    assert free[1, 1] > 0.5
    assert solution.centres[1, 1] == pytest.approx(0.3, abs=1e-4)
    assert solution.centres[0, 1] == pytest.approx(free[0, 1], abs=0.02)
    with pytest.raises(ValueError, match="camera indices"):
        replace(start, half_spaces=replace(held, camera=np.array([2])))


def test_a_camera_that_stands_already_stays_wherever_it_is():
    start = _problem([1.7 * _on_ring(-0.1), _on_ring(0.1)], max_step=0.6)
    solution = solve_baseline(replace(start, fixed=(0,)))
    assert np.array_equal(solution.centres[0], 1.7 * _on_ring(-0.1))
    assert np.linalg.norm(solution.centres[1]) == pytest.approx(RING)
    assert np.linalg.norm(solution.centres[1] - _on_ring(0.1)) > 0.5
    with pytest.raises(ValueError, match="camera indices"):
        replace(start, fixed=(2,))
