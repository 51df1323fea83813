"""What an object may be made of, as parts of a scene: its surface and how light goes.

Every material is grey, so that the three channels of an image may carry three frames.
"""

from dataclasses import dataclass
from typing import BinaryIO, Literal, get_args

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from planning.model.errors import InputError
from planning.verify.reconstruction.arrays import Array

from .scene_text import scene_of

MaterialName = Literal["matt", "gloss", "metal", "skin"]
MATERIAL_NAMES: tuple[MaterialName, ...] = get_args(MaterialName)
OBJECT = "object.ply"

# Reduced scattering of skin in green light, 46 / cm (550 / 500)^-1.4 by the review of
# Jacques (Phys. Med. Biol. 58, 2013; recalled) [1/m].
_SCATTERING = 4e3
# What an index of 1.4 reflects of light that falls squarely on it.
_SHEEN = 0.028


@dataclass(frozen=True)
class Surface:
    """How much of the light an object reflects.

    Attributes:
        albedo: Share of the light that a matt surface gives back, in the mean.
        texture: Amplitude of a solid texture about it, as a share of it, where matt or
            metal.

    Raises:
        InputError: If some of the surface would give back more than it gets.
    """

    albedo: float = 0.5
    texture: float = 0.2

    def __post_init__(self) -> None:
        brightest = self.albedo * (1.0 + self.texture)
        if not (self.albedo > 0.0 and 0.0 <= self.texture < 1.0 and brightest < 1.0):
            raise InputError(
                f"albedo {self.albedo:g} with a texture of {self.texture:g}: the "
                f"brightest spots give back {brightest:.2f} of the light; both must be "
                f"positive and this below 1: lower either"
            )

    def files(self) -> dict[MaterialName, str]:
        """Return the scene part of each material: integrator, object, its surface."""
        albedo = '<texture type="mesh_attribute" name="{}"><string name="name" '
        albedo += 'value="vertex_albedo"/></texture>'
        surfaces: dict[MaterialName, str] = {
            "matt": f'<bsdf type="diffuse">{albedo.format("reflectance")}</bsdf>',
            "gloss": '<bsdf type="roughplastic"><float name="alpha" value="0.1"/>'
            '<float name="int_ior" value="1.5"/><boolean name="nonlinear" '
            # Mitsuba mixes gloss and body by the mean albedo, which vertices lack.
            'value="true"/><rgb name="diffuse_reflectance" '
            f'value="{self.albedo}"/></bsdf>',
            "metal": '<bsdf type="roughconductor"><string name="material" '
            'value="none"/><float name="alpha" value="0.25"/>'
            f"{albedo.format('specular_reflectance')}</bsdf>",
        }
        path = '<integrator type="path"><integer name="max_depth" value="$max_depth"/>'
        sides = '<bsdf type="twosided">{}</bsdf>'
        files: dict[MaterialName, str] = {
            name: scene_of([f"{path}</integrator>", _shape(sides.format(surface))])
            for name, surface in surfaces.items()
        }
        files["skin"] = self._skin()
        return files

    def _skin(self) -> str:
        """Grey matter that scatters light inside, below a thin sheen.

        The single-scattering albedo for a diffuse one of A, after Chiang, Kutz and
        Burley (2016)::

            1 - exp(-5.09406 A + 2.61188 A^2 - 4.31805 A^3)
        """
        a = self.albedo
        single = 1.0 - np.exp(-5.09406 * a + 2.61188 * a**2 - 4.31805 * a**3)
        # Light is scattered dozens of times before it comes out again; roulette from
        # the tenth on ends paths earlier and leaves the mean as it is.
        integrator = '<integrator type="volpath"><integer name="max_depth" value='
        integrator += '"200"/><integer name="rr_depth" value="10"/></integrator>'
        skin = (
            f'<bsdf type="mask"><float name="opacity" value="{_SHEEN}"/>'
            '<bsdf type="twosided"><bsdf type="roughconductor"><string name="material" '
            'value="none"/><float name="alpha" value="0.3"/></bsdf></bsdf></bsdf>'
            '<medium type="homogeneous" name="interior"><rgb name="sigma_t" '
            f'value="1"/><float name="scale" value="{_SCATTERING / single:.6g}"/>'
            f'<rgb name="albedo" value="{single:.6g}"/>'
            '<phase type="isotropic"/></medium>'
        )
        return scene_of([integrator, _shape(skin)])


def write_ply(mesh: TriangleMesh, file: BinaryIO, albedo: Array | None = None) -> None:
    """Write a mesh as binary PLY; `albedo_0` is how Mitsuba reads an attribute."""
    names = ["x", "y", "z", *(() if albedo is None else ("albedo_0",))]
    header = ["ply", "format binary_little_endian 1.0"]
    header += [f"element vertex {len(mesh.vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(mesh.faces)}"]
    header += ["property list uchar int vertex_indices", "end_header", ""]
    columns = mesh.vertices if albedo is None else np.c_[mesh.vertices, albedo]
    faces = np.empty(len(mesh.faces), dtype=[("n", "u1"), ("at", "<i4", (3,))])
    faces["n"], faces["at"] = 3, mesh.faces
    file.write("\n".join(header).encode())
    file.write(columns.astype("<f4").tobytes())
    file.write(faces.tobytes())


def _shape(of: str) -> str:
    return (
        f'<shape type="ply" id="object"><string name="filename" value="{OBJECT}"/>'
        f'<boolean name="face_normals" value="true"/>{of}</shape>'
    )
