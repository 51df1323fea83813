"""Eqs. (9)-(10) against brute force in the plane: 8 modes of random set-ups.

Two cameras look at two half planes that meet in an edge. Brute force asks, point by
point from E onwards, whether camera 2 projects it inside its image, at an accepted
incidence and with a free line of sight; it knows projections, dot products and crossing
segments, no signed angle. E, the end of camera 1's stretch, is found by the same means.

    python -m benchmarks.paper.coverage_triangle [set-ups per mode, default 3000]
"""

import sys
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from planning.cameras.baselines.coverage_triangle import largest_baseline, seam_angles

_Array = NDArray[np.float64]

SHAPES = ("flat", "bent", "concave", "unequal")
MODES = tuple((axes, shape) for axes in ("parallel", "turned") for shape in SHAPES)
# Points of the stretch beyond E that camera 2 must see; close by E first.
_BEYOND = np.concatenate([np.geomspace(1e-6, 0.1, 60), np.linspace(0.11, 1.0, 60)])
_BISECTIONS = 60


@dataclass(frozen=True, eq=False)
class SetUps:
    """n planar set-ups; arc length s runs from side 1 (s < edge) to side 2.

    Vectors are (n, 2); the edge is at s = 0, side 1 runs along +x with normal +y.
    """

    turn: _Array
    centre1: _Array
    axis1: _Array
    start1: _Array
    field1: _Array
    theta1: _Array
    centre2: _Array
    axis2: _Array
    start2: _Array
    field2: _Array
    theta2: _Array

    def keep(self, mask: NDArray[np.bool_]) -> Self:
        """Return the set-ups of a mask."""
        return type(self)(**{f.name: getattr(self, f.name)[mask] for f in fields(self)})

    def point(self, s: _Array) -> _Array:
        """Return the surface points at arc length s (n,)."""
        side2 = np.column_stack([np.cos(self.turn), -np.sin(self.turn)])
        side1 = np.array([1.0, 0.0])
        return s[:, None] * np.where(s[:, None] > 0.0, side2, side1)

    def normal(self, beyond: NDArray[np.bool_]) -> _Array:
        """Return the normals of side 2 where `beyond`, else of side 1."""
        side2 = np.column_stack([np.sin(self.turn), np.cos(self.turn)])
        return np.where(beyond[:, None], side2, np.array([0.0, 1.0]))

    def sees(self, camera: int, s: _Array) -> NDArray[np.bool_]:
        """Return whether a camera sees the surface at s, by brute force."""
        centre, axis, half, theta = (
            getattr(self, f"{name}{camera}")
            for name in ("centre", "axis", "field", "theta")
        )
        point, normal = self.point(s), self.normal(s > 0.0)
        ray = point - centre
        depth = _dot(ray, axis)
        aside = np.abs(ray[:, 0] * axis[:, 1] - ray[:, 1] * axis[:, 0])
        in_field = (depth > 0.0) & (aside <= depth * np.tan(half))
        length = np.linalg.norm(ray, axis=1)
        squarely = -_dot(ray, normal) >= np.cos(theta) * length
        return in_field & squarely & ~self._blocked(centre, s)

    def _blocked(self, centre: _Array, s: _Array) -> NDArray[np.bool_]:
        """Whether the line of sight crosses the other side, taken 10 m long."""
        point = self.point(s)
        other = self.point(np.where(s > 0.0, -10.0, 10.0))
        ray = point - centre
        cross = ray[:, 0] * other[:, 1] - ray[:, 1] * other[:, 0]
        safe = np.where(np.abs(cross) < 1e-15, np.nan, cross)
        # centre + a ray = b other, the edge being the origin.
        a = -(centre[:, 0] * other[:, 1] - centre[:, 1] * other[:, 0]) / safe
        b = -(centre[:, 0] * ray[:, 1] - centre[:, 1] * ray[:, 0]) / safe
        return (a > 0.0) & (a < 1.0 - 1e-9) & (b > 0.0) & (b < 1.0)


def draw_set_ups(
    axes: str, shape: str, n: int, rng: np.random.Generator
) -> tuple[SetUps, _Array, NDArray[np.bool_]]:
    """Return n set-ups of a mode, E of each as an arc length, and the verdicts.

    A set-up counts when each camera sees the point that it aims at, and no edge but the
    one at E lies between E and camera 2's aim.
    """
    parts: list[tuple[SetUps, _Array, NDArray[np.bool_]]] = []
    while sum(len(end) for _, end, _ in parts) < n:
        raw = _random(axes, shape, 2 * n, rng)
        raw = _edge_at_end(raw.keep(raw.sees(1, raw.start1)), rng)
        end = _end_of_camera1(raw)
        valid = (end >= 0.0) & (raw.start2 > end + 1e-3) & raw.sees(2, raw.start2)
        good, end = raw.keep(valid), end[valid]
        parts.append((good, end, _covered(good, end)))
    names = [f.name for f in fields(SetUps)]
    joined = {k: np.concatenate([getattr(p[0], k) for p in parts])[:n] for k in names}
    return (
        SetUps(**joined),
        np.concatenate([p[1] for p in parts])[:n],
        np.concatenate([p[2] for p in parts])[:n],
    )


def predicted(
    ups: SetUps, end: _Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_], _Array]:
    """Return verdicts by phi, by d and by the shorthand, and the slack.

    Verdicts by d where phi or phi_max leave (0, pi) are taken from phi.
    """
    edge = np.abs(end) < 1e-9
    here = ups.normal(~edge & (end > 0.0))
    beyond = ups.normal(edge | (end > 0.0))
    angles = seam_angles(
        _lift(ups.point(end)),
        _lift(ups.point(end + 1e-3) - ups.point(end - 1e-3)),
        centres=(_lift(ups.centre1), _lift(ups.centre2)),
        axes=(_lift(ups.axis1), _lift(ups.axis2)),
        normals=(_lift(here), _lift(beyond)),
    )
    phi_max = angles.largest(ups.field2, ups.theta2)
    slack = phi_max - angles.phi
    d1 = np.linalg.norm(ups.centre1 - ups.point(end), axis=1)
    d2 = np.linalg.norm(ups.centre2 - ups.point(end), axis=1)
    d = np.linalg.norm(ups.centre2 - ups.centre1, axis=1)
    limit = largest_baseline(d1, d2, phi_max)
    decides = np.isfinite(limit) & (angles.phi > 0.0) & (angles.phi < np.pi)
    by_d = np.where(decides, d < limit, slack > 0.0)
    shorthand = np.minimum(
        ups.field1 + ups.field2 + angles.delta_axes,
        ups.theta1 + ups.theta2 + angles.delta_surface,
    )
    return slack > 0.0, by_d, angles.phi < shorthand, slack


def _random(axes: str, shape: str, n: int, rng: np.random.Generator) -> SetUps:
    def between(low: float, high: float) -> _Array:
        return rng.uniform(low, high, n)

    turn = {
        "flat": np.zeros(n),
        "bent": between(0.1, 1.9),
        "concave": between(-1.2, -0.1),
        "unequal": between(-1.0, 1.6),
    }[shape]
    equal = shape != "unequal"
    field1, theta1 = between(0.12, 0.7), between(0.7, 1.3)
    field2 = field1 if equal else between(0.12, 0.7)
    theta2 = theta1 if equal else between(0.7, 1.3)
    tilt = np.zeros((2, n)) if axes == "parallel" else rng.uniform(-0.7, 0.7, (2, n))
    common = 0.5 * turn if axes == "parallel" and shape != "unequal" else None
    face1 = (np.zeros(n) if common is None else common) + tilt[0]
    face2 = (turn if common is None else common) + tilt[1]
    start1 = -between(0.05, 0.6)
    start2 = between(0.02, 0.9)
    side2 = np.column_stack([np.cos(turn), -np.sin(turn)])
    axis1 = -np.column_stack([np.sin(face1), np.cos(face1)])
    axis2 = -np.column_stack([np.sin(face2), np.cos(face2)])
    aim1 = start1[:, None] * np.array([1.0, 0.0])
    centre1 = aim1 - between(0.4, 1.5)[:, None] * axis1
    centre2 = start2[:, None] * side2 - between(0.4, 1.5)[:, None] * axis2
    return SetUps(
        turn, centre1, axis1, start1, field1, theta1,
        centre2, axis2, start2, field2, theta2,
    )  # fmt: skip


def _edge_at_end(ups: SetUps, rng: np.random.Generator) -> SetUps:
    """Move camera 1 of about half the set-ups so that its plane ends with its part."""
    flat = replace(ups, turn=np.zeros_like(ups.turn))
    end = _end_of_camera1(flat)
    shift = np.where(rng.random(len(end)) < 0.5, end, 0.0)
    return replace(
        ups,
        centre1=ups.centre1 - shift[:, None] * np.array([1.0, 0.0]),
        start1=ups.start1 - shift,
    )


def _end_of_camera1(ups: SetUps) -> _Array:
    """Where camera 1's stretch about its aim ends; NaN if beyond 3 m."""
    low, high = ups.start1.copy(), np.full(len(ups.turn), np.nan)
    steps = np.linspace(0.0, 1.0, 600)[1:]
    # The edge itself is a step, so that no sliver beyond it goes unnoticed.
    before = [ups.start1 * (1.0 - k) for k in steps]
    after = [np.full_like(ups.start1, 1e-9 + 3.0 * k * k) for k in steps]
    for s in (*before, np.full_like(ups.start1, 1e-12), *after):
        seen = ups.sees(1, s)
        going = np.isnan(high)
        low = np.where(going & seen, s, low)
        high = np.where(going & ~seen, s, high)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        seen = ups.sees(1, middle)
        low, high = np.where(seen, middle, low), np.where(seen, high, middle)
    return np.where(np.abs(low) < 1e-9, 0.0, low)


def _covered(ups: SetUps, end: _Array) -> NDArray[np.bool_]:
    covered = np.ones(len(end), dtype=bool)
    for part in _BEYOND:
        covered &= ups.sees(2, end + part * (ups.start2 - end))
    return covered


def _dot(a: _Array, b: _Array) -> _Array:
    return np.sum(a * b, axis=-1)


def _lift(plane: _Array) -> _Array:
    return np.column_stack([plane, np.zeros(len(plane))])


def main(n: int) -> None:
    """Print the share of right verdicts of each mode."""
    print(f"{n} set-ups a mode; share of right verdicts")
    heads = ("covered", "at edge", "phi", "d", "shorthand")
    print(f"{'axes':9} {'shape':8} " + " ".join(f"{head:>9}" for head in heads))
    for seed, (axes, shape) in enumerate(MODES):
        ups, end, truth = draw_set_ups(axes, shape, n, np.random.default_rng(seed))
        by_phi, by_d, short, _ = predicted(ups, end)
        right = [np.mean(verdict == truth) for verdict in (by_phi, by_d, short)]
        shares = [np.mean(truth), np.mean(end == 0.0), *right]
        row = " ".join(f"{share:9.4f}" for share in shares)
        print(f"{axes:9} {shape:8} {row}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3000)
