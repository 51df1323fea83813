"""What a plan does at the centroid of every face, by the audit's own predicates."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.parallel import mapped
from planning.model.plan import RigPlan
from planning.verify.audit.audit_samples import AuditSamples, samples_on
from planning.verify.audit.predicates.audit_devices import (
    AuditCamera,
    AuditProjector,
    audit_cameras,
    audit_projectors,
)
from planning.verify.audit.predicates.audit_optics import dot, towards
from planning.verify.audit.predicates.error_terms import (
    PairGeometry,
    deviation,
    error_terms,
)
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import (
    LIT,
    MEASURED,
    SEEN,
    Steps,
    light_steps,
    pair_figures,
    pair_holds,
    sight_steps,
)
from planning.verify.audit.predicates.recompute import Recomputed
from planning.verify.audit.predicates.recomputed_views import (
    RecomputedViews,
    recompute_views,
)
from planning.verify.audit.predicates.view_pairs import (
    GOOD,
    Sighted,
    met_angle,
    view_terms,
)

# Faces that one thread looks at together: with half as many, calls of numpy count.
_CHUNK = 1 << 15


@dataclass(frozen=True, eq=False)
class PerFace:
    """Every device and every pair at n faces.

    Attributes:
        light: Limits of *lit* passed, of each projector, (n_p, n); `LIT`: lit.
        sight: Limits of *seen* passed, of each camera, (n_c, n); `SEEN`: seen.
        pairs: As of `Recomputed`, (n_p, n_c, n).
        failing: What the first limit that a pair fails on lit and seen faces looks at,
            as `pair_figures` has it; NaN elsewhere, (n_p, n_c, n).
        best: Number of the pair p n_c + c that measures each face with the least
            deviation, -1 where none does, (n,).
        sigma: That deviation, with what the calibration leaves [m]; NaN elsewhere.
        terms: Its independent terms [m], (n,) each.
        angle: Between light and view of that pair [rad].
    """

    light: Steps
    sight: Steps
    pairs: Steps
    failing: Array
    best: Ints
    sigma: Array
    terms: dict[str, Array]
    angle: Array

    @property
    def n_pairs(self) -> Ints:
        """How many pairs measure each face, (n,)."""
        return (self.pairs == MEASURED).sum(axis=(0, 1))

    def cause(self, samples: AuditSamples) -> NDArray[np.int64]:
        """Return the cause of each face as the audit names it, -1 where measured."""
        unused = np.zeros(self.light.shape)
        return Recomputed(samples, self.light, unused, self.pairs).cause.astype(
            np.int64
        )


def centroids(plan: RigPlan) -> AuditSamples:
    """Return a sample at the centroid of every face of a plan's surface."""
    surface = plan.surface
    faces = np.arange(len(surface.mesh.faces))
    inside = surface.target_faces(plan.requirements.target)
    areas = surface.mesh.face_areas
    return samples_on(surface, surface.mesh.face_centroids, faces, inside, areas)


def per_face(plan: RigPlan, samples: AuditSamples, *, threads: int) -> PerFace:
    """Recompute every device and pair on samples; no result depends on the threads."""
    if plan.cameras_alone:
        return views_per_face(plan, samples, threads=threads)
    shadow = Shadow.of(plan, threads=1)
    devices = audit_projectors(plan), audit_cameras(plan)
    n = len(samples)
    chunks = [slice(k, min(k + _CHUNK, n)) for k in range(0, n, _CHUNK)]
    every = np.arange(n)
    parts = mapped(
        lambda chunk: _of_chunk(plan, *devices, samples.take(every[chunk]), shadow),
        chunks,
        threads,
    )

    def joined(name: str) -> NDArray[Any]:
        return np.concatenate([getattr(part, name) for part in parts], axis=-1)

    terms = {
        name: np.concatenate([part.terms[name] for part in parts])
        for name in parts[0].terms
    }
    names = ("light", "sight", "pairs", "failing", "best", "sigma", "angle")
    return PerFace(**{name: joined(name) for name in names}, terms=terms)


@dataclass(frozen=True, eq=False)
class ViewsPerFace(PerFace):
    """Cameras alone: of a pair the first one, p, is a camera, too.

    Attributes:
        views: As the audit recomputes them.
    """

    views: RecomputedViews

    @property
    def n_pairs(self) -> Ints:
        """How many pairs measure each face, (n,)."""
        pairs = np.triu(np.ones(self.views.met.shape[:2], dtype=bool))
        return (self.views.met[pairs] == GOOD).sum(axis=0) * self.views.measured

    def cause(self, samples: AuditSamples) -> NDArray[np.int64]:
        """Return the cause of each face as the audit names it, -1 where measured."""
        return self.views.cause.astype(np.int64)


def views_per_face(
    plan: RigPlan, samples: AuditSamples, *, threads: int
) -> ViewsPerFace:
    """Recompute every pair of cameras alone on samples."""
    views = recompute_views(plan, samples, Shadow.of(plan, threads=threads))
    cameras, limits = audit_cameras(plan), plan.requirements.triangulation
    n_c, n = len(cameras), len(samples)
    failing = np.full((n_c, n_c, n), np.nan)
    best, least = np.full(n, -1), np.full(n, np.inf)
    angle, terms = np.full(n, np.nan), dict[str, Array]()
    for p in range(n_c):
        for c in range(p + 1, n_c):
            both = np.flatnonzero(views.met[p, c] >= 0)
            some, passed = samples.take(both), views.met[p, c, both]
            one, other = (Sighted.of(cameras[k], some) for k in (p, c))
            errors = view_terms(one, other, some.normals, limits)
            names = ("matches",) if limits.accuracy_of == "noise" else tuple(errors)
            met, total = met_angle(one, other), deviation(errors)
            limited = np.where(passed == 0, met, deviation(errors, names))
            failing[p, c, both] = np.where(passed == GOOD, np.nan, limited)
            good = (passed == GOOD) & views.measured[both]
            better = np.flatnonzero(good & (total < least[both]))
            rows = both[better]
            least[rows], best[rows], angle[rows] = (
                total[better],
                p * n_c + c,
                met[better],
            )
            for name, values in errors.items():
                terms.setdefault(name, np.full(n, np.nan))[rows] = values[better]
    sigma = np.where(best >= 0, least, np.nan)
    light = np.zeros((0, n), dtype=np.int8)
    pairs = np.where(views.met < 0, np.int8(-1), views.met + np.int8(SEEN))
    return ViewsPerFace(
        light, views.sight, pairs, failing, best, sigma, terms, angle, views
    )


def _of_chunk(
    plan: RigPlan,
    projectors: tuple[AuditProjector, ...],
    cameras: tuple[AuditCamera, ...],
    samples: AuditSamples,
    shadow: Shadow,
) -> PerFace:
    limits, n = plan.requirements, len(samples)
    n_p, n_c = len(projectors), len(cameras)
    light = np.zeros((n_p, n), dtype=np.int8)
    sight = np.zeros((n_c, n), dtype=np.int8)
    for p, projector in enumerate(projectors):
        light[p] = light_steps(projector, samples, limits.projector, shadow)
    for c, camera in enumerate(cameras):
        sight[c] = sight_steps(camera, samples, limits.camera, shadow)
    pairs = np.where(light[:, None] == LIT, sight[None], np.int8(-1))
    together = np.array([[c.works_with(p) for c in cameras] for p in projectors])
    pairs[~together.reshape(n_p, n_c)] = -1
    failing = np.full((n_p, n_c, n), np.nan)
    best, least = np.full(n, -1), np.full(n, np.inf)
    terms: dict[str, Array] = {}
    angle = np.full(n, np.nan)
    for p, projector in enumerate(projectors):
        for c, camera in enumerate(cameras):
            both = np.flatnonzero(pairs[p, c] == SEEN)
            pair = PairGeometry.of(projector, camera, samples.take(both))
            errors = error_terms(pair, limits.triangulation)
            figures = pair_figures(pair, errors, limits.triangulation)
            holds = pair_holds(figures, limits.triangulation)
            passed = np.cumprod(holds, axis=0, dtype=np.int8).sum(axis=0)
            pairs[p, c, both] += passed.astype(np.int8)
            fails = np.flatnonzero(passed < len(holds))
            failing[p, c, both[fails]] = figures[passed[fails], fails]
            total = deviation(errors)
            better = np.flatnonzero((passed == len(holds)) & (total < least[both]))
            rows = both[better]
            least[rows], best[rows] = total[better], p * n_c + c
            for name, values in errors.items():
                terms.setdefault(name, np.full(n, np.nan))[rows] = values[better]
            along, _ = projector.light.to_points(pair.points[better])
            view, _ = towards(pair.points[better], camera.world_from_device[:3, 3])
            angle[rows] = np.arccos(np.clip(dot(along, view), -1.0, 1.0))
    sigma = np.where(best >= 0, least, np.nan)
    return PerFace(light, sight, pairs, failing, best, sigma, terms, angle)
