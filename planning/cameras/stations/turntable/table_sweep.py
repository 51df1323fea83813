"""What a turntable turns must keep off what stands still, all the way round.

Turning takes a point on a circle of radius r at height h about the axis: two bodies of
which one turns meet somewhere on the way iff they share an (r, h), or one holds the
other from the start. Both are compared by points of their surfaces, no farther apart
than the clearance that is kept. What only glides on a plane across the axis, as a part
on a table that stands still, doesn't meet it.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.spatial import KDTree

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.repair.contained import held
from planning.model.errors import InfeasibleLimitsError
from planning.model.heads import Turntable
from planning.scene.placed_bodies import Obstruction

# Kept between what turns and what stands still [m], or a share of a large part's size;
# points lie three to that distance, and no more of them than this are looked at.
_KEPT_M, _KEPT_SHARE, _FINE, _MOST = 5e-4, 2e-3, 3.0, 1_500_000
# Of the cosine between the axis and the normal of such a plane.
_ACROSS = 1e-4
# Of a floor that the part stands on [m].
_TOUCHES_M = 1e-4


def check_sweep(
    table: Turntable,
    part: TriangleMesh,
    turning: Sequence[Obstruction],
    still: Sequence[Obstruction],
    floor: tuple[Array, float] | None,
) -> None:
    """Refuse a table that turns the part into what stands still.

    Args:
        table: In the world.
        part: At angle 0.
        turning: What is fastened to the part.
        still: What isn't.
        floor: The direction up and the floor's height along it [m]; None: there is
            none. A part that stands below it already may, but no lower.

    Raises:
        InfeasibleLimitsError: It names both, where they meet, and what to do.
    """
    kept = max(_KEPT_M, _KEPT_SHARE * part.radius)
    turns = [("the part", part), *((o.words, o.mesh) for o in turning)]
    for name, mesh in turns if still else ():
        own = _profile(table, mesh, kept)
        tree = KDTree(own)
        for solid in still:
            theirs, glides = _faced(table, solid.mesh, kept)
            # A little below such a plane nothing of what turns may be.
            inside = theirs - np.column_stack([0.0 * glides, 2.0 / 3.0 * kept * glides])
            apart, _ = tree.query(inside, distance_upper_bound=kept)
            near = apart <= np.where(glides == 0.0, kept, 0.5 * kept)
            swallowed = held(mesh, solid.mesh.vertices).all()
            if near.any() or swallowed or held(solid.mesh, mesh.vertices).all():
                _refuse(name, solid, theirs[near] if near.any() else theirs, own, kept)
    if floor is not None:
        _check_floor(table, turns, *floor)


def _profile(table: Turntable, mesh: TriangleMesh, kept: float) -> Array:
    """Return (r, h) about the axis of points all over a surface, (n, 2) [m]."""
    samples = sample_surface(mesh, _count(mesh, kept), seed=0)
    return _about(table, np.concatenate([mesh.vertices[mesh.used], samples.points]))


def _faced(table: Turntable, mesh: TriangleMesh, kept: float) -> tuple[Array, Array]:
    """The same, and which way along the axis a plane across it faces, else 0, (n,)."""
    samples = sample_surface(mesh, _count(mesh, kept), seed=0)
    along = samples.normals @ np.array(table.axis)
    across = np.abs(np.abs(along) - 1.0) <= _ACROSS
    return _about(table, samples.points), np.where(across, np.sign(along), 0.0)


def _count(mesh: TriangleMesh, kept: float) -> int:
    return int(min(_MOST, max(1000, mesh.area * (_FINE / kept) ** 2)))


def _about(table: Turntable, points: Array) -> Array:
    arm, axis = points - np.array(table.point_m), np.array(table.axis)
    height = arm @ axis
    return np.column_stack(
        [np.linalg.norm(arm - height[:, None] * axis, axis=1), height]
    )


def _refuse(name: str, solid: Obstruction, met: Array, own: Array, kept: float) -> None:
    low, high = met[:, 1].min() - kept, met[:, 1].max() + kept
    level = own[(own[:, 1] >= low) & (own[:, 1] <= high)]
    reach = float((level if len(level) else own)[:, 0].max())
    raise InfeasibleLimitsError(
        f"{solid.words} stands still, {1e3 * met[:, 0].min():.0f} mm from the axis, "
        f"where the turntable turns {name}, which sweeps out to {1e3 * reach:.0f} mm "
        f"there; {1e3 * kept:.2g} mm must be kept: move it beyond, or leave it out of "
        f"turntable.still if it turns along"
    )


def _check_floor(
    table: Turntable,
    turns: Iterable[tuple[str, TriangleMesh]],
    up: Array,
    height_m: float,
) -> None:
    """A circle's lowest point is h cos(t) - r sin(t) over its middle, t off upright."""
    along = float(np.clip(np.array(table.axis) @ up, -1.0, 1.0))
    aside, base = np.sqrt(1.0 - along**2), float(np.array(table.point_m) @ up)
    for name, mesh in turns:
        points = mesh.vertices[mesh.used]
        r, h = _about(table, points).T
        lowest = base + float((h * along - r * aside).min())
        least = min(height_m, float((points @ up).min()))
        if lowest < least - _TOUCHES_M:
            raise InfeasibleLimitsError(
                f"the turntable turns {name} {1e3 * (least - lowest):.1f} mm below the "
                f"floor: raise turntable.point_mm, turn its axis upright, or lower "
                f"workspace.floor_mm"
            )
