"""Dominant regions: the most curved surface, in pieces that one projector can serve."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints
from geometry.curvature.curvature import CurvatureField
from geometry.curvature.face_curvature import steep_directions
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import face_pairs

from .cones import cone_pieces, normal_cone
from .dominance import dominant_faces, face_curvedness

# Of the area, and of the normals of a region.
MIN_REGION_SHARE, CONE_HALF_ANGLE = 0.002, float(np.deg2rad(50.0))


@dataclass(frozen=True, eq=False)
class Region:
    """Connected surface of high curvedness whose normals fit one cone.

    Attributes:
        id: Its number, from 0, largest area first.
        faces: Indices of its faces, ascending.
        area_m2: Its area.
        mean_normal: Unit axis of its cone, the area-weighted mean of its normals, (3,).
        cone_angle: Half angle in [rad] about it that holds 98 % of the area's normals.
        mean_curvedness: Area-weighted mean of the curvedness in [1/m].
    """

    id: int
    faces: Ints
    area_m2: float
    mean_normal: Array
    cone_angle: float
    mean_curvedness: float


@dataclass(frozen=True, eq=False)
class DominantRegions:
    """Regions of a mesh, and what each face needs to know of them; iterates regions.

    Attributes:
        regions: Largest first.
        face_region: Region of each face, -1 for none, shape (n_f,).
        steep: Unit direction T1 of largest |curvature| in each face's plane, (n_f, 3);
            zero where it is arbitrary or not trusted, in a region or not.
        dominant_share: Area of the regions over the area of the mesh.
    """

    regions: tuple[Region, ...]
    face_region: Ints
    steep: Array
    dominant_share: float

    def __iter__(self) -> Iterator[Region]:
        return iter(self.regions)

    def __len__(self) -> int:
        return len(self.regions)

    def __getitem__(self, index: int) -> Region:
        return self.regions[index]

    def steep_on(self, target: str | None) -> Array:
        """Return T1 of each face of a target, zero elsewhere, where it binds nothing.

        That is the whole `surface`, or else the regions.
        """
        if target == "surface":
            return self.steep
        return np.where((self.face_region >= 0)[:, None], self.steep, 0.0)


def dominant_regions(
    mesh: TriangleMesh,
    field: CurvatureField,
    *,
    area_share: float = 0.2,
    min_region_share: float = MIN_REGION_SHARE,
    cone_half_angle: float = CONE_HALF_ANGLE,
) -> DominantRegions:
    """Return the share of the trusted area with the highest curvedness, in regions.

    Trusted faces have three valid vertices, so the rim of an open border is left out;
    where nothing is trusted, the surface counts as uniform. Bodies too small for a
    region are left out too. Curvedness is that of `face_curvedness`. A plateau of equal
    curvedness at the cut is taken whole: a sphere, a cylinder or a plate is dominant as
    a whole. If less than the share is curved at all, that is all. Islands and holes
    below ``min_region_share`` of the area vanish; what stays is cut into pieces that
    fit a cone (`cone_pieces`). What is smaller and fits no neighbour is dropped, unless
    the whole surface is dominant, or that would be more than a tenth.

    Args:
        mesh: The surface.
        field: Its curvatures.
        area_share: Share of the trusted area that is dominant, in (0, 1].
        min_region_share: Smallest region, as a share of the mesh's area, in [0, 1).
        cone_half_angle: Half angle in [rad] that a region's normals must fit, below
            60 degrees of incidence by what position and perspective need.

    Raises:
        ValueError: If a share or angle is out of range, or the field isn't its own.
    """
    if not 0 < area_share <= 1:
        raise ValueError(f"area_share must lie in (0, 1], got {area_share}")
    if not 0 <= min_region_share < 1:
        raise ValueError(f"min_region_share must lie in [0, 1), got {min_region_share}")
    if not 0 < cone_half_angle < np.pi:
        raise ValueError(f"cone_half_angle must lie in (0, pi), got {cone_half_angle}")
    curvedness, trusted = face_curvedness(mesh, field)
    pairs = face_pairs(mesh.edges, manifold_only=False)[0]
    least = min_region_share * mesh.area
    dominant = dominant_faces(mesh, curvedness, trusted, pairs, area_share, least)
    whole = bool(dominant.all())
    pieces = cone_pieces(mesh, dominant, pairs, least, cone_half_angle, keep_all=whole)
    return regions_of_pieces(mesh, field, pieces, curvedness)


def regions_of_pieces(
    mesh: TriangleMesh, field: CurvatureField, pieces: Sequence[Ints], curvedness: Array
) -> DominantRegions:
    """Return pieces (each the ascending indices of its faces) as numbered regions."""
    regions = tuple(
        _region(i, mesh, faces, curvedness) for i, faces in enumerate(pieces)
    )
    face_region = np.full(len(mesh.faces), -1, dtype=np.int64)
    for region in regions:
        face_region[region.faces] = region.id
    steep = steep_directions(mesh, field)
    share = float(mesh.face_areas[face_region >= 0].sum() / mesh.area)
    for values in (face_region, steep):
        values.setflags(write=False)
    return DominantRegions(regions, face_region, steep, share)


def _region(number: int, mesh: TriangleMesh, faces: Ints, curvedness: Array) -> Region:
    axis, angle = normal_cone(mesh, faces)
    areas = mesh.face_areas[faces]
    axis.setflags(write=False)
    return Region(
        id=number,
        faces=faces,
        area_m2=float(areas.sum()),
        mean_normal=axis,
        cone_angle=angle,
        mean_curvedness=float(np.average(curvedness[faces], weights=areas)),
    )
