"""The front of projectors, cameras, coverage and accuracy, from one matrix."""

from dataclasses import replace

from threadpoolctl import threadpool_limits

from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from planning.model.errors import InfeasibleLimitsError
from planning.model.progress import Report, Stopwatch
from planning.report.live_bar import shown
from planning.rig.mounted import Mounted
from planning.rig.rig import Rig
from planning.rig.wishes import Wishes
from planning.scene.interest import Select, Weight
from planning.scene.ranges.ranged_body import RangedBody
from planning.steps.asked.request import request_of
from planning.steps.prepare import prepared

from .choices import Chooser
from .front_matrix import matrix_of
from .front_points import judged_front
from .front_refused import check_front
from .kept_front import KeptFront


def plan_front(
    mesh: TriangleMesh | RangedBody,
    rig: Rig,
    wishes: Wishes,
    *,
    select: Select | None = None,
    weight: Weight | None = None,
    fixed: Mounted | None = None,
    seed: int = 0,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Report | bool = False,
) -> KeptFront:
    """Return what every number of projectors and cameras gives.

    Args:
        mesh: The surface, in metres; a body known by its ranges is refused.
        rig: Devices and limits, from `load_rig`.
        wishes: What is asked; `max_projectors` 0: as many as light nearly all that can
            be lit, `max_cameras` None: as many as then measure nearly all of it, eight
            at most.
        select: As of `plan_rig`.
        weight: As of `plan_rig`.
        fixed: Devices that stay where they are and count, from `read_mounted`.
        seed: The same seed gives the same front.
        threads: Worker threads; no result depends on it. None: one for each core.
        time_limit: Wall time in [s] that ends the run; then there is no front.
        progress: As of `plan_rig`.

    Raises:
        InputError: If an argument can't be used.
        InfeasibleLimitsError: If no device can serve anything.
        TimeLimitError: If the time limit came first.
    """
    rig = rig if fixed is None else fixed.on(rig)
    with (
        shown(progress) as report,
        (clock := Stopwatch(report, time_limit=time_limit)).ticking(),
        threadpool_limits(1),
    ):
        # Any number is looked at; the requirements of a plan have one.
        counted = replace(wishes, max_projectors=wishes.max_projectors or 1)
        request = replace(
            request_of(mesh, rig, counted, clock, select=select, weight=weight),
            seed=seed,
            threads=threads or n_threads(),
            mounted=fixed,
        )
        check_front(request)
        ready = prepared(request, clock)
        ready = replace(ready, request=replace(request, wishes=wishes))
        matrix = matrix_of(ready, clock)
        with clock.stage("covers", "front: the best of each number"):
            chooser = Chooser(ready, matrix)
            choices = chooser.choices(clock)
        if not choices:
            raise InfeasibleLimitsError(
                f"no camera of {len(matrix.cameras)} poses measures anything that "
                f"{max(chooser.lit)} projectors light; `plan --max-projectors "
                f"{max(chooser.lit)}` says which limits stop it"
            )
        with clock.stage("claims", "front: every rig on fresh samples"):
            front, taken = judged_front(chooser, choices, clock)
        return KeptFront.of(ready, matrix, front, taken)
