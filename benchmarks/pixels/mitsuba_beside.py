r"""Images of Mitsuba 3, a path tracer that isn't ours, beside the built-in renderer's.

First both render the same matt world without a bounce: how far edges lie apart, the
error of both clouds, and error / sigma by decile of sigma with sensor noise. Then what
the built-in renderer leaves out, one effect after the other.

    PYTHONPATH=.:tests python -m benchmarks.pixels.mitsuba_beside \
        [PATHS [OF_EFFECTS [EFFECT...]]]

with 48 paths a pixel for both, or so many; 0 leaves a table out. Of the effects, those
whose names begin so, or all.
Where Mitsuba is missing (`pip install 'ringrig[render]'`) it says so, no more.
"""

import sys
import time
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from support import reconstruction_rigs as rigs

from benchmarks.pixels.cloud_sigma import OverSigma
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.shapes.sample_head.sample_head import sample_head
from planning.verify.reconstruction.check.accuracy import Expected, nearest_distance
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.patterns.defocus import Defocus
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.render.mitsuba.materials import Surface
from planning.verify.reconstruction.render.mitsuba.physics import Physics
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.scanner import Scanner

_Array = NDArray[np.float64]
_FALSE_M = 1e-3
_NOISY, _CLEAN = Photometry(), Photometry(noisy=False)


def rig(mesh: TriangleMesh, focal: float) -> Scanner:
    """Return a projector and two cameras 1 m before the front of an object."""
    projector = rigs.diverging("P1", rigs.direction(-15.0, 5.0), mesh.radius, 3.5e-3)
    cameras = [
        rigs.camera("C1", rigs.direction(0.0, -20.0), focal=focal),
        rigs.camera("C2", rigs.direction(12.0, 25.0), focal=focal),
    ]
    return Scanner.of(rigs.plan_of(mesh, [projector], cameras))


def head() -> TriangleMesh:
    """Return the sample head about the origin."""
    mesh = sample_head(n_faces=40_000, open_neck=True)
    return TriangleMesh(mesh.vertices - mesh.centre, mesh.faces)


@dataclass(frozen=True)
class Effect:
    """What differs from the matt world without a bounce."""

    name: str
    physics: dict[str, Any] = field(default_factory=dict)
    surface: dict[str, Any] = field(default_factory=dict)
    light: dict[str, Any] = field(default_factory=dict)
    focus: Defocus | None = None


EFFECTS = (
    Effect("matt, no bounce"),
    Effect("texture 0.6", surface={"texture": 0.6}),
    Effect("ambient 0.5", light={"ambient": 0.5}),
    Effect("projector f/1.6 set to 1.2 m", focus=Defocus(1.2, 12e-3)),
    Effect("gamma 2.2", light={"gamma": 2.2}),
    Effect("vignetting 0.5", physics={"vignetting": 0.5}),
    Effect("gloss", physics={"material": "gloss", "bounces": 2}),
    Effect("metal", physics={"material": "metal", "bounces": 2}),
    Effect(
        "interreflection, albedo 0.8",
        physics={"bounces": 3},
        surface={"albedo": 0.8},
    ),
    Effect("skin, albedo 0.6", physics={"material": "skin"}, surface={"albedo": 0.6}),
)


def edges_apart(ours: Reconstruction, theirs: Reconstruction) -> tuple[_Array, float]:
    """Return distances of the same edges in both images [px]; share that both have.

    Edges are of one row or column; the nearest of the same ring is the same.
    """
    places = [
        np.column_stack([c.pixels, 1e3 * c.ring, 1e5 * c.camera])
        for c in (ours.everything, theirs.everything)
    ]
    away, nearest = KDTree(places[1]).query(places[0], distance_upper_bound=0.9)
    found = np.isfinite(away)
    apart = (places[1][np.asarray(nearest)[found]] - places[0][found])[:, :2]
    alike = np.any(np.abs(apart) < 1e-6, axis=1)
    return np.linalg.norm(apart[alike], axis=1), float(found.mean())


def beside(name: str, scanner: Scanner, spp: int) -> None:
    """Print both renderers' figures of an object."""
    physics, begin = Physics(bounces=0, spp=spp), time.monotonic()
    for words, light in (("no noise", _CLEAN), ("sensor noise", _NOISY)):
        ours = reconstruct(scanner, seed=0, photometry=light)
        theirs = reconstruct(scanner, seed=0, photometry=light, physics=physics)
        errors = [one.accuracy for one in (ours, theirs)]
        apart, both = edges_apart(ours, theirs)
        rms = [np.nan if one is None else 1e3 * one.rms_m for one in errors]
        print(
            f"| {name}, {words} | {_rms(apart):.3f} ({both:.1%}) | {rms[0]:.4f} | "
            f"{rms[1]:.4f} | {rms[1] / rms[0] - 1.0:+.0%} |"
        )
        if light.noisy:
            for who, one in (("built-in", ours), ("Mitsuba", theirs)):
                sure = OverSigma.of(one, scanner)
                row = f"{sure.deciles}   all {sure.ratio:.2f}"
                print(f"| {name}, error / sigma, {who} | {row} | | | |")
    print(f"<!-- {time.monotonic() - begin:.0f} s -->", flush=True)


def effects(scanner: Scanner, spp: int, some: tuple[str, ...]) -> None:
    """Print a line for each effect whose name begins with one of these."""
    samples = sample_surface(scanner.mesh, 20_000, seed=0)
    tau = scanner.limits.check.tau_m
    first = reconstruct(scanner, seed=0, photometry=_NOISY).everything
    measured = nearest_distance(first, samples, 2.01 * tau) <= tau
    expected = Expected(samples, measured)
    print("\nCompleteness: of what the built-in renderer measures\n")
    print(
        "| effect | rms [mm] | bias [mm] | rms / sigma | complete | left out | "
        "false > 1 mm | what is told |\n|---|---|---|---|---|---|---|---|"
    )
    for effect in (one for one in EFFECTS if one.name.startswith(some)):
        usual = Physics(bounces=0, spp=spp, surface=Surface(**effect.surface))
        begin, physics = time.process_time(), replace(usual, **effect.physics)
        light = replace(_NOISY, **effect.light)
        stands = replace(scanner, projector_focus=effect.focus)
        result = reconstruct(
            stands, seed=0, expected=expected, photometry=light, physics=physics
        )
        print(_line(effect.name, result, scanner), flush=True)
        print(
            f"{time.process_time() - begin:.0f} s of CPU", file=sys.stderr, flush=True
        )


def _line(name: str, result: Reconstruction, scanner: Scanner) -> str:
    told = "; ".join(result.failures + result.remarks) or "nothing: limits are kept"
    errors = result.accuracy
    if errors is None:
        return f"| {name} | | | | | | | {told} |"
    ratio = OverSigma.of(result, scanner).ratio
    left_out = sum(sum(pair.rejected.values()) for pair in result.pairs)
    share = left_out / max(1, sum(pair.n_edges for pair in result.pairs))
    false = errors.beyond(_FALSE_M)
    return (
        f"| {name} | {1e3 * errors.rms_m:.3f} | {1e3 * errors.bias_m:+.3f} | "
        f"{ratio:.2f} | {result.completeness.fractions[1]:.1%} | {share:.1%} | "
        f"{false:.3%} | {told} |"
    )


def _rms(values: _Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main(spp: int, of_effects: int, some: tuple[str, ...]) -> None:
    """Print both tables."""
    if find_spec("mitsuba") is None:
        print("skipped: Mitsuba isn't installed (pip install 'ringrig[render]')")
        return
    objects = {"head": rig(head(), 2400.0)}
    if spp:
        waves = rigs.bumpy_sphere(0.055, subdivisions=6)
        print(f"{spp} paths a pixel, one projector of 1280 x 800, two cameras\n")
        print(
            "| object | edges apart, rms [px] (share found) | built-in rms [mm] | "
            "Mitsuba rms [mm] | difference |\n|---|---|---|---|---|"
        )
        for name, scanner in ({"waves": rig(waves, 3478.0)} | objects).items():
            beside(name, scanner, spp)
    if of_effects:
        print(f"\nHead, {of_effects} paths a pixel")
        effects(objects["head"], of_effects, some)


if __name__ == "__main__":
    paths = [int(number) for number in sys.argv[1:3]] or [48]
    main(paths[0], paths[-1], tuple(sys.argv[3:]) or ("",))
