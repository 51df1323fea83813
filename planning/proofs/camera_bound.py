"""The bound over all poses for cameras, given the projectors.

The samples are those that the projectors light and some candidate measures, frozen as a
set, and so is how many of them must be measured: the cover's own. Cells hold every
position of the workspace, each with a superset of what a camera anywhere inside it
measures with these projectors, however it is aimed and rolled (`measurable_cells`).
Where the object overflows the image, cells are cut by aim as well (`aim_cells`).

Shadows are counted only if the bound without them stays below the count: they cost
most, and what is proved without them holds with them. So with cells by aim.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from geometry.devices import PinholeModel
from geometry.directions.cube_map import CubeMap
from geometry.directions.open_directions import DirectionLimits
from geometry.directions.widened_maps import WidenedMaps
from geometry.mesh.tensors import lengths
from planning.proofs.cells.aim_cells import AimTree
from planning.proofs.cells.image_cone import image_cone
from planning.proofs.cells.measurable_cells import MeasurableCells
from planning.proofs.cells.position_cells import PositionTree
from planning.scene.measured import LitSamples
from planning.scene.scene import Scene
from solvers.cells.cell_bound import CellStatus

from .all_poses import BoundQuestion, ContinuousBound, Effort
from .optimistic_coverage import mesh_reach, open_samples

DEFAULT = Effort(
    finest=7, aims=None, maps=5, budget=1.5e9, shadows=3e8, most_samples=2000
)
PROVE = Effort(finest=8, aims=5, maps=7, budget=1e10, shadows=np.inf)


def bound_cameras(
    scene: Scene,
    device: PinholeModel,
    samples: LitSamples,
    question: BoundQuestion,
    effort: Effort,
) -> ContinuousBound:
    """Bound the cameras over every pose of the workspace, for given projectors.

    Args:
        scene: Surface and requirements.
        device: Optics of the cameras.
        samples: Those that some candidate measures and no existing camera does, with
            light and rings on them.
        question: How many of them must be measured.
        effort: What to spend.
    """
    if question.count <= 1:
        # What is required takes one, with shadows or without: no cell is looked at.
        effort = replace(effort, finest=0, aims=None, shadows=0.0)
    cells = CameraCells(scene, device, samples, effort)
    found, shadows = question.searched(cells.without_shadows, effort.budget), False
    for tree in cells.finer:
        if found.status is CellStatus.PROVED:
            break
        better = question.searched(tree(), effort.budget)
        # Cut short, a finer search may have proved less.
        if better.lower_bound >= found.lower_bound:
            found, shadows = better, cells.shadows
    shadows = shadows or found.status is CellStatus.PROVED
    return ContinuousBound(question, found, shadows, np.empty((0, 3)))


class CameraCells:
    """The trees that are searched, one after the other; each made when it is wanted.

    Args:
        scene: Surface and requirements.
        device: Optics of the cameras.
        samples: With light and rings on them.
        effort: How fine they are.
    """

    def __init__(
        self,
        scene: Scene,
        device: PinholeModel,
        samples: LitSamples,
        effort: Effort,
    ) -> None:
        self._scene, self._device, self._samples = scene, device, samples
        self._effort = effort
        self._limits = MeasurableCells(
            samples, scene.requirements, device, check_cancelled=scene.check_cancelled
        )
        near = scene.requirements.workspace.camera_radius_m[0]
        pairs = len(samples.target) * len(scene.mesh.faces)
        self.shadows = pairs <= effort.shadows and near >= mesh_reach(scene)

    @property
    def without_shadows(self) -> PositionTree:
        """Cells of positions without shadows."""
        return self._positions(self._effort.finest, None)

    @property
    def finer(self) -> list[Callable[[], PositionTree | AimTree]]:
        """Finer cells among shadows; then cells by aim, where that is of any use."""
        found: list[Callable[[], PositionTree | AimTree]] = [self.among_shadows]
        if self._effort.aims is not None and self.field_binds:
            found.append(self.by_aim)
        return found

    def among_shadows(self) -> PositionTree:
        """Return finer cells of positions, among shadows if these count."""
        return self._positions(self._effort.finest + 1, self._maps)

    def by_aim(self) -> AimTree:
        """Return the same, cut by aim as well."""
        assert self._effort.aims is not None
        half = image_cone(self._device).half_angle
        return AimTree(self.among_shadows(), half, finest=self._effort.aims)

    @property
    def field_binds(self) -> bool:
        """Whether a camera that looks at the centre may miss some sample."""
        space = self._scene.requirements.workspace
        offsets = self._samples.target.samples.points - np.array(space.centre)
        reach = float(lengths(offsets).max())
        return not self._device.holds_ball(reach, space.camera_radius_m[0])

    def _positions(self, finest: int, maps: WidenedMaps | None) -> PositionTree:
        space = self._scene.requirements.workspace
        return PositionTree(
            space,
            space.camera_radius_m,
            self._device.range_m,
            self._samples.target.samples.points,
            maps,
            finest=finest,
            limits=self._limits,
        )

    @cached_property
    def _maps(self) -> WidenedMaps | None:
        if not self.shadows:
            return None
        cube = CubeMap(1 << self._effort.maps)
        # Of the direction itself, cameras have no limit but incidence.
        limits = DirectionLimits(self._scene.requirements.camera.max_incidence, 0.0)
        opened = open_samples(
            self._scene, limits, self._samples.target, cube, shadows=True
        )
        return WidenedMaps(opened, cube)
