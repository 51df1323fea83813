"""Predicted s_N and ring pitch against rendered images, by deciles of |r.m|.

The edge noise s_0 is measured on a plane square to the light, seen near the optical
axis; nothing is fitted on the objects under test. Off-axis views turn the cameras
until the object stands as far off the axis as the table says.

    python -m benchmarks.pixels.sigma_deciles [focal length in px, default 3478]
"""

import sys
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation
from support import reconstruction_rigs
from support.edge_noise import EdgeNoise
from support.plain_shapes import grid
from support.reconstruction_rigs import reconstruct_plan

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from geometry.poses import look_at
from geometry.rays.proximity import closest_points
from geometry.shapes.primitives import sphere
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.scene import lighting
from planning.scene.codes.patterns import pattern_of
from planning.scene.measuring import measurability
from planning.scene.samples import Target
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.render.photometry import Photometry

_Array = NDArray[np.float64]

RIGS = reconstruction_rigs
# A 12 Mpx sensor of 3.45 um pixels behind a 12 mm lens: 30 degrees are in its image.
FOCAL, RESOLUTION = 3478.0, (4096, 3000)
GAP = 3.5e-3
LIGHT = Photometry()
# Azimuth and elevation of each camera, and the axis that it turns about: towards a
# corner of its image each.
VIEWS = ((0.0, -25.0, 0.94), (-50.0, 20.0, 2.2), (40.0, 10.0, 4.08), (12.0, 5.0, 5.34))
_UP = np.array([0.0, 0.0, 1.0])
_LIMITS = CameraLimits(np.radians(70.0))
_LEAST_LIGHT = 0.5
# The brightest texture and the ambient light reach the exposure, not the mean albedo.
_HALF_BRIGHT = 0.5 + LIGHT.ambient
_FULL = LIGHT.exposure * 255.0 / ((1.0 + LIGHT.albedo_variation) * (1 + LIGHT.ambient))
_SHOT = 255.0 / LIGHT.full_well * _HALF_BRIGHT * _FULL
_READ = LIGHT.read_noise**2 + 1.0 / 12.0
NOISE = EdgeNoise(
    LIGHT.camera_blur_px, LIGHT.projector_blur_m, float(_SHOT / (_SHOT + _READ))
)


@dataclass(frozen=True, eq=False)
class Errors:
    """Measured points against their prediction, shape (n,) each.

    Attributes:
        error: Signed distance from the mesh along its normal [m].
        per_px: s_N for an edge noise of one pixel [m/px].
        conditioning: |r.m|.
        light_cos: -N.L.
        px_per_m: Ring pitch over h [px/m].
        off_axis: Angle of the viewing ray off the optical axis [rad].
        pitch: Predicted ring pitch [px].
        seen_pitch: Mean distance to the next ring on either side in the image [px];
            NaN where one isn't there.
    """

    error: _Array
    per_px: _Array
    conditioning: _Array
    light_cos: _Array
    px_per_m: _Array
    off_axis: _Array
    pitch: _Array
    seen_pitch: _Array

    @property
    def plain(self) -> _Array:
        """Edge noise by the law of planning, up to s_0."""
        return 1.0 / self.light_cos

    @property
    def by_blur(self) -> _Array:
        """Edge noise by blur and shot noise, up to a factor."""
        return NOISE.relative(self.light_cos, self.px_per_m)

    def scale(self, law: str) -> float:
        """Return the factor of a law for which errors are its s_N in the mean."""
        return _rms(self.error / (self.per_px * getattr(self, law)))

    def deciles(self, law: str, scale: float) -> _Array:
        """Return the rms error over s_N in each decile of |r.m|, shape (10,)."""
        ratio = self.error / (scale * self.per_px * getattr(self, law))
        order = np.argsort(self.conditioning, kind="stable")
        return np.array([_rms(ratio[part]) for part in np.array_split(order, 10)])


def projector(light: str, gap: float = GAP) -> dict:
    """Return the one projector, 1 m away."""
    make = RIGS.diverging if light == "diverging" else RIGS.parallel
    return make("P1", RIGS.direction(-15.0, 5.0), 0.07, gap)


def cameras(off_axis_deg: float, focal: float = FOCAL) -> list[dict]:
    """Return cameras 1 m away that have the object so far off their axes."""
    made = []
    for index, (azimuth, elevation, turn) in enumerate(VIEWS, 1):
        position = RIGS.direction(azimuth, elevation)
        entry = RIGS.camera(f"C{index}", position, focal=focal)
        pose = look_at(position, np.zeros(3), _UP)
        about = np.cos(turn) * pose[:3, 0] + np.sin(turn) * pose[:3, 1]
        aside = Rotation.from_rotvec(np.radians(off_axis_deg) * about).as_matrix()
        pose[:3, :3] = aside @ pose[:3, :3]
        entry["world_from_device"] = pose.tolist()
        entry["resolution"] = list(RESOLUTION)
        entry["K"][0][2], entry["K"][1][2] = (0.5 * (n - 1.0) for n in RESOLUTION)
        made.append(entry)
    return made


def plane_before(source: dict) -> TriangleMesh:
    """Return a plane at the origin, square to the way to the projector."""
    sheet = grid(0.12, 0.12, divisions=(2, 2))
    turn = look_at(np.zeros(3), np.array(source["world_from_device"])[:3, 3], _UP)
    return TriangleMesh(sheet.vertices @ turn[:3, :3].T, sheet.faces)


def measured(
    mesh: TriangleMesh, source: dict, views: list[dict], light: Photometry = LIGHT
) -> Errors:
    """Render, decode and triangulate an object; return errors and predictions."""
    plan = RIGS.plan_of(mesh, [source], views)
    cloud = reconstruct_plan(plan, seed=0, threads=1, photometry=light).everything
    parts = [
        _of_camera(mesh, cloud.take(cloud.camera == c), plan.projectors[0], camera)
        for c, camera in enumerate(plan.cameras)
    ]
    return Errors(*np.concatenate(parts, axis=1))


def _of_camera(
    mesh: TriangleMesh, cloud: Cloud, source: PlannedProjector, camera: PlannedCamera
) -> _Array:
    near = closest_points(mesh, cloud.points)
    normals = mesh.face_normals[near.faces]
    samples = SurfaceSamples(cloud.points, normals, near.faces, 1.0)
    target = Target(samples, np.zeros(normals.shape))
    seen = measurability.view(camera, target, _LIMITS, None)
    light = lighting.light_on(source, target)
    rings = pattern_of(source).surfaces(cloud.points)
    asked = TriangulationLimits(0.1, 1.0)
    quality = measurability.pair_quality(normals, light, rings, seen, asked)
    cosine = seen.rays @ camera.world_from_device[:3, 2]
    kept = (seen.seen) & (light.incidence_cos > _LEAST_LIGHT)
    columns = (
        near.distances,
        quality.sigma * light.incidence_cos,
        quality.conditioning,
        light.incidence_cos,
        quality.pitch / rings.spacing,
        np.arccos(np.clip(cosine, -1.0, 1.0)),
        quality.pitch,
        _seen_pitch(cloud),
    )
    return np.stack([column[kept] for column in columns])


def _seen_pitch(cloud: Cloud) -> _Array:
    """Mean distance of each edge to the nearest of the next ring on either side."""
    # Rings lie far apart in the third coordinate, so that others aren't looked at.
    place = np.column_stack([cloud.pixels, 1e3 * cloud.ring])
    tree = KDTree(place)
    apart = [
        tree.query(place + [0.0, 0.0, 1e3 * step], distance_upper_bound=50.0)[0]
        for step in (-1, 1)
    ]
    mean = 0.5 * (apart[0] + apart[1])
    return np.where(np.isfinite(mean), mean, np.nan)


def _rms(values: _Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def objects() -> dict[str, tuple[TriangleMesh, float]]:
    """Return the objects under test, and how far off the axis they stand [deg]."""
    ball, waves = (
        sphere(0.06, subdivisions=6),
        RIGS.bumpy_sphere(0.055, subdivisions=6),
    )
    return {
        "sphere, on the axis": (ball, 0.0),
        "sphere, 15 deg off": (ball, 15.0),
        "sphere, 27 deg off": (ball, 27.3),
        "waves, 27 deg off": (waves, 27.3),
    }


def main(focal: float) -> None:
    """Print the table."""
    # As many pixels between rings, whatever the focal length, but no wider than 6 mm.
    gap = min(GAP * FOCAL / focal, 6e-3)
    print(f"f = {focal:g} px, rings {1e3 * gap:.1f} mm apart")
    print("rms of error / s_N in each decile of |r.m|; s_N with the edge noise s_px")
    print("by law 1: s_0 / (-N.L), as for planning; by law 2: blur and shot noise too")
    for light in ("diverging", "parallel"):
        source = projector(light, gap)
        plane, views = plane_before(source), cameras(0.0, focal)
        flat = measured(plane, source, views)
        scales = {law: flat.scale(law) for law in ("plain", "by_blur")}
        clean = measured(plane, source, views, replace(LIGHT, noisy=False))
        print(
            f"\n{light} light: s_0 = {scales['plain']:.4f} px, on a plane; "
            f"{clean.scale('plain'):.4f} px of it without any pixel noise"
        )
        for name, (mesh, off) in objects().items():
            found = measured(mesh, source, cameras(off, focal))
            far = np.degrees(found.off_axis.max())
            print(f"{name} (to {far:.1f} deg), {len(found.error)} points")
            cut = np.quantile(found.conditioning, np.linspace(0.1, 1.0, 10))
            print("  |r.m| up to " + " ".join(f"{c:5.2f}" for c in cut))
            for index, law in enumerate(("plain", "by_blur"), 1):
                parts = found.deciles(law, scales[law])
                mean = found.scale(law) / scales[law]
                off_mean = parts / mean - 1.0
                print(
                    f"  law {index}       "
                    + " ".join(f"{p:5.2f}" for p in parts)
                    + f"   all {mean:.2f}, deciles {100 * off_mean.min():+.1f} to "
                    f"{100 * off_mean.max():+.1f} % of it"
                )
            ratio = found.seen_pitch / found.pitch
            low, middle, high = np.nanquantile(ratio, [0.05, 0.5, 0.95])
            print(
                f"  pitch seen / predicted: median {middle:.4f}, 5 % {low:.4f}, "
                f"95 % {high:.4f}; predicted {found.pitch.min():.1f} to "
                f"{found.pitch.max():.1f} px"
            )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else FOCAL)
