"""Fewer cameras, where the bound over all poses leaves room for them."""

from planning.model.devices.planned import PlannedProjector
from planning.scene.scene import Scene

from .priced_cameras import fewer_by_prices
from .proved_cameras import CameraStage, camera_stage

_WHY = "fewer; found from poses between the candidates that prices asked for"


def has_room(stage: CameraStage) -> bool:
    """Return whether the bound over all poses leaves room for fewer cameras.

    Cameras with bodies aren't looked at.
    """
    proof = stage.certificate
    bound = proof.continuous
    if bound is None or proof.status == "infeasible" or stage.cover.has_bodies:
        return False
    return bound.lower_bound < proof.needed.count


def fewer_cameras(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    stage: CameraStage,
    tries: int,
) -> CameraStage | None:
    """Return the stage of fewer cameras from poses anywhere; None: none were found.

    They join the candidates, over which the count is proved again.
    """
    again = fewer_by_prices(scene, projectors, stage.cover, tries)
    if again is None:
        return None
    routes = stage.routes
    if routes is not None:
        needed = again.selection.needed
        routes = routes.changed(cover=needed, taken="cover", why=_WHY)
    return camera_stage(scene, again, routes)
