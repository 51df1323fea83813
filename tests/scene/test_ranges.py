"""Ranges by least squares: points, their sphere, and what isn't known of it."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from geometry.shapes.best_sphere import BestSphere, fit_sphere
from geometry.shapes.sight_lines import SightLines, locate
from planning.cameras.camera_routes import widest_routes
from planning.model.errors import InfeasibleLimitsError, InputError
from planning.model.plan import RigPlan
from planning.pipeline import plan_rig
from planning.report.entries.range_entries import limits_at, with_spread
from planning.report.summary.ring_lines import range_lines
from planning.rig.range_guard import guarded
from planning.rig.rig import load_rig
from planning.scene.ranges.range_file import read_range_file
from planning.scene.ranges.ranged_body import read_ranges
from planning.verify.audit.audit_case import examine
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.baselines.range_claims import audit_ranges

HEADER = "point,x_mm,y_mm,z_mm,dx,dy,dz,sigma_deg"
RANGED = HEADER + ",range_mm,sigma_mm"
CENTRE, RADIUS = np.array([0.1, -0.05, 0.3]), 0.06
SIGMA_DEG = 0.03


def directions(n):
    """Well spread over the sphere, shape (n, 3)."""
    z, turn = np.linspace(-0.9, 0.9, n), 2.4 * np.arange(n)
    side = np.sqrt(1.0 - z * z)
    return np.column_stack([side * np.cos(turn), side * np.sin(turn), z])


def viewpoints(point, outward):
    """Three viewpoints 0.97 m from a point, 21 degrees off its normal."""
    sides = np.cross(outward, np.eye(3))
    sides /= np.linalg.norm(sides, axis=1)[:, None]
    return point + 0.9 * outward + 0.35 * sides


def sights(n=14, sigma_deg=SIGMA_DEG, seed=None, radius=RADIUS):
    """Rows (name, O [m], r) of points on the ball, with noise where there's a seed."""
    rng, rows = np.random.default_rng(seed), []
    for name, outward in enumerate(directions(n)):
        point = CENTRE + radius * outward
        for origin in viewpoints(point, outward):
            ray = (point - origin) / np.linalg.norm(point - origin)
            if seed is not None:
                ray = ray + np.radians(sigma_deg) * rng.normal(size=3)
            rows.append((f"p{name}", origin, ray / np.linalg.norm(ray)))
    return rows


def write(path, rows, sigma_deg=SIGMA_DEG):
    lines = [
        ",".join([name, *(f"{1e3 * x:.9f}" for x in origin), *map(repr, ray.tolist())])
        + f",{sigma_deg}"
        for name, origin, ray in rows
    ]
    path.write_text("\n".join([HEADER, *lines]) + "\n")
    return path


def lines_of(rows, sigma, ranges=None, range_sigma=np.nan):
    n = len(rows)
    return SightLines(
        np.array([origin for _, origin, _ in rows]),
        np.array([ray for _, _, ray in rows]),
        np.full(n, sigma),
        np.full(n, np.nan) if ranges is None else np.array(ranges),
        np.full(n, range_sigma),
    )


def test_exact_rays_meet_in_the_exact_point():
    rows = sights()[:3]
    found = locate(lines_of(rows, 1e-3))
    truth = CENTRE + RADIUS * directions(14)[0]
    np.testing.assert_allclose(found.position, truth, atol=1e-13)
    assert found.chi_square < 1e-18
    assert found.n_free == 3


def test_without_weights_it_is_the_closed_form_of_the_paper():
    """Viewpoints equally far: weights are alike, whatever the rays miss each other."""
    point = np.array([0.2, 0.1, 0.0])
    rng = np.random.default_rng(1)
    origins = point + 1.0 * directions(5)
    rays = point - origins + 1e-4 * rng.normal(size=(5, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    across = [np.eye(3) - np.outer(r, r) for r in rays]
    closed = np.linalg.solve(
        sum(across), sum(a @ o for a, o in zip(across, origins, strict=True))
    )
    rows = [("p", o, r) for o, r in zip(origins, rays, strict=True)]
    found = locate(lines_of(rows, 1e-4)).position
    assert np.linalg.norm(closed - point) > 1e-5
    # Of unlike distances only the disagreement itself, times 1e-4, is left.
    np.testing.assert_allclose(found, closed, atol=3e-8)


def test_a_near_view_counts_for_more_than_a_far_one():
    """Two parallel-plane sights that miss each other: means weighted by 1/t^2."""
    origins = [np.array([-1.0, 0.0, 0.0]), np.array([0.0, -3.0, 1e-3])]
    rows = [("p", origins[0], np.eye(3)[0]), ("p", origins[1], np.eye(3)[1])]
    found = locate(lines_of(rows, 1e-3))
    assert found.position[2] == pytest.approx(1e-3 / (1.0 + 9.0), rel=1e-3)
    assert found.chi_square == pytest.approx(1e-6 / (1e-6 * (1.0 + 9.0)), rel=1e-3)
    assert found.covariance[2, 2] == pytest.approx(1e-6 / (1.0 + 1.0 / 9.0), rel=1e-3)


def test_a_distance_alone_is_a_point_with_the_covariance_of_its_parts():
    row = [("p", np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, -1.0]))]
    found = locate(lines_of(row, 1e-3, [1.5], 4e-3))
    np.testing.assert_allclose(found.position, [0.0, 0.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(
        np.diag(found.covariance), [1.5e-3**2, 1.5e-3**2, 4e-3**2], rtol=1e-9
    )
    assert found.n_free == 0


def test_covariance_is_that_of_monte_carlo():
    rng, rows, sigma = np.random.default_rng(4), sights()[:3], 2e-3
    drawn = []
    for _ in range(2000):
        noisy = []
        for name, origin, ray in rows:
            bent = ray + sigma * rng.normal(size=3)
            noisy.append((name, origin, bent / np.linalg.norm(bent)))
        drawn.append(locate(lines_of(noisy, sigma)))
    spread = np.cov(np.array([d.position for d in drawn]).T)
    truth = locate(lines_of(rows, sigma)).covariance
    np.testing.assert_allclose(spread, truth, atol=0.1 * np.abs(truth).max())
    assert np.mean([d.chi_square for d in drawn]) == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize(
    ("rays", "message"),
    [
        ([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]], "parallel"),
        ([[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0]], "behind"),
    ],
)
def test_lines_that_hold_no_point_say_so(rays, message):
    rays = np.array(rays) / np.linalg.norm(rays, axis=1)[:, None]
    rows = [("p", np.array([float(k), 0.0, 0.0]), ray) for k, ray in enumerate(rays)]
    with pytest.raises(ValueError, match=message):
        locate(lines_of(rows, 1e-3))


def test_exact_points_give_the_exact_sphere():
    points = CENTRE + RADIUS * directions(5)
    found = fit_sphere(points, np.tile(1e-6 * np.eye(3), (5, 1, 1)))
    np.testing.assert_allclose(found.centre, CENTRE, atol=1e-13)
    assert found.radius == pytest.approx(RADIUS, abs=1e-13)
    assert found.shape_sigma == 0.0


def test_covariance_of_the_sphere_is_that_of_monte_carlo():
    rng, points = np.random.default_rng(5), CENTRE + RADIUS * directions(12)
    spread = np.array([1e-4, 1e-4, 4e-4])
    covariances = np.tile(np.diag(spread**2), (12, 1, 1))
    drawn = []
    for _ in range(200):
        # Where chance makes points stray by more than they should, so does the answer.
        found = fit_sphere(points + spread * rng.normal(size=(12, 3)), covariances)
        drawn.append(np.append(found.centre, found.radius))
    truth = fit_sphere(points, covariances).covariance
    found = np.cov(np.array(drawn).T)
    np.testing.assert_allclose(found, truth, atol=0.3 * np.abs(truth).max())


def test_bumps_are_told_from_noise_and_make_the_sphere_uncertain():
    rng, u = np.random.default_rng(6), directions(200)
    points = CENTRE + (RADIUS + 3e-3 * rng.normal(size=200))[:, None] * u
    points = points + 1e-3 * rng.normal(size=points.shape)
    found = fit_sphere(points, np.tile(1e-6 * np.eye(3), (200, 1, 1)))
    assert found.shape_sigma == pytest.approx(3e-3, rel=0.2)
    assert found.chi_square == pytest.approx(196.0, rel=1e-6)
    assert found.covariance[3, 3] == pytest.approx(1e-5 / 200, rel=0.3)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.eye(3), "3 points"),
        (np.column_stack([directions(9)[:, :2], np.zeros(9)]), "plane"),
    ],
)
def test_points_that_fix_no_sphere_say_so(points, message):
    with pytest.raises(ValueError, match=message):
        fit_sphere(points, np.tile(np.eye(3), (len(points), 1, 1)))


def test_millimetres_degrees_and_lengths_of_directions(tmp_path):
    file = tmp_path / "o.csv"
    file.write_text(
        f"# trial views\n\n{RANGED}\n a , 1000,0,-250, 0,0,-4, 0.5, 750, 2\n"
        f"b,0,0,0,3,0,4,1,,\n"
    )
    one, two = read_range_file(file).observations
    assert one.line == 4
    assert (one.point, one.origin_m, one.direction) == (
        "a",
        (1.0, 0.0, -0.25),
        (0.0, 0.0, -1.0),
    )
    assert one.sigma_rad == pytest.approx(np.radians(0.5))
    assert (one.range_m, one.range_sigma_m) == (0.75, 0.002)
    assert two.direction == pytest.approx((0.6, 0.0, 0.8))
    assert two.range_m is None


GOOD = "a,0,0,0,0,0,1,0.1"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "lacks 'point'"),
        (HEADER, "no observation"),
        (HEADER.replace("sigma_deg", "sigma"), "lacks 'sigma_deg'"),
        (HEADER + ",colour\n" + GOOD + ",red", "doesn't know 'colour'"),
        (HEADER + ",dx\n" + GOOD + ",1", "names dx twice"),
        (HEADER + ",range_mm\n" + GOOD + ",1", "go together"),
        (f"{HEADER}\n{GOOD},7", r"line 2: 9 cells, the header has 8"),
        (f"{HEADER}\n,0,0,0,0,0,1,0.1", "point is empty"),
        (f"{HEADER}\n{GOOD}\na,0,0,x,0,0,1,0.1", "line 3: z_mm = 'x' must be a number"),
        (f"{HEADER}\na,0,0,nan,0,0,1,0.1", "z_mm = nan must be finite"),
        (f"{HEADER}\na,0,0,1000000001,0,0,1,0.1", "z_mm = 1000000001 must be finite"),
        (f"{HEADER}\na,0,0,0,0,0,0,0.1", "no direction"),
        (f"{HEADER}\na,0,0,0,0,0,1,0", "sigma_deg = 0 must be over 0"),
        (f"{HEADER}\na,0,0,0,0,0,1,7", "at most 5"),
        (f"{RANGED}\n{GOOD},5,", "range_mm without sigma_mm"),
        (f"{RANGED}\n{GOOD},-5,1", "range_mm = -5 must be positive"),
        (f"{RANGED}\n{GOOD},5,0", "sigma_mm = 0 must be positive"),
        (f'{HEADER}\na,"0', "quote no cell"),
        (f"{HEADER}\n{GOOD}", "seen once and without a distance"),
        (
            f"{HEADER}\n{GOOD}\nb,0,0,0,0,0,1,1\nb,1,0,0,-0.001,0,1,1",
            "too near to each",
        ),
    ],
)
def test_files_that_hold_no_object_are_refused_with_line_and_rule(
    text, message, tmp_path
):
    file = tmp_path / "o.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_ranges(file)
    assert str(file) in str(caught.value)


def test_a_file_that_is_not_there_or_no_text(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_ranges(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="utf-8"):
        read_ranges(tmp_path / "b.csv")


def test_one_wrong_row_is_named_and_the_point_kept(tmp_path):
    rows = sights(seed=2)
    bend = np.array([0.0, 0.0, 0.02])
    rows[16] = (rows[16][0], rows[16][1], rows[16][2] + bend)
    body = read_ranges(write(tmp_path / "o.csv", rows))
    (refused,) = body.refused
    assert (refused.name, refused.lines) == ("p5", (18,))
    assert "without this row they agree" in refused.reason
    assert len(body.points) == 14
    assert body.points[5].lines == (17, 19)
    assert np.linalg.norm(body.ball.centre - CENTRE) < 2e-3


def test_where_two_sights_disagree_the_point_goes(tmp_path):
    rows = sights(seed=2)
    # Bent out of the plane of the two, so that they miss each other.
    bend = 0.02 * np.cross(rows[0][2], rows[1][2]) / 0.35
    rows[0] = (rows[0][0], rows[0][1], rows[0][2] + bend)
    del rows[2]
    body = read_ranges(write(tmp_path / "o.csv", rows))
    assert [(one.name, one.lines) for one in body.refused] == [("p0", (2, 3))]
    assert "none stands out" in body.refused[0].reason
    assert len(body.points) == 13


def test_where_any_row_may_be_the_wrong_one_the_point_goes(tmp_path):
    """Three sights in one plane: whichever is left out, the others meet."""
    rows = sights()
    point = CENTRE + RADIUS * directions(14)[0]
    for k, aim in enumerate((0.0, 0.0, 0.02)):
        origin = point + np.array([0.4 * (k - 1), -0.9, 0.0])
        ray = point + [aim, 0.0, 0.0] - origin
        rows[k] = ("p0", origin, ray / np.linalg.norm(ray))
    body = read_ranges(write(tmp_path / "o.csv", rows))
    assert [(one.name, one.lines) for one in body.refused] == [("p0", (2, 3, 4))]


def test_noise_of_the_stated_size_is_not_refused(tmp_path):
    for seed in range(5):
        body = read_ranges(write(tmp_path / "o.csv", sights(seed=seed)))
        assert not body.refused
        off = np.append(body.ball.centre - CENTRE, body.ball.radius - RADIUS)
        assert off @ np.linalg.solve(body.ball.covariance, off) < 15.0


def test_seen_from_one_side_the_far_one_is_known_worst(tmp_path):
    rows = [row for row in sights(30, seed=1) if row[1][2] > CENTRE[2] + 0.3]
    body = read_ranges(write(tmp_path / "o.csv", rows))
    assert body.least_known[2] < -0.7
    whole = read_ranges(write(tmp_path / "all.csv", sights(30, seed=1)))
    assert body.position_sigma_m > 2.0 * whole.position_sigma_m


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ranges")
    return read_ranges(write(folder / "o.csv", sights(seed=5)))


def test_the_surface_is_the_sphere_in_the_axes_of_the_file(body):
    reach = np.linalg.norm(body.mesh.vertices - body.ball.centre, axis=1)
    np.testing.assert_allclose(reach, body.ball.radius, rtol=1e-12)


def test_position_sigma_bounds_every_surface_point(body):
    rng = np.random.default_rng(0)
    u = rng.normal(size=(300, 3))
    u /= np.linalg.norm(u, axis=1)[:, None]
    spread = np.sqrt(np.linalg.eigvalsh(body.ball.point_covariances(u))[:, 2])
    assert spread.max() <= 1.001 * body.position_sigma_m
    assert spread.max() > 0.98 * body.position_sigma_m


def test_surface_points_vary_as_centre_radius_and_bumps_do():
    rng = np.random.default_rng(8)
    root = 1e-3 * np.tril(rng.normal(size=(4, 4)))
    ball = BestSphere(CENTRE, RADIUS, root @ root.T, 2e-3, np.zeros(5), 0.0)
    u = directions(7)[4]
    state = rng.normal(size=(40_000, 4)) @ root.T
    bumps = 2e-3 * rng.normal(size=(40_000, 1))
    drawn = np.cov((state[:, :3] + (state[:, 3:] + bumps) * u).T)
    np.testing.assert_allclose(
        ball.point_covariances(u[None])[0], drawn, atol=0.03 * np.abs(drawn).max()
    )


def test_two_sigma_are_kept_free_of_every_limit(body):
    rig = load_rig("default")
    tight, guard = guarded(rig, body)
    two = 2.0 * body.position_sigma_m
    assert guard.length_m == pytest.approx(two)
    assert tight.standoff_m == rig.standoff_m
    assert tight.standoff_play_m == pytest.approx(rig.standoff_play_m - two)
    for name in ("projector_device", "camera_device"):
        low, high = getattr(rig, name)().range_m
        expected = (low + two, high - two)
        assert getattr(tight, name)().range_m == pytest.approx(expected, abs=1e-12)
    turn = np.degrees(np.arcsin(two / 0.95))
    assert guard.angle_rad == pytest.approx(np.radians(turn))
    for name, limit in (("projector", 60.0), ("camera", 70.0)):
        left = getattr(tight.table.limits, f"{name}_max_incidence_deg")
        assert left == pytest.approx(limit - turn)


def test_a_body_known_too_badly_leaves_no_play(tmp_path):
    vague = write(tmp_path / "o.csv", sights(sigma_deg=3.0), sigma_deg=3.0)
    with pytest.raises(InfeasibleLimitsError, match=r"standoff_play_mm is 50; observe"):
        guarded(load_rig("default"), read_ranges(vague))


def test_the_sphere_has_no_dominant_regions_to_ask_for(body):
    with pytest.raises(InputError, match="no dominant region"):
        plan_rig(body, load_rig("default"), max_projectors=6, target="dominant")
    with pytest.raises(InputError, match="no faces to select"):
        plan_rig(body, load_rig("default"), max_projectors=6, select=[1])


@pytest.fixture(scope="module")
def plan(body, with_little_work, tmp_path_factory):
    """One side of the ball, few candidates, without the check from pixels."""
    rig = tmp_path_factory.mktemp("rig") / "few.toml"
    rig.write_text(
        'base = "default"\nname = "few"\n[placement]\nn_candidate_projectors = 40\n'
        "n_candidate_cameras = 60\nn_reference_projectors = 600\n"
        "n_reference_cameras = 400\n[requirements]\nmin_reachable = 0.1\n"
        '[workspace]\nshape = "cone"\naxis = [0, -1, 0]\nhalf_angle_deg = 22\n'
        "[calibration]\nangle_deg = 0.0\nposition_mm = 0.0\n"
    )
    spared: list[float] = []

    def noted(*words, spare_field):
        spared.append(spare_field)
        return widest_routes(*words, spare_field=spare_field)

    with with_little_work(), pytest.MonkeyPatch.context() as patch:
        patch.setattr("planning.steps.stages.widest_routes", noted)
        made = plan_rig(body, load_rig(rig), max_projectors=8, check=False)
    assert set(spared) == {made.to_document()["ranges"]["guard_rad"]}
    return made


@pytest.mark.long
def test_the_plan_carries_points_sphere_and_guard(plan, body):
    entry = plan.to_document()["ranges"]
    assert len(entry["observations"]) == 42
    assert entry["sphere"]["radius_m"] == body.ball.radius
    assert plan.requirements.target == "surface"
    assert plan.requirements.camera.max_incidence == pytest.approx(
        np.radians(70.0) - entry["guard_rad"]
    )
    least, most = plan.requirements.workspace.camera_radius_m
    width = 0.1 - 4.0 * body.position_sigma_m
    assert most - least == pytest.approx(width, abs=1e-9)
    text = "\n".join(range_lines(plan.document))
    assert "14 points" in text
    rows = plan.to_document()["baselines"]
    assert f"{len(rows)} of {len(rows)} rows" in text


@pytest.mark.long
def test_rows_keep_two_sigma_of_d_max(plan, body):
    """Against d_max of spheres drawn from the estimate's own covariance."""
    rng = np.random.default_rng(0)
    cameras = {camera.id: camera for camera in plan.cameras}
    assert plan.document.baselines
    for row in plan.document.baselines:
        assert row.covered_at_2_sigma is True
        assert row.d < row.d_max_stated - 2.0 * row.d_max_sigma
        assert row.d_max_stated >= row.d_max
        at = np.array(row.E)
        outward = (at - body.ball.centre) / np.linalg.norm(at - body.ball.centre)
        state = rng.multivariate_normal(np.zeros(4), body.ball.covariance, 3000)
        bumps = body.ball.shape_sigma * rng.normal(size=(3000, 1))
        moved = at + state[:, :3] + (state[:, 3:] + bumps) * outward
        one, two = (cameras[name] for name in row.cameras)
        drawn = limits_at(one, two, moved, row, np.radians(70.0))
        assert row.d_max_sigma == pytest.approx(np.std(drawn), rel=0.1)


@pytest.mark.long
def test_d_max_of_a_row_is_that_of_the_incidence_as_stated(plan, body):
    row = plan.document.baselines[0]
    _, guard = guarded(load_rig("default"), body)
    stated = {"camera.max_incidence": row.iota[1] + 0.05}
    (found,) = with_spread(
        [row], plan.cameras, body.ball, replace(guard, stated=stated)
    )
    d1, d2 = row.D1, row.D2
    square = d1**2 + d2**2 - 2.0 * d1 * d2 * np.cos(row.phi + 0.05)
    assert found.d_max_stated == pytest.approx(np.sqrt(square), rel=1e-9)
    stated = {"camera.max_incidence": row.iota[1] + 1e-5}
    (tight,) = with_spread(
        [row], plan.cameras, body.ball, replace(guard, stated=stated)
    )
    assert row.d < tight.d_max_stated
    assert tight.covered_at_2_sigma is False


def audited(plan, document):
    findings = AuditFindings()
    changed = RigPlan.from_document(document, plan.surface)
    audit_ranges(replace(_case(plan), plan=changed), findings)
    return findings.failures


@cache
def _case(plan):
    return examine(plan, seed=0, n_samples=100, threads=1)


@pytest.mark.long
def test_the_audit_finds_nothing_in_a_true_plan(plan):
    assert audited(plan, plan.to_document()) == ()


SPOILED = {
    "position_m": lambda r: r["points"][3]["position_m"].__setitem__(0, 0.2),
    "viewpoint": lambda r: r["observations"][7].update(
        direction=[-x for x in r["observations"][7]["direction"]]
    ),
    "a little off": lambda r: r["points"][3]["position_m"].__setitem__(
        2, r["points"][3]["position_m"][2] + 5e-6
    ),
    "points.p3.covariance_m2": lambda r: r["points"][3]["covariance_m2"][0].__setitem__(
        0, 1e-5
    ),
    "points.p3.chi_square": lambda r: r["points"][3].update(chi_square=0.1),
    "points.p3.n_free": lambda r: r["points"][3].update(n_free=5),
    "points.p3.residual_m": lambda r: r["points"][3].update(residual_m=1e-5),
    "observations": lambda r: r["points"].pop(),
    "significance": lambda r: r.update(significance=0.999),
    "sphere": lambda r: r["sphere"]["centre_m"].__setitem__(1, -0.0503),
    "sphere.covariance_m2": lambda r: r["sphere"]["covariance_m2"][3].__setitem__(
        3, 1e-9
    ),
    "sphere.shape_sigma_m": lambda r: r["sphere"].update(shape_sigma_m=2e-3),
    "sphere.chi_square": lambda r: r["sphere"].update(chi_square=1.0),
    "position_sigma_m": lambda r: r.update(position_sigma_m=1e-4),
    "guard_m": lambda r: r.update(guard_m=1e-4),
    "guard_rad": lambda r: r.update(guard_rad=1e-4),
    "standoff_play_m": lambda r: r["stated"].update(standoff_play_m=0.06),
    "camera.range_m.1": lambda r: r["stated"]["camera.range_m"].__setitem__(1, 2.0),
    "projector.max_incidence": lambda r: r["stated"].update(
        {"projector.max_incidence": 1.1}
    ),
    "broken": lambda r: r["stated"].pop("standoff_play_m"),
}


@pytest.mark.long
@pytest.mark.parametrize("what", SPOILED)
def test_the_audit_finds_each_false_claim(plan, what):
    document = plan.to_document()
    SPOILED[what](document["ranges"])
    failures = audited(plan, document)
    name = {"position_m": "points.p3", "a little off": "points.p3"}.get(what, what)
    assert any(name in failure for failure in failures), failures


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "value"),
    [("d_max_stated", 1.9), ("d_max_sigma", 1e-3), ("covered_at_2_sigma", False)],
)
def test_the_audit_finds_false_rows(plan, name, value):
    document = plan.to_document()
    document["baselines"][0][name] = value
    failures = audited(plan, document)
    assert any(name in failure for failure in failures), failures


@pytest.mark.long
def test_the_audit_finds_a_surface_that_is_not_the_sphere(plan):
    mesh = plan.surface.mesh
    grown = replace(mesh, vertices=mesh.vertices * 1.0001)
    other = RigPlan.from_document(plan.to_document(), replace(plan.surface, mesh=grown))
    failures = audited(other, other.to_document())
    assert any("surface.npz" in failure for failure in failures)


@pytest.mark.long
def test_a_plan_of_a_mesh_has_no_such_claims(plan):
    document = {k: v for k, v in plan.to_document().items() if k != "ranges"}
    assert audited(plan, document) == ()
    assert range_lines(RigPlan.from_document(document, plan.surface).document) == []


def test_documented_columns_are_those_that_are_read():
    text = (
        Path(__file__).resolve().parents[2] / "docs" / "use" / "ranges.md"
    ).read_text()
    for name in RANGED.split(","):
        assert f"`{name}`" in text or f"{name}," in text
