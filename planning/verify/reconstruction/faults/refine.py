"""A rig refined over the edges of an object, before the clouds are merged.

Edges of all pairs against the mesh, and, where the object isn't the mesh, against each
other: how far it differs is an unknown of every patch of its surface. Expected of the
devices is what a calibration leaves; what is to blame is free, be it the object, which
otherwise says where in the world both stand: no edge does.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from planning.model.devices.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.check.refined_rig import Moved, RefinedRig
from planning.verify.reconstruction.decode.decode import Decoded, Pairs, measure_edges
from planning.verify.reconstruction.scanner import Scanner

from .adjustment import Adjusted, adjust, expected_of
from .bundle import BIASED_PX, SHIFT, TURN, ZOOM, Bundle, by_body
from .cause_words import in_words, untwisted
from .diagnosis import MOUNTED, reachable, stated
from .search import Search
from .supposed import Evidence, Object, Supposed

# What a good calibration leaves of a device, where none is stated.
CALIBRATED = CalibrationErrors(angle=1e-4, position_m=5e-5, focal=5e-4)
# The relief that a search begins with [m], and its rounds.
_RELIEF_M, _ROUNDS = 1e-3, 4
_LEAST_RELIEF_M = 1e-7


def refine(believed: Scanner, pairs: Pairs) -> RefinedRig | None:
    """Return a rig as the edges of all its pairs say that it stands; None without any.

    Args:
        believed: Poses and optics as they are believed, what is drawn, and the mesh.
        pairs: What every pair of devices decoded.
    """
    evidence = Evidence.of(believed, pairs)
    if len(evidence) == 0:
        return None
    every, causes = reachable(believed, evidence)
    bundle = Bundle(evidence, every.bundle.supposed, _RELIEF_M)
    everything = expected_of(bundle, MOUNTED)
    every = adjust(bundle, everything)
    for _ in range(_ROUNDS):
        relief = max(bundle.relief(every.offsets), _LEAST_RELIEF_M)
        bundle = replace(bundle, relief_m=relief)
        every = adjust(bundle, everything, start=every.x, unit=max(1.0, every.scatter))
    errors = stated(believed, CALIBRATED)
    more, found = Search(every, errors).causes()
    px = np.hypot(evidence.noise_px, BIASED_PX)
    before = np.abs(bundle.offsets(np.zeros(bundle.n_unknowns)))
    after = np.abs(bundle.apart_from_relief(np.nan_to_num(found.offsets)))
    refined = _as_refined(believed, found)
    return RefinedRig(
        refined,
        tuple(_moved(believed, refined, found, errors)),
        tuple(in_words(cause, believed) for cause in causes + more),
        float(np.nanmedian(before * px)),
        float(np.median(after * px)),
        bundle.relief_m,
    )


def remeasured(design: Scanner, rig: Scanner, pairs: Pairs) -> Pairs:
    """Return what the edges of pairs measure with other poses and optics."""
    known, limits = dict(rig.pairs()), design.limits.decoder

    def again(p: int, c: int, pair: Decoded) -> Decoded:
        if not len(pair.edges) or pair.rejected.get("labels", 0):
            return pair
        new = measure_edges(
            pair.edges,
            design.projectors[p].pattern_for(design.cameras[c]),
            known[(p, c)],
            pair.lit_pixels,
            pair.saturated,
            min_conditioning=limits["min_conditioning"],
            max_slant=limits["max_slant"],
            sure_roots=True,
            lit=pair.lit,
        )
        return replace(new, n_saturated=pair.n_saturated, saturated=pair.saturated)

    return [((p, c), again(p, c, pair)) for (p, c), pair in pairs]


def _moved(
    believed: Scanner, refined: Scanner, found: Adjusted, errors: CalibrationErrors
) -> list[Moved]:
    """Return what moved by how much, the largest surprise first."""
    (mesh,), (body,) = Supposed.of(believed).objects, found.supposed.objects
    before = (*believed.cameras, *believed.projectors, mesh)
    after = (*refined.cameras, *refined.projectors, body)
    expected = expected_of(found.bundle, errors)
    surprises = by_body(found.x / np.where(expected > 0.0, expected, np.inf))
    sigmas = by_body(np.sqrt(np.diag(found.covariance)))
    rows: list[Moved] = []
    for one, now, sigma, surprise in zip(before, after, sigmas, surprises, strict=True):
        turn = now.world_from_device[:3, :3] @ one.world_from_device[:3, :3].T
        if isinstance(now, Object) or isinstance(one, Object):
            name, zoom = "object", body.scale
        else:
            name, zoom = one.id, float(now.matrix[0, 0] / one.matrix[0, 0])
        row = Moved(
            name,
            float(Rotation.from_matrix(turn).magnitude()),
            float(np.sqrt(np.mean(sigma[TURN] ** 2))),
            float(np.linalg.norm(now.centre - one.centre)),
            float(np.sqrt(np.mean(sigma[SHIFT] ** 2))),
            zoom - 1.0,
            float(sigma[ZOOM][0]),
            float(np.sqrt(np.mean(surprise**2))),
        )
        rows.append(row)
    return sorted(rows, key=lambda row: -row.surprise)


def _as_refined(believed: Scanner, found: Adjusted) -> Scanner:
    """Return the rig; each device keeps what it draws, and its rings move with it."""
    rig = found.supposed
    cameras = tuple(
        replace(one, world_from_device=now.world_from_device, matrix=now.matrix)
        for one, now in zip(believed.cameras, rig.cameras, strict=True)
    )
    projectors: list[ProjectorCalibration] = []
    for one, now in zip(believed.projectors, rig.projectors, strict=True):
        pose = untwisted(one, now).world_from_device
        rings = pose @ np.linalg.inv(one.world_from_device) @ one.world_from_ring
        moved = replace(one, world_from_device=pose, world_from_ring=rings)
        projectors.append(replace(moved, matrix=now.matrix, drawn_for=one.drawn_matrix))
    n = found.bundle.columns("objects", 0)[0]
    across, body = found.covariance[:n, n:], found.covariance[n:, n:]
    # Against the object: where both lie in the world no edge tells.
    told = found.covariance[:n, :n] - across @ np.linalg.pinv(body) @ across.T
    return replace(
        believed,
        cameras=cameras,
        projectors=tuple(projectors),
        calibration=None,
        covariance=told,
    )
