import numpy as np
import pytest

from geometry.devices import ParallelModel, PinholeModel
from geometry.distortion import distorted, least_at, slope

K = np.array([[1200.0, 0, 639.5], [0, 1180.0, 399.5], [0, 0, 1]])
DISTORTION = (-0.21, 0.08, 0.0011, -0.0007, 0.013)


def pinhole(distortion: tuple[float, ...] = (0.0,) * 5) -> PinholeModel:
    return PinholeModel(K, (1280, 800), (0.2, 2.0), distortion)  # type: ignore[arg-type]


def points(n: int = 200) -> np.ndarray:
    rng = np.random.default_rng(0)
    z = rng.uniform(0.4, 1.5, n)
    return np.column_stack(
        [rng.uniform(-0.4, 0.4, n) * z, rng.uniform(-0.3, 0.3, n) * z, z]
    )


def brown_conrady(x: float, y: float) -> tuple[float, float]:
    """OpenCV's formula, written out."""
    k1, k2, p1, p2, k3 = DISTORTION
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


def test_projection_is_opencvs_formula_point_by_point() -> None:
    at = points(20)
    found = pinhole(DISTORTION).project(at)
    for p, pixel in zip(at, found, strict=True):
        x, y = brown_conrady(p[0] / p[2], p[1] / p[2])
        expected = [1200.0 * x + 639.5, 1180.0 * y + 399.5]
        np.testing.assert_allclose(pixel, expected, rtol=1e-13)


def test_the_axis_meets_the_principal_point_and_right_and_down_are_positive() -> None:
    camera = pinhole()
    at = np.array([[0.0, 0, 1], [0.1, 0, 1], [0, 0.1, 1]])
    np.testing.assert_allclose(
        camera.project(at), [[639.5, 399.5], [759.5, 399.5], [639.5, 517.5]], rtol=1e-14
    )


@pytest.mark.parametrize("distortion", [(0.0,) * 5, DISTORTION])
def test_rays_undo_projection(distortion: tuple[float, ...]) -> None:
    camera = pinhole(distortion)
    at = points()
    rays = camera.rays(camera.project(at))
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0, rtol=1e-14)
    unit = at / np.linalg.norm(at, axis=1, keepdims=True)
    np.testing.assert_allclose(rays, unit, atol=1e-12)


@pytest.mark.parametrize("distortion", [(0.0,) * 5, DISTORTION])
def test_ray_jacobian_is_the_finite_difference_of_rays(
    distortion: tuple[float, ...],
) -> None:
    camera = pinhole(distortion)
    at = points(50)
    pixels, h = camera.project(at), 1e-3
    columns = []
    for k in range(2):
        step = h * np.eye(2)[k]
        columns.append(
            (camera.rays(pixels + step) - camera.rays(pixels - step)) / (2 * h)
        )
    numeric = np.stack(columns, axis=2)
    jacobian = camera.ray_jacobian(at)
    assert jacobian.shape == (50, 3, 2)
    scale = np.abs(numeric).max()
    np.testing.assert_allclose(jacobian, numeric, atol=1e-8 * scale)


def test_ray_jacobian_does_not_depend_on_depth() -> None:
    camera = pinhole(DISTORTION)
    at = points(20)
    np.testing.assert_allclose(
        camera.ray_jacobian(at), camera.ray_jacobian(3.0 * at), atol=1e-15
    )


def test_points_at_or_behind_the_centre_have_no_pixel_and_are_not_contained() -> None:
    camera = pinhole()
    pixels = camera.project(np.array([[0.0, 0, -1], [0, 0, 0], [0.1, 0, np.nan]]))
    assert np.isnan(pixels).all()
    assert not camera.contains(pixels).any()


@pytest.mark.parametrize(
    ("terms", "fold"),
    [
        ((0.0,) * 5, np.inf),
        ((0.2, 0.1, 0.0, 0.0, 0.0), np.inf),
        ((-0.35, 0.0, 0.0, 0.0, 0.0), 1.05**-0.5),
        ((0.0, -0.2, 0.0, 0.0, 0.0), 1.0),
        ((0.0, 0.0, 0.0, 0.0, -1.0 / 7.0), 1.0),
        ((0.0, 0.0, 0.03, -0.04, 0.0), 1.0 / 0.35),
        # It folds, and would unfold again.
        ((-2.0 / 3.0, 0.2, 0.0, 0.0, 0.0), 1.0),
        ((-0.35, 0.13, 0.0, 0.0, -0.018), None),
        (DISTORTION, None),
    ],
)
def test_before_the_fold_each_ray_has_a_pixel_of_its_own(terms, fold) -> None:
    camera = pinhole(terms)
    if fold is not None:
        assert camera.fold == pytest.approx(fold, rel=1e-6)
    rng, far = np.random.default_rng(0), min(camera.fold, 4.0)
    r, turn = far * np.sqrt(rng.uniform(size=2000)), rng.uniform(0, 2 * np.pi, 2000)
    p = np.column_stack([r * np.cos(turn), r * np.sin(turn)])
    assert np.linalg.eigvalsh(slope(p, terms)).min() > -1e-9
    if np.isfinite(camera.fold):
        aside = np.array([[1.001 * camera.fold, 0.0, 1.0], [0.0, 1e3, 1.0]])
        assert np.isnan(camera.project(aside)).all()
        assert not camera.in_field(aside).any()
        ends = camera.fold * np.column_stack([np.cos(turn), np.sin(turn)])
        least = np.hypot(*distorted(ends, terms).T).min()
        assert least_at(camera.fold, terms) <= least + 1e-9


def test_rays_are_found_though_pixels_lie_beyond_the_fold() -> None:
    """Outwards first, then back: where the steps would begin is no ray of the image."""
    matrix = np.array([[560.0, 0, 639.5], [0, 560.0, 511.5], [0, 0, 1]])
    terms = (0.45, 0.091, -0.004, 0.002, -0.132)
    camera = PinholeModel(matrix, (1280, 1024), (0.2, 2.0), terms)
    assert np.hypot(*(camera.corners[0] - matrix[:2, 2]) / 560.0) > 1.1 * camera.fold
    back = camera.project(camera.rays(camera.corners))
    np.testing.assert_allclose(back, camera.corners, atol=1e-6)


def test_the_image_reaches_half_a_pixel_beyond_the_outer_centres() -> None:
    camera = pinhole()
    pixels = np.array(
        [[-0.5, -0.5], [1279.5, 799.5], [-0.51, 5], [5, 799.51], [640, 400]]
    )
    np.testing.assert_array_equal(
        camera.contains(pixels), [True, True, False, False, True]
    )


def test_shapes_with_more_axes_go_through() -> None:
    camera = pinhole(DISTORTION)
    at = points(12).reshape(3, 4, 3)
    pixels = camera.project(at)
    assert pixels.shape == (3, 4, 2)
    np.testing.assert_array_equal(
        pixels.reshape(-1, 2), camera.project(at.reshape(-1, 3))
    )
    assert camera.rays(pixels).shape == (3, 4, 3)


def test_focal_length_and_panel_are_what_they_say() -> None:
    assert pinhole().focal_px == pytest.approx(np.sqrt(1200.0 * 1180.0))
    panel = ParallelModel((1000, 600), 2e-4, (0.5, 1.5))
    np.testing.assert_allclose(panel.half_panel, [0.1, 0.06], rtol=1e-15)
    assert panel.beam_radius is None


def test_a_beam_and_an_image_answer_the_same_questions_about_their_field() -> None:
    beam = ParallelModel((1000, 600), 1e-3, (0.5, 1.5), beam_radius=0.4)
    at = np.array([[0.39, 0.0, 1.0], [0.35, 0.25, 1.0], [0.0, 0.31, 1.0], [0, 0, -1]])
    assert beam.in_field(at).tolist() == [True, False, False, True]
    np.testing.assert_array_equal(beam.ray_starts(at), at * [1, 1, 0])
    assert beam.pixel_m(5.0) == 1e-3
    image = pinhole(DISTORTION)
    assert image.in_field(image.middle_ray * [[0.1], [2.0]]).tolist() == [True, True]
    assert not image.in_field(-image.middle_ray)
    assert not np.any(image.ray_starts(at))
    assert image.pixel_m(2.0) == pytest.approx(2.0 / np.sqrt(1200.0 * 1180.0))
