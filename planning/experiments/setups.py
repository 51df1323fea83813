"""The two set-ups of section VII: the box under 7 circles, the face under 3.

What the paper states is taken as it is: 2 projectors, 2 cameras, their resolutions,
about 1 m, the focal length and image centre, the circles' number, the face's radii.
Everything else is ours, because the paper doesn't give it: directions of the devices,
the size of the box, the box's radii, the head, the projectors' optics.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import box
from geometry.shapes.sample_head.sample_head import sample_head
from planning.model.requirements import CheckLimits
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.light_laws import LightName
from planning.verify.reconstruction.scanner import ScanLimits, Scanner

from .paper_devices import (
    FITTING,
    PRINTED,
    Optics,
    bearing,
    placed_camera,
    placed_projector,
)

Variant = Literal["printed", "fits"]
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
_HEAD_FACES = 20_000
_ANY_M = 1.0
# More than this slants rings until they smear; the decoder's limit [rad].
_MAX_LIT, _MAX_SEEN = float(np.deg2rad(60.0)), float(np.deg2rad(70.0))


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
        scanner: Devices and object, as the decoder knows them.
    """

    name: str
    variant: str
    light: LightName
    optics: Optics
    radii_m: Array
    scanner: Scanner

    @property
    def mesh(self) -> TriangleMesh:
        """The object."""
        return self.scanner.mesh

    @property
    def gap_m(self) -> float:
        """Median gap between rings, from the centre on [m]."""
        return float(np.median(np.diff(self.radii_m, prepend=0.0)))


def paper_experiment(
    name: str,
    *,
    light: LightName = "parallel",
    variant: Variant = "printed",
    distortion: float = 0.0,
    radii_m: Array | None = None,
) -> Experiment:
    """Return the `box`, an edge towards the rig, or the `face`, and the devices.

    Args:
        name: Of the object.
        light: `parallel`, as the paper assumes, or `diverging`.
        variant: Focal length and image centre.
        distortion: k1 of the cameras' lenses; the decoder knows it.
        radii_m: Other radii than the paper's [m], rising.
    """
    build, target, stated_m = _OBJECTS[name]
    mesh, radii = build(), stated_m if radii_m is None else radii_m
    optics = replace(VARIANTS[variant], distortion=distortion)
    gap_m = float(np.median(np.diff(radii, prepend=0.0)))
    # Nothing is asked but to look; the decoder reads some of the limits.
    check = CheckLimits(_ANY_M, _ANY_M, _ANY_M, gap_m, 0.0, 1.0)
    scanner = Scanner(
        tuple(
            placed_projector(f"P{number}", light, bearing(*at), target, radii)
            for number, at in enumerate(PROJECTORS_DEG, 1)
        ),
        tuple(
            placed_camera(f"C{number}", optics, bearing(*at), target)
            for number, at in enumerate(CAMERAS_DEG, 1)
        ),
        mesh,
        np.zeros(len(mesh.faces), dtype=np.int64),
        np.ones(len(mesh.faces), dtype=bool),
        ScanLimits(check, 0.1, _MAX_LIT, _MAX_SEEN),
    )
    return Experiment(name, variant, light, optics, radii, scanner)


box_experiment = partial(paper_experiment, "box")
face_experiment = partial(paper_experiment, "face")


def _box() -> TriangleMesh:
    plain = box((BOX_M, BOX_M, BOX_M))
    turned = Rotation.from_euler("z", 45.0, degrees=True).as_matrix()
    return TriangleMesh(plain.vertices @ turned.T, plain.faces)


@cache
def _head() -> TriangleMesh:
    return sample_head(n_faces=_HEAD_FACES)


# The mesh, where the ring axes meet it, and the radii. The head's point lies between
# the tip of the nose and the eyes.
_OBJECTS: dict[str, tuple[Callable[[], TriangleMesh], Array, Array]] = {
    "box": (_box, np.array([0.0, -BOX_M / np.sqrt(2.0), 0.0]), BOX_RADII_M),
    "face": (_head, np.array([0.0, -0.090, -0.020]), FACE_RADII_M),
}
