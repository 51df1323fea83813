"""A rig refined over the edges of an object, before the clouds are merged.

Edges of all pairs against the mesh, and, where the object isn't the mesh, against each
other: how far it differs is an unknown of every patch of its surface, whose size as a
whole the edges tell. What a calibration leaves is expected of the devices; where none
is stated, what mounting leaves.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from planning.model.calibration_errors import CalibrationErrors
from planning.verify.reconstruction.arrays import Array, Indices
from planning.verify.reconstruction.calibration import DeviceCalibration
from planning.verify.reconstruction.check.refined_rig import Moved, RefinedRig
from planning.verify.reconstruction.decode.decode import Decoded, Pairs, measure_edges
from planning.verify.reconstruction.scanner import Scanner

from .adjustment import Adjusted, adjust, expected_of
from .bundle import BIASED_PX, SHIFT, TURN, ZOOM, Bundle
from .cause_words import in_words, untwisted
from .diagnosis import MOUNTED, PLACED, reachable
from .explanations import misfit
from .search import Search
from .supposed import Evidence, Role, Supposed, places

# What a good calibration leaves of a device, where none is stated.
CALIBRATED = CalibrationErrors(angle=1e-4, position_m=5e-5, focal=5e-4)
# Edges of each pair, and of all of them.
_EDGES_A_PAIR, _EDGES = 900, 20_000
# A patch of surface is so many ring gaps wide.
_PATCH_TAU = 2.0
# The relief that a search begins with [m], and its rounds.
_RELIEF_M, _ROUNDS = 1e-3, 4
_LEAST_RELIEF_M = 1e-7


def refine(believed: Scanner, pairs: Pairs) -> RefinedRig | None:
    """Return a rig as the edges of all its pairs say that it stands; None without any.

    Args:
        believed: Poses and optics as they are believed, what is drawn, and the mesh.
        pairs: What every pair of devices decoded.
    """
    most = max(1, min(_EDGES_A_PAIR, _EDGES // max(1, len(pairs))))
    evidence = Evidence.of(believed, pairs, most)
    if len(evidence) == 0:
        return None
    every, causes = reachable(believed, evidence)
    start = every.bundle.supposed
    errors = believed.calibration
    if errors is None or errors == CalibrationErrors():
        errors = CALIBRATED
    bundle = Bundle(evidence, start, _patches(evidence, start), _RELIEF_M)
    everything = expected_of(bundle, MOUNTED, PLACED)
    found = adjust(bundle, everything)
    for _ in range(_ROUNDS):
        relief = max(bundle.relief(found.offsets), _LEAST_RELIEF_M)
        bundle = replace(bundle, relief_m=relief)
        found = adjust(bundle, everything, start=found.x, unit=max(1.0, found.scatter))
    stated = replace(believed, calibration=errors)
    least = misfit(evidence, found.supposed)
    search = Search(stated, found, least, PLACED)
    causes += search.causes()
    found = search.found
    px = np.hypot(evidence.noise_px, BIASED_PX)
    before = np.abs(bundle.offsets(np.zeros(bundle.n_unknowns)))
    after = np.abs(bundle.apart_from_relief(np.nan_to_num(found.offsets)))
    return RefinedRig(
        _as_refined(believed, found),
        tuple(_moved(believed, found, expected_of(bundle, errors, PLACED))),
        tuple(in_words(cause, believed) for cause in causes),
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


def _patches(evidence: Evidence, rig: Supposed) -> Indices:
    """Return which cube of space each edge lies in, all that miss the mesh in one."""
    at, _ = places(evidence, rig)
    size = _PATCH_TAU * rig.plan.limits.check.tau_m
    known = np.isfinite(at[:, 0])
    cube = np.floor(np.where(known[:, None], at, 0.0) / size).astype(np.int64)
    return np.unique(np.column_stack([known, cube]), axis=0, return_inverse=True)[
        1
    ].ravel()


def _moved(believed: Scanner, found: Adjusted, expected: Array) -> list[Moved]:
    """Return what moved by how much, the largest surprise first."""
    bundle, rig = found.bundle, found.supposed
    sigma = np.sqrt(np.diag(found.covariance))
    surprise = found.x / np.where(expected > 0.0, expected, np.inf)
    rows: list[Moved] = []
    of: dict[Role, tuple[DeviceCalibration, ...]] = {
        "cameras": believed.cameras,
        "projectors": believed.projectors,
    }
    for role, devices in of.items():
        for k, one in enumerate(devices):
            now = untwisted(one, getattr(rig, role)[k])
            zoom = float(now.matrix[0, 0] / one.matrix[0, 0]) - 1.0
            poses = one.world_from_device, now.world_from_device
            columns = bundle.columns(role, k)
            row = _row(one.id, poses, zoom, sigma[columns], surprise[columns])
            rows.append(row)
    (body,), (mesh,) = rig.objects, Supposed.of(believed).objects
    poses, own = (
        (mesh.world_from_device, body.world_from_device),
        bundle.columns("objects", 0),
    )
    rows.append(_row("object", poses, body.scale - 1.0, sigma[own], surprise[own]))
    return sorted(rows, key=lambda row: -row.surprise)


def _row(
    name: str, poses: tuple[Array, Array], zoom: float, sigma: Array, surprise: Array
) -> Moved:
    one, now = poses
    return Moved(
        name,
        float(Rotation.from_matrix(now[:3, :3] @ one[:3, :3].T).magnitude()),
        float(np.sqrt(np.mean(sigma[TURN] ** 2))),
        float(np.linalg.norm(now[:3, 3] - one[:3, 3])),
        float(np.sqrt(np.mean(sigma[SHIFT] ** 2))),
        zoom,
        float(sigma[ZOOM][0]),
        float(np.sqrt(np.mean(surprise**2))),
    )


def _as_refined(believed: Scanner, found: Adjusted) -> Scanner:
    """Return the rig; each device keeps what it draws, and its rings move with it."""
    rig = found.supposed
    cameras = tuple(
        replace(one, world_from_device=now.world_from_device, matrix=now.matrix)
        for one, now in zip(believed.cameras, rig.cameras, strict=True)
    )
    lamps = [
        untwisted(*two) for two in zip(believed.projectors, rig.projectors, strict=True)
    ]
    projectors = tuple(
        replace(
            one,
            world_from_device=now.world_from_device,
            world_from_ring=now.world_from_device
            @ np.linalg.inv(one.world_from_device)
            @ one.world_from_ring,
            matrix=now.matrix,
            drawn_for=one.drawn_matrix,
        )
        for one, now in zip(believed.projectors, lamps, strict=True)
    )
    n = found.bundle.columns("objects", 0)[0]
    covariance, body = found.covariance[:n, :n], found.covariance[n:, n:]
    across = found.covariance[:n, n:]
    # Against the object: where both lie in the world no edge tells.
    told = covariance - across @ np.linalg.solve(body, across.T)
    return replace(
        believed,
        cameras=cameras,
        projectors=projectors,
        calibration=None,
        covariance=told,
    )
