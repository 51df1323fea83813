"""The acceptance test of VDI/VDE 2634 part 2, on rendered artefacts in a plan's volume.

    PF   probing error, form: span of a sphere's points about the sphere fitted freely
    PS   probing error, size: diameter of that sphere less the calibrated one
    SD   sphere spacing error: distance of two fitted centres less the calibrated one
    F    flatness measurement error: span of a plate's points about their plane

Three in a thousand points may be left out of a span, and those count alone whose stated
deviation keeps to what the plan asks of a point. Each artefact is rendered, decoded
and merged as the object is in the plan's check; what a calibration leaves then moves
the points of a whole rig alike (`rigs_off`), so that one rendering serves them all.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from geometry.arrays import Array, Mask
from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from planning.model.errors import InfeasibleLimitsError
from planning.verify.reconstruction.check.merge import merge
from planning.verify.reconstruction.check.overlaps import ring_pitch_px
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.render.photometry import assumed_light
from planning.verify.reconstruction.render.rendered import Spent, decode_rendered
from planning.verify.reconstruction.scanner import Scanner

from .artefacts import Bar, Plate, bars, plates
from .fits import FEWEST, fit_sphere, flatness
from .rigs_off import displaced, drawn

Quantity = Literal["PF", "PS", "SD", "F"]
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
# Of a plate's face so much is left out along its border, as a share of each side.
_BORDER = 0.05


@dataclass(frozen=True, eq=False)
class Measured:
    """An artefact, and the merged points that a rig measured of it.

    Attributes:
        artefact: What was rendered.
        cloud: Of all its surface.
    """

    artefact: Bar | Plate
    cloud: Cloud

    def deviations(self, moved: Array) -> dict[Quantity, list[float]]:
        """Return what is read from the points, each moved by (n, 3) [m]."""
        points = self.cloud.points + moved
        known = np.isfinite(points).all(axis=1)
        if isinstance(self.artefact, Plate):
            face = points[known & self._on_face(self.artefact)]
            return {"F": [flatness(face)]} if len(face) >= FEWEST else {}
        nearest = self._of_sphere(self.artefact)
        balls = [
            fit_sphere(points[known & (nearest == k)])
            for k in (0, 1)
            if np.count_nonzero(known & (nearest == k)) >= FEWEST
        ]
        found: dict[Quantity, list[float]] = {
            "PF": [ball.form for ball in balls],
            "PS": [2.0 * (ball.radius - self.artefact.radius) for ball in balls],
        }
        if len(balls) == 2:
            apart = float(np.linalg.norm(balls[1].centre - balls[0].centre))
            found["SD"] = [apart - self.artefact.length]
        return found

    def _on_face(self, plate: Plate) -> Mask:
        """Which points lie within the plate's face, and were seen from before it."""
        pose, (length, width, thick) = plate.pose, plate.size
        x, y, z = ((self.cloud.points - pose[:3, 3]) @ pose[:3, :3]).T
        reach = 0.5 - _BORDER
        inside = (np.abs(x) <= reach * length) & (np.abs(y) <= reach * width)
        seen = self.cloud.rays @ pose[:3, 2] < 0.0
        return inside & seen & (np.abs(z) < 0.5 * thick)

    def _of_sphere(self, bar: Bar) -> Array:
        ways = self.cloud.points[:, None] - bar.centres
        return np.linalg.norm(ways, axis=2).argmin(axis=1)


@dataclass(frozen=True, eq=False)
class Acceptance:
    """What a maker would state of a rig.

    Attributes:
        ball: Radius of the ball about the object, half of L0 [m].
        perfect: Deviations at each place, the devices where they are taken to be [m].
        drawn: Of each drawn rig the largest deviation in size, (draws,) each [m].
        unmeasured: Names of artefacts that too few points were measured of.
    """

    ball: float
    perfect: dict[Quantity, tuple[float, ...]]
    drawn: dict[Quantity, Array]
    unmeasured: tuple[str, ...]

    def largest(self, quantity: Quantity) -> float:
        """Return the largest deviation in size of a perfectly calibrated rig [m]."""
        return float(np.abs(self.perfect[quantity]).max())

    def quantiles(self, quantity: Quantity) -> tuple[float, float]:
        """Return what half, and 95 %, of the drawn rigs keep to [m]."""
        half, most = np.quantile(self.drawn[quantity], [0.5, 0.95])
        return float(half), float(most)

    def to_document(self) -> dict[str, Any]:
        """Return plain JSON values, in metres."""
        return {
            "L0_m": 2.0 * self.ball,
            "perfect": {
                name: {
                    "places": len(values),
                    "largest_m": self.largest(name),
                    "each_m": list(values),
                }
                for name, values in self.perfect.items()
            },
            "calibrated": {
                name: {
                    "rigs": len(values),
                    "median_m": self.quantiles(name)[0],
                    "p95_m": self.quantiles(name)[1],
                }
                for name, values in self.drawn.items()
            },
            "unmeasured": list(self.unmeasured),
        }


def accept(
    scanner: Scanner,
    *,
    seed: int,
    draws: int,
    threads: int | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> Acceptance:
    """Measure every artefact, as calibrated perfectly and in rigs drawn at random.

    Args:
        scanner: The plan's; its mesh says where the measuring volume is.
        seed: Of pixel noise and of the rigs.
        draws: How many rigs; none are drawn where the plan states no calibration.
        threads: Worker threads; no result depends on them. None: all cores.
        progress: Receives a line for each artefact.

    Raises:
        InfeasibleLimitsError: If too few points were measured of every artefact.
    """
    threads = threads or n_threads()
    places: dict[str, Bar | Plate] = {
        **{f"bar {k}": one for k, one in enumerate(bars(scanner), 1)},
        **{f"plate {k}": one for k, one in enumerate(plates(scanner), 1)},
    }
    measured: list[Measured] = []
    unmeasured: list[str] = []
    perfect: dict[Quantity, list[float]] = {name: [] for name in QUANTITIES}
    for k, (name, artefact) in enumerate(places.items()):
        progress(f"artefacts: {name}, {k + 1} of {len(places)}")
        one = Measured(artefact, _cloud(scanner, artefact.mesh(), seed + k, threads))
        found = one.deviations(np.zeros_like(one.cloud.points))
        if not found.get("SD" if isinstance(artefact, Bar) else "F"):
            unmeasured.append(name)
            continue
        measured.append(one)
        for quantity, values in found.items():
            perfect[quantity] += values
    if not measured:
        raise InfeasibleLimitsError(
            f"of none of {len(places)} artefacts {FEWEST} points are measured in the "
            f"ball of {1e3 * scanner.mesh.radius:.0f} mm about the object; plan for "
            f"more of it"
        )
    return Acceptance(
        scanner.mesh.radius,
        {name: tuple(values) for name, values in perfect.items() if values},
        _drawn(scanner, measured, seed, draws),
        tuple(unmeasured),
    )


def _cloud(scanner: Scanner, mesh: TriangleMesh, seed: int, threads: int) -> Cloud:
    """Return the merged points that a rig measures of an artefact as it should."""
    before = replace(scanner, mesh=mesh)
    decoded = decode_rendered(
        scanner,
        before,
        assumed_light(scanner),
        seed=seed,
        threads=threads,
        spent=Spent(),
    )
    everything = Cloud.join([one.cloud.of_devices(p, c) for (p, c), one in decoded])
    if not len(everything):
        return everything
    lit = {pair: one.lit for pair, one in decoded}
    pitch = ring_pitch_px(everything, scanner)
    merged = merge(everything, scanner, lit, pitch_px=pitch)
    total = np.hypot(merged.sigma, merged.calibration)
    return merged.cloud.take(total <= scanner.limits.max_sigma_m)


def _drawn(
    scanner: Scanner, measured: list[Measured], seed: int, draws: int
) -> dict[Quantity, Array]:
    """Return the largest deviation of each drawn rig over all places."""
    errors = scanner.calibration
    if errors is None or not draws:
        return {}
    largest: dict[Quantity, list[float]] = {name: [] for name in QUANTITIES}
    for k in range(draws):
        rig = drawn(scanner, errors, np.random.default_rng((seed, k)))
        of_rig: dict[Quantity, list[float]] = {name: [] for name in QUANTITIES}
        for one in measured:
            moved = displaced(one.cloud, scanner, rig)
            for quantity, values in one.deviations(moved).items():
                of_rig[quantity] += np.abs(values).tolist()
        for quantity, values in of_rig.items():
            if values:
                largest[quantity].append(max(values))
    return {name: np.array(values) for name, values in largest.items() if values}
