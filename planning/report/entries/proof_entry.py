"""What travels with a plan so that others can derive its bounds."""

from collections.abc import Iterable
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from planning.model.document.certificates import (
    Certificate,
    Certificates,
    ProofRecord,
)
from planning.model.proofs import CoverProof, PoseProof, ProofFile
from planning.proofs.candidate_certificate import Refutation
from planning.proofs.quotas import required_samples
from planning.proofs.selection import cover_problem
from planning.report.partial_plan import PartialPlan
from planning.scene.draws import DRAWS, Draw
from planning.scene.lighting import light_on, lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.measured import LitSamples, measured_by
from planning.scene.samples import Target
from planning.scene.scene import Scene
from solvers.covers.cover import reduced_problem
from solvers.covers.exact.exclusion import excluded
from solvers.status import WorkBudget

# Counted work that a certificate may take, and the samples by which it asks for less
# than is required, if that can be proved: so many the audit may see otherwise.
_BUDGET, _SPARE = 3e9, 1 / 250
# Of fresh samples that confirmed no cover of projectors one in so many joined.
_JOINED = 3
_MOST_ROUNDS = 12
# Farther apart devices stand elsewhere [m].
_MOVED = 1e-6


def with_proofs(
    partial: PartialPlan, certificates: Certificates
) -> tuple[Certificates, ProofFile | None]:
    """Return the certificates, those that can be derived again called proved.

    Of devices at stations what is proved is of stations; of a plan that was cut short
    nothing is made to be checked.
    """
    if partial.truncated or partial.stationed is not None:
        return certificates, None
    scene, limits = partial.scene, partial.scene.requirements
    candidates, cover = partial.stage.candidates, partial.camera_stage.cover
    target = cover.samples.target
    stated = {
        "projector": (
            certificates.projectors,
            _frozen(scene, candidates.samples, _projector_draws()),
            candidates.lit,
            limits.dominant_coverage,
            partial.stage.refutation,
        ),
        "camera": (
            certificates.cameras,
            _frozen(scene, target, _camera_draws()) if _stand(partial) else None,
            _measured(partial),
            limits.coverage,
            partial.camera_stage.refutation,
        ),
    }
    proofs: dict[str, CoverProof] = {}
    over_poses: dict[str, PoseProof] = {}
    changed: dict[str, Certificate] = {}
    for kind, (claims, frozen, covers, share, refutation) in stated.items():
        if claims is None or frozen is None or not claims.needed.lower_bound:
            continue
        bound, offered = claims.continuous, _over_poses(frozen, refutation)
        if bound is not None and offered is not None:
            over_poses[kind] = offered
            bound = bound.changed(certificate="offered")
            changed[f"{kind}s"] = claims = claims.changed(continuous=bound)
        proof = _proof(claims, frozen, covers, share)
        if proof is not None:
            proofs[kind] = proof
            if proof.n_sets + 1 >= claims.needed.lower_bound:
                among = claims.candidates.changed(status="proved")
                changed[f"{kind}s"] = claims.changed(candidates=among)
    if not changed:
        return certificates, None
    file = ProofFile.of(proofs, over_poses)
    record = ProofRecord(path="proof.npz", sha256=file.sha256)
    return certificates.changed(**changed, proof=record), file


def _stand(partial: PartialPlan) -> bool:
    """Whether the projectors stand where they stood when cameras were covered for."""
    lit, projectors = partial.camera_stage.cover.samples, partial.final_projectors
    return len(lit.lights) == len(projectors) and all(
        np.allclose(light.offsets, light_on(p, lit.target).offsets, rtol=0, atol=_MOVED)
        for light, p in zip(lit.lights, projectors, strict=True)
    )


def _measured(partial: PartialPlan) -> NDArray[np.bool_]:
    """Return which candidate measures which sample of the cover, shape (n, m).

    With the rings as they are written: finer ones than those that cameras were covered
    for let candidates reach less, of which a share asks for less.
    """
    cover, projectors = partial.camera_stage.cover, partial.final_projectors
    if partial.rings is None:
        return cover.measured
    scene, target = partial.scene.among(projectors), cover.samples.target
    lit = lit_stages(scene, projectors, target) == LIT
    written = LitSamples.of(projectors, target, lit)
    views = cover.candidates.on(target)
    return measured_by(scene, cover.candidates.cameras, written, views)


_Ints = NDArray[np.int64]
# Draws, points, faces, and the places of a cover's samples among them.
_Frozen = tuple[_Ints, NDArray[np.float64], _Ints, _Ints]


def _over_poses(frozen: _Frozen, refutation: Refutation | None) -> PoseProof | None:
    """Return the certificate over all poses, of all samples up to its last one.

    None where there is none, or of a cover of more samples, or largely of a part of a
    draw.
    """
    draws, points, faces, where = frozen
    if refutation is None or len(refutation.multipliers) > len(where):
        return None
    n = len(refutation.multipliers)
    last = where[n] if n < len(where) else len(points)
    every = np.zeros(last, dtype=np.int64)
    every[where[:n]] = refutation.multipliers
    proof = PoseProof(draws, faces, refutation.n_devices, every)
    return proof if proof.is_of_whole_draws else None


def _projector_draws() -> Iterable[list[tuple[Draw, int]]]:
    """Draws that the samples of projectors may be of, with how many were taken."""
    fresh = DRAWS.fresh_projectors
    more = [(fresh.later(k), _JOINED) for k in range(1, 1 + _MOST_ROUNDS)]
    return ([(DRAWS.projectors, 1), *more[:k]] for k in range(1 + _MOST_ROUNDS))


def _camera_draws() -> Iterable[list[tuple[Draw, int]]]:
    fresh = DRAWS.fresh_cameras
    more = [(fresh.later(k), 1) for k in range(1, 1 + _MOST_ROUNDS)]
    return ([(DRAWS.cameras, 1), *more[:k]] for k in range(1 + _MOST_ROUNDS))


def _frozen(
    scene: Scene, samples: Target, tried: Iterable[list[tuple[Draw, int]]]
) -> _Frozen | None:
    """Return draws, all their samples, and which of these a cover's samples are.

    A cover of cameras has those that are lit. None where they are of other draws.
    """
    own = set(map(bytes, samples.samples.points))
    for draws in tried:
        targets = [(d, every, scene.target_samples(d).samples) for d, every in draws]
        drawn = [(d, n, s.points[::n], s.faces[::n]) for d, n, s in targets]
        # One that confirmed, before floors were asked for, has joined nothing.
        drawn = [one for one in drawn if not own.isdisjoint(map(bytes, one[2]))]
        place = {bytes(p): i for i, p in enumerate(chain(*(s[2] for s in drawn)))}
        where = [place.get(bytes(point)) for point in samples.samples.points]
        known = [i for i in where if i is not None]
        if drawn and len(known) == len(where):
            told = np.array([(d.count, d.stream, every) for d, every, *_ in drawn])
            points = np.concatenate([points for *_, points, _ in drawn])
            faces = np.concatenate([faces for *_, faces in drawn])
            return told, points, faces, np.array(known, dtype=np.int64)
    return None


def _proof(
    claims: Certificate, frozen: _Frozen, covers: NDArray[np.bool_], share: float
) -> CoverProof | None:
    draws, points, faces, where = frozen
    every = np.zeros((len(points), covers.shape[1]), dtype=bool)
    every[where] = covers
    required = required_samples(np.any(every, axis=1), share)
    total = claims.candidates.for_total
    least = claims.needed.lower_bound
    few = (least if total is None else min(least, total)) - 1
    if few < 0:
        return None
    reduced = reduced_problem(cover_problem(every, required))
    for asked in (required - int(_SPARE * required), required):
        found = excluded(every, reduced, few, asked, WorkBudget(_BUDGET))
        if found is not None:
            return CoverProof(draws, points, faces, **vars(found))
    return None
