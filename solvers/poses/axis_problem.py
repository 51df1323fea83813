"""Data of the program of a ring axis; `axis_program` solves it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .compiled import Light, check_program

# The largest ring is kept by this share, well above IPOPT's tolerance.
INSET = 1e-6

# Pitch limits count little until they are near: error shares to this power of k.
PITCH_POWER = 4


@dataclass(frozen=True, eq=False)
class AxisProgram:
    """One projector's samples, and how k cameras see them.

    Attributes:
        light: Kind of light.
        points: X in [m], shape (n, 3).
        rays: Unit viewing rays r, shape (n, k, 3).
        slopes: G in [1/px], shape (n, k, 2, 3).
        seen: Which camera sees which sample, shape (n, k).
        noise: s, edge noise x distance in [px m], shape (n, k).
        placement_m: s_R |N.r| in [m], shape (n, k).
        facing: f = |N.r| / distance in [1/m], shape (n, k).
        others: What other projectors make of a sample, 1/(1 + e), shape (n,).
        held: Lit points X in [m] that stay inside the largest ring, shape (h, 3).
        start: a to start from, shape (2,).
        ring_radius: Largest ring, a tangent (diverging) or in [m] (parallel).
        gap: Of the rings, likewise.
        min_conditioning: c_0, over 0.
        max_sigma_m: s_max in [m]; inf doesn't bind.
        min_pitch_px: p_0 in [px]; 0 doesn't bind.

    Raises:
        ValueError: If an array has the wrong shape or isn't finite, or a limit isn't
            positive.
    """

    light: Light
    points: NDArray[np.float64]
    rays: NDArray[np.float64]
    slopes: NDArray[np.float64]
    seen: NDArray[np.bool_]
    noise: NDArray[np.float64]
    placement_m: NDArray[np.float64]
    facing: NDArray[np.float64]
    others: NDArray[np.float64]
    held: NDArray[np.float64]
    start: NDArray[np.float64]
    ring_radius: float
    gap: float
    min_conditioning: float
    max_sigma_m: float = np.inf
    min_pitch_px: float = 0.0

    def __post_init__(self) -> None:
        n, k = self.seen.shape
        shapes = {"points": (n, 3), "rays": (n, k, 3), "slopes": (n, k, 2, 3)}
        shapes |= {name: (n, k) for name in ("noise", "placement_m", "facing")}
        shapes |= {"others": (n,), "held": (len(self.held), 3), "start": (2,)}
        check_program(self, self.light, shapes)
        for name in ("ring_radius", "gap", "min_conditioning"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}, must be positive")
        if not self.max_sigma_m > 0.0:
            raise ValueError(f"max_sigma_m is {self.max_sigma_m}, must be positive")
        if not 0.0 <= self.min_pitch_px < np.inf:
            raise ValueError(f"min_pitch_px is {self.min_pitch_px}, must be 0 or more")
