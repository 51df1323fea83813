"""Gray-code captures of `../shared/data/captures/procam`, read with their calibration.

    python -m benchmarks.captures.procam

Needs OpenCV: pip install 'ringrig[captures]'. The board's 9 x 7 inner corners are found
in the white image, decoded by local homographies and triangulated with the calibration
that its authors' program estimated. Two pixels of their projector show one of the code.

Then their camera is calibrated from the five white images; and both devices from the
corners of the two complete poses, which are as many as are tested: what then stays off
the board's plane is no more than decoding and board leave, the rest is the file's.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.captures.local_homography import codes_at
from planning.verify.reconstruction.calibration import PairCalibration
from planning.verify.reconstruction.captures.gray.gray_captures import read_capture
from planning.verify.reconstruction.captures.gray.pair_file import read_pair
from planning.verify.reconstruction.captures.images import read_grey
from planning.verify.reconstruction.decode.dense.two_rays import meet_rays

FOLDER = Path(__file__).resolve().parents[3] / "shared/data/captures/procam"
CAMERA_PX, CODE_PX, CODE_STEP = (1280, 1024), (1024, 768), 2
WHOLE, POSES, CORNERS, SQUARE_M = (0, 2), range(5), (9, 7), 0.075
_MM = 1e3

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Board:
    """Triangulated corners of a board, row by row, shape (63, 3) [m]."""

    corners: Array
    residual_px: Array

    @property
    def plane_rms_m(self) -> float:
        """Root mean square distance from the plane through them [m]."""
        centred = self.corners - self.corners.mean(axis=0)
        return float(np.linalg.svd(centred)[1][2] / np.sqrt(len(centred)))

    @property
    def neighbours_m(self) -> Array:
        """Distances of corners beside each other [m]."""
        grid = self.corners.reshape(CORNERS[1], CORNERS[0], 3)
        steps = [np.diff(grid, axis=axis).reshape(-1, 3) for axis in (0, 1)]
        return np.linalg.norm(np.concatenate(steps), axis=1)


def file_pair() -> PairCalibration:
    """The authors' calibration."""
    return read_pair(
        FOLDER / "calibration_result.xml",
        camera_size=CAMERA_PX,
        projector_size=CODE_PX,
        unit_m=1e-3,
    )


def corners_in(pose: int) -> Array:
    """The board's corners in the white image of a pose, shape (63, 2)."""
    white = read_grey(FOLDER / f"capture_{pose}" / "graycode_40.png", CAMERA_PX)
    found, corners = cv2.findChessboardCorners(white.astype(np.uint8), CORNERS)
    assert found, f"no board in pose {pose}"
    return corners.reshape(-1, 2).astype(np.float64)


def coded_corners(pose: int, pair: PairCalibration) -> tuple[Array, Array]:
    """Corners in the image and on the panel, shape (63, 2) each."""
    dense = pair.projector.dense
    assert dense is not None
    folder = FOLDER / f"capture_{pose}"
    codes = read_capture(folder, dense, code_step=CODE_STEP).read.map
    seen = corners_in(pose)
    return seen, codes_at(codes, seen)


def board(seen: Array, shown: Array, pair: PairCalibration) -> Board:
    """Triangulate corners."""
    rays = pair.camera.rays(seen)
    met = meet_rays(
        pair.camera.centre, rays, shown, np.ones_like(shown), pair.projector
    )
    return Board(met.points, met.residual_px)


def flat_board() -> NDArray[np.float32]:
    """The board's corners in its own frame [m], shape (63, 3)."""
    grid = np.mgrid[0 : CORNERS[0], 0 : CORNERS[1]].T.reshape(-1, 2)
    return np.column_stack([grid * SQUARE_M, np.zeros(len(grid))]).astype(np.float32)


def camera_of_boards() -> tuple[float, Array, Array]:
    """Reprojection rms [px], matrix and lens of the camera by all five poses."""
    images = [corners_in(pose).astype(np.float32) for pose in POSES]
    flat = [flat_board()] * len(images)
    rms, matrix, lens, *_ = cv2.calibrateCamera(flat, images, CAMERA_PX, None, None)
    return rms, matrix, lens.ravel()


def reprojection_rms(matrix: Array, lens: Array) -> float:
    """Reprojection rms of the five boards by given intrinsics, poses free [px]."""
    squares: list[Array] = []
    for pose in POSES:
        seen = corners_in(pose)
        _, turn, shift = cv2.solvePnP(flat_board(), seen, matrix, lens)
        drawn, _ = cv2.projectPoints(flat_board(), turn, shift, matrix, lens)
        squares.append(np.square(drawn.reshape(-1, 2) - seen).sum(axis=1))
    return float(np.sqrt(np.mean(squares)))


def refitted(
    pair: PairCalibration, corners: list[tuple[Array, Array]]
) -> tuple[float, PairCalibration]:
    """The pair by its own corners: rms [px], both devices and their pose estimated."""
    seen, shown = ([one[k].astype(np.float32) for one in corners] for k in range(2))
    camera, projector = pair.camera, pair.projector
    width, height = CODE_PX
    rms, own, bent, matrix, lens, turn, shift, *_ = cv2.stereoCalibrate(
        [flat_board()] * len(seen),
        seen,
        shown,
        camera.matrix.copy(),
        np.array(camera.distortion),
        projector.matrix.copy(),
        np.array(projector.distortion),
        (CODE_STEP * width, CODE_STEP * height),
        flags=cv2.CALIB_USE_INTRINSIC_GUESS,
    )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn.T, -turn.T @ shift.ravel()
    found = replace(
        projector,
        world_from_device=pose,
        matrix=matrix,
        distortion=tuple(lens.ravel().tolist()),
    )
    seeing = replace(camera, matrix=own, distortion=tuple(bent.ravel().tolist()))
    return rms, PairCalibration(found, seeing)


def main() -> None:
    """Print the figures."""
    pair = file_pair()
    corners = [coded_corners(pose, pair) for pose in WHOLE]
    rms, fitted = refitted(pair, corners)
    print(
        "| calibration | pose | off the plane, rms [mm] | neighbours, mean [mm] | "
        "off 75 mm | worst | rays pass [px] |"
    )
    print("|---|---|---|---|---|---|---|")
    for name, one in (("the file's", pair), (f"refitted ({rms:.2f} px)", fitted)):
        for pose, (seen, shown) in zip(WHOLE, corners, strict=True):
            found = board(seen, shown, one)
            steps = found.neighbours_m
            off = steps / SQUARE_M - 1.0
            print(
                f"| {name} | {pose} | {_MM * found.plane_rms_m:.2f} | "
                f"{_MM * steps.mean():.2f} | {off.mean():+.2%} | "
                f"{np.abs(off).max():.2%} | {np.median(found.residual_px):.2f} |"
            )
    error, matrix, lens = camera_of_boards()
    theirs = pair.camera
    print("\n| camera | f_x | f_y | c_x | c_y | five boards, rms [px] |")
    print("|---|---|---|---|---|---|")
    for name, k, d, px in (
        ("the file's", theirs.matrix, np.array(theirs.distortion), None),
        ("by the five boards", matrix, lens, error),
    ):
        px = reprojection_rms(k, d) if px is None else px
        print(
            f"| {name} | {k[0, 0]:.3f} | {k[1, 1]:.3f} | {k[0, 2]:.3f} | "
            f"{k[1, 2]:.3f} | {px:.3f} |"
        )


if __name__ == "__main__":
    main()
