"""Compare evenly spaced rings with those spaced by curvature, by what lies between.

Usage: python -m benchmarks.paper.ring_radii   (from a checkout, ringrig installed)

Plans the sample head and, where `../shared/data/meshes` exists, the face scan; then
measures for every projector how far the lit surface is from straight lines between
neighbouring rings, along the beam, at three places of each gap and 720 azimuths. Steps
and chords over creases are left out. Even rings as placed, and as many as the plan's
own; the plan's own, by curvature; and two spacings of as many rings that know neither
cameras nor a widest gap, by sqrt(kappa) and by R^0.2 kappa^0.4 of the target.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.machine import machine
from geometry.files.readers import load_mesh
from planning import RequirementError, load_rig, plan_rig
from planning.model.devices.planned import PlannedProjector
from planning.rings.beam_profile import cast_beam
from planning.rings.ring_creases import Creases, find_creases
from planning.rings.ring_limits import ring_beam
from planning.rings.ring_radii import uniform_radii
from planning.rings.ring_spacing import spaced_radii
from planning.rings.ring_stage import space_rings
from planning.scene.codes.patterns import pattern_of
from planning.scene.scene import Scene

ROOT = Path(__file__).resolve().parents[2]
SCAN = ROOT.parent / "shared" / "data" / "meshes" / "face_scan_james.obj"
MESHES = {"face.obj": (ROOT / "face.obj", {}), "face scan": (SCAN, {"size_mm": 200.0})}
AZIMUTHS = 720
PLACES = 4
MM = 1e3


def main() -> int:
    """Print the table; return 0."""
    print(f"{machine()}\n")
    print(
        "Distance of the lit surface from chords between rings, along the beam [mm].\n"
    )
    print(
        "| mesh | projector | spacing | rings | gaps on lit samples [mm] "
        "| target rms | 99 % | 99.9 % | max | all that is lit rms | 99 % | max |"
    )
    print("|" + "---|" * 12)
    seconds = {
        name: _compare(name, path, unit)
        for name, (path, unit) in MESHES.items()
        if path.exists()
    }
    for name, spent in seconds.items():
        print(f"\n{name}: spacing all projectors took {spent:.2f} s.")
    return 0


def _compare(name: str, path: Path, unit: dict[str, float]) -> float:
    """Print the rows of one mesh; return the seconds that spacing its rings took."""
    mesh = load_mesh(path, **(unit or {"unit": "mm"}))
    try:
        plan = plan_rig(mesh, load_rig("default"), max_projectors=3, check=False)
    except RequirementError as error:
        plan = error.plan
    surface = plan.surface
    scene = Scene(
        surface.mesh, surface.region, surface.steep, plan.requirements, 0, threads=1
    )
    outer = plan.projectors[0].ring_radii[-1]
    n_even = plan.to_document()["projectors"][0]["rings"]["n_even"]
    even = [
        replace(p, ring_radii=uniform_radii(outer, outer / n_even * (1.0 + 1e-12)))
        for p in plan.projectors
    ]
    begin = time.perf_counter()
    spaced = space_rings(scene, even, plan.cameras, "curvature").projectors
    spent = time.perf_counter() - begin
    creases = find_creases(scene.mesh, 0.5 * scene.mesh.mean_edge)
    for before, own in zip(even, spaced, strict=True):
        n = len(own.ring_radii)
        same = replace(own, ring_radii=outer * np.arange(1, n + 1) / n)
        cases = {
            "even": before,
            "even, as many": same,
            "**by curvature**": own,
            "sqrt(kappa) alone": _unbounded(scene, before, creases, n, 0.5, 0.0),
            "R^0.2 kappa^0.4 alone": _unbounded(scene, before, creases, n, 0.4, 0.2),
        }
        for label, projector in cases.items():
            if label == "even, as many" and n == len(before.ring_radii):
                continue
            _print_row(scene, name, label, projector, creases)
    return spent


def _unbounded(
    scene: Scene,
    projector: PlannedProjector,
    creases: Creases,
    n: int,
    power: float,
    outwards: float,
) -> PlannedProjector:
    """Rings by a power of kappa with no limit but that gaps are 1/4 to 4 even ones."""
    beam = ring_beam(scene, projector, creases)
    limits, even = beam.limits(), beam.even_gap
    middle = 0.5 * (limits.edges[1:] + limits.edges[:-1])
    # spaced_radii goes by the root of what it is given.
    weight = limits.kappa ** (2.0 * power) * middle ** (2.0 * outwards)
    whole = np.ones(len(weight))
    wide = replace(
        limits,
        kappa=weight,
        coarsest=np.where(limits.free, limits.coarsest, 4.0 * even),
        finest=np.where(limits.free, limits.finest, 0.25 * even * whole),
    )
    return replace(projector, ring_radii=spaced_radii(wide, n))


def _print_row(
    scene: Scene, name: str, label: str, projector: PlannedProjector, creases: Creases
) -> None:
    target, lit, gaps = _errors(scene, projector, creases)
    print(
        f"| {name} | {projector.id} | {label} | {len(projector.ring_radii)} "
        f"| {gaps[0]:.1f} to {gaps[1]:.1f} "
        f"| {_rms(target):.3f} | {_upper(target, 0.99):.3f} "
        f"| {_upper(target, 0.999):.3f} | {target.max():.3f} "
        f"| {_rms(lit):.3f} | {_upper(lit, 0.99):.3f} | {lit.max():.3f} |",
        flush=True,
    )


def _errors(
    scene: Scene, projector: PlannedProjector, creases: Creases
) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
    """Largest error in each gap at each azimuth, on target and all that is lit [mm]."""
    radii = projector.ring_radii
    share = np.arange(PLACES) / PLACES
    rows = np.append(
        (radii[:-1, None] + np.diff(radii)[:, None] * share).ravel(), radii[-1]
    )
    profile = cast_beam(scene, projector, rows, AZIMUTHS)
    steepest = np.tan(scene.requirements.projector.max_incidence)
    crossed = _crossed(projector, radii, creases)
    on_target, everywhere, widths = [], [], []
    for gap in range(len(radii) - 1):
        part = slice(gap * PLACES, (gap + 1) * PLACES + 1)
        c, z = rows[part], profile.heights[part]
        stretch = np.sqrt(1.0 + c**2) if projector.light == "diverging" else 1.0 + 0 * c
        far = np.log(z * stretch[:, None])
        rise = np.abs(np.diff(far, axis=0)) <= steepest * np.diff(np.arctan(c))[:, None]
        good = profile.lit[part].all(axis=0) & rise.all(axis=0) & ~crossed[gap]
        weight = ((c - c[0]) / (c[-1] - c[0]))[:, None]
        chord = 1.0 / ((1.0 - weight) / z[0] + weight / z[-1])
        error = (np.abs(z - chord) * stretch[:, None]).max(axis=0)
        everywhere.append(error[good])
        on_target.append(error[good & profile.target[part].any(axis=0)])
        widths += (z[0] * (c[-1] - c[0]) / np.sqrt(1.0 + c[0] ** 2))[good].tolist()
    target, lit = (MM * np.concatenate(parts) for parts in (on_target, everywhere))
    return target, lit, (MM * min(widths), MM * max(widths))


def _crossed(
    projector: PlannedProjector, radii: np.ndarray, creases: Creases
) -> np.ndarray:
    """Whether a crease crosses each gap at each azimuth."""
    ring = creases.points - projector.world_from_ring[:3, 3]
    ring = ring @ projector.world_from_ring[:3, :3]
    turn = np.arctan2(ring[:, 1], ring[:, 0]) % (2.0 * np.pi)
    column = np.floor(turn * AZIMUTHS / (2.0 * np.pi)).astype(int)
    gap = np.searchsorted(radii, pattern_of(projector).coordinate(creases.points)) - 1
    crossed = np.zeros((len(radii) - 1, AZIMUTHS), dtype=bool)
    inside = (gap >= 0) & (gap < len(crossed))
    for aside in (-1, 0, 1):
        crossed[gap[inside], (column[inside] + aside) % AZIMUTHS] = True
    return crossed


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _upper(values: np.ndarray, share: float) -> float:
    return float(np.quantile(values, share))


if __name__ == "__main__":
    sys.exit(main())
