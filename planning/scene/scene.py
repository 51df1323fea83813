"""What both planning stages look at: the surface, its target, and how rays see it."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.devices import DeviceModel
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import sample_surface
from geometry.rays.visibility import Visibility
from geometry.repair.hollow import MeshShell, measure_shell
from planning.cache.cache import NO_CACHE, Cache
from planning.cache.content import content
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import (
    CameraLimits,
    CheckLimits,
    Requirements,
    Workspace,
)
from planning.scene.workspace.candidates import Candidates
from planning.scene.workspace.model_candidates import ModelCandidates
from planning.scene.workspace.view_tiles import Site

from .draws import DRAWS, Draw
from .occlusion import Occlusion
from .placed_bodies import (
    Blocker,
    Device,
    Kind,
    Obstruction,
    PlacedBody,
    bodies_of,
    existing_bodies,
    kind_of,
)
from .samples import Target, merged

_D = TypeVar("_D", PlannedProjector, PlannedCamera)

# Positions are written to 0.01 mm; twice the half diagonal of that cube.
_ROUNDING_M = 2e-5


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that doesn't depend on where devices stand.

    Attributes:
        mesh: The surface.
        region: Dominant region of each face, -1 for none, shape (n_f,).
        steep: Unit T1 of each face, zero where arbitrary or outside the target.
        requirements: What is asked.
        seed: Of every random draw.
        threads: Worker threads; no result depends on it.
        check_cancelled: Called between pieces of work; raises when the run is cut.
        placed: Bodies of devices that were chosen, beside those that stand already.
        obstructions: What stands about the object and isn't a device.
        cache: What was answered before about a scene of the same content.
    """

    mesh: TriangleMesh
    region: NDArray[np.int64]
    steep: NDArray[np.float64]
    requirements: Requirements
    seed: int
    threads: int
    check_cancelled: Callable[[], None] = lambda: None
    placed: tuple[PlacedBody, ...] = ()
    obstructions: tuple[Obstruction, ...] = ()
    cache: Cache = NO_CACHE

    @cached_property
    def content(self) -> str:
        """A hash of all that answers about the scene depend on."""
        stands = self.requirements, self.placed, self.obstructions
        return content(self.mesh, self._regions_content, self.seed, *stands)

    @cached_property
    def _regions_content(self) -> str:
        return content(self.region, self.steep)

    @cached_property
    def in_run(self) -> Cache:
        """The cache, or one that ends with the scene: for what every draft asks."""
        return self.cache if self.cache.entries is not None else Cache.in_memory()

    @cached_property
    def bodies(self) -> tuple[Blocker, ...]:
        """All that stands in the way of light and views, but the object."""
        return self.obstructions + existing_bodies(self.requirements) + self.placed

    def among(self, devices: Iterable[Device]) -> "Scene":
        """Return the scene with the bodies of these devices, and no other planned."""
        return self.with_placed(bodies_of(one for one in devices if not one.existing))

    def less_one_obstacle(self) -> Iterator[tuple[str, "Scene"]]:
        """Yield what each obstacle is called, and the scene without it."""
        for moved in self.obstructions:
            rest = tuple(other for other in self.obstructions if other is not moved)
            yield moved.words, self._with(obstructions=rest)

    @property
    def surfaces(self) -> tuple["Scene", ...]:
        """The scene of each surface that is measured by itself: this one."""
        return (self,)

    @property
    def has_floors(self) -> bool:
        """Whether parts of the target have quotas of their own."""
        return bool(self.requirements.region_coverage)

    @property
    def without_floors(self) -> "Scene":
        """The scene of which no region has a floor."""
        if not self.has_floors:
            return self
        return self._with(requirements=replace(self.requirements, region_coverage=0.0))

    @cached_property
    def for_light(self) -> "Scene":
        """The scene as projectors know it: whatever is asked of cameras alone."""
        required = self.requirements
        pairs = replace(required.triangulation, max_sigma_m=None, accuracy_of="total")
        return self._with(
            requirements=replace(
                required,
                coverage=1.0,
                max_cameras=None,
                min_reachable=0.0,
                min_views=None,
                camera=CameraLimits(0.0),
                triangulation=pairs,
                check=CheckLimits(*(0.0,) * 6),
            )
        )

    def within(self, workspace: Workspace) -> "Scene":
        """Return the scene with another workspace."""
        return self.asking(replace(self.requirements, workspace=workspace))

    def asking(self, requirements: Requirements) -> "Scene":
        """Return the scene of which something else is asked."""
        return self._with(requirements=requirements)

    def with_obstructions(self, obstructions: tuple[Obstruction, ...]) -> "Scene":
        """Return the scene with others standing about."""
        return self._with(obstructions=obstructions)

    def with_placed(self, placed: tuple[PlacedBody, ...]) -> "Scene":
        """Return the scene with other bodies of chosen devices."""
        return self._with(placed=placed) if placed or self.placed else self

    def _with(self, **changes: object) -> "Scene":
        other = replace(self, **changes)
        self._carry(other)
        return other

    def _carry(self, other: "Scene") -> None:
        """Hand on what rays are cast against: it is the same mesh."""
        other.__dict__["visibility"] = self.visibility
        if self.cache.entries is not None:
            other.__dict__["_regions_content"] = self._regions_content

    @cached_property
    def safe_workspace(self) -> Workspace:
        """The workspace less what rounding a position may cost."""
        return self.requirements.workspace.inset(_ROUNDING_M)

    @cached_property
    def visibility(self) -> Visibility:
        """Occlusion by the mesh."""
        return Visibility(self.mesh, threads=self.threads)

    @cached_property
    def occlusion(self) -> Occlusion:
        """The same, asked of samples."""
        return Occlusion((self.visibility,))

    @cached_property
    def shell(self) -> MeshShell:
        """Whether the mesh is hollow, and what of it lies inside."""
        return self.cache.recall(
            "measure_shell",
            (self.mesh,),
            lambda: measure_shell(self.visibility.caster),
        )

    @cached_property
    def target_faces(self) -> NDArray[np.bool_]:
        """Whether each face is in the target."""
        if self.requirements.target == "surface":
            return np.ones(len(self.mesh.faces), dtype=bool)
        return self.region >= 0

    @cached_property
    def large_regions(self) -> NDArray[np.int64]:
        """Regions of at least `region_share` of the target's area, ascending.

        A `region_coverage` is theirs.
        """
        areas = self.mesh.face_areas
        inside = self.region >= 0
        of_region = np.bincount(self.region[inside], areas[inside])
        least = self.requirements.region_share * areas[self.target_faces].sum()
        return np.flatnonzero(of_region >= least * (1.0 - 1e-9))

    def floor_rows(
        self, samples: Target, kind: Kind
    ) -> tuple[NDArray[np.int64], int, float]:
        """Return which part with a quota samples are of, how many, and the share.

        Parts are large regions, from 1; 0 is of none, shape (n,). The share is that
        which devices of a kind must cover of each part.
        """
        share = self.requirements.region_coverage
        if not share:
            return np.zeros(len(samples), dtype=np.int64), 1, 0.0
        number = np.zeros(int(self.region.max(initial=-1)) + 2, dtype=np.int64)
        large = self.large_regions
        # Faces of no region count as the last.
        number[large] = 1 + np.arange(large.size)
        return number[self.region[samples.samples.faces]], 1 + large.size, share

    def region_samples(self, draw: Draw, region: int) -> Target:
        """Return area-true samples of a region, by a stream of its own."""
        return self.drawn(draw, self.region == region, region + 1)

    def more_of_regions(self, target: Target, draw: Draw) -> Target | None:
        """Draw what large regions lack of so many samples; None: they have enough."""
        region = self.region[target.samples.faces]
        every: Target | None = None
        for index in self.large_regions.tolist():
            lack = draw.count - int((region == index).sum())
            if lack > 0:
                more = self.region_samples(draw.of(lack), index)
                every = more if every is None else merged(every, more)
        return every

    def target_samples(self, draw: Draw) -> Target:
        """Return area-true samples of the target."""
        return self.drawn(draw, self.target_faces)

    def surface_samples(self, draw: Draw) -> Target:
        """Return area-true samples of the whole surface, by the draw's next stream."""
        return self.drawn(draw.later(1), None)

    def site(self, kind: Kind, device: DeviceModel) -> Site | None:
        """Return what devices stand over side by side; None where the object fits."""
        required, space = self.requirements, self.requirements.workspace
        radius, standoff, limits = (
            (space.projector_radius_m, space.projector_standoff_m, required.projector)
            if kind == "projector"
            else (space.camera_radius_m, space.camera_standoff_m, required.camera)
        )
        if standoff is None:
            return None
        samples = self.target_samples(DRAWS.site).samples
        return Site(device, space, radius, standoff, samples, limits.max_incidence)

    def candidates(
        self, templates: Iterable[_D], space: Workspace | None = None
    ) -> ModelCandidates[_D]:
        """Return what gives candidates over the object, of each template's model.

        In its workspace, or another one.
        """

        def of(template: _D) -> Candidates[_D]:
            site = self.site(kind_of(template), template.device)
            if site is not None and space is not None:
                site = replace(site, workspace=space)
            return Candidates(template, space or self.requirements.workspace, site)

        return ModelCandidates(tuple(of(template) for template in templates))

    def drawn(self, draw: Draw, within: NDArray[np.bool_] | None, *part: int) -> Target:
        """Return area-true samples of some faces (None: of all), by a stream."""
        # SeedSequence mixes seed and stream, so neighbouring seeds share no draw.
        mixed = np.random.SeedSequence([self.seed, draw.stream, *part])
        samples = sample_surface(
            self.mesh, draw.count, seed=int(mixed.generate_state(1)[0]), within=within
        )
        return Target(samples, self.steep[samples.faces])
