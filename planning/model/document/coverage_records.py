"""`coverage`, `regions`, `marginal`, `overlaps` and `firing_schedule`."""

from typing import Literal

from pydantic import Field

from .part import Part, Vector3


class Areas(Part):
    """The five areas that belong together, in [m²]."""

    area_m2: float
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
    reachable_share: float


class PredictedSigma(Part):
    """Standard deviation along the normal, by the best pair of each measured sample.

    Of `noise_px` and `ring_sigma_m` alone: calibration is taken as perfect.
    """

    median_m: float
    p95_m: float


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
    """

    samples: int
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


class RegionRecord(Part):
    """A region of the target.

    Attributes:
        lit_by: Projectors that samples of it are assigned to.
        lit_fraction: Share of its samples that any projector lights.
    """

    id: int
    area_m2: float
    n_faces: int
    mean_normal: Vector3
    cone_angle: float
    mean_curvedness: float
    lit_by: tuple[str, ...]
    lit_fraction: float


class ProjectorMarginal(Part):
    """Areas with so many projectors [m²]."""

    n_projectors: int
    lit_target_m2: float
    lit_surface_m2: float


class CameraMarginal(Part):
    """Areas with so many cameras and all projectors of the plan [m²]."""

    n_cameras: int
    measured_target_m2: float
    measured_surface_m2: float


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
