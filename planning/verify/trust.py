"""What of a plan nobody can recompute from its files: no claims, and taken on trust.

Keys are dotted, `*` stands for any name or number; a key stands for all below it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from planning.model.plan import RigPlan
from planning.model.words import shell_word
from planning.verify.audit.proofs.poses.pose_claims import PoseBound

from .held_figures import EXACTLY, WHOLLY
from .no_claims import is_under, under

OVER_POSES = "bounds over all poses: not derived again, which --proofs does"
# Of a member that is verified without its family.
OF_MEMBER = (
    "that it is one of a family, which isn't here, and what all members tell together: "
    "their ball (requirements.workspace.centre, object_radius_m), rings spaced and "
    "left out for them (projectors.*.rings), axes in their middle (ring_axes.taken)"
)

# Claims that the audit holds against others, but doesn't recompute; by what they say.
ON_TRUST = {
    OVER_POSES: ("certificates.*.continuous",),
    "the numbers needed, and what other numbers of devices cover at most": (
        "certificates.*.needed",
        "certificates.*.by_count",
        "certificates.*.best_area",
        "certificates.*.one_fewer",
        "certificates.*.greedy_count",
        "certificates.*.but_for_bodies",
        "certificates.*.bounds_leave_out",
        "certificates.*.excluded_pairs",
        "certificates.*.n_samples",
        "certificates.*.required_m2",
        "certificates.*.n_regions",
        "certificates.*.status",
        "certificates.*.alone",
        "certificates.*.routes",
    ),
    "figures of the rig that may bind nothing, and how many poses it offered": (
        *(f"rig.*.figures.{n}" for n in ("range_mm", "frame_rate_hz", "exposure_ms")),
        *(f"rig.*.figures.{n}" for n in ("response", "mount")),
        # Rings are drawn as if a projector's lens were straight.
        "rig.projector.figures.distortion",
        "rig.more_projectors.*.figures.distortion",
        "rig.n_candidate_*",
    ),
    "how the rig lays out rings at first, and its limits of other patterns": (
        *(f"rig.rings.{n}" for n in ("tilt", "shift_m", "gap_m", "outer_radius")),
        "rig.rings.margin_m",
        "rig.limits.min_angle_deg",
        "rig.limits.max_angle_deg",
        "rig.limits.min_conditioning",
        "rig.limits.min_ring_pitch_px",
        "rig.limits.ring_sigma_mm",
    ),
    "where candidates begin, rings left out, and axes that no limit asks for": (
        "requirements.workspace.bearing",
        "projectors.*.rings.left_out",
        "ring_axes.other",
    ),
    "that the run was, or wasn't, cut": ("truncated",),
    "the numbers that survival takes": ("survival.projectors", "survival.cameras"),
    "what planning both kinds together saved": ("joint",),
    "numbers of heads or steps, and their bounds": ("stations.count", "stations.steps"),
    "rigs drawn of the plan that isn't robust": (
        "robust.n_*_without",
        "robust.missed_by_without",
        "robust.rounds",
    ),
    "what a family's members take alone": ("family.projectors", "family.cameras"),
}
# Figures that only the code that made them tells again, and then to the last digit.
UNAUDITED = {
    "how curved the surface is, and in which neighbourhood that was measured": (
        "regions.*.mean_curvedness",
        "surface.curvature_radius_m",
    ),
    "what kind of body the mesh is, and its walls": ("meshes.*.shell",),
    "how many seam points cameras share, and at a border or not": (
        "baselines.*.n_seam",
        "baselines.*.shares_border",
    ),
    "the region that fewer projectors light worst": ("marginal.*.worst_region*",),
    "how many samples the plan's areas are of": ("coverage.samples",),
    "within what distance of a sample the check looks for a point": (
        "requirements.check.tau_m",
    ),
}
# Likewise of the check from pixels.
UNAUDITED_OF_CHECK = {
    "the largest error, and how much is off by more than 1 mm": (
        "reconstruction.accuracy_max_m",
        "reconstruction.beyond_1mm_fraction",
    ),
    "edges that gave no point, and the noise of pixels": (
        "reconstruction.left_out_fraction",
        "reconstruction.pixel_noise",
    ),
    "errors and points of parts of the surface": (
        "reconstruction.by_region",
        *(f"reconstruction.*.{name}" for name in ("n_points", "predicted_missing")),
        *(f"reconstruction.{part}.*_m" for part in ("dominant", "whole_surface")),
    ),
    "what light that bounces is taken to do": (
        *(f"reconstruction.interreflection.{n}" for n in ("albedo", "cell_m")),
        *(f"reconstruction.interreflection.{n}" for n in ("n_cells", "worst_*")),
    ),
    "likely causes of what the check missed": ("reconstruction.failures",),
}
# By what faces are chosen that no user chose.
_FOUND = {"curvature": "curvature", "outside": "what lies outside"}
# Of files that aren't part of the plan: what was planned with, and what for.
_OF_RIG = (
    "the rig's file, which has devices, noise, limits, workspace and obstacles (rig): "
    "compare it, or give --replan --rig FILE"
)
_OF_FILE = "the mesh file, its digest, size and repairs (meshes): give --mesh {path}"


def is_trusted(key: str) -> bool:
    """Return whether a claim is among those that are held against others alone.

    What the plan was made with decides how closely figures are held, and the mesh file
    is looked at where it is given: verify tells of either.
    """
    files = ("sha256", "unit", "scale_to_m", "n_vertices", "n_faces", "repairs")
    own = ("made_with", *(f"meshes.*.{name}" for name in files))
    patterns = (*(p for parts in ON_TRUST.values() for p in parts), *own)
    return is_under(key, patterns)


def taken_on_trust(
    plan: RigPlan,
    mesh: TriangleMesh | None,
    claims_held: str,
    figures_held: str,
    over_poses: Sequence[PoseBound] | None = None,
) -> tuple[str, ...]:
    """Return what was believed of a plan, a line each; () where nothing was.

    Args:
        plan: The plan.
        mesh: What its surface was compared with; None: with nothing.
        claims_held: How closely its claims were held, "" where they weren't again.
        figures_held: The same of the figures of its check.
        over_poses: What became of bounds over all poses; None: nothing was tried.
    """
    if plan.document.reconstruction is None:
        figures_held = EXACTLY
    of_check = _of_check(plan, figures_held)
    if claims_held == WHOLLY:
        return of_check
    lines = [*held_against_others(plan, over_poses), *of_surface(plan, claims_held)]
    if plan.of_member:
        lines.append(OF_MEMBER)
    for kind in ("projectors", "cameras"):
        proof = getattr(plan.document.certificates, kind)
        if proof is None or not proof.needed.lower_bound:
            continue
        if proof.candidates.status != "proved" or plan.proof is None:
            lines.append(f"the bound on {kind} over the candidates: claimed, no proof")
    if claims_held != EXACTLY:
        lines += _told(plan, UNAUDITED)
        lines.append(f"the last digits of claims: {claims_held or 'not compared'}")
    lines += of_check
    planned = {("projector", len(plan.projectors)), ("camera", len(plan.cameras))}
    unnamed = [
        place
        for place, row in enumerate(plan.document.marginal)
        if row.reference is None and row.number not in planned
    ]
    if unnamed:
        lines.append(
            f"marginal, rows {', '.join(map(str, unnamed))}: the file doesn't say "
            f"where those devices stand"
        )
    if plan.document.request is None:
        lines.append("what was asked: the plan has no request beside its requirements")
    return (*lines, _OF_RIG, *_of_mesh(plan, mesh))


def _of_mesh(plan: RigPlan, mesh: TriangleMesh | None) -> tuple[str, ...]:
    """Return what of the mesh file was believed, a line each."""
    record, planned = plan.document.meshes[0], plan.surface.mesh
    if mesh is None:
        path = shell_word(record.path) if record.path else "FILE"
        return (_OF_FILE.format(path=path),)
    x, y, z = 1e3 * np.ptp(mesh.bounds, axis=0)
    unit = (
        f"the unit of the mesh file, {record.unit} by the plan, in which it is "
        f"{x:.4g} x {y:.4g} x {z:.4g} mm"
    )
    lines = list[str]()
    if mesh.source is None or mesh.source.sha256 != record.sha256:
        lines.append(
            "the mesh file that was planned (meshes): the one given has the same shape "
            "and other bytes"
        )
    near, same = 1e-9 * mesh.radius, mesh.faces.shape == planned.faces.shape
    if not (same and np.allclose(mesh.corners, planned.corners, 0.0, near)):
        lines.append(
            "how the surface is cut into triangles, along which samples of bounds lie "
            "(faces in surface.npz): the mesh file's are others"
        )
    return (*lines, unit)


def held_against_others(
    plan: RigPlan, over_poses: Sequence[PoseBound] | None = None
) -> tuple[str, ...]:
    """Return which claims of a plan the audit doesn't recompute, a line a kind."""
    lines = list[str]()
    for what, named in _named(plan, ON_TRUST).items():
        if what == OVER_POSES and over_poses is not None:
            lines += [bound.trusted for bound in over_poses if bound.trusted]
        elif named:
            lines.append(what)
    return tuple(lines)


def of_surface(plan: RigPlan, claims_held: str) -> tuple[str, ...]:
    """Return what of `surface.npz` is taken as it stands there, a line each.

    Not again computed, it is the planner's word; and chosen faces are the user's.
    """
    requirements = plan.requirements
    kind = plan.document.faces_chosen_by
    lines: list[str] = []
    found = kind in _FOUND
    if not found or claims_held != EXACTLY:
        what = "which faces are the target" * (requirements.target != "surface")
        chosen = "by a file that surface.selection names"
        if found:
            chosen = f"by {_FOUND[kind]}, says surface.selection"
        what = what or "which faces are of which region"
        lines.append(f"{what} (region in surface.npz): chosen {chosen}")
    lines += [
        f"the shape of obstacle {one.name!r} (obstacle_* in surface.npz): the rig has "
        f"it from a file"
        for one in plan.document.rig.obstacle
        if one.shape == "mesh"
    ]
    again = kinds_offered_again(plan) if claims_held == EXACTLY else ()
    beside = [kind for kind in ("projector", "camera") if kind not in again]
    if plan.cameras_alone:
        beside = ["camera"]
    if beside:
        places = ", ".join(f"reference_{kind}s" for kind in beside)
        lines.append(
            f"which poses define what can be reached, of which shares are ({places} "
            f"in surface.npz)"
        )
    limited = requirements.projector.min_tangent_angle > 0.0 and not plan.cameras_alone
    if claims_held != EXACTLY and limited:
        lines.append(
            "the steep directions T1 (steep in surface.npz), about which tangent "
            "angles are limited: a face without one has no such limit"
        )
    return tuple(lines)


def kinds_offered_again(plan: RigPlan) -> tuple[str, ...]:
    """Return of which kinds of devices the poses that the rig offers come out again.

    Poses of another plan may stand for those of devices that stand already, and bodies
    of cameras had to be clear of projectors that have moved since.
    """
    rig, requirements = plan.document.rig, plan.requirements
    if plan.document.request is None or requirements.existing or plan.cameras_alone:
        return ()
    bodied = any(model.body is not None for model in rig.models("camera"))
    return ("projector",) if bodied else ("projector", "camera")


def _of_check(plan: RigPlan, figures_held: str) -> tuple[str, ...]:
    """Return what of the recorded check was believed, a line each."""
    if figures_held == EXACTLY:
        return ()
    if not figures_held:
        return ("every figure of the check (reconstruction): not compared",)
    digits = f"the last digits of figures of the check: {figures_held}"
    return (*_told(plan, UNAUDITED_OF_CHECK), digits)


def _told(plan: RigPlan, table: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Return which claims of a table a plan makes, a line a kind with their keys."""
    kinds = _named(plan, table).items()
    return tuple(f"{what} ({', '.join(named)})" for what, named in kinds if named)


def _named(
    plan: RigPlan, table: Mapping[str, Sequence[str]]
) -> Mapping[str, Sequence[str]]:
    """Return of each kind of claims in a table those that a plan makes."""
    keys = list(_keys(plan.to_document()))
    return {
        what: [p for p in patterns if any(map(under((p,)), keys))]
        for what, patterns in table.items()
    }


def _keys(value: Any, key: str = "") -> Iterator[str]:  # noqa: ANN401
    """Yield the dotted keys of all that a document holds but nulls."""
    parts: Iterable[tuple[Any, Any]] = ()
    if isinstance(value, Mapping):
        parts = value.items()
    elif isinstance(value, list):
        parts = enumerate(value)
    elif value is not None:
        yield key
    for name, part in parts:
        yield from _keys(part, f"{key}.{name}" if key else str(name))
