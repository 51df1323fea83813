"""Claims about what lies inside a body, by the audit's own random rays."""

import numpy as np
from numpy.typing import NDArray

from planning.model.plan import RigPlan
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.estimates import POINT
from planning.verify.audit.ledger import Ledger, as_number
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.recompute import Reach, Recomputed

# As `docs/method/orientation.md` has them.
_HIDDEN = 0.05
_LESS_THAN_BEHIND = 1.0 / 3.0
_THIN_DIAMETERS = 0.05

_MAX_SAMPLES = 5000
_RAYS = 160
_SIGMAS = 2.5
_STREAM = 20_151_117
_ABOVE = 3e-6
# The planner's figure of the whole surface rests on at least so many spots.
_PLANNER_SPOTS = 12_000


def audit_inside(
    plan: RigPlan,
    own: Recomputed,
    reach: Reach,
    shadow: Shadow,
    ledger: Ledger,
    *,
    seed: int,
) -> None:
    """Check the area that lies inside, and how much of it no projector reaches.

    A plan that states neither has nothing to check.
    """
    claims = {
        "meshes.0.shell.inside_m2": ledger.read("meshes", 0, "shell", "inside_m2"),
        "coverage.unreachable_inside_m2": ledger.read(
            "coverage", "unreachable_inside_m2"
        ),
    }
    if all(claim is None for claim in claims.values()):
        return
    every = -(-len(own.samples) // _MAX_SAMPLES)
    chosen = np.arange(0, len(own.samples), every)
    samples = own.samples.take(chosen)
    dark = samples.in_target & ~reach.projectors[chosen]
    inside, unsure = _inside(samples, shadow, np.random.default_rng((_STREAM, seed)))
    open_surface = ledger.read("meshes", 0, "shell", "kind") == "open surface"
    areas = plan.surface.mesh.face_areas
    target = areas[plan.surface.target_faces(plan.requirements.target)].sum()
    for (key, claimed), mask, within, whole in zip(
        claims.items(),
        (inside & (not open_surface), inside & dark),
        (np.full(len(dark), not open_surface), dark),
        (float(areas.sum()), float(target)),
        strict=True,
    ):
        part = samples.weights * mask
        # Half of the samples, at worst, are of the part in question.
        p = min(part.sum() * every / whole + 2.0 / len(chosen), 1.0)
        error = np.sqrt(p * (1.0 - p) * (2.0 / len(chosen) + 1.0 / _PLANNER_SPOTS))
        ledger.number(
            key,
            as_number(claimed),
            float(part.sum()) * every,
            (POINT + 3.0 * float(error)) * whole
            + float(samples.weights[within & unsure].sum()) * every,
        )


def _inside(
    samples: AuditSamples, shadow: Shadow, rng: np.random.Generator
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether each sample sees too little, and whether that is too close to tell."""
    caster = shadow.caster
    mesh = caster.mesh
    above = _ABOVE * mesh.radius
    seen = _free_share(samples.points, samples.normals, shadow, rng)
    down = samples.points - above * samples.normals
    below, depth = caster.first_hits(down, -samples.normals)
    normals = mesh.face_normals[below]
    wall = (below >= 0) & (np.einsum("ij,ij->i", normals, samples.normals) < 0)
    wall &= depth <= _THIN_DIAMETERS * 2.0 * mesh.radius
    inside = seen < _HIDDEN
    rest = np.flatnonzero(wall & ~inside & (seen < _LESS_THAN_BEHIND))
    back = down[rest] - depth[rest, None] * samples.normals[rest]
    other = _free_share(back, normals[rest], shadow, rng)
    limit = _LESS_THAN_BEHIND * other
    inside[rest] = seen[rest] < limit
    unsure = _near(seen, np.full(len(seen), _HIDDEN))
    unsure[rest] |= _near(seen[rest], limit)
    # Just above a third a thin wall isn't compared here, but may be by the planner.
    unsure |= wall & _near(seen, np.full(len(seen), _LESS_THAN_BEHIND))
    return inside, unsure


def _near(seen: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether a share of random rays may lie on the other side of a limit."""
    error = np.sqrt(np.maximum(limit * (1.0 - limit), 0.0) / _RAYS)
    return np.abs(seen - limit) < _SIGMAS * error


def _free_share(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    shadow: Shadow,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Share of random rays, dense in proportion to the cosine, that meet nothing."""
    caster = shadow.caster
    begin = points + _ABOVE * caster.mesh.radius * normals
    free = np.zeros(len(points))
    for _ in range(_RAYS):
        # The normal plus a point of the unit sphere follows the cosine law.
        ball = rng.normal(size=normals.shape)
        along = normals + ball / np.linalg.norm(ball, axis=1, keepdims=True)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        hit, _ = caster.first_hits(begin, along)
        free += hit < 0
    return free / _RAYS
