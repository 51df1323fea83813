"""The two set-ups of section VII: the box under 7 circles, the face under 3.

What the paper states is taken as it is: 2 projectors, 2 cameras, their resolutions,
about 1 m, the focal length and image centre, the circles' number, the face's radii.
Everything else is ours, because the paper doesn't give it: directions of the devices,
the size of the box, the box's radii, the head, the projectors' optics.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import box
from geometry.shapes.sample_head.sample_head import HeadShape, sample_head
from planning.model.plan import RigPlan
from planning.model.surface import Surface

from .paper_devices import (
    FITTING,
    PRINTED,
    STANDOFF_M,
    Light,
    Optics,
    bearing,
    camera_entry,
    projector_entry,
)

Variant = Literal["printed", "fits"]
NAMES = ("box", "face")
VARIANTS: dict[str, Optics] = {"printed": PRINTED, "fits": FITTING}

INCH_M = 0.0254
# (azimuth, elevation) in degrees: projectors left and right at the level of the table,
# cameras left and right above. Seen along a ring axis the cameras are then a quarter
# turn apart, so that the curve that one is blind on, r.m = 0, is not the other's.
PROJECTORS_DEG = ((-20.0, -12.0), (20.0, -12.0))
CAMERAS_DEG = ((-25.0, 15.0), (25.0, 15.0))
BOX_M = 0.120
BOX_RADII_M = np.linspace(0.012, 0.084, 7)
FACE_RADII_M = np.array([1.0, 2.0, 4.0]) * INCH_M
# Between the tip of the nose and the eyes, on the surface of the head.
_FACE_TARGET = np.array([0.0, -0.090, -0.020])
_HEAD_FACES = 20_000
# More than this slants rings until they smear; the decoder's limit [rad].
_ANY_M = 1.0
_MAX_INCIDENCE = np.deg2rad(70.0)


@dataclass(frozen=True, eq=False)
class Experiment:
    """One experiment: an object and the devices about it.

    Attributes:
        name: `box` or `face`.
        variant: `printed`: focal length and image centre of the paper; `fits`: the
            whole of the rings is in the image.
        light: Kind of light.
        optics: The cameras' interior.
        radii_m: Of the rings, on the object or, in diverging light, at 1 m [m].
        plan: Devices and surface, as the decoder reads them.
    """

    name: str
    variant: str
    light: Light
    optics: Optics
    radii_m: NDArray[np.float64]
    plan: RigPlan

    @property
    def mesh(self) -> TriangleMesh:
        """The object."""
        return self.plan.surface.mesh

    @property
    def gap_m(self) -> float:
        """Median gap between rings, from the centre on [m]."""
        return float(np.median(np.diff(self.radii_m, prepend=0.0)))


def box_experiment(
    *,
    light: Light = "parallel",
    variant: Variant = "printed",
    distortion: float = 0.0,
) -> Experiment:
    """Return the box, an edge towards the rig, under 2 projectors of 7 circles.

    Args:
        light: `parallel`, as the paper assumes, or `diverging`.
        variant: Focal length and image centre.
        distortion: k1 of the cameras' lenses; the decoder knows it.
    """
    plain = box((BOX_M, BOX_M, BOX_M))
    turned = Rotation.from_euler("z", 45.0, degrees=True).as_matrix()
    mesh = TriangleMesh(plain.vertices @ turned.T, plain.faces)
    target = np.array([0.0, -BOX_M / np.sqrt(2.0), 0.0])
    return _experiment("box", mesh, target, BOX_RADII_M, light, variant, distortion)


def face_experiment(
    *,
    light: Light = "parallel",
    variant: Variant = "printed",
    distortion: float = 0.0,
    radii_m: NDArray[np.float64] = FACE_RADII_M,
    shape: HeadShape | None = None,
) -> Experiment:
    """Return the head under 2 projectors of circles of 1, 2 and 4 inches.

    Args:
        light: `parallel`, as the paper assumes, or `diverging`.
        variant: Focal length and image centre.
        distortion: k1 of the cameras' lenses; the decoder knows it.
        radii_m: Other radii than the paper's [m], rising.
        shape: Proportions of the head; default those of the sample.
    """
    mesh = _head(shape or HeadShape())
    return _experiment("face", mesh, _FACE_TARGET, radii_m, light, variant, distortion)


def single(experiment: Experiment, *, projector: int = 0, camera: int = 0) -> RigPlan:
    """Return the plan of one projector and one camera of an experiment."""
    document = experiment.plan.document
    one = {
        "projectors": document["projectors"][projector : projector + 1],
        "cameras": document["cameras"][camera : camera + 1],
    }
    return RigPlan(document | one, experiment.plan.surface)


@cache
def _head(shape: HeadShape) -> TriangleMesh:
    return sample_head(shape, n_faces=_HEAD_FACES)


def _experiment(
    name: str,
    mesh: TriangleMesh,
    target: NDArray[np.float64],
    radii_m: NDArray[np.float64],
    light: Light,
    variant: Variant,
    distortion: float,
) -> Experiment:
    printed = VARIANTS[variant]
    optics = Optics(printed.focal_px, printed.centre_px, distortion)
    gap_m = float(np.median(np.diff(radii_m, prepend=0.0)))
    document = {
        "requirements": _requirements(mesh, gap_m),
        "projectors": [
            projector_entry(f"P{n}", light, bearing(*at), target, radii_m)
            for n, at in enumerate(PROJECTORS_DEG, 1)
        ],
        "cameras": [
            camera_entry(f"C{n}", optics, bearing(*at), target)
            for n, at in enumerate(CAMERAS_DEG, 1)
        ],
    }
    plan = RigPlan(document, _surface(mesh))
    return Experiment(name, variant, light, optics, radii_m, plan)


def _surface(mesh: TriangleMesh) -> Surface:
    """The whole surface is the target; there are no reference poses."""
    n, none = len(mesh.faces), np.zeros((0, 4, 4))
    member = np.zeros(n, dtype=np.int64)
    return Surface(mesh, member, member, np.zeros((n, 3)), none, none, none)


def _requirements(mesh: TriangleMesh, gap_m: float) -> dict[str, Any]:
    """What was asked: nothing but to look; the decoder reads some of the limits."""
    return {
        "max_projectors": len(PROJECTORS_DEG),
        "max_cameras": len(CAMERAS_DEG),
        "coverage": 0.95,
        "dominant_coverage": 0.9,
        "min_reachable": 0.9,
        "target": "surface",
        "pattern": "rings",
        "projector": {"max_incidence": np.deg2rad(60.0), "min_tangent_angle": 0.7},
        "camera": {"max_incidence": _MAX_INCIDENCE, "max_sample_distance_m": None},
        "triangulation": {"min_conditioning": 0.1, "noise_px": 0.1},
        "check": {
            "max_rms_m": _ANY_M,
            "max_p95_m": _ANY_M,
            "max_bias_m": _ANY_M,
            "tau_m": gap_m,
            "min_completeness": 0.0,
            "max_predicted_missing": 1.0,
        },
        "workspace": {
            "centre": mesh.centre.tolist(),
            "object_radius_m": mesh.radius,
            "up": [0.0, 0.0, 1.0],
            "axis": [0.0, -1.0, 0.0],
            "half_angle": np.pi,
            "projector_radius_m": [STANDOFF_M, STANDOFF_M],
            "camera_radius_m": [STANDOFF_M, STANDOFF_M],
            "floor_m": None,
            "n_reference_projectors": 0,
            "n_reference_cameras": 0,
            "reference_ring_radius": 0.0,
        },
    }
