"""`coverage`, `regions`, `marginal`, `overlaps` and `firing_schedule`."""

from typing import Annotated, Literal

from pydantic import Field

from .part import Count, Part, Size, Vector3

# Of a reference pose.
Place = Annotated[int, Field(ge=0)]


class Areas(Part):
    """The five areas that belong together, in [m²]."""

    area_m2: Size
    reachable_by_projectors_m2: float
    lit_m2: float
    reachable_by_cameras_m2: float
    measured_m2: float


class Relaxation(Part):
    """A single change of a limit, and the share of the target that it makes reachable.

    Attributes:
        change: What to change, in words.
        reachable_share: In [0, 1].
    """

    change: str
    reachable_share: Size


class PredictedSigma(Part):
    """Standard deviation along the normal of the target's measured samples [m].

    Of each the pair that measures it with the least, what the calibration leaves
    included where the rig states it.

    Attributes:
        noise_median_m: Of edge noise, misplaced rings and the panel's pixels alone, of
            the same pairs; None in plans from before.
        noise_p95_m: Likewise.
        terms_rms_m: Root mean square of each independent term: `edges`, noise of the
            `light` and of the `phase`, `rings`, `linearity` of drawn edges, noise of
            `matches` of cameras alone, and of the calibration `camera` and `projector`;
            absent where nothing states it.
    """

    median_m: Size
    p95_m: Size
    noise_median_m: Size | None = None
    noise_p95_m: Size | None = None
    terms_rms_m: dict[
        Literal["edges", "light", "phase", "rings", "linearity"]
        | Literal["matches", "camera", "projector"],
        Size,
    ] = Field(default={})


class Coverage(Part):
    """What is covered, and what isn't by which cause; areas in [m²].

    Attributes:
        samples: Fresh samples of the target behind the figures.
        uncovered_by_cause: Target area that isn't measured.
        unreachable_by_cause: Target area that no reference projector lights.
        unreachable_inside_m2: The part of it that lies inside the body.
        blocked_by_body_m2: Unmeasured target area that each device's body stands
            before; absent where no device has a body.
        blocked_by_obstacle_m2: Unmeasured target area that each obstacle stands before;
            absent where there are none.
        sigma: What is predicted of the target's measured samples; None: there are none.
        relaxations: What would let projectors reach enough.
        unmeasurable_by_cause: Lit target area that no reference camera measures.
        camera_relaxations: What would let cameras reach enough.
        asked: Digest of what was asked of the plan, `asked_digest`.
    """

    samples: Count
    surface: Areas
    target: Areas
    uncovered_by_cause: dict[str, float]
    unreachable_by_cause: dict[str, float]
    unreachable_inside_m2: float = 0.0
    blocked_by_body_m2: dict[str, float] = Field(default={})
    blocked_by_obstacle_m2: dict[str, float] = Field(default={})
    sigma: PredictedSigma | None = None
    relaxations: tuple[Relaxation, ...] = ()
    unmeasurable_by_cause: dict[str, float] = Field(default={})
    camera_relaxations: tuple[Relaxation, ...] = ()
    asked: str | None = None


class RobustRecord(Part):
    """How many drawn rigs meet what was asked, and what that costs.

    Attributes:
        n_drawn: Rigs drawn.
        n_met: Of them, those that meet it.
        least: So many make it as good as sure that the quantile of all rigs does.
        rounds: How often the plan was mended for it.
        n_projectors_without: Projectors of the plan for exact rigs; likewise below.
        n_met_without: Of as many of its rigs, those that meet it.
        missed_by: How many of the rigs miss which figure; `missed_by_without` likewise.
    """

    n_drawn: Count
    n_met: Count
    least: Count
    rounds: Count
    n_projectors_without: Count
    n_cameras_without: Count
    n_met_without: Count
    missed_by: dict[str, int] = Field(default_factory=dict)
    missed_by_without: dict[str, int] = Field(default_factory=dict)


class RegionCoverage(Part):
    """What is covered of a region, as `coverage` says it of the target; areas in [m²].

    Attributes:
        samples: Fresh samples behind the figures, more than those of the target where
            few of these fall into a large region.
        uncovered_by_cause: Area that isn't measured.
        measured_by: Area that each camera measures, of those that measure any of it.
        floor: Whether enough of it is lit and measured; None: it has no floor.
        relaxations: What would let a missed floor be met; of the largest dark region
            too small for a floor what one would cost.
    """

    samples: Count
    reachable_by_projectors_m2: float
    lit_m2: float
    reachable_by_cameras_m2: float
    measured_m2: float
    uncovered_by_cause: dict[str, float]
    measured_by: dict[str, float]
    floor: Literal["met", "missed"] | None
    relaxations: tuple[str, ...] = ()


class RegionRecord(Part):
    """A region of the target.

    Attributes:
        lit_by: Projectors that samples of it are assigned to.
        lit_fraction: Share of its area that any projector lights.
        centre_m: Area-weighted mean of its faces' centroids, in the world [m].
        coverage: Areas of it; None in plans from before.
    """

    id: int
    area_m2: Size
    n_faces: Count
    mean_normal: Vector3
    cone_angle: float
    mean_curvedness: Size
    lit_by: tuple[str, ...]
    lit_fraction: Size
    centre_m: Vector3 | None = None
    coverage: RegionCoverage | None = None


class ProjectorMarginal(Part):
    """Areas with so many projectors [m²].

    Attributes:
        worst_region: Large region of which they light the least share of what can be
            reached; None: there is none, or the plan is from before.
        worst_region_lit: That share.
        reference: Places of the projectors among the reference poses of `surface.npz`;
            absent where they are the plan's, or stand at none of these poses.
    """

    n_projectors: Count
    lit_target_m2: float
    lit_surface_m2: float
    worst_region: int | None = None
    worst_region_lit: Size | None = None
    reference: tuple[Place, ...] | None = None

    @property
    def number(self) -> tuple[str, int]:
        """The kind of device, and how many."""
        return "projector", self.n_projectors


class CameraMarginal(Part):
    """Areas with so many cameras and all projectors of the plan [m²].

    Attributes:
        reference: As of projectors.
    """

    n_cameras: Count
    measured_target_m2: float
    measured_surface_m2: float
    reference: tuple[Place, ...] | None = None

    @property
    def number(self) -> tuple[str, int]:
        """The kind of device, and how many."""
        return "camera", self.n_cameras


class Overlap(Part):
    """Area on which light of both of two projectors falls [m²]."""

    projectors: tuple[str, str]
    target_m2: float
    surface_m2: float


class ExposureSchedule(Part):
    """Which projectors may shine at once.

    Attributes:
        groups: Ids of those that shine together, group by group.
        lower_bound: Proven least number of groups.
        clique: Projectors of which any two overlap.
    """

    groups: tuple[tuple[str, ...], ...]
    n_groups: int
    lower_bound: int
    proof: Literal["clique", "exhaustion", "none"]
    clique: tuple[str, ...]
