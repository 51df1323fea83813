"""What is asked about the poses of projectors, or of a plan's cameras."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.devices import ParallelModel, PinholeModel
from planning.model.plan import RigPlan
from planning.model.requirements import Requirements
from planning.verify.audit.audit_case import AuditCase
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.devices.workspace_claims import turns
from planning.verify.audit.predicates.audit_devices import audit_projectors
from planning.verify.audit.predicates.predicates import LIT, MEASURED, light_steps
from planning.verify.audit.predicates.recompute import light_of_plan, pairs_with
from planning.verify.audit.predicates.reference_devices import optics_of

from .lit_cells import LitCells
from .measured_cells import Lens, LitBy, MeasuredCells
from .skies import Skies, SkyMaps
from .sphere_cells import Cells
from .too_few import OptimisticCells

_Make = Callable[[Ints, Skies | None], OptimisticCells]
# Pixels from the middle to the rim of maps of what is blocked: the finer ones take four
# times as long, and are drawn where the others leave cells open.
_PIXELS = (100, 200, 400)


@dataclass(frozen=True, eq=False)
class DeviceCells:
    """Cells of the poses of one kind of device.

    Attributes:
        roots: Cells that hold all poses together.
        object_m: Farthest a sample is from the centre; 0 of parallel light [m].
        make: What cells serve of some samples, with or without their skies.
        maps: What is blocked of samples, ever finer; none where nothing counts.
        in_sight: Which of some samples nothing hides from poses, of cells of no size.
    """

    roots: Cells
    object_m: float
    make: _Make
    maps: tuple[SkyMaps, ...]
    in_sight: Callable[[Ints, Cells], Mask]

    @property
    def stages(self) -> tuple[SkyMaps | None, ...]:
        """The maps of each attempt; None: shadows don't count."""
        return None, *self.maps

    def counts(self, maps: SkyMaps | None) -> bool:
        """Return whether all that counts of shadows is in these maps."""
        return maps is not None or not self.maps

    def at_middles(self, cells: Cells, some: Ints) -> Mask:
        """Return which of some samples a pose in the middle of each cell may serve.

        With one ray each for what is in between, which no map tells better; (k, n).
        """
        poses = cells.shrunk()
        may = np.ones((len(cells.low_m), len(some)), dtype=bool)
        return self.make(some, None).serve(poses, may) & self.in_sight(some, poses)

    def of(
        self, some: Ints, say: Callable[[str], None], maps: SkyMaps | None
    ) -> OptimisticCells:
        """Return what cells serve of some of the samples, by their numbers."""
        return self.make(some, None if maps is None else maps.of(some, say))


def device_cells(
    case: AuditCase, kind: str, samples: AuditSamples, lit_by: Mask, *, shadows: bool
) -> DeviceCells:
    """Return the cells of all poses of a kind, and what they may serve of samples.

    Args:
        case: The plan.
        kind: `projector` or `camera`.
        samples: All that are spoken of.
        lit_by: Which of them each of the plan's projectors lights, (n_p, n).
        shadows: Whether what is in the way counts.
    """
    plan, limits = case.plan, _required(case.plan)
    space, devices = limits.workspace, optics_of(plan, kind)
    shell = space.projector_radius_m if kind == "projector" else space.camera_radius_m
    centre = np.array(space.centre)
    corners = plan.surface.mesh.corners.reshape(-1, 3)
    reach = float(np.linalg.norm(corners - centre, axis=1).max())
    object_m = float(np.linalg.norm(samples.points - centre, axis=1).max())
    ranges = [device.range_m for device in devices]
    ends = min(low for low, _ in ranges), max(high for _, high in ranges)
    depth, aside = _outside(devices, shell[0], reach)
    incidence, tangent = limits.camera.max_incidence, 0.0
    make: _Make = partial(_measured, plan, samples, lit_by, ends)
    if kind == "projector":
        incidence = limits.projector.max_incidence
        tangent = limits.projector.min_tangent_angle
        make = partial(_lit, plan, samples, ends, aside)
    maps = ()
    # A ray that ends among the faces may be blocked beyond its device.
    if shadows and depth >= reach and incidence < 0.5 * np.pi:
        touching_m = 2.0 * case.shadow.slack_m
        given = samples, case.shadow.caster, incidence, tangent, touching_m
        maps = tuple(SkyMaps(*given, pixels) for pixels in _PIXELS)
    parallel = aside is not None
    return DeviceCells(
        Cells.of_shell(*shell),
        0.0 if parallel else object_m,
        make,
        maps,
        partial(_in_sight, case, samples, None if parallel else centre),
    )


def _in_sight(
    case: AuditCase,
    samples: AuditSamples,
    centre: Array | None,
    some: Ints,
    poses: Cells,
) -> Mask:
    taken, seen = samples.take(some), []
    for direction, radius in zip(poses.middle, poses.low_m, strict=True):
        way = np.broadcast_to(direction, taken.points.shape)
        away = np.full(len(some), np.inf)
        if centre is not None:
            way = centre + radius * direction - taken.points
            away = np.linalg.norm(way, axis=1)
            way = way / away[:, None]
        seen.append(case.shadow.free(taken.points, taken.faces, -way, away))
    return np.array(seen)


def _outside(
    devices: Sequence[PinholeModel | ParallelModel], near: float, reach: float
) -> tuple[float, float | None]:
    """Return how far light has come out of the ball of the mesh where it starts [m].

    And of parallel light, how far a device may be off its direction [rad]: across it
    the device is no farther from the centre than what it lights and half its panel.
    """
    panels = [d for d in devices if isinstance(d, ParallelModel)]
    if not panels:
        return near, None
    halves = [0.5 * d.pixel_pitch_m * float(np.hypot(*d.resolution)) for d in panels]
    across = reach + max(halves)
    depth = float(np.sqrt(max(0.0, near**2 - across**2)))
    return depth, float(np.arcsin(across / near)) if depth > reach else np.pi


def _required(plan: RigPlan) -> Requirements:
    """Return its requirements, and where devices stand as the part sees them.

    What turns sees them all around, in whatever part of a room they are.
    """
    required = plan.requirements
    if not turns(plan):
        return required
    return replace(required, workspace=required.workspace.whole_shell)


def _lit(
    plan: RigPlan,
    samples: AuditSamples,
    ends: tuple[float, float],
    aside: float | None,
    some: Ints,
    skies: Skies | None,
) -> OptimisticCells:
    required, taken = _required(plan), samples.take(some)
    return LitCells(required.workspace, taken, required.projector, ends, skies, aside)


def _measured(
    plan: RigPlan,
    samples: AuditSamples,
    lit_by: Mask,
    ends: tuple[float, float],
    some: Ints,
    skies: Skies | None,
) -> OptimisticCells:
    required, taken = _required(plan), samples.take(some)
    cameras = [d for d in optics_of(plan, "camera") if isinstance(d, PinholeModel)]
    projectors = audit_projectors(plan)
    offered = [
        LitBy.of(projector, taken, lit[some], required.triangulation)
        for projector, lit in zip(projectors, lit_by, strict=True)
    ]
    return MeasuredCells(required, taken, offered, Lens.of(cameras), ends, skies)


def lit_by_plan(case: AuditCase, kind: str, samples: AuditSamples) -> Mask:
    """Return which samples are spoken of: of cameras what each projector lights.

    Of projectors all, in one row; shape (n_p, n).
    """
    if kind == "projector":
        return np.ones((1, len(samples)), dtype=bool)
    light, _ = light_of_plan(case.plan, samples, case.shadow)
    return light == LIT


def free_of_existing(case: AuditCase, kind: str, samples: AuditSamples) -> Mask:
    """Return what existing devices serve, whatever the rings of projectors, (n,)."""
    plan, shadow = case.plan, case.shadow
    free = np.zeros(len(samples), dtype=bool)
    if kind == "projector":
        for device, planned in zip(case.projectors, plan.projectors, strict=True):
            if planned.existing:
                # Their axes may yet be turned: what is free only lowers the bound.
                widest = replace(device, radii=np.array([np.inf]))
                limits = plan.requirements.projector
                free |= light_steps(widest, samples, limits, shadow) == LIT
        return free
    lit_by = lit_by_plan(case, kind, samples)
    for device, camera in zip(case.cameras, plan.cameras, strict=True):
        if camera.existing:
            args = case.projectors, samples, lit_by, plan.requirements, shadow
            free |= np.any(pairs_with(device, *args) == MEASURED, axis=0)
    return free
