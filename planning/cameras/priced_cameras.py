"""Fewer cameras, from poses between the candidates that prices of the samples ask for.

Of the linear program of how much K known poses measure at most, the dual prices say
what each sample is worth. A pose that isn't known can raise it only if what it measures
costs more than what every known one does. Poses around the dearest are offered, those
that cost more join, and the program is solved again, from less and less far: column
generation (Gilmore & Gomory 1961). Once K may be enough as far as the program knows,
prices are those of fewer.
"""

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.proofs.quotas import Quotas
from planning.scene.bodies.clearance import with_clearance
from planning.scene.measuring.measured import measured_by, taken
from planning.scene.scene import Scene
from planning.scene.workspace.model_candidates import one_of_each
from solvers.bit_rows import pack_rows
from solvers.cells.cell_problem import CellProblem, whole_rows
from solvers.cells.known_poses import TOLERANCE, KnownPoses, Proposed
from solvers.one_thread import on_one_thread
from solvers.status import WorkBudget

from .camera_cover import CameraCover, candidate_cover
from .camera_routes import cover_by_cover
from .proved_cameras import CameraStage, camera_stage

_WHY = "fewer; found from poses between the candidates that prices asked for"

# How far out poses are offered, in spacings of a lattice of so many; how many at a
# time, as many around each of the dearest, so many at least; and samples at most.
_N_LATTICE = 600
_SCALES = 1.0, 0.8, 0.65, 0.5, 0.4, 0.3, 0.22, 0.16
_OFFERED, _EACH = 600, 4
_SAMPLES = 3000
# What prices prove beyond the count is given up if it is more than so many times what
# the last poses took from it.
_GAINS = 15.0
# Counted work of the program.
_BUDGET = 1e10


def has_room(stage: CameraStage) -> bool:
    """Return whether the bound over all poses leaves room for fewer cameras.

    Also where fewer are allowed than the candidates need. Cameras with bodies aren't
    looked at.
    """
    proof = stage.certificate
    bound = proof.continuous
    if bound is None or stage.cover.has_bodies:
        return False
    return bound.lower_bound < proof.needed.count


def fewer_cameras(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    stage: CameraStage,
    tries: int,
) -> CameraStage | None:
    """Return the stage of fewer cameras from poses anywhere; None: none were found.

    They join the candidates, over which the count is proved again.
    """
    again = fewer_by_prices(scene, projectors, stage.cover, tries)
    if again is None:
        return None
    routes = stage.routes
    if routes is not None:
        needed = again.selection.needed
        routes = routes.changed(cover=needed, taken="cover", why=_WHY)
    return camera_stage(scene, again, routes)


def fewer_by_prices(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    found: CameraCover,
    tries: int,
) -> CameraCover | None:
    """Return a cover over more candidates that needs fewer cameras; None: none does.

    It is solved as any is, until fresh samples confirm it; the next prices are of all
    samples that took. It ends after so many tries that saved none.
    """
    best, needed = None, found.selection.needed
    while tries > 0:
        more = priced_poses(scene, found, needed - 1)
        if not more:
            break
        found = cover_by_cover(scene, projectors, found.candidates.joined(more))
        selection = found.selection
        if selection.needed < needed and selection.status != "infeasible":
            best, needed = found, selection.needed
        else:
            tries -= 1
    return best


@on_one_thread
def priced_poses(
    scene: Scene, found: CameraCover, n_cameras: int
) -> tuple[PlannedCamera, ...]:
    """Return poses that so many cameras, or fewer, ask for beside the candidates.

    None where prices tell that so many aren't enough, wherever they were offered.
    """
    devices = list(found.candidates.cameras)
    cover = candidate_cover(scene, found.measured, found.samples, devices)
    offer = scene.candidates(one_of_each(devices))
    given, some = cover.n_existing, np.arange(min(len(cover.covers), _SAMPLES))
    samples, covers = taken(found.samples, some, found.samples.lit), cover.covers[some]
    whole = whole_rows(_problem(cover.quotas.part(some), covers, given))
    poses = KnownPoses(whole, pack_rows(covers.T), WorkBudget(_BUDGET))
    rng = np.random.default_rng([cover.seed, n_cameras])
    count, beyond, proposal = n_cameras - given, np.inf, None
    for scale in _SCALES:
        proposal = poses.proposed(count)
        while proposal is not None and not _refutes(proposal) and count > 1:
            count, beyond = count - 1, np.inf
            proposal = poses.proposed(count)
        if proposal is None or not _refutes(proposal):
            break
        prices, dearest = proposal.multipliers, proposal.largest_cost
        before, beyond = beyond, float(whole.least_cost(prices) / dearest) - count
        if beyond > _GAINS * (before - beyond):
            break
        dear = np.flatnonzero(prices @ covers >= (1.0 - TOLERANCE) * dearest)
        offered: list[PlannedCamera] = []
        for i in dear[dear >= given]:
            around = offer.around((devices[i],), _N_LATTICE, scale)
            most = min(len(around), max(_EACH, _OFFERED // len(dear)))
            offered += [around[k] for k in rng.choice(len(around), most, replace=False)]
        offered = list(with_clearance(scene, tuple(offered)))
        if not offered:
            continue
        measured = measured_by(scene, offered, samples)
        dearer = np.flatnonzero(prices @ measured > dearest)
        devices += [offered[k] for k in dearer]
        covers = np.hstack([covers, measured[:, dearer]])
        poses.append(pack_rows(measured[:, dearer].T))
    else:
        # What the last poses change is told by prices that know them.
        proposal = poses.proposed(count)
    if count == n_cameras - given and proposal is not None and _refutes(proposal):
        return ()
    return tuple(devices[len(found.candidates.cameras) :])


def _refutes(proposal: Proposed) -> bool:
    """Return whether known poses aren't enough, by prices of which any is above 0."""
    return not proposal.reached and bool(proposal.multipliers.any())


def _problem(quotas: Quotas, covers: NDArray[np.bool_], n_existing: int) -> CellProblem:
    """What cameras must cover beside those that stand already."""
    fixed = np.any(covers[:, :n_existing], axis=1)
    return CellProblem(
        np.any(covers, axis=1).astype(np.float64),
        quotas.floors.astype(np.float64),
        np.where(fixed, 0, 1),
        quotas.regions.row,
        float(quotas.total),
    )
