"""What errors of all devices together do to the points that a plan measures.

With w, m and (N.r)/(m.r) of the pair that measures a point best, and the displacements
of rays dX of the camera and dY of the projector, e_N = w.dX + (m.dY) (N.r)/(m.r). A
motion of the whole rig is no error of shape: the motion of the object that takes off
most of all e_N is taken off.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.verify.audit.audit_samples import draw_samples
from planning.verify.audit.predicates.audit_devices import (
    audit_cameras,
    audit_projectors,
)
from planning.verify.audit.predicates.error_terms import (
    NOISE_TERMS,
    PairGeometry,
    deviation,
    error_terms,
)
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import MEASURED
from planning.verify.audit.predicates.recompute import recompute

from .device_errors import N_ERRORS, Device, shifts_of


@dataclass(frozen=True, eq=False)
class PointErrors:
    """Errors along the normal of n samples that are measured.

    Attributes:
        points: Where they are, (n, 3).
        normals: Unit normals, (n, 3).
        by_errors: e_N by each error of each device, projectors first, (n, 10 d).
        noise_m: Deviation by edge noise and misplaced rings alone, (n,).
        stated_m: That by the calibration that the plan states alone, (n,).
    """

    points: Array
    normals: Array
    by_errors: Array
    noise_m: Array
    stated_m: Array

    def settled(self, devices: tuple[Device, ...]) -> tuple[Array, Array]:
        """Return `by_errors`, and errors, without what a motion of the whole rig does.

        With T what such a motion is of all errors and M = `by_errors` T that of the
        points, errors are (1 - T M^+ `by_errors`) of those before, (10 d, 10 d).
        """
        centre = self.points.mean(axis=0)
        motion = np.zeros((self.by_errors.shape[1], 6))
        for k, device in enumerate(devices):
            arm = device.world_from_device[:3, 3] - centre
            rows = N_ERRORS * k
            motion[rows : rows + 3, :3] = np.eye(3)
            motion[rows + 3 : rows + 6, 3:] = np.eye(3)
            motion[rows + 3 : rows + 6, :3] = np.cross(np.eye(3), arm).T
        fitted = np.linalg.pinv(self.by_errors @ motion) @ self.by_errors
        settled = np.eye(len(motion)) - motion @ fitted
        return self.by_errors @ settled, settled


def point_errors(plan: RigPlan, *, n_samples: int, threads: int) -> PointErrors:
    """Look at samples of the target that the plan measures, by their best pairs.

    Raises:
        PlanFileError: If it measures none.
    """
    samples = draw_samples(plan.surface, plan.requirements.target, n_samples, 0)
    samples = samples.take(samples.in_target)
    actual = recompute(plan, samples, Shadow.of(plan, threads=threads))
    limits = plan.requirements.triangulation
    devices = (*plan.projectors, *plan.cameras)
    least = np.full(len(samples), np.inf)
    noise, whole = least.copy(), least.copy()
    by_errors = np.zeros((len(samples), N_ERRORS * len(devices)))
    for p, projector in enumerate(audit_projectors(plan)):
        for c, camera in enumerate(audit_cameras(plan)):
            some = np.flatnonzero(actual.pairs[p, c] == MEASURED)
            pair = PairGeometry.of(projector, camera, samples.take(some))
            terms = error_terms(pair, limits)
            total = deviation(terms)
            better = total < least[some]
            rows, points = some[better], pair.points[better]
            least[rows], whole[rows] = total[better], total[better]
            noise[rows] = deviation(terms, NOISE_TERMS)[better]
            of_camera = shifts_of(plan.cameras[c], points).rays
            of_projector = shifts_of(plan.projectors[p], points).rays
            by_errors[rows] = 0.0
            for k, vectors, rays in (
                (p, pair.m * pair.levers[:, None], of_projector),
                (len(plan.projectors) + c, pair.w, of_camera),
            ):
                columns = slice(N_ERRORS * k, N_ERRORS * (k + 1))
                by_errors[rows, columns] = np.einsum(
                    "ni,nij->nj", vectors[better], rays
                )
    measured = np.isfinite(least)
    if not measured.any():
        raise PlanFileError(
            "the plan measures none of its target; nothing to calibrate"
        )
    samples, noise = samples.take(measured), noise[measured]
    stated = np.sqrt(np.maximum(whole[measured] ** 2 - noise**2, 0.0))
    return PointErrors(
        samples.points, samples.normals, by_errors[measured], noise, stated
    )
