"""Target regions that a user chose: given faces, or the highest of given weights."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.arrays import Mask
from geometry.curvature.curvature import CurvatureField
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.topology import face_pairs

from .cones import cone_pieces
from .dominance import face_curvedness
from .regions import (
    CONE_HALF_ANGLE,
    MIN_REGION_SHARE,
    DominantRegions,
    regions_of_pieces,
)


def regions_of_faces(
    mesh: TriangleMesh, field: CurvatureField, chosen: ArrayLike
) -> DominantRegions:
    """Return exactly the chosen faces, bool (n_f,), in regions for one projector each.

    Nothing is added and nothing left out: not at an open border, where curvature isn't
    trusted, nor small pieces. Steep directions come from the curvature as in
    `dominant_regions`; where it isn't trusted they are zero and bind nothing. Pieces
    below 0.2 % of the chosen area are joined to a neighbour if one cone holds both.

    Raises:
        ValueError: If `chosen` isn't one bool a face or chooses none.
    """
    faces = np.asarray(chosen)
    if faces.dtype != np.bool_ or faces.shape != (len(mesh.faces),):
        raise ValueError(
            f"chosen must be {len(mesh.faces)} bool, one a face, "
            f"got {faces.dtype} {faces.shape}"
        )
    if not faces.any():
        raise ValueError("chosen must hold at least one face, holds none")
    curvedness, _ = face_curvedness(mesh, field)
    pairs = face_pairs(mesh.edges, manifold_only=False)[0]
    least = MIN_REGION_SHARE * float(mesh.face_areas[faces].sum())
    pieces = cone_pieces(mesh, faces, pairs, least, CONE_HALF_ANGLE, keep_all=True)
    return regions_of_pieces(mesh, field, pieces, curvedness)


def heaviest_faces(
    mesh: TriangleMesh,
    weight: ArrayLike,
    corners: NDArray[np.integer],
    *,
    area_share: float = 0.2,
) -> Mask:
    """Return the faces of highest weight, a share of the area, shape (n_f,).

    A face (its corners are vertices in the numbering of `weight`, (n_f, 3)) has the
    least weight of its corners, which takes the place of the curvedness in
    `dominant_regions`. Faces of equal weight are taken all or none, so that the share,
    in (0, 1], may be exceeded; a face of weight 0 is never taken, so that it may be
    missed: weights of 1 and 0 choose what has 1.

    Raises:
        ValueError: If the weight of a corner is negative or not finite, no face has one
            above zero, or the share is out of range.
    """
    if not 0 < area_share <= 1:
        raise ValueError(f"area_share must lie in (0, 1], got {area_share}")
    of_corners = np.asarray(weight, dtype=np.float64)[corners]
    good = (of_corners >= 0) & np.isfinite(of_corners)
    if not np.all(good):
        face, corner = np.argwhere(~good)[0]
        raise ValueError(
            f"the weight of vertex {corners[face, corner]} is "
            f"{of_corners[face, corner]}, must be a finite number, at least 0"
        )
    values = of_corners.min(axis=1)
    if not values.max() > 0:
        raise ValueError("no face has a weight above 0 at all its corners")
    order = np.argsort(-values, kind="stable")
    area = np.cumsum(mesh.face_areas[order])
    cut = values[order[np.searchsorted(area, area_share * area[-1])]]
    return (values >= cut) & (values > 0)
