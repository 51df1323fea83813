"""Candidate viewpoints: projectors and cameras at poses over the whole workspace."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.model.device_poses import ring_frame
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Workspace

from .offered_poses import OfferedPoses
from .view_tiles import Site

_Array = NDArray[np.float64]


def projector_candidates(
    template: PlannedProjector,
    workspace: Workspace,
    n: int,
    *,
    ring_offset: tuple[float, float],
    site: Site | None = None,
) -> tuple[PlannedProjector, ...]:
    """Return projector candidates over the whole workspace.

    Args:
        template: Optics, light and rings; its poses are replaced.
        workspace: Where devices may stand.
        n: Candidates wanted, at least.
        ring_offset: Tilt and azimuth of the ring axis, as `ring_frame` takes them.
        site: What they stand over in tiled placement; None: all look at the centre.

    Raises:
        InfeasibleLimitsError: If the workspace holds no position.
    """
    poses = _offer_of(template, workspace, site).over(n)
    return _projectors(template, poses, ring_offset)


def projectors_towards(
    template: PlannedProjector,
    workspace: Workspace,
    directions: _Array,
    *,
    ring_offset: tuple[float, float],
    site: Site | None = None,
) -> tuple[PlannedProjector, ...]:
    """Return admissible candidates in directions from the centre, unit, shape (n, 3).

    The other arguments are those of `projector_candidates`.
    """
    poses = _offer_of(template, workspace, site).towards(directions)
    return _projectors(template, poses, ring_offset)


def projectors_around(
    chosen: Sequence[PlannedProjector],
    workspace: Workspace,
    n_lattice: int,
    *,
    ring_offset: tuple[float, float],
    scale: float = 1.0,
    site: Site | None = None,
) -> tuple[PlannedProjector, ...]:
    """Return candidates between those of a lattice, close around chosen ones.

    Each chosen pose gets positions out to the lattice's spacing, as seen from the
    centre of the workspace, as far as they are admissible; laid out from the vertical
    through it, so that they turn with the workspace. In tiled placement, they are
    turned about what they look at and moved along with it.

    Args:
        chosen: Projectors of the lattice.
        workspace: Where devices may stand.
        n_lattice: Poses of the lattice.
        ring_offset: As for `projector_candidates`.
        scale: How far out, as a share of the lattice's spacing.
        site: As for `projector_candidates`.
    """
    if not chosen:
        return ()
    poses = np.stack([projector.world_from_device for projector in chosen])
    offer = _offer_of(chosen[0], workspace, site)
    around = offer.around(poses, n_lattice, scale)
    return _projectors(chosen[0], around, ring_offset)


def camera_candidates(
    template: PlannedCamera, workspace: Workspace, n: int, site: Site | None = None
) -> tuple[PlannedCamera, ...]:
    """Return camera candidates over the whole workspace, at least n.

    The arguments are those of `projector_candidates`.
    """
    return _cameras(template, _offer_of(template, workspace, site).over(n))


def cameras_towards(
    template: PlannedCamera,
    workspace: Workspace,
    directions: _Array,
    site: Site | None = None,
) -> tuple[PlannedCamera, ...]:
    """Return cameras in directions from the centre, as `projectors_towards` does."""
    return _cameras(template, _offer_of(template, workspace, site).towards(directions))


def _offer_of(
    template: PlannedProjector | PlannedCamera, workspace: Workspace, site: Site | None
) -> OfferedPoses:
    projects = isinstance(template, PlannedProjector)
    radius = workspace.projector_radius_m if projects else workspace.camera_radius_m
    return OfferedPoses(template.device, workspace, radius, site)


def _projectors(
    template: PlannedProjector, poses: _Array, ring_offset: tuple[float, float]
) -> tuple[PlannedProjector, ...]:
    device_from_ring = ring_frame(np.eye(4), template.device, *ring_offset)
    return tuple(
        replace(
            template,
            world_from_device=pose,
            world_from_ring=pose @ device_from_ring,
            existing="",
        )
        for pose in poses
    )


def _cameras(template: PlannedCamera, poses: _Array) -> tuple[PlannedCamera, ...]:
    return tuple(replace(template, world_from_device=p, existing="") for p in poses)
