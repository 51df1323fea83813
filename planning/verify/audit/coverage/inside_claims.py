"""Claims about what lies inside a body, by the audit's own random rays."""

import numpy as np

from geometry.arrays import Array, Mask, lengths
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_findings import AuditFindings
from planning.verify.audit.audit_samples import AuditSamples, samples_on
from planning.verify.audit.estimates import POINT
from planning.verify.audit.predicates.audit_optics import dot
from planning.verify.audit.predicates.occlusion import Shadow

# As `docs/method/orientation.md` has them.
_HIDDEN = 0.05
_LESS_THAN_BEHIND = 1.0 / 3.0
_THIN_DIAMETERS = 0.05

_MAX_SAMPLES = 5000
_RAYS = 160
# Where so large a share of the first rays meets nothing, a third doesn't lie far off.
_FIRST, _CLEAR = 40, 0.75
_SIGMAS = 2.5
_STREAM = 20_151_117
_ABOVE = 3e-6
# The planner's figure of the whole surface rests on at least so many spots.
_PLANNER_SPOTS = 12_000


def audit_inside(case: AuditCase, findings: AuditFindings) -> None:
    """Check the area that lies inside, and how much of it no projector reaches.

    A plan that states neither has nothing to check. A target of what lies outside must
    hold all of that, and nothing that lies inside.
    """
    every = -(-len(case.samples) // _MAX_SAMPLES)
    chosen = np.arange(0, len(case.samples), every)
    samples = case.samples.take(chosen)
    if case.plan.requirements.target == "outside":
        _audit_outside(case, samples, findings)
    coverage, shell = case.plan.coverage, case.plan.document.meshes[0].shell
    stated = coverage.model_fields_set | shell.model_fields_set
    if stated.isdisjoint(("unreachable_inside_m2", "inside_m2")):
        return
    dark = samples.in_target & ~case.reachable.projectors[chosen]
    rng = np.random.default_rng((_STREAM, case.seed))
    inside, unsure = _inside(samples, case.shadow, rng)
    closed = np.full(len(dark), shell.kind != "open surface")
    for key, claimed, within, whole in (
        ("meshes.0.shell.inside_m2", shell.inside_m2, closed, case.estimator.area_m2),
        (
            "coverage.unreachable_inside_m2",
            coverage.unreachable_inside_m2,
            dark,
            case.estimator.target_m2,
        ),
    ):
        area, doubt = (
            every * float(samples.weights[within & flags].sum())
            for flags in (inside, unsure)
        )
        # Half of the samples, at worst, are of the part in question.
        p = min(area / whole + 2.0 / len(chosen), 1.0)
        error = np.sqrt(p * (1.0 - p) * (2.0 / len(chosen) + 1.0 / _PLANNER_SPOTS))
        tolerance = (POINT + 3.0 * float(error)) * whole + doubt
        findings.number(key, claimed, area, tolerance)


def _audit_outside(
    case: AuditCase, samples: AuditSamples, findings: AuditFindings
) -> None:
    """Check that faces are the target or not as their centroids lie outside."""
    faces, surface = samples.faces, case.plan.surface
    middles = samples_on(
        surface,
        surface.mesh.face_centroids[faces],
        faces,
        samples.in_target,
        samples.weights,
    )
    rng = np.random.default_rng((_STREAM, case.seed, 1))
    inside, unsure = _inside(middles, case.shadow, rng)
    wrong = (inside == middles.in_target) & ~unsure
    share = float(middles.weights[wrong].sum() / middles.weights.sum())
    findings.holds(
        share <= POINT,
        "requirements.target",
        f"is 'outside', but of {share:.1%} of the surface the target holds what lies "
        "inside, or lacks what lies outside",
    )


def _inside(
    samples: AuditSamples, shadow: Shadow, rng: np.random.Generator
) -> tuple[Mask, Mask]:
    """Whether each sample sees too little, and whether that is too close to tell."""
    caster = shadow.caster
    mesh = caster.mesh
    above = _ABOVE * mesh.radius
    seen = _free_share(samples.points, samples.normals, shadow, rng)
    down = samples.points - above * samples.normals
    below, depth = caster.first_hits(down, -samples.normals)
    normals = mesh.face_normals[below]
    wall = (below >= 0) & (dot(normals, samples.normals) < 0)
    wall &= depth <= _THIN_DIAMETERS * 2.0 * mesh.radius
    limit = np.full(len(seen), _HIDDEN)
    variance = limit * (1.0 - limit)
    # What lies above all that a wall's other side may ask for isn't compared with it.
    thin = np.flatnonzero(wall & (seen < 2.0 * _LESS_THAN_BEHIND))
    back = down[thin] - depth[thin, None] * samples.normals[thin]
    beyond = _free_share(back, normals[thin], shadow, rng)
    asked = _LESS_THAN_BEHIND * beyond
    limit[thin] = np.maximum(limit[thin], asked)
    variance[thin] = np.maximum(
        variance[thin],
        asked * (1.0 - asked) + _LESS_THAN_BEHIND**2 * beyond * (1.0 - beyond),
    )
    unsure = np.abs(seen - limit) < _SIGMAS * np.sqrt(variance / _RAYS)
    return seen < limit, unsure


def _free_share(
    points: Array, normals: Array, shadow: Shadow, rng: np.random.Generator
) -> Array:
    """Share of random rays, dense in proportion to the cosine, that meet nothing."""
    share = _of_rays(_FIRST, points, normals, shadow, rng)
    near = np.flatnonzero(share < _CLEAR)
    others = _of_rays(_RAYS - _FIRST, points[near], normals[near], shadow, rng)
    share[near] += (1.0 - _FIRST / _RAYS) * (others - share[near])
    return share


def _of_rays(
    n: int, points: Array, normals: Array, shadow: Shadow, rng: np.random.Generator
) -> Array:
    caster = shadow.caster
    begin = points + _ABOVE * caster.mesh.radius * normals
    free = np.zeros(len(points))
    for _ in range(n):
        # The normal plus a point of the unit sphere follows the cosine law.
        ball = rng.normal(size=normals.shape)
        along = normals + ball / lengths(ball)[:, None]
        along /= np.maximum(lengths(along), 1e-12)[:, None]
        free += ~caster.met(begin, along)
    return free / n
