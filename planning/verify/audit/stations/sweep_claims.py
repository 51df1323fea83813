"""Claims about the way round: nothing that stands still is where a turntable turns.

Seen from what turns, a point that stands still goes round a circle. Circles are
followed by chords of a degree, and a chord that meets the surface is a collision; so
are circles of points that turn, which chords of what stands still meet. The poses of
the steps alone don't show it: the table passes all angles between them.
"""

from collections.abc import Iterator

import numpy as np

from geometry.arrays import Array
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.rays.rays import RayCaster
from geometry.repair.contained import held
from planning.model.document.station_records import StationsRecord
from planning.model.plan import RigPlan
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.devices.workspace_claims import room_from_world, turned_back

# Points of each surface beside its corners, of which no more than as many are followed.
_POINTS, _CHORDS = 1500, 360
# Of a floor that the part stands on [m]; of a sampled profile likewise.
_TOUCHES_M = 2e-4


def audit_sweep(plan: RigPlan, told: StationsRecord, findings: AuditFindings) -> None:
    """Check that what turns keeps off what stands still and the floor, all the way."""
    table = plan.document.rig.turntable
    if told.axis is None or told.point_m is None or not told.stations:
        return
    if table is not None and table.steps == 1:
        return
    axis, point = np.array(told.axis), np.array(told.point_m)
    turning = {"the part": plan.surface.mesh}
    for obstacle in plan.surface.obstacles:
        if not obstacle.station:
            turning[f"obstacle {obstacle.name!r}"] = obstacle.mesh
    still = dict(_standing(plan, told.stations[0].id))
    for name, mesh in turning.items():
        for other, solid in still.items():
            met = (
                held(mesh, solid.vertices).all()
                or held(solid, mesh.vertices).all()
                or _meets(mesh, solid, axis, point)
                or _meets(solid, mesh, axis, point)
            )
            findings.holds(not met, "", f"turning, {name} meets obstacle {other!r}")
        _audit_floor(plan, name, mesh, axis, point, findings)


def _standing(plan: RigPlan, station: str) -> Iterator[tuple[str, TriangleMesh]]:
    """Yield what stands still, in the room, from how it is seen at one step."""
    back = room_from_world(plan, station)
    for obstacle in plan.surface.obstacles:
        if obstacle.station == station:
            mesh = obstacle.mesh
            vertices = mesh.vertices @ back[:3, :3].T + back[:3, 3]
            yield obstacle.name, TriangleMesh(vertices, mesh.faces)


def _meets(mesh: TriangleMesh, other: TriangleMesh, axis: Array, point: Array) -> bool:
    """Whether points of another surface meet a mesh as they go round the axis."""
    own = other.vertices[other.used]
    own = own[:: max(1, len(own) // _POINTS)]
    points = np.concatenate([own, sample_surface(other, _POINTS, seed=1).points])
    step = turned_back(axis, point, 2.0 * np.pi / _CHORDS)
    caster = RayCaster(mesh, threads=1)
    for _ in range(_CHORDS):
        ends = points @ step[:3, :3].T + step[:3, 3]
        ways = ends - points
        lengths = np.linalg.norm(ways, axis=1)
        far = np.flatnonzero(lengths > 0.0)
        along = ways[far] / lengths[far, None]
        if caster.occluded(points[far], along, lengths[far]).any():
            return True
        points = ends
    return False


def _audit_floor(
    plan: RigPlan,
    name: str,
    mesh: TriangleMesh,
    axis: Array,
    point: Array,
    findings: AuditFindings,
) -> None:
    space = plan.requirements.workspace
    if space.floor_m is None:
        return
    up, centre = np.array(space.up), np.array(space.centre)
    heights = (mesh.vertices[mesh.used] - centre) @ up
    least, lowest = min(space.floor_m, float(heights.min())), np.inf
    for k in range(_CHORDS):
        turn = turned_back(axis, point, 2.0 * np.pi * k / _CHORDS)
        turned = mesh.vertices[mesh.used] @ turn[:3, :3].T + turn[:3, 3]
        lowest = min(lowest, float(((turned - centre) @ up).min()))
    findings.holds(
        lowest >= least - _TOUCHES_M,
        "",
        f"turning, {name} comes {1e3 * (least - lowest):.3g} mm below the floor",
    )
