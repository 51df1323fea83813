"""Plans made by hand on a sphere, with claims from a slow loop over points.

The loop is written a third time, from `docs/reference/semantics.md`, in scalars and
with the definitions taken literally (J_r by differences of rays, rays by inverting the
distortion; no shadow rays, because a convex body shadows nothing that faces the light).
Neither planner nor audit is used. `build_plan` is cached, `make_plan` isn't, `tampered`
gives a changed copy.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import fibonacci_cap, look_at
from geometry.shapes.primitives import sphere
from planning.model.plan import RigPlan
from planning.model.surface import Surface

from .bare_plan import bare_plan

LIGHT = (
    "projector_beam",
    "projector_range",
    "projector_incidence",
    "tangent_angle",
    "pixel_distance",
    "projector_occlusion",
    "projector_body",
    "blocked_by_obstacle",
)
SIGHT = (
    "camera_field",
    "camera_range",
    "camera_incidence",
    "camera_occlusion",
    "camera_body",
    "blocked_by_obstacle",
    "sample_distance",
)
PAIR = ("too_dark", "clipped", "conditioning", "angle", "sigma", "pitch")
LIT, MEASURED = len(LIGHT), len(SIGHT) + len(PAIR)
RADIUS_M = 0.05
UP = np.array([0.0, 1.0, 0.0])
# Sign of a cone's normal along the axis of the rings; +1 is the error to be found.
RING_SIGN = -1.0


def build_plan(light: str = "diverging", target: str = "dominant") -> RigPlan:
    """Return a plan of two projectors and two cameras, all of whose claims are true."""
    return _built(light, target)


@cache
def _built(light: str, target: str) -> RigPlan:
    return make_plan(light, target)


def make_plan(light: str = "diverging", target: str = "dominant") -> RigPlan:
    """Compute what `build_plan` returns."""
    surface = _surface(light)
    document = _document(light, target, surface)
    _claim(document, surface)
    return RigPlan.from_document(document, surface)


def unclaimed(light: str = "diverging") -> RigPlan:
    """Return the same devices and limits in a plan that claims nothing, at once."""
    surface = _surface(light)
    document = _document(light, "dominant", surface)
    parts = (document.pop(key) for key in ("requirements", "projectors", "cameras"))
    kept = {key: document[key] for key in ("created", "cost", "rig")}
    plan = bare_plan(*parts, surface, **kept)
    area = {"area_m2": surface.mesh.area}

    def complete(document: dict[str, Any]) -> None:
        document["surface"]["curvature_radius_m"] = 0.01
        document["coverage"]["target"] |= area
        document["coverage"]["surface"] |= area

    return tampered(plan, complete)


def tampered(plan: RigPlan, change: Callable[[dict[str, Any]], object]) -> RigPlan:
    """Return a copy of a plan whose document was changed in place by `change`."""
    document = plan.to_document()
    change(document)
    return RigPlan.from_document(document, plan.surface)


def save(plan: RigPlan, folder: Any) -> Any:
    """Write a plan into a folder with a true digest; return the path of plan.json."""
    document = plan.to_document()
    document["surface"]["sha256"] = plan.surface.sha256()
    RigPlan.from_document(document, plan.surface).save(folder / "plan.json")
    return folder / "plan.json"


def _surface(light: str) -> Surface:
    mesh = sphere(RADIUS_M, subdivisions=3)
    centroids = mesh.face_centroids
    region = np.full(len(mesh.faces), -1)
    region[centroids[:, 2] > 0.01] = 0
    region[(centroids[:, 2] > 0.01) & (centroids[:, 1] > 0.0)] = 1
    return Surface(
        mesh=mesh,
        member=np.zeros(len(mesh.faces), dtype=np.int64),
        region=region,
        steep=_steep(mesh) * ((region >= 0) & (centroids[:, 0] > 0.0))[:, None],
        reference_projectors=(poses := _reference(10, 0.9, 1.0)),
        reference_rings=np.stack([_ring(light, pose) for pose in poses]),
        reference_cameras=_reference(4, 0.6, 0.98),
    )


def _steep(mesh: TriangleMesh) -> np.ndarray:
    """Direction of the meridians about z, in the plane of each face."""
    down = np.cross(np.cross(mesh.face_normals, [0.0, 0.0, 1.0]), mesh.face_normals)
    return down / np.linalg.norm(down, axis=1, keepdims=True)


def _reference(n: int, half_angle: float, distance: float) -> np.ndarray:
    around = fibonacci_cap(n, np.array([0.0, 0.0, 1.0]), half_angle)
    return look_at(distance * around, np.zeros(3), up=UP)


def _ring(light: str, pose: np.ndarray) -> np.ndarray:
    """Ring frame: turned by 6 degrees about the device's x, or shifted in y."""
    ring = pose.copy()
    if light == "parallel":
        ring[:3, 3] += 0.02 * pose[:3, 1]
        return ring
    c, s = math.cos(math.radians(6)), math.sin(math.radians(6))
    ring[:3, :3] = pose[:3, :3] @ np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])
    return ring


def _radii(light: str) -> list[float]:
    """Rings whose gaps grow outwards, the first of them out on the object."""
    if light == "parallel":
        return np.geomspace(0.007, 0.062, 30).tolist()
    return np.geomspace(0.062, 0.142, 38).tolist()


def _document(light: str, target: str, surface: Surface) -> dict[str, Any]:
    projector, camera = _models(light)
    projectors, cameras = [], []
    for name, direction in (("P1", (0.42, 0.0, 0.9)), ("P2", (-0.3, -0.2, 0.9))):
        at = np.array(direction) / np.linalg.norm(direction)
        pose = look_at(at, np.zeros(3), up=UP)
        projectors.append(
            {
                "id": name,
                "light": light,
                "world_from_device": pose.tolist(),
                "world_from_ring": _ring(light, pose).tolist(),
                **projector,
                "ring_radii": _radii(light),
            }
        )
    for name, direction, aim in (
        ("C1", (0.1, 0.55, 0.9), (0.0, 0.0, 0.0)),
        ("C2", (-0.8, 0.2, 0.9), (0.03, 0.0, 0.0)),
    ):
        at = 0.99 * np.array(direction) / np.linalg.norm(direction)
        pose = look_at(at, np.array(aim), up=UP, roll=0.3)
        cameras.append({"id": name, "world_from_device": pose.tolist(), **camera})
    return {
        "format": "ringrig-plan",
        "version": 1,
        "units": {"length": "m", "angle": "rad"},
        "seed": 0,
        "created": "2026-11-21T00:00:00Z",
        "command": [],
        "truncated": False,
        "meshes": [_mesh_entry(surface.mesh)],
        "surface": {"path": "surface.npz", "sha256": "", "curvature_radius_m": 0.01},
        "rig": {
            "light": light,
            "projector": projector | {"figures": {"frame_rate_hz": 60.0}},
            "camera": camera
            | {"figures": {"frame_rate_hz": 40.0, "exposure_ms": 20.0}},
            "limits": {
                "projector_max_incidence_deg": 60.0,
                "min_tangent_angle_deg": 40.0,
                "camera_max_incidence_deg": 70.0,
                "min_conditioning": 0.1,
                "noise_px": 0.1,
                "min_ring_pitch_px": 7.0,
            },
        },
        "requirements": _requirements(light, target, surface),
        "projectors": projectors,
        "cameras": cameras,
        "cost": _cost(light),
        "members": [],
        "reconstruction": None,
        "timings_s": {},
    }


def _cost(light: str) -> dict[str, Any]:
    """Two projectors of 30 rings, 5 bits, or 38, 6 bits; two refreshes a frame."""
    bits = 5 if light == "parallel" else 6
    frames, before = (2 * (2 + 2 * bits + 2 * cameras) for cameras in (2, 3))
    return {
        "pixels": 2 * 640 * 480,
        "n_frames": frames,
        "frame_s": 1.0 / 30.0,
        "t1": frames / 30.0 / 614_400,
        "t2": 1e-7,
        "t3": 0.25,
        "t4": 2.0,
        "t5": 7.0,
        "n_cameras_before": 3,
        "C": frames / 30.0 + 614_400 * 1e-7 + 9.25,
        "C_all_rings": frames / 30.0 + 614_400 * 1e-7 + 9.25,
        "C_before": before / 30.0 + 921_600 * 1e-7 + 9.25,
    }


def _mesh_entry(mesh: TriangleMesh) -> dict[str, Any]:
    return {
        "path": None,
        "sha256": None,
        "unit": "m",
        "scale_to_m": 1.0,
        "n_vertices": len(mesh.vertices),
        "n_faces": len(mesh.faces),
        "area_m2": mesh.area,
        "repairs": [],
    }


def _models(light: str) -> tuple[dict[str, Any], dict[str, Any]]:
    diverging = light == "diverging"
    projector = {
        "K": [[2880.0, 0, 960], [0, 2870.0, 1000], [0, 0, 1]] if diverging else None,
        "resolution": [1920, 1080] if diverging else [1000, 800],
        "pixel_pitch_m": None if diverging else 1e-4,
        "range_m": [0.94, 0.985],
        "beam_radius": None if diverging else 0.048,
    }
    camera = {
        "K": [[5000.0, 0, 156.0], [0, 4970.0, 237.0], [0, 0, 1]],
        "distortion": [-0.5, 2.0, 0.01, -0.008, 0.0],
        "resolution": [640, 480],
        "range_m": [0.93, 0.972],
    }
    return projector, camera


def _requirements(light: str, target: str, surface: Surface) -> dict[str, Any]:
    return {
        "max_projectors": 3,
        "max_cameras": None,
        "coverage": 0.5,
        "dominant_coverage": 0.6,
        "min_reachable": 0.3,
        "region_coverage": 0.3,
        "region_share": 0.01,
        "target": target,
        "pattern": "rings",
        "projector": {
            "max_incidence": math.radians(60),
            "min_tangent_angle": math.radians(40),
        },
        "camera": {"max_incidence": math.radians(70), "max_sample_distance_m": 4.5e-4},
        "triangulation": {
            "min_conditioning": 0.1,
            "noise_px": 0.1,
            "max_sigma_m": 8.3e-5,
            "min_ring_pitch_px": 7.0,
            "ring_sigma_m": 1.3e-5,
        },
        "check": {
            "max_rms_m": 1e-4,
            "max_p95_m": 3e-4,
            "max_bias_m": 3e-5,
            "tau_m": 3e-3,
            "min_completeness": 0.9,
            "max_predicted_missing": 0.03,
        },
        "workspace": {
            "centre": surface.mesh.centre.tolist(),
            "object_radius_m": surface.mesh.radius,
            "up": [0.0, 1.0, 0.0],
            "axis": [0.0, 0.0, 1.0],
            "half_angle": 1.2,
            "projector_radius_m": [0.9, 1.1],
            "camera_radius_m": [0.9, 1.1],
            "floor_m": -1.0,
            "n_reference_projectors": 10,
            "n_reference_cameras": 4,
            "reference_ring_radius": _radii(light)[-1],
        },
    }


def pairs_of(plan: RigPlan) -> tuple[list[dict[str, Any]], Any, Any, Any]:
    """Return rows of the slow loop with pairs; weights, flags of the target, regions.

    Of each row `pairs` lists the projector and camera that measure it, and `reference`
    says with how many reference cameras each projector does.
    """
    document, surface = plan.to_document(), plan.surface
    points, faces, weights = _points(surface.mesh)
    limits, projectors = document["requirements"], document["projectors"]
    camera, rows = document["cameras"][0], []
    views = [
        camera | {"world_from_device": pose}
        for pose in surface.reference_cameras.tolist()
    ]
    for point, face in zip(points, faces.tolist(), strict=True):
        inside = surface.region[face] >= 0
        row = _evaluate(document, surface, point, face, inside)
        p, n = point.tolist(), surface.mesh.face_normals[face].tolist()

        def measured(i: int, one: Any, row: Any = row, p: Any = p, n: Any = n) -> bool:
            lit = row["lit_by"][i]
            return lit and pair_steps(projectors[i], one, p, n, limits) == MEASURED

        each = range(len(projectors))
        row["pairs"] = [
            (i, c)
            for i in each
            for c, one in enumerate(document["cameras"])
            if measured(i, one)
        ]
        row["reference"] = [sum(measured(i, one) for one in views) for i in each]
        rows.append(row)
    region = surface.region[faces]
    return rows, weights, region >= 0, region


# The slow loop ------------------------------------------------------------------------


def _claim(document: dict[str, Any], surface: Surface) -> None:
    """Write every recomputable claim into the document."""
    points, faces, weights = _points(surface.mesh)
    limits = document["requirements"]
    whole = limits["target"] == "surface"
    inside = np.array([whole or surface.region[face] >= 0 for face in faces])
    rows = [
        _evaluate(document, surface, point, int(face), flag)
        for point, face, flag in zip(points, faces, inside, strict=True)
    ]

    def area(test: Callable[[dict[str, Any]], object], within: np.ndarray) -> float:
        chosen = np.array([bool(test(row)) for row in rows]) & within
        return float(weights[chosen].sum())

    everything = np.ones(len(rows), dtype=bool)
    coverage: dict[str, Any] = {"samples": len(rows)}
    for part, within in (("surface", everything), ("target", inside)):
        coverage[part] = {
            "area_m2": area(lambda row: True, within),
            "reachable_by_projectors_m2": area(
                lambda row: row["by_projectors"], within
            ),
            "lit_m2": area(lambda row: row["lit"], within),
            "reachable_by_cameras_m2": area(lambda row: row["by_cameras"], within),
            "measured_m2": area(lambda row: row["measured"], within),
        }
    for name, causes in (
        ("uncovered_by_cause", LIGHT + SIGHT + PAIR),
        ("unreachable_by_cause", LIGHT),
        ("unmeasurable_by_cause", SIGHT + PAIR),
    ):
        split = {c: area(lambda row, n=name, c=c: row[n] == c, inside) for c in causes}
        coverage[name] = {cause: value for cause, value in split.items() if value > 0}
    document["coverage"] = coverage
    _claim_devices(document, rows, area, inside)
    shares = _claim_regions(document, surface, rows, faces)
    _claim_tables(document, shares, area, everything, inside)
    document["baselines"] = _baselines(document, surface.mesh)
    shared = area(lambda row: all(row["seen"]), inside)
    together = shared >= 0.01 * coverage["target"]["area_m2"]
    document["camera_groups"] = [["C1", "C2"]] if together else [["C1"], ["C2"]]
    falls_on_both = area(lambda row: all(row["falls"]), inside)
    document["overlaps"] = [
        {
            "projectors": ["P1", "P2"],
            "target_m2": falls_on_both,
            "surface_m2": area(lambda row: all(row["falls"]), everything),
        }
    ]
    document["firing_schedule"] = {
        "groups": [["P1"], ["P2"]],
        "n_groups": 2,
        "lower_bound": 2,
        "proof": "clique",
        "clique": ["P1", "P2"],
    }
    document["members"] = [{"mesh": 0, "coverage": coverage, "regions": [0, 1]}]


def _points(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Four points a face, the centroids of its quarters."""
    shares = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6.0
    points = np.einsum("qk,fkd->fqd", shares, mesh.corners).reshape(-1, 3)
    return (
        points,
        np.repeat(np.arange(len(mesh.faces)), 4),
        np.repeat(mesh.face_areas, 4) / 4,
    )


def _evaluate(
    document: dict[str, Any], surface: Surface, point: Any, face: int, inside: bool
) -> dict[str, Any]:
    limits = document["requirements"]
    p, n = (
        [float(x) for x in point],
        [float(x) for x in surface.mesh.face_normals[face]],
    )
    steep = [float(x) for x in surface.steep[face]]
    projectors, cameras = document["projectors"], document["cameras"]
    steps = [
        light_steps(entry, p, n, steep, limits["projector"]) for entry in projectors
    ]
    lit = [s == LIT for s in steps]
    pairs = [
        [pair_steps(projector, camera, p, n, limits) for camera in cameras]
        for projector, on in zip(projectors, lit, strict=True)
        if on
    ]
    seen = [any(pair[j] == MEASURED for pair in pairs) for j in range(len(cameras))]
    margins = [
        margin(entry, p, n, steep, limits["projector"]) if on else -math.inf
        for entry, on in zip(projectors, lit, strict=True)
    ]
    measured = any(seen)
    if any(lit):
        cause = (SIGHT + PAIR)[max(map(max, pairs))] if not measured else None
    else:
        cause = LIGHT[max(steps)]
    reference = LIT
    if not any(lit):
        reference = _reference_light(document, surface, p, n, steep)
    sight = MEASURED if measured or not any(lit) else 0
    if not measured and any(lit):
        sight = _reference_sight(document, surface, p, n, lit)
    any_light = {"max_incidence": math.radians(89.0), "min_tangent_angle": 0.0}
    return {
        "falls": [
            light_steps({**entry, "range_m": [0.0, 99.0]}, p, n, [0.0] * 3, any_light)
            == LIT
            for entry in projectors
        ],
        "lit": any(lit),
        "lit_by": lit,
        "seen": seen,
        "measured": measured,
        "margins": margins,
        "server": margins.index(max(margins)) if any(lit) else None,
        "by_projectors": reference == LIT,
        "by_cameras": any(lit) and sight == MEASURED,
        "uncovered_by_cause": cause,
        "unreachable_by_cause": None if reference == LIT else LIGHT[reference],
        "unmeasurable_by_cause": None if sight == MEASURED else (SIGHT + PAIR)[sight],
        "inside": inside,
    }


def _reference_light(
    document: dict[str, Any], surface: Surface, p: Any, n: Any, steep: Any
) -> int:
    first, limits = document["projectors"][0], document["requirements"]
    last = limits["workspace"]["reference_ring_radius"]
    return max(
        light_steps(
            first
            | {
                "world_from_device": pose,
                "world_from_ring": ring,
                "ring_radii": [last],
            },
            p,
            n,
            steep,
            limits["projector"],
        )
        for pose, ring in zip(
            surface.reference_projectors.tolist(),
            surface.reference_rings.tolist(),
            strict=True,
        )
    )


def _reference_sight(
    document: dict[str, Any], surface: Surface, p: Any, n: Any, lit: list[bool]
) -> int:
    camera = document["cameras"][0]
    return max(
        pair_steps(
            projector,
            camera | {"world_from_device": pose},
            p,
            n,
            document["requirements"],
        )
        for pose in surface.reference_cameras.tolist()
        for projector, on in zip(document["projectors"], lit, strict=True)
        if on
    )


def light_steps(entry: Any, p: Any, n: Any, steep: Any, limits: Any) -> int:
    """Limits of *lit* that a point on a convex body passes, `LIT`: lit."""
    local = _into(entry["world_from_device"], p)
    ring = _into(entry["world_from_ring"], p)
    last = entry["ring_radii"][-1]
    w, h = entry["resolution"]
    x, y, z = local
    rho = math.sqrt(ring[0] ** 2 + ring[1] ** 2)
    along, length = light(entry, p)
    if entry["light"] == "diverging":
        if z <= 0 or ring[2] <= 0 or rho / ring[2] > last:
            return 0
        (fx, _, cx), (_, fy, cy), _ = entry["K"]
        u, v = fx * x / z + cx, fy * y / z + cy
        if not (-0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5):
            return 0
    else:
        pitch = entry["pixel_pitch_m"]
        if abs(x) > w * pitch / 2 or abs(y) > h * pitch / 2 or rho > last:
            return 0
        if entry["beam_radius"] is not None and math.hypot(x, y) > entry["beam_radius"]:
            return 0
    if not entry["range_m"][0] <= length <= entry["range_m"][1]:
        return 1
    if not -_dot(n, along) >= math.cos(limits["max_incidence"]):
        return 2
    if not abs(_dot(steep, along)) <= math.cos(limits["min_tangent_angle"]):
        return 3
    return LIT


def light(entry: Any, p: Any) -> tuple[list[float], float]:
    """Direction of the light at a point, and the length of its way."""
    pose = entry["world_from_device"]
    if entry["light"] == "parallel":
        return [pose[i][2] for i in range(3)], _into(pose, p)[2]
    return _unit([p[i] - pose[i][3] for i in range(3)])


def margin(entry: Any, p: Any, n: Any, steep: Any, limits: Any) -> float:
    """The smaller margin of a lit point."""
    along, _ = light(entry, p)
    squarely = limits["max_incidence"] - math.acos(min(1.0, -_dot(n, along)))
    if not any(steep):
        return squarely
    tangent = math.acos(min(1.0, abs(_dot(steep, along))))
    return min(squarely, tangent - limits["min_tangent_angle"])


def pair_steps(projector: Any, camera: Any, p: Any, n: Any, limits: Any) -> int:
    """Limits of *seen*, then *measurable*, a lit point passes, `MEASURED`: all."""
    local = _into(camera["world_from_device"], p)
    origin = [camera["world_from_device"][i][3] for i in range(3)]
    r, t = _unit([p[i] - origin[i] for i in range(3)])
    w, h = camera["resolution"]
    if local[2] <= 0:
        return 0
    u, v = project(camera, local)
    if not (-0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5):
        return 0
    if not camera["range_m"][0] <= t <= camera["range_m"][1]:
        return 1
    cosine = -_dot(n, r)
    if not cosine >= math.cos(limits["camera"]["max_incidence"]):
        return 2
    focal = math.sqrt(camera["K"][0][0] * camera["K"][1][1])
    if not local[2] / (focal * cosine) <= limits["camera"]["max_sample_distance_m"]:
        return 6
    # Light is not stated, so that nothing is too dark or clipped.
    return 9 + _triangulation_steps(projector, camera, p, n, (r, t, u, v), limits)


def _triangulation_steps(
    projector: Any, camera: Any, p: Any, n: Any, sight: Any, limits: Any
) -> int:
    asked = limits["triangulation"]
    r, t, u, v = sight
    y = _into(projector["world_from_ring"], p)
    rho = math.hypot(y[0], y[1])
    radii = projector["ring_radii"]
    if projector["light"] == "parallel":
        m, coordinate, per_gap = [y[0] / rho, y[1] / rho, 0.0], rho, 1.0
    else:
        coordinate = rho / y[2]
        slope = math.sqrt(1 + coordinate**2)
        m = [y[0] / rho / slope, y[1] / rho / slope, RING_SIGN * coordinate / slope]
        per_gap = y[2] / slope
    frame = projector["world_from_ring"]
    m = [sum(frame[i][j] * m[j] for j in range(3)) for i in range(3)]
    k = max(1, next(i for i, radius in enumerate(radii) if radius >= coordinate))
    spacing = per_gap * (radii[k] - radii[k - 1])
    across = _cross(r, _cross(n, m))
    g = math.hypot(*(_dot(column, across) for column in _ray_slope(camera, u, v)))
    conditioning, squarely = abs(_dot(r, m)), abs(_dot(n, r))
    if not conditioning >= asked["min_conditioning"]:
        return 0
    noise = asked["noise_px"] / -_dot(n, light(projector, p)[0])
    sigma = math.hypot(
        noise * t * g / conditioning, asked["ring_sigma_m"] * squarely / conditioning
    )
    if not sigma <= asked["max_sigma_m"]:
        return 2
    return 4 if spacing * squarely / (t * g) >= asked["min_ring_pitch_px"] else 3


def project(camera: Any, local: Any) -> tuple[float, float]:
    """Pixel of a point in the camera's frame."""
    a, b = distort(camera["distortion"], local[0] / local[2], local[1] / local[2])
    (fx, _, cx), (_, fy, cy), _ = camera["K"]
    return fx * a + cx, fy * b + cy


def distort(coefficients: Any, a: float, b: float) -> tuple[float, float]:
    """OpenCV's Brown-Conrady model."""
    k1, k2, p1, p2, k3 = coefficients
    s = a * a + b * b
    radial = 1 + s * (k1 + s * (k2 + s * k3))
    return (
        a * radial + 2 * p1 * a * b + p2 * (s + 2 * a * a),
        b * radial + p1 * (s + 2 * b * b) + 2 * p2 * a * b,
    )


def ray(camera: Any, u: float, v: float) -> list[float]:
    """Unit viewing ray of a pixel in the world; distortion inverted by iteration."""
    (fx, _, cx), (_, fy, cy), _ = camera["K"]
    goal = (u - cx) / fx, (v - cy) / fy
    a, b = goal
    for _ in range(30):
        bent = distort(camera["distortion"], a, b)
        a, b = a + goal[0] - bent[0], b + goal[1] - bent[1]
    turn = camera["world_from_device"]
    direction = [turn[i][0] * a + turn[i][1] * b + turn[i][2] for i in range(3)]
    return _unit(direction)[0]


def _ray_slope(camera: Any, u: float, v: float) -> tuple[list[float], list[float]]:
    columns = []
    for du, dv in ((1.0, 0.0), (0.0, 1.0)):
        ahead, behind = ray(camera, u + du, v + dv), ray(camera, u - du, v - dv)
        columns.append([(x - y) / 2 for x, y in zip(ahead, behind, strict=True)])
    return columns[0], columns[1]


def _claim_devices(document: Any, rows: Any, area: Any, inside: np.ndarray) -> None:
    for i, entry in enumerate(document["projectors"]):
        entry["lit_area_m2"] = area(lambda row, i=i: row["lit_by"][i], inside)
        served = [r["margins"][i] for r in rows if r["inside"] and r["server"] == i]
        entry["min_margin_rad"] = min(served, default=None)
    for j, entry in enumerate(document["cameras"]):
        entry["seen_area_m2"] = area(lambda row, j=j: row["seen"][j], inside)
        entry["sole_area_m2"] = area(
            lambda row, j=j: row["seen"][j] and sum(row["seen"]) == 1, inside
        )


def _cone_angle(surface: Surface, members: np.ndarray) -> float:
    """Least angle about the mean normal within which 98 % of the area faces."""
    areas, normals = (
        values[members]
        for values in (surface.mesh.face_areas, surface.mesh.face_normals)
    )
    off = np.arccos(normals @ (areas @ normals) / np.linalg.norm(areas @ normals))
    return min(a for a in off if areas[off <= a].sum() >= 0.98 * areas.sum())


def _claim_regions(
    document: Any, surface: Surface, rows: Any, faces: np.ndarray
) -> list[dict[int, float]]:
    """Claim them; return by region what one and two projectors light of its reach."""
    document["regions"] = []
    shares: list[dict[int, float]] = [{}, {}]
    limits, areas = document["requirements"], surface.mesh.face_areas
    for number in (0, 1):
        members = surface.region == number
        mine = [
            (row, areas[face])
            for row, face in zip(rows, faces, strict=True)
            if members[face]
        ]
        names = {
            document["projectors"][row["server"]]["id"] for row, _ in mine if row["lit"]
        }
        whole = sum(weight for _, weight in mine)
        mean = areas[members] @ surface.mesh.face_normals[members]
        document["regions"].append(
            {
                "id": number,
                "area_m2": float(areas[members].sum()),
                "n_faces": int(members.sum()),
                "mean_normal": (mean / np.linalg.norm(mean)).tolist(),
                "cone_angle": _cone_angle(surface, members),
                "mean_curvedness": 20.0,
                "lit_by": sorted(names),
                "lit_fraction": sum(weight for row, weight in mine if row["lit"])
                / whole,
                "centre_m": (
                    areas[members]
                    @ surface.mesh.face_centroids[members]
                    / areas[members].sum()
                ).tolist(),
                "coverage": _region_coverage(mine, limits["region_coverage"]),
            }
        )
        reach = sum(weight for row, weight in mine if row["by_projectors"])
        for n, lit in enumerate(shares if reach else (), start=1):
            some = [weight for row, weight in mine if any(row["lit_by"][:n])]
            lit[number] = sum(some) / reach
    document["surface"]["dominant_share"] = float(
        areas[surface.in_dominant].sum() / areas.sum()
    )
    return shares


def _region_coverage(mine: Any, share: float) -> dict[str, Any]:
    def area(test: Callable[[Any], object]) -> float:
        return sum(weight for row, weight in mine if test(row)) / 4

    areas: dict[str, Any] = {
        "samples": len(mine),
        "reachable_by_projectors_m2": area(lambda row: row["by_projectors"]),
        "lit_m2": area(lambda row: row["lit"]),
        "reachable_by_cameras_m2": area(lambda row: row["by_cameras"]),
        "measured_m2": area(lambda row: row["measured"]),
    }
    split = {
        c: area(lambda row, c=c: row["uncovered_by_cause"] == c)
        for c in LIGHT + SIGHT + PAIR
    }
    areas["uncovered_by_cause"] = {cause: a for cause, a in split.items() if a > 0}
    areas["measured_by"] = {
        name: area(lambda row, j=j: row["seen"][j])
        for j, name in enumerate(("C1", "C2"))
    }
    met = areas["lit_m2"] >= share * areas["reachable_by_projectors_m2"]
    met &= areas["measured_m2"] >= share * areas["reachable_by_cameras_m2"]
    return areas | {"floor": "met" if met else "missed"}


def _claim_tables(
    document: Any,
    shares: list[dict[int, float]],
    area: Any,
    everything: Any,
    inside: Any,
) -> None:
    parts = (("target", inside), ("surface", everything))
    document["marginal"] = [
        {f"n_{kind}": n}
        | {
            f"{verb}_{part}_m2": area(lambda row, n=n, k=key: any(row[k][:n]), within)
            for part, within in parts
        }
        for kind, verb, key in (
            ("projectors", "lit", "lit_by"),
            ("cameras", "measured", "seen"),
        )
        for n in (1, 2)
    ]
    for row, lit in zip(document["marginal"], shares, strict=False):
        worst = min(lit, key=lambda number: lit[number], default=None)
        row |= {"worst_region": worst, "worst_region_lit": lit.get(worst)}
    target, limits = document["coverage"]["target"], document["requirements"]
    document["certificates"] = {
        kind: {
            "count": 2,
            "status": "feasible",
            "required_m2": share * target[of],
            "n_samples": document["coverage"]["samples"],
            "floors": 2,
            "candidates": {
                "lower_bound": 1,
                "n_candidates": candidates,
                "for_total": 1,
            },
            "continuous": None,
            "greedy_count": 3,
            "needed": {"count": 2, "lower_bound": 1},
            "best_area": {"value_m2": target[have], "upper_bound_m2": target[of]},
            "one_fewer": {"upper_bound_m2": target[of]},
        }
        for kind, share, of, have, candidates in (
            (
                "projectors",
                limits["dominant_coverage"],
                "reachable_by_projectors_m2",
                "lit_m2",
                10,
            ),
            (
                "cameras",
                limits["coverage"],
                "reachable_by_cameras_m2",
                "measured_m2",
                4,
            ),
        )
    }


def _baselines(document: Any, mesh: TriangleMesh) -> list[dict[str, Any]]:
    top = int(np.argmax(mesh.face_centroids[:, 2]))
    meeting, normal = mesh.face_centroids[top], mesh.face_normals[top]
    poses = {c["id"]: np.array(c["world_from_device"]) for c in document["cameras"]}
    rows = []
    entries = {c["id"]: c for c in document["cameras"]}
    theta = document["requirements"]["camera"]["max_incidence"]
    for first, second in (("C1", "C2"), ("C2", "C1")):
        o1, o2, axis = poses[first][:3, 3], poses[second][:3, 3], poses[first][:3, 2]
        d1, d2 = math.dist(o1, meeting), math.dist(o2, meeting)
        d = math.dist(o1, o2)
        phi = math.acos((d1 * d1 + d2 * d2 - d * d) / (2 * d1 * d2))
        axial = float((o2 - o1) @ axis)
        one, two = o1 - meeting, o2 - meeting
        onward = np.cross(np.cross(one, two), normal)
        field, incidence = _slacks(one, two, normal, entries[second], theta)
        before, _ = _slacks(two, one, normal, entries[first], theta)
        limit = phi + min(field, incidence)
        axes = axis, poses[second][:3, 2]
        beta = [
            _signed(one, -axes[0], one, two),
            _signed(-axes[1], two, one, two),
        ]
        half = [beta[0] + before, beta[1] + field]
        depth = [float(-one @ axes[0]), float(-two @ axes[1])]
        rows.append(
            {
                "cameras": [first, second],
                "E": meeting.tolist(),
                "D1": d1,
                "D2": d2,
                "phi": phi,
                "phi_max": limit,
                "normals": [normal.tolist(), normal.tolist()],
                "d": d,
                "d_lateral": math.sqrt(d * d - axial * axial),
                "d_axial": axial,
                "d_max": math.sqrt(d1 * d1 + d2 * d2 - 2 * d1 * d2 * math.cos(limit)),
                "slack": limit - phi,
                "covered": phi < limit,
                "limit": "camera_field" if field < incidence else "camera_incidence",
                "standoff1": depth[0],
                "standoff2": depth[1],
                "C1": depth[0] * math.tan(half[0]),
                "C2": depth[1] * math.tan(half[1]),
                "beta": beta,
                "iota": [
                    _signed(one, normal, one, two),
                    _signed(normal, two, one, two),
                ],
                "half_field": half,
                "max_incidence": theta,
                "delta_axes": phi - beta[0] - beta[1],
                "delta_surface": 0.0,
                "shares_border": True,
                "n_seam": 12,
                "onward": (onward / np.linalg.norm(onward)).tolist(),
            }
        )
    return rows


def _signed(start: Any, end: Any, to_first: Any, to_second: Any) -> float:
    """Angle from one direction to another in the plane, positive from u1 to u2."""
    x = to_first / np.linalg.norm(to_first)
    y = to_second - (to_second @ x) * x
    y /= np.linalg.norm(y)
    turn = math.atan2(end @ y, end @ x) - math.atan2(start @ y, start @ x)
    return math.remainder(turn, 2.0 * math.pi)


def _slacks(
    to_first: Any, to_second: Any, normal: Any, camera: Any, theta: float
) -> tuple[float, float]:
    """Turns of u2 about E, away from u1, until E leaves the field or the incidence."""
    x = to_first / np.linalg.norm(to_first)
    y = to_second - (to_second @ x) * x
    y /= np.linalg.norm(y)
    start = math.atan2(to_second @ y, to_second @ x)
    turned = 0.0
    turn = np.array(camera["world_from_device"])[:3, :3]
    w, h = camera["resolution"]
    while True:
        ahead = -(math.cos(start + turned) * x + math.sin(start + turned) * y) @ turn
        u, v = project(camera, ahead)
        if not (-0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5):
            break
        turned += 2e-5
    incidence = theta - _signed(normal, to_second, to_first, to_second)
    return turned, incidence


def _into(pose: Any, p: Any) -> list[float]:
    offset = [p[i] - pose[i][3] for i in range(3)]
    return [sum(pose[i][j] * offset[i] for i in range(3)) for j in range(3)]


def _dot(a: Any, b: Any) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Any, b: Any) -> list[float]:
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def _unit(a: Any) -> tuple[list[float], float]:
    length = math.sqrt(_dot(a, a))
    return [x / length for x in a], length
