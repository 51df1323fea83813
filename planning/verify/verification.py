"""`plan verify`: the audit of every claim, then the simulated reconstruction."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from threading import Event
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from geometry.parallel import abandonable, n_threads
from planning.model.errors import InputError, PlanningError
from planning.model.plan import RigPlan
from planning.verify.audit.audit import Audit, audited
from planning.verify.audit.audit_case import AuditCase, examine
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.coverage.prediction import possible_at_floors
from planning.verify.audit.figure_claims import contradictions
from planning.verify.family import audit_family
from planning.verify.mesh_comparison import (
    comparable,
    compare_meshes,
    compare_records,
)
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.comparison import PredictedSamples, compare
from planning.verify.reconstruction.check.interreflection import (
    ALBEDO,
    interreflection,
)
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.check.view_check import Ball, reconstruct_views
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.render.countdown import countdown
from planning.verify.reconstruction.render.mitsuba.physics import Physics
from planning.verify.reconstruction.render.photometry import Photometry, assumed_light
from planning.verify.reconstruction.scanner import Scanner

from .held_figures import WHOLLY, Again, hold_claims, hold_figures
from .trust import OF_MEMBER, held_against_others, taken_on_trust
from .verdict import Verification


# BLAS must not split sums differently where figures are held to the last digit.
@threadpool_limits.wrap(limits=1, user_api="blas")
def verify_plan(
    plan: RigPlan,
    mesh: TriangleMesh | None = None,
    *,
    check_pixels: bool = True,
    truth: RigPlan | None = None,
    physics: Physics | None = None,
    photometry: Photometry | None = None,
    seed: int | None = None,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
    again: Again | None = None,
    proofs: bool = True,
    over_poses: bool = False,
) -> Verification:
    """Recompute every claim of a plan, then measure its object through pixels.

    Args:
        plan: The plan, as written.
        mesh: If given, it must be the surface that the plan speaks of. If it isn't, it
            is also what is rendered, so that the pixels say how it differs; unless its
            size is so different that the file is another one, or in another unit.
        check_pixels: Whether the reconstruction is run.
        truth: What really stands there; the plan by default. With it, or with another
            mesh, every limit of the check that isn't kept is a failure.
        physics: What Mitsuba renders; None: the built-in renderer does. With it, too,
            every limit that isn't kept is a failure.
        photometry: Light and sensor; None: as the plan's check assumes.
        seed: Of the audit's samples and the pixel noise; the plan's own by default.
        threads: Worker threads; no result depends on them. None: all cores.
        progress: Receives a line when a stage begins.
        again: Computes claims again by the code that made them, some or all, so that
            they are held to the last digit where nothing of what made the plan is
            different; None: they are held by the audit alone.
        proofs: Whether bounds over candidates are derived again.
        over_poses: Whether those over all poses are, which may take minutes.

    Raises:
        InputError: If `truth` can't be rendered for the plan.
        PlanFileError: If the plan is broken, so that its claims have no meaning.
    """

    def say(line: str) -> None:
        if progress is not None:
            progress(line)

    if plan.document.family is not None:
        if mesh is not None or truth is not None:
            raise InputError(
                "a family is verified as its members were planned: compare a mesh, or "
                "what really stands there, with the plan of one member (members/NAME)"
            )
        return _verify_family(
            plan,
            say,
            check_pixels=check_pixels,
            physics=physics,
            photometry=photometry,
            seed=seed,
            threads=threads,
            again=again,
            proofs=proofs,
            over_poses=over_poses,
        )
    if truth is not None and truth.cameras_alone != plan.cameras_alone:
        raise InputError(
            "what stands there and the plan must have projectors both, or neither; "
            "give a plan of the same pattern"
        )
    threads = threads or n_threads()
    seed = plan.document.seed if seed is None else seed
    say("audit: recomputing every claim on fresh samples")
    case = examine(plan, seed=seed, threads=threads)
    other, differs = None, list[str]()
    if mesh is not None:
        differs = compare_meshes(mesh, plan.surface.mesh, seed)
        if differs and comparable(mesh, plan.surface.mesh):
            other = mesh
        differs += compare_records(mesh, plan)
    recorded = plan.document.reconstruction
    if recorded is not None:
        room = assumed_light(Scanner.of(plan)).ambient
        differs += contradictions(recorded, room, plan.digest)
    how = {"photometry": photometry, "physics": physics}
    pixels, unrendered = None, ()
    # Pixels need what was recomputed, and no claim.
    drawn = Event()
    if proofs:
        # They take longer than what a thread is left for.
        drawn.set()
    with abandonable(1) as pool:
        told = say if over_poses else None
        auditing = pool.submit(
            _audited_after, drawn, case, proofs=proofs, over_poses=told
        )
        try:
            try:
                if check_pixels:
                    pixels = _reconstruct(
                        *(plan, case, truth, other, seed, threads, say, how, drawn)
                    )
            finally:
                drawn.set()
        except Exception as error:
            # Of a plan without meaning, or with false claims, that is said, and not how
            # it can't be rendered.
            if isinstance(error, PlanningError) or not auditing.result().failures:
                auditing.result()
                raise
            unrendered = (f"pixels: not to be rendered ({type(error).__name__})",)
        audit = auditing.result()
    claims_held, figures_held = "", ""
    failures = [*audit.failures, *differs, *unrendered]
    if not failures:
        if again is not None:
            say("claims: computed again by the code that made them")
        differ, claims_held = hold_claims(plan, again, threads)
        failures += differ
    missed: tuple[str, ...] = ()
    as_planned = truth is None and other is None and not any(how.values())
    if pixels is not None and not as_planned:
        # What is recorded is of the rig as planned, by the built-in renderer.
        failures += pixels.failures
    elif pixels is not None:
        false, figures_held = hold_figures(plan, pixels.record(), seed)
        reported = () if recorded is None else recorded.failures
        none = pixels.accuracy is None and not plan.coverage.surface.measured_m2
        if recorded is None and none:
            # Such a plan says itself that no point is to be had.
            reported = pixels.failures
        if reported and not false:
            missed = pixels.failures or reported
        else:
            failures += (*pixels.failures, *false)
    return Verification(
        tuple(failures),
        audit,
        pixels,
        missed,
        claims_held=claims_held,
        compared=figures_held,
        trusted=taken_on_trust(plan, mesh, claims_held, figures_held, audit.over_poses),
    )


def _audited_after(turn: Event, case: AuditCase, **how: Any) -> Audit:  # noqa: ANN401
    """Audit a case when its turn comes."""
    turn.wait()
    return audited(case, **how)


def _verify_family(
    plan: RigPlan,
    say: Callable[[str], None],
    **how: Any,  # noqa: ANN401
) -> Verification:
    """Verify every member by itself, then what is said of them together."""
    family, found = plan.document.family, list[tuple[str, Verification]]()
    assert family is not None
    for record, member in zip(plan.document.members, plan.members, strict=True):
        say(f"member {record.name}")
        found.append((record.name, verify_plan(member, progress=say, **how)))
    false = audit_family(plan, [one.audit.case for _, one in found])
    held = ""
    if not false and all(one.passed for _, one in found):
        false, held = hold_claims(plan, how["again"], how["threads"] or n_threads())
    # Members tell what became of their own bounds over all poses.
    told = () if how["over_poses"] else None
    believed = () if held == WHOLLY else held_against_others(plan, told)
    # Of one that needn't be served what it misses is no requirement; a lie is a lie.
    served = [one for m, one in enumerate(found) if m not in family.left_out]
    worst = found[min(family.worst, len(found) - 1)][1]
    return Verification(
        (*false, *(f"{name}: {line}" for name, one in found for line in one.failures)),
        replace(
            worst.audit,
            unmet=tuple(f"{n}: {line}" for n, one in served for line in one.unmet),
        ),
        worst.reconstruction,
        members=tuple(found),
        claims_held=held,
        trusted=(
            *believed,
            *(
                f"{name}: {line}"
                for name, one in found
                for line in one.trusted
                if line != OF_MEMBER
            ),
        ),
    )


def _reconstruct(
    plan: RigPlan,
    case: AuditCase,
    truth: RigPlan | None,
    mesh: TriangleMesh | None,
    seed: int,
    threads: int,
    say: Callable[[str], None],
    how: Mapping[str, Any],
    drawn: Event,
) -> Reconstruction:
    """Measure through pixels; tell when a thread has no pair left to draw.

    What comes then takes one thread.
    """
    if plan.cameras_alone and how["physics"] is not None:
        raise InputError(
            "physics is of light that projectors show, and this plan's pattern is "
            "'none'; leave it out"
        )
    standing = None if truth is None and mesh is None else Scanner.of(truth or plan)
    if standing is not None and mesh is not None:
        standing = replace(standing, mesh=mesh)
    believed = Scanner.of(plan)
    samples = bare(case.samples)
    expected = Expected(samples, case.actual.measured, case.actual.by_pair)
    count = countdown(
        lambda line: say(f"pixels: {line}"),
        n_cameras=len(believed.cameras),
        threads=threads,
        all_first=plan.cameras_alone,
    )

    def told(done: int, n: int) -> None:
        if n - done < threads:
            drawn.set()
        count(done, n)

    if plan.cameras_alone:
        space = plan.requirements.workspace
        pixels = reconstruct_views(
            believed,
            Ball(np.array(space.centre), space.object_radius_m),
            seed=seed,
            threads=threads,
            truth=standing,
            expected=expected,
            photometry=how["photometry"],
            progress=told,
        )
    else:
        pixels = reconstruct(
            believed,
            seed=seed,
            threads=threads,
            truth=standing,
            expected=expected,
            progress=told,
            **how,
        )
    possible = possible_at_floors(plan, case.samples, threads=threads)
    prediction = PredictedSamples(
        samples, case.samples.weights, case.actual.measured_by, possible
    )
    compared = compare(believed, prediction, pixels.everything, pixels.accuracy)
    if plan.cameras_alone:
        # Light that falls evenly has bounced already.
        return replace(pixels, comparison=compared)
    physics, stated = how["physics"], believed.light
    albedo = ALBEDO if stated is None else stated.albedo[1]
    if physics is not None:
        albedo = physics.surface.albedo
    bounced = interreflection(believed, pixels.merged, albedo=albedo)
    return replace(pixels, comparison=compared, interreflection=bounced)


def bare(samples: AuditSamples) -> SurfaceSamples:
    """Return samples as the reconstruction takes them, of one weight."""
    weight = float(samples.weights[0]) if len(samples) else 0.0
    return SurfaceSamples(samples.points, samples.normals, samples.faces, weight)
