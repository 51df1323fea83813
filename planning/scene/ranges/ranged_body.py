"""The object where nothing was known of its ranges: points, sphere, uncertainty.

The paper's case without prior information of ranges: they come by least squares from
what a few trial views or a few measured distances say. `docs/use/ranges.md`.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from geometry.mesh.mesh import MeshSource, TriangleMesh
from geometry.shapes.best_sphere import BestSphere, fit_sphere
from geometry.shapes.primitives import sphere
from geometry.shapes.sight_lines import SightedPoint, locate
from planning.model.errors import InputError

from .range_file import Observation, RangeFile, read_range_file, sight_lines

# Observations that chance would let disagree so much once in a thousand are refused.
SIGNIFICANCE = 1e-3
# A point known no better than this share of its distance isn't known to first order.
_VAGUE = 0.1
_SUBDIVISIONS = 4


@dataclass(frozen=True, eq=False)
class RangedPoint:
    """A point of the object, from some rows of the file."""

    name: str
    lines: tuple[int, ...]
    estimate: SightedPoint


@dataclass(frozen=True)
class Refused:
    """Rows of a point that were left out, and why."""

    name: str
    lines: tuple[int, ...]
    reason: str


@dataclass(frozen=True, eq=False)
class RangedBody:
    """The least-squares sphere of observations: what is planned for without a mesh."""

    file: RangeFile
    points: tuple[RangedPoint, ...]
    refused: tuple[Refused, ...]
    ball: BestSphere

    @cached_property
    def mesh(self) -> TriangleMesh:
        """The sphere as a surface, in the axes of the file."""
        ball = sphere(self.ball.radius, subdivisions=_SUBDIVISIONS)
        n, m = len(ball.vertices), len(ball.faces)
        source = MeshSource(self.file.path, self.file.sha256, "mm", 1e-3, n, m)
        vertices = ball.vertices + self.ball.centre
        return TriangleMesh(vertices, ball.faces, source=source)

    @cached_property
    def position_sigma_m(self) -> float:
        """Largest standard deviation of any surface point in any direction [m].

        The root of the largest eigenvalue of [I u] C [I u]^T + tau^2 u u^T over the
        directions u of the mesh's vertices.
        """
        return float(np.sqrt(self._largest.max()))

    @cached_property
    def least_known(self) -> NDArray[np.float64]:
        """Direction from the centre to the surface that is known worst, shape (3,)."""
        return self._outward[int(np.argmax(self._largest))]

    @property
    def _outward(self) -> NDArray[np.float64]:
        return (self.mesh.vertices - self.ball.centre) / self.ball.radius

    @cached_property
    def _largest(self) -> NDArray[np.floating]:
        return np.linalg.eigvalsh(self.ball.point_covariances(self._outward))[:, 2]


def read_ranges(path: str | Path) -> RangedBody:
    """Locate the object that a file of observations speaks of.

    Raises:
        InputError: If the file can't be read, or what is left of it fixes no sphere.
    """
    return ranged_body(read_range_file(path))


def ranged_body(file: RangeFile) -> RangedBody:
    """Locate the points of observations, refuse what disagrees, fit the sphere.

    Raises:
        InputError: If the points that are left fix no sphere.
    """
    named: dict[str, list[Observation]] = {}
    for observation in file.observations:
        named.setdefault(observation.point, []).append(observation)
    points: list[RangedPoint] = []
    refused: list[Refused] = []
    for name, rows in named.items():
        point, left_out = _located(name, rows)
        points += [] if point is None else [point]
        refused += left_out
    try:
        ball = fit_sphere(
            np.array([p.estimate.position for p in points]).reshape(-1, 3),
            np.array([p.estimate.covariance for p in points]).reshape(-1, 3, 3),
        )
    except (ValueError, np.linalg.LinAlgError) as error:
        raise InputError(_too_little(file.path, error, refused)) from None
    return RangedBody(file, tuple(points), tuple(refused), ball)


def _too_little(path: str, error: Exception, refused: list[Refused]) -> str:
    first = "".join(f"; {refusal_line(one)}" for one in refused[:3])
    more = f"; {len(refused) - 3} more refused" if len(refused) > 3 else ""
    return (
        f"{path}: {error}; observe more points, from more sides and not all in a "
        f"plane{first}{more}"
    )


def refusal_line(one: Refused) -> str:
    """Return what was left out and why, for a person."""
    lines = ", ".join(map(str, one.lines))
    return f"point {one.name} (line {lines}) refused: {one.reason}"


def _located(
    name: str, rows: list[Observation]
) -> tuple[RangedPoint | None, list[Refused]]:
    """A point from its rows, or without the one row that the others speak against."""
    lines = tuple(row.line for row in rows)
    located, why = _attempt(rows)
    if located is None:
        return None, [Refused(name, lines, why)]
    if _agrees(located):
        return RangedPoint(name, lines, located), []
    why = (
        f"its rows disagree, chi^2 {located.chi_square:.1f} of {located.n_free} free "
        f"(limit {_limit(located):.1f})"
    )
    rest = [_attempt(rows[:k] + rows[k + 1 :])[0] for k in range(len(rows))]
    guilty = [
        k
        for k, one in enumerate(rest)
        if one is not None and one.n_free > 0 and _agrees(one)
    ]
    if len(guilty) != 1:
        return None, [Refused(name, lines, f"{why}, and none stands out")]
    (k,) = guilty
    kept, others = rest[k], lines[:k] + lines[k + 1 :]
    assert kept is not None
    reason = f"{why}; without this row they agree"
    return RangedPoint(name, others, kept), [Refused(name, (lines[k],), reason)]


def _attempt(rows: list[Observation]) -> tuple[SightedPoint | None, str]:
    """Where rows say that a point is; None and why if they don't say it."""
    if len(rows) < 2 and all(row.range_m is None for row in rows):
        return None, "seen once and without a distance"
    lines = sight_lines(rows)
    try:
        located = locate(lines)
    except (ValueError, np.linalg.LinAlgError) as error:
        return None, str(error)
    reach = float(np.linalg.norm(located.position - lines.origins, axis=1).min())
    worst = float(np.sqrt(np.linalg.eigvalsh(located.covariance)[2]))
    if not worst <= _VAGUE * reach:
        return None, (
            f"known to {1e3 * worst:.0f} mm at {1e3 * reach:.0f} mm only: its "
            f"viewpoints stand too near to each other"
        )
    return located, ""


def _agrees(located: SightedPoint) -> bool:
    return located.n_free == 0 or located.chi_square <= _limit(located)


def _limit(located: SightedPoint) -> float:
    """Chi-square that chance exceeds once in a thousand."""
    return float(chdtri(located.n_free, SIGNIFICANCE))
