"""The folder that `plan export --to mitsuba` writes: a scene for each projector."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from planning.model.files import write_together
from planning.verify.reconstruction.pattern_files import FOLDER, write_patterns
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.scanner import Scanner

from .materials import OBJECT, Surface, write_ply
from .scene_text import DEFAULTS, MATERIALS, Shine, Window, obstacle_names, scene_text

# Pinholes over the pupil of a projector that isn't in focus everywhere.
_PINHOLES = 24

_README = """A rig of ringrig as scenes for Mitsuba 3 (pip install mitsuba)

    mitsuba -m llvm_ad_rgb P1.xml                          what {first} sees in white
    mitsuba -m llvm_ad_rgb -s 1 P1.xml -o seen.exr         the second camera, and so on
    mitsuba -m llvm_ad_rgb -Dframe={frame} P1.xml
    mitsuba -m llvm_ad_rgb -Dmaterial=gloss -Dspp=256 P1.xml

P1.xml, P2.xml, ...  one projector's light each; sensors 0, 1, ... are {cameras}
object.ply           the surface that the plan speaks of, with each vertex's albedo
materials/           -Dmaterial=: {materials}
patterns/            what is projected, -Dframe=; sequence.json says what each image is

Parameters (-Dname=value): {defaults}; max_depth counts
light's path from projector to camera, 2 is without a bounce between surfaces.
Lengths are metres, in the frame named below. Images are linear: radiance, not levels.
Pixel (0, 0) of an image has its centre at (0.5, 0.5) in Mitsuba, at (0, 0) in the plan.
A camera's image is the window of a larger film whose middle is the principal point.
{lenses}
A lens shift leaves a projector's light even as seen from the middle of its image, not
across a plane. Parallel light comes from a pinhole 100 km away. Housings and obstacles
are black; that of the projector that shines ends at its optical centre.
Plan {digest}
"""


def write_scenes(
    scanner: Scanner, folder: Path, surface: Surface, *, ambient: float = 0.0
) -> list[Path]:
    """Write scenes, object, materials, patterns and a README; return the scenes.

    Args:
        scanner: Devices, optics and object of a plan.
        folder: Where they go; it is made.
        surface: How much light the object reflects.
        ambient: Radiance of the room, as of `scene_text`.

    Raises:
        SceneError: If a camera's optics are none of Mitsuba's.
        OSError: If it can't be written.
    """
    windows = [Window.whole(camera) for camera in scanner.cameras]
    pupil = pupil_points(scanner)
    texts: dict[Path, str] = {}
    for p, projector in enumerate(scanner.projectors):
        white = f"{FOLDER}/{projector.id}/{scanner.frames(p)[0].name}.png"
        shine = Shine(projector, white, pupil)
        text = scene_text(scanner, shine, windows, ambient=ambient)
        texts[folder / f"{projector.id}.xml"] = text
    scenes = list(texts)
    readme = folder / "README.txt"
    texts[readme] = _readme(scanner)
    folder.mkdir(parents=True, exist_ok=True)
    if readme.exists() and readme.read_text().startswith(_README[:40]):
        # Scenes of an older plan must not stand beside a newer one's object.
        for old in set(folder.glob("*.xml")) - texts.keys():
            old.unlink()
    write_object(scanner, folder, surface)
    write_patterns(scanner, folder)
    write_together({path: _writes(text) for path, text in texts.items()})
    return scenes


def write_object(scanner: Scanner, folder: Path, surface: Surface) -> None:
    """Write object, obstacles and materials into a folder.

    Raises:
        OSError: If they can't be written.
    """
    mesh = scanner.mesh
    texture = replace(Photometry(), albedo_variation=surface.texture)
    albedo = surface.albedo * texture.albedo(mesh.vertices).astype(np.float64)
    files: dict[Path, Callable[[BinaryIO], object]] = {
        folder / OBJECT: lambda file: write_ply(mesh, file, albedo)
    }
    for name, solid in zip(obstacle_names(scanner), scanner.obstacles, strict=True):
        files[folder / name] = lambda file, m=solid.mesh: write_ply(m, file)
    (folder / MATERIALS).mkdir(exist_ok=True)
    for name, text in surface.files().items():
        files[folder / MATERIALS / f"{name}.xml"] = _writes(text)
    write_together(files)


def pupil_points(scanner: Scanner) -> Sequence[tuple[float, float]]:
    """Return points of the projectors' pupil [m], spread evenly as two sunflowers.

    One where nobody says how they are focused.
    """
    focus = scanner.projector_focus
    if focus is None:
        return ((0.0, 0.0),)
    # Point by point opposite each other: else blur would move the edges.
    k = np.repeat(np.arange(_PINHOLES // 2), 2)
    radius = 0.5 * focus.aperture_m * np.sqrt((k + 0.5) / (0.5 * _PINHOLES))
    turn = k * np.pi * 0.5 * (np.sqrt(5.0) - 1.0) + np.pi * (np.arange(_PINHOLES) % 2)
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    return list(zip(x.tolist(), y.tolist(), strict=True))


def _writes(text: str) -> Callable[[BinaryIO], object]:
    return lambda file: file.write(text.encode())


def _readme(scanner: Scanner) -> str:
    cameras = [camera.id for camera in scanner.cameras]
    first, frames = scanner.projectors[0], scanner.frames(0)
    lens, pupil = [one.focus for one in scanner.cameras], scanner.projector_focus
    sharp = sorted({f"{one.focus_m:g} m" for one in lens if one is not None})
    lenses = [
        f"Cameras are thin lenses, focused at {' or '.join(sharp)}."
        if sharp and None not in lens
        else "Cameras are pinholes: the plan doesn't say how they are focused."
        if not sharp
        else f"Cameras are thin lenses, focused at {' or '.join(sharp)}, and pinholes "
        f"where the plan doesn't say how they are focused.",
        "Projectors are pinholes: the plan doesn't say how they are focused."
        if pupil is None
        else f"Projectors are {_PINHOLES} pinholes over a pupil of "
        f"{1e3 * pupil.aperture_m:.3g} mm, in step at {pupil.focus_m:g} m.",
    ]
    return _README.format(
        first=cameras[0] if cameras else "no camera",
        cameras=", ".join(cameras),
        frame=f"{FOLDER}/{first.id}/{frames[2].name}.png",
        materials=", ".join(Surface().files()),
        defaults=", ".join(f"{key} {value}" for key, value in DEFAULTS.items()),
        lenses="\n".join(lenses),
        digest=scanner.digest,
    )
