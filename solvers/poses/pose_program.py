"""The projector pose of largest margin, eqs. (1)-(2) of the paper with limits.

For a device at Q with rotation R (columns are its axes) and served samples (P, N, T),
X = R^T (P - Q), light L = (P - Q)/|P - Q| (diverging) or R e_z (parallel)::

    maximise    t
    subject to  -N.L >= cos(max_incidence - t)
                |T.L| <= cos(min_tangent_angle + t)        where T != 0
                X in the frustum or the panel, inside the last ring, in range
                lo <= |Q - centre| <= hi,  axis.(Q - centre) >= |Q - centre| cos(half)
                up.Q >= floor,  n.Q >= d for each half-space (n, d)

over Q, R and t: smooth and not convex, so an optimum is local. ``pose_nlp`` states it
in CasADi; this module solves it over an active set and checks the answer in numpy, with
its own formulas. Occlusion isn't part of it: rays decide after every move.

Under parallel light the margin depends on L alone, and without the limits on T and Q
the best L is known by a cone program (``cone``). The start is turned to it about the
centre of the workspace; where every limit holds there, no pose has a larger margin over
these samples: the optimum is GLOBAL, for the samples that the projector was assigned.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from solvers.status import SolveStatus

from .compiled import local_status
from .pose_problem import PoseProgram, pose_margins

_ROUNDS = 8
_SETTLED_RAD = 1e-6


@dataclass(frozen=True, eq=False)
class PoseSolution:
    """Answer of :func:`solve_pose`; figures are recomputed in numpy over all samples.

    Attributes:
        program: The program this answers.
        status: ``OPTIMAL`` from the cone program: no pose has a larger margin over
            these samples. ``LOCALLY_OPTIMAL`` from IPOPT, ``FEASIBLE`` if it stopped
            early or the start couldn't be improved, ``UNKNOWN`` if no pose held every
            limit.
        world_from_device: The pose, shape (4, 4); the start unless a better was found.
        slack: Least slack of the other limits, see :func:`pose_slack`.
    """

    program: PoseProgram
    status: SolveStatus
    world_from_device: NDArray[np.float64]
    slack: float

    @property
    def moved(self) -> bool:
        """Whether the pose differs from the start."""
        return not np.array_equal(
            self.world_from_device, self.program.world_from_device
        )


def pose_slack(
    program: PoseProgram, world_from_device: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the least slack of each sample's other limits, the device last, (n + 1,).

    Lengths count in [m], image coordinates as tangents, angles in [rad]; at least 0
    where every limit holds.
    """
    rotation, position = world_from_device[:3, :3], world_from_device[:3, 3]
    local = (program.points - position) @ rotation
    frame = program.ring_from_device
    ring = local if frame is None else local @ frame[:3, :3].T + frame[:3, 3]
    flat, rings = (_flattened(program, points) for points in (local, ring))
    inside = np.min([flat - program.sides[0], program.sides[1] - flat], axis=(0, 2))
    if np.isfinite(program.ring_radius):
        beyond = np.hypot(rings[:, 0], rings[:, 1])
        inside = np.minimum(inside, program.ring_radius - beyond)
    if program.light == "parallel":
        span = local[:, 2]
        axial = program.beam_radius_m - np.hypot(local[:, 0], local[:, 1])
        inside = np.minimum(inside, axial)
    else:
        span = np.linalg.norm(local, axis=1)
    low, high = program.range_m
    samples = np.min([inside, span - low, high - span], axis=0)
    return np.append(samples, _workspace_slack(program, position))


def _flattened(
    program: PoseProgram, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return x and y (parallel), or x/z and y/z (diverging; inf behind), (n, 2)."""
    flat, z = points[:, :2], points[:, 2:]
    if program.light == "parallel":
        return flat
    return np.where(z > 0, flat / np.where(z > 0, z, 1.0), np.inf)


def _workspace_slack(program: PoseProgram, position: NDArray[np.float64]) -> float:
    offset = position - program.centre
    radius = float(np.linalg.norm(offset))
    low, high = program.shell_m
    slack = min(radius - low, high - radius)
    if program.half_angle < np.pi:
        across = float(np.linalg.norm(np.cross(program.axis, offset)))
        angle = np.arctan2(across, float(program.axis @ offset))
        slack = min(slack, program.half_angle - float(angle))
    if program.up is not None and np.isfinite(program.floor):
        slack = min(slack, float(program.up @ position) - program.floor)
    planes = program.half_spaces
    if len(planes):
        slack = min(slack, float(np.min(planes[:, :3] @ position - planes[:, 3])))
    return slack


def solve_pose(
    program: PoseProgram, *, max_points: int = 60, max_iterations: int = 200
) -> PoseSolution:
    """Move a projector to the largest margin: of all poses, or near its start.

    Args:
        program: What to serve, from where to start; no worse pose is returned.
        max_points: Tightest samples that IPOPT starts with; violated ones join.
        max_iterations: Limit of each IPOPT run.
    """
    if program.light == "parallel" and (proved := _globally_best(program)):
        return proved
    from .pose_nlp import pose_of, run_ipopt

    start = np.array(program.world_from_device, dtype=np.float64)
    best, best_margin, best_slack = start, *_figures(program, start)
    active = _tightest(program, start, max_points)
    settled, pose, margin, slack = False, start, best_margin, best_slack
    for _ in range(_ROUNDS):
        outcome = run_ipopt(program, active, pose, max_iterations=max_iterations)
        if not np.all(np.isfinite(outcome.x)):
            break
        pose = pose_of(program, outcome.x)
        margin, slack = _figures(program, pose)
        if slack >= 0.0 and (margin > best_margin or not best_slack >= 0.0):
            best, best_margin, best_slack = pose, margin, slack
        violated = _violated(program, pose, float(outcome.x[6]))
        fresh = np.setdiff1d(violated, active)[:max_points]
        if fresh.size == 0:
            settled = outcome.success
            break
        active = np.union1d(active, fresh)
    settled = settled and slack >= 0.0 and margin >= best_margin - _SETTLED_RAD
    status = local_status(held=best_slack >= 0.0, settled=settled)
    return PoseSolution(program, status, best, best_slack)


def _globally_best(program: PoseProgram) -> PoseSolution | None:
    """Return the pose of the best direction; None where it breaks another limit."""
    from .cone import max_margin_direction

    best = max_margin_direction(program.normals)
    if best.light is None:
        return None
    start = np.array(program.world_from_device, dtype=np.float64)
    turn = Rotation.align_vectors(best.light[None], start[:3, 2][None])[0]
    pose = np.eye(4)
    pose[:3, :3] = turn.as_matrix() @ start[:3, :3]
    pose[:3, 3] = program.centre + turn.apply(start[:3, 3] - program.centre)
    least = program.max_incidence - best.max_incidence - _SETTLED_RAD
    # A start that is as good stays.
    for offered in (start, pose):
        margin, slack = _figures(program, offered)
        if margin >= least and slack >= 0.0:
            return PoseSolution(program, SolveStatus.OPTIMAL, offered, slack)
    return None


def _figures(program: PoseProgram, pose: NDArray[np.float64]) -> tuple[float, float]:
    return (
        float(np.min(pose_margins(program, pose))),
        float(np.min(pose_slack(program, pose))),
    )


def _tightest(
    program: PoseProgram, pose: NDArray[np.float64], n: int
) -> NDArray[np.int64]:
    """Return samples of least margin, and of least slack, half of each."""
    margins, slack = pose_margins(program, pose), pose_slack(program, pose)[:-1]
    half = max(1, n // 2)
    return np.union1d(
        np.argsort(margins, kind="stable")[:half],
        np.argsort(slack, kind="stable")[:half],
    ).astype(np.int64)


def _violated(
    program: PoseProgram, pose: NDArray[np.float64], margin: float
) -> NDArray[np.int64]:
    """Samples that break a limit or the margin that IPOPT claims, worst first."""
    short = margin - _SETTLED_RAD - pose_margins(program, pose)
    broken = -pose_slack(program, pose)[:-1]
    worst = np.argsort(-np.maximum(short, broken), kind="stable")
    worst = worst[(short[worst] > 0) | (broken[worst] > 0)]
    return worst.astype(np.int64)
