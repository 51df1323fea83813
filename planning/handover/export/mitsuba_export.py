"""Mitsuba: the scenes that the check renders too, in the frame of an export."""

from dataclasses import replace
from pathlib import Path

from planning.model.devices.planned import PlannedCamera
from planning.verify.reconstruction.render.mitsuba.materials import Surface
from planning.verify.reconstruction.render.mitsuba.scene_files import write_scenes
from planning.verify.reconstruction.render.mitsuba.scene_text import SceneError
from planning.verify.reconstruction.scanner import Scanner

from .exported_rig import ExportedRig, id_words

NAME = "mitsuba"


def mitsuba_lacks(rig: ExportedRig) -> list[str]:
    """Return a sentence for distortion, and one for parallel light."""
    sentences = rig.lacks
    if rig.distorted:
        sentences.append(
            f"{id_words(rig.distorted)}: without distortion, Mitsuba has no such lens"
        )
    if rig.parallel:
        sentences.append(
            f"{id_words(rig.parallel)}: parallel light comes from a pinhole 100 km "
            f"away, and strays by up to 0.4 um; Mitsuba 3.9 puts it up to 1.2 mm aside"
        )
    return sentences


def write_mitsuba(
    rig: ExportedRig, folder: Path, surface: Surface, ambient: float | None
) -> list[Path]:
    """Write a scene for each projector; return them.

    Args:
        rig: In its frame.
        folder: Where they go; it is made.
        surface: How much light the object reflects.
        ambient: Light of the room; None: what the plan's check assumes.

    Raises:
        SceneError: If there is no projector, or the pixels of a camera aren't square.
        OSError: If it can't be written.
    """
    if rig.plan.cameras_alone:
        raise SceneError("a scene is of a projector, and this plan's pattern is 'none'")
    of_plan = Scanner.of(rig.plan)
    projectors = [
        d.planned for d in rig.devices if not isinstance(d.planned, PlannedCamera)
    ]
    cameras = [d.planned for d in rig.devices if isinstance(d.planned, PlannedCamera)]
    scanner = replace(
        of_plan,
        projectors=tuple(
            replace(
                projector,
                world_from_device=moved.world_from_device,
                world_from_ring=moved.world_from_ring,
            )
            for projector, moved in zip(of_plan.projectors, projectors, strict=True)
        ),
        cameras=tuple(
            replace(
                camera,
                world_from_device=moved.world_from_device,
                distortion=(0.0,) * 5,
            )
            for camera, moved in zip(of_plan.cameras, cameras, strict=True)
        ),
        mesh=rig.mesh,
        obstacles=tuple(
            replace(solid, mesh=mesh)
            for solid, mesh in zip(
                of_plan.obstacles, rig.obstacles.values(), strict=True
            )
        ),
    )
    room = of_plan.limits.check.ambient if ambient is None else ambient
    scenes = write_scenes(scanner, folder, surface, ambient=room)
    readme = folder / "README.txt"
    lines = [f"Frame: {rig.frame.words}", *mitsuba_lacks(rig)]
    readme.write_text(readme.read_text() + "".join(f"{line}\n" for line in lines))
    return scenes
