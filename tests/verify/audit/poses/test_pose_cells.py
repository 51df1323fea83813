"""Cells of the audit's own are attacked: no pose covers what the cell it is in lacks.

What a pose covers is decided by the audit's predicates, of which the cells share the
limits and no geometry. Shapes: a head, a ball over a box, a bowl with a border.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.factories import make_workspace

from geometry.arrays import Array, Mask
from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from geometry.shapes.primitives import box, sphere
from geometry.shapes.sample_head.sample_head import sample_head
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.requirements import ProjectorLimits, Workspace
from planning.verify.audit.audit_samples import AuditSamples, samples_on
from planning.verify.audit.predicates.audit_devices import (
    AuditCamera,
    AuditProjector,
    audit_projectors,
)
from planning.verify.audit.predicates.error_terms import PairGeometry, error_terms
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import (
    LIT,
    MEASURED,
    light_steps,
    pair_figures,
)
from planning.verify.audit.predicates.recompute import pairs_with
from planning.verify.audit.proofs.poses.lit_cells import LitCells
from planning.verify.audit.proofs.poses.measured_cells import Lens, LitBy, MeasuredCells
from planning.verify.audit.proofs.poses.skies import Skies, SkyMaps
from planning.verify.audit.proofs.poses.sphere_cells import Cells

_LIMITS = ProjectorLimits(np.radians(65.0), np.radians(30.0))
_DEEPEST = 26
_EVERYWHERE = (0.0, np.inf)


def _bowl() -> TriangleMesh:
    whole = sphere(0.1, subdivisions=3)
    kept = whole.face_centroids[:, 2] < 0.02
    # Its inner side is the surface.
    return TriangleMesh(whole.vertices, whole.faces[kept][:, ::-1])


def _ball_over_box() -> TriangleMesh:
    ball, plate = sphere(0.04, subdivisions=3), box((0.2, 0.16, 0.03))
    lifted = TriangleMesh(ball.vertices + [0.01, 0.0, 0.065], ball.faces)
    return TriangleMesh.joined([plate, lifted])


_SHAPES = {
    "head": lambda: sample_head(n_faces=3000),
    "ball over box": _ball_over_box,
    "bowl": _bowl,
}


@cache
def _shape(name: str) -> tuple[TriangleMesh, Shadow, AuditSamples, Workspace]:
    mesh = _SHAPES[name]()
    rng = np.random.default_rng(7)
    faces = rng.choice(len(mesh.faces), 400, p=mesh.face_areas / mesh.area)
    corners = rng.dirichlet(np.ones(3), 400)
    points = np.einsum("nk,nkd->nd", corners, mesh.corners[faces])
    normals = mesh.face_normals[faces]
    steep = np.cross(normals, rng.normal(size=(400, 3)))
    steep /= np.linalg.norm(steep, axis=1)[:, None]
    steep[::3] = 0.0
    none = np.zeros(400, dtype=np.int64)
    samples = AuditSamples(
        *(points, normals, faces.astype(np.int64), steep, none),
        np.ones(400, dtype=bool),
        np.ones(400),
    )
    reach = float(np.linalg.norm(mesh.vertices - mesh.centre, axis=1).max())
    shell = (1.1 * reach, 2.2 * reach)
    space = make_workspace(
        *(mesh.radius, 1.0),
        centre=tuple(mesh.centre.tolist()),
        projector_radius_m=shell,
        camera_radius_m=shell,
    )
    return mesh, Shadow(mesh, threads=1), samples, space


@cache
def _maps(name: str) -> Skies:
    _, shadow, samples, _ = _shape(name)
    angles = _LIMITS.max_incidence, _LIMITS.min_tangent_angle
    maps = SkyMaps(samples, shadow.caster, *angles, 2.0 * shadow.slack_m, 100)
    return maps.of(np.arange(len(samples)), lambda _: None)


def _cells_about(offsets: Array, shell: tuple[float, float], deepest: int) -> Cells:
    """Return a cell about each place (n, 3), halved a number of times of its own."""
    rng = np.random.default_rng(3)
    radius = np.linalg.norm(offsets, axis=1)
    polar = np.arccos(offsets[:, 2] / radius)
    turn = np.mod(np.arctan2(offsets[:, 1], offsets[:, 0]), 2.0 * np.pi)
    roots = Cells.of_shell(*shell)
    at = (polar > 0.5 * np.pi) * 4 + np.floor(turn / (0.5 * np.pi)).astype(np.int64)
    cells = roots.take(at)
    halvings = rng.integers(0, deepest + 1, len(offsets))
    for k in range(deepest):
        halves = cells.halves(0.5 * shell[0])
        first = Cells(*(column[::2] for column in halves))
        inside = (
            (radius <= first.high_m)
            & (polar <= first.polar_end)
            & (turn <= first.turn_end)
        )
        chosen = halves.take(2 * np.arange(len(offsets)) + ~inside)
        columns = zip(chosen, cells, strict=True)
        cells = Cells(*(np.where(halvings > k, new, old) for new, old in columns))
    held = (cells.low_m <= radius) & (radius <= cells.high_m)
    held &= (cells.polar <= polar) & (polar <= cells.polar_end)
    assert np.all(held & (cells.turn <= turn) & (turn <= cells.turn_end))
    return cells


def _lacking(cells: Cells, made: LitCells | MeasuredCells, covered: Mask) -> int:
    """Count what poses cover and their cells lack; some cells must lack something."""
    every = np.ones(covered.shape, dtype=bool)
    served = np.concatenate(
        [
            made.serve(cells.take(part), every[part])
            for part in np.array_split(np.arange(len(covered)), 20)
        ]
    )
    assert covered.any()
    assert not served.all()
    return int((covered & ~served).sum())


def _directions(n: int) -> Array:
    away = np.random.default_rng(5).normal(size=(n, 3))
    return away / np.linalg.norm(away, axis=1)[:, None]


def _lit(device: PinholeModel | ParallelModel, name: str, poses: Array) -> Mask:
    _, shadow, samples, _ = _shape(name)
    wide = np.array([np.inf])
    return np.array(
        [
            light_steps(AuditProjector(device, p, p, wide), samples, _LIMITS, shadow)
            == LIT
            for p in poses
        ]
    )


@pytest.mark.long
@pytest.mark.parametrize("name", _SHAPES)
def test_no_place_lights_what_its_cell_lacks(name) -> None:
    _, _, samples, space = _shape(name)
    rng = np.random.default_rng(11)
    radius = rng.uniform(*space.projector_radius_m, 600)
    offsets = radius[:, None] * _directions(600)
    centre = np.array(space.centre)
    poses = look_at(centre + offsets, centre, up=np.array([0.1, 0.2, 0.97]))
    wide = np.array([[50.0, 0.0, 500.0], [0.0, 50.0, 500.0], [0.0, 0.0, 1.0]])
    low, high = space.projector_radius_m
    ends = (1.2 * low, 0.9 * high)
    device = PinholeModel(wide, (1000, 1000), ends)
    cells = _cells_about(offsets, space.projector_radius_m, _DEEPEST)
    made = LitCells(space, samples, _LIMITS, ends, _maps(name))
    assert _lacking(cells, made, _lit(device, name, poses)) == 0


@pytest.mark.parametrize("name", _SHAPES)
@pytest.mark.long
def test_no_direction_lights_what_its_cell_lacks(name) -> None:
    _, _, samples, space = _shape(name)
    towards, centre = _directions(600), np.array(space.centre)
    poses = look_at(centre + 3.0 * towards, centre, up=np.array([0.1, 0.2, 0.97]))
    device = ParallelModel((1000, 1000), 0.01, (0.0, 100.0))
    cells = _cells_about(towards, (1.0 - 1e-9, 1.0 + 1e-9), _DEEPEST)
    made = LitCells(space, samples, _LIMITS, _EVERYWHERE, _maps(name), np.pi)
    assert _lacking(cells, made, _lit(device, name, poses)) == 0


@pytest.mark.long
@pytest.mark.parametrize("name", _SHAPES)
def test_skies_close_most_of_what_is_blocked(name) -> None:
    # Open maps would be a superset, too: of what small cells hold most is lit.
    _, _, samples, space = _shape(name)
    radius = np.mean(space.projector_radius_m)
    offsets, centre = radius * _directions(60), np.array(space.centre)
    poses = look_at(centre + offsets, centre, up=np.array([0.1, 0.2, 0.97]))
    wide = np.array([[50.0, 0.0, 500.0], [0.0, 50.0, 500.0], [0.0, 0.0, 1.0]])
    lit = _lit(PinholeModel(wide, (1000, 1000), _EVERYWHERE), name, poses)
    polar = np.arccos(offsets[:, 2] / radius)
    turn = np.mod(np.arctan2(offsets[:, 1], offsets[:, 0]), 2.0 * np.pi)
    tiny = Cells(
        np.full(60, radius), np.full(60, radius), polar, polar + 1e-6, turn, turn + 1e-6
    )
    every = np.ones(lit.shape, dtype=bool)
    open_sky = LitCells(space, samples, _LIMITS, _EVERYWHERE, None)
    in_shadow = open_sky.serve(tiny, every) & ~lit
    left = LitCells(space, samples, _LIMITS, _EVERYWHERE, _maps(name))
    still = left.serve(tiny, every) & ~lit
    assert in_shadow.sum() > 50
    assert still.sum() < 0.4 * in_shadow.sum()


@pytest.mark.long
@pytest.mark.parametrize("name", _SHAPES)
def test_no_direction_of_a_pixel_that_is_closed_is_lit(name) -> None:
    # Without the slack that cells have: so outlines may miss no pixel.
    _, _, _, space = _shape(name)
    skies, towards = _maps(name), _directions(3000)
    device = ParallelModel((1000, 1000), 0.01, (0.0, 100.0))
    centre = np.array(space.centre)
    poses = look_at(centre + 3.0 * towards, centre, up=np.array([0.1, 0.2, 0.97]))
    lit = _lit(device, name, poses)
    at, k = np.nonzero(lit)
    assert len(at) > 100_000
    assert not skies.shut(k, towards[at]).any()


_ERRORS = CalibrationErrors(angle=1e-4, position_m=2e-5, focal=1e-4, principal_px=0.3)
# Each with that limit alone, or what makes most of the deviation.
_LIMITS_OF_PAIRS: dict[str, dict[str, object]] = {
    "conditioning": {"min_conditioning": 0.5},
    "pitch": {},
    "edges": {"ring_sigma_m": None},
    "rings": {"noise_px": 1e-6},
    "calibration": {"noise_px": 1e-6, "ring_sigma_m": None, "calibration": _ERRORS},
}


@pytest.mark.long
@pytest.mark.parametrize("light", ["diverging", "parallel"])
@pytest.mark.parametrize("limit", _LIMITS_OF_PAIRS)
def test_no_camera_measures_what_its_cell_lacks(handmade, light, limit) -> None:
    plan, rng = handmade.build_plan(light), np.random.default_rng(2)
    surface, projectors = plan.surface, audit_projectors(plan)
    faces = rng.choice(np.flatnonzero(surface.in_dominant), 300)
    every = np.ones(300, dtype=bool)
    samples = samples_on(surface, surface.mesh.face_centroids[faces], faces, every)
    shadow, required = Shadow(surface.mesh, threads=1), plan.requirements
    free = replace(
        required.triangulation,
        min_conditioning=0.0,
        max_sigma_m=None,
        min_ring_pitch_px=None,
    )
    free = replace(free, **_LIMITS_OF_PAIRS[limit])
    lit = np.array(
        [light_steps(p, samples, required.projector, shadow) == LIT for p in projectors]
    )
    matrix = np.array([[1200.0, 0, 320.0], [0, 1190.0, 240.0], [0, 0, 1]])
    device = PinholeModel(matrix, (640, 480), (0.93, 0.972))
    away = _directions(600) + [0.0, 0.0, 1.5]
    away /= np.linalg.norm(away, axis=1)[:, None]
    offsets = rng.uniform(0.95, 1.03, 600)[:, None] * away
    centre = np.array(required.workspace.centre)
    aims = centre + rng.uniform(-0.25, 0.25, (600, 3))
    poses = look_at(centre + offsets, aims, up=np.array([0.1, 0.9, 0.1]), roll=0.7)
    cameras = [AuditCamera(device, pose) for pose in poses]
    # Limits as half of the pairs keep them.
    pairs = [PairGeometry.of(projectors[0], c, samples) for c in cameras[:20]]
    figures = [pair_figures(p, error_terms(p, free), free)[4:] for p in pairs]
    sigma, pitch = np.nanmedian(figures, axis=(0, 2))
    if limit == "pitch":
        free = replace(free, min_ring_pitch_px=float(pitch))
    elif limit != "conditioning":
        free = replace(free, max_sigma_m=float(sigma))
    seen = replace(required.camera, max_sample_distance_m=1.2e-3)
    required = replace(required, camera=seen, triangulation=free)
    covered = [
        np.any(
            pairs_with(c, projectors, samples, lit, required, shadow) == MEASURED,
            axis=0,
        )
        for c in cameras
    ]
    offered = [
        LitBy.of(p, samples, by, free) for p, by in zip(projectors, lit, strict=True)
    ]
    lens = Lens.of([device])
    made = MeasuredCells(required, samples, offered, lens, device.range_m, None)
    cells = _cells_about(offsets, required.workspace.camera_radius_m, _DEEPEST)
    assert _lacking(cells, made, np.array(covered)) == 0
