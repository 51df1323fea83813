"""A calibrated camera and projector, from the file that calibrated them.

As OpenCV's samples, Moreno and Taubin's program (3DIMPVT 2012) and others write them:
two camera matrices, two lenses, and what turns the camera's axes into the projector's::

    X_projector = R X_camera + T
"""

from pathlib import Path

import numpy as np

from planning.model.errors import CalibrationError
from planning.model.light.dense_code import DenseCode
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    PairCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.light_laws import LIGHTS
from planning.verify.reconstruction.patterns.dense_patterns import DensePattern
from planning.verify.reconstruction.patterns.ring_patterns import DrawnRings

from .opencv_entries import opencv_matrices

# What programs call each; "roration" is what one of them writes.
_NAMES = {
    "camera matrix": ("cam_int", "cam_K", "camera_matrix", "cameraMatrix1", "K1", "M1"),
    "camera lens": ("cam_dist", "cam_kc", "distCoeffs1", "D1"),
    "projector matrix": ("proj_int", "proj_K", "cameraMatrix2", "K2", "M2"),
    "projector lens": ("proj_dist", "proj_kc", "distCoeffs2", "D2"),
    "rotation": ("R", "rotation", "roration"),
    "translation": ("T", "translation"),
}
_ROTATION_SLACK = 1e-4


def read_pair(
    path: Path,
    *,
    camera_size: tuple[int, int],
    projector_size: tuple[int, int],
    unit_m: float,
) -> PairCalibration:
    """Return a camera at the origin and its projector, which shows OpenCV's Gray code.

    Args:
        path: FileStorage in XML or YAML.
        camera_size: Width and height of the images [px].
        projector_size: Of what the projector showed [px].
        unit_m: What the translation is in [m].

    Raises:
        CalibrationError: If the file can't be read, or lacks or breaks something.
    """
    matrices = opencv_matrices(path, CalibrationError)
    try:
        found = {what: _named(matrices, what) for what in _NAMES}
        pose = _pose(found["rotation"], found["translation"] * unit_m)
        camera = CameraCalibration(
            "camera",
            np.eye(4),
            _pinhole(found["camera matrix"], "camera"),
            camera_size,
            _lens(found["camera lens"], "camera"),
        )
        projector = ProjectorCalibration(
            "projector",
            pose,
            _pinhole(found["projector matrix"], "projector"),
            projector_size,
            pose,
            None,
            DrawnRings(LIGHTS["diverging"], np.zeros(0)),
            dense=DensePattern(DenseCode(shifts=0), projector_size),
            distortion=_lens(found["projector lens"], "projector"),
        )
    except ValueError as error:
        raise CalibrationError(f"{path}: {error}") from None
    return PairCalibration(projector, camera)


def _named(matrices: dict[str, Array], what: str) -> Array:
    names = [name for name in _NAMES[what] if name in matrices]
    if len(names) != 1:
        has = ", ".join(matrices) or "no matrix"
        where = f"twice, as {' and '.join(names)}" if names else "nowhere"
        raise ValueError(
            f"says the {what} {where}; write it once as one of "
            f"{', '.join(_NAMES[what])} (it has {has})"
        )
    return matrices[names[0]]


def _pinhole(matrix: Array, device: str) -> Array:
    plain = matrix.shape == (3, 3)
    if plain:
        rest = matrix.copy()
        rest[[0, 1, 0, 1], [0, 1, 2, 2]] = 0.0
        plain = rest.tolist() == [[0.0] * 3, [0.0] * 3, [0.0, 0.0, 1.0]]
    if not plain or not np.all(np.diag(matrix) > 0.0):
        raise ValueError(
            f"the {device}'s matrix {matrix.tolist()} must be fx, 0, cx, 0, fy, cy, 0, "
            f"0, 1 in px, without skew"
        )
    return matrix


def _lens(matrix: Array, device: str) -> tuple[float, ...]:
    values = matrix.ravel().tolist()
    if len(values) < 4 or any(values[5:]):
        raise ValueError(
            f"the {device}'s lens has {len(values)} values; only 4 or 5 (k1, k2, p1, "
            f"p2, k3) are known here, calibrate with these"
        )
    return tuple([*values, 0.0][:5])


def _pose(rotation: Array, translation: Array) -> Array:
    """Pose of the projector in the camera's frame, (4, 4)."""
    if rotation.shape != (3, 3) or translation.size != 3:
        raise ValueError(
            f"rotation is {rotation.shape}, must be 3 x 3, and translation has "
            f"{translation.size} values, must have 3"
        )
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if not (off <= _ROTATION_SLACK and np.linalg.det(rotation) > 0.0):
        raise ValueError(f"rotation is off an orthonormal matrix by {off:.2g}")
    if not np.any(translation):
        raise ValueError("translation is 0: camera and projector stand in one place")
    pose = np.eye(4)
    pose[:3, :3] = rotation.T
    pose[:3, 3] = -rotation.T @ translation.ravel()
    return pose
