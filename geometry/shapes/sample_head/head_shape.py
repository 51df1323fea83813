"""Proportions of the sample head, and a population of them."""

from dataclasses import dataclass
from math import isfinite

import numpy as np

from geometry.mesh.mesh import MeshError

# Least and largest proportion that the sculpture stays a head at, and the standard
# deviation among adults (rounded from anthropometric surveys), all in [mm].
_RANGES = {
    "width": (125.0, 180.0, 6.0),
    "depth": (165.0, 220.0, 7.0),
    "crown_height": (95.0, 135.0, 5.0),
    "face_length": (92.0, 135.0, 6.0),
    "cheek_width": (115.0, 152.0, 6.0),
    "jaw_width": (88.0, 126.0, 6.0),
    "brow_ridge": (0.0, 8.0, 1.5),
    "eye_spacing": (54.0, 74.0, 3.5),
    "eye_depth": (9.0, 17.0, 1.5),
    "nose_length": (40.0, 60.0, 3.5),
    "nose_width": (28.0, 46.0, 3.0),
    "nose_projection": (12.0, 24.0, 2.2),
    "nose_hump": (-3.0, 5.0, 1.3),
    "mouth_width": (42.0, 62.0, 3.5),
    "lip_fullness": (5.0, 12.0, 1.3),
    "chin_projection": (-7.0, 6.0, 2.5),
    "ear_height": (50.0, 76.0, 4.0),
    "ear_standoff": (7.0, 22.0, 1.6),
    "neck_width": (86.0, 124.0, 7.0),
    "neck_length": (14.0, 45.0, 4.0),
    "scale": (0.1, 10.0, 0.0),
}


@dataclass(frozen=True)
class HeadShape:
    """Proportions of a head in [mm]; the defaults are those of an average adult.

    Attributes:
        width: Breadth of the skull above the ears.
        depth: Forehead to the back of the head.
        crown_height: Pupils to the top of the head.
        face_length: Pupils to the lower edge of the chin.
        cheek_width: Breadth over the cheekbones.
        jaw_width: Breadth over the angles of the jaw.
        brow_ridge: How far the brow stands out.
        eye_spacing: Between the pupils.
        eye_depth: Forehead to the front of the eyeball.
        nose_length: Root to base of the nose.
        nose_width: Over the wings of the nose.
        nose_projection: Tip of the nose in front of the upper lip's root.
        nose_hump: Bridge of the nose above the straight line from root to tip.
        mouth_width: Between the corners of the mouth.
        lip_fullness: Height of each lip's red part.
        chin_projection: Chin in front of its average place.
        ear_height: Length of the ear.
        ear_standoff: Rear rim of the ear from the side of the head.
        neck_width: Breadth of the neck.
        neck_length: Chin to the plane where the neck is cut off.
        scale: Factor on all lengths, a plain number.

    Raises:
        MeshError: If a proportion is outside the range in which this is a head.
    """

    width: float = 154.0
    depth: float = 190.0
    crown_height: float = 113.0
    face_length: float = 113.0
    cheek_width: float = 134.0
    jaw_width: float = 108.0
    brow_ridge: float = 4.0
    eye_spacing: float = 63.0
    eye_depth: float = 13.0
    nose_length: float = 50.0
    nose_width: float = 35.0
    nose_projection: float = 19.0
    nose_hump: float = 1.0
    mouth_width: float = 51.0
    lip_fullness: float = 8.0
    chin_projection: float = 0.0
    ear_height: float = 61.0
    ear_standoff: float = 11.0
    neck_width: float = 104.0
    neck_length: float = 22.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        for name, (least, largest, _) in _RANGES.items():
            value = getattr(self, name)
            if not (isfinite(value) and least <= value <= largest):
                raise MeshError(
                    f"head {name} is {value}: must lie in {least:g} to {largest:g}"
                )

    @classmethod
    def random(cls, seed: int) -> "HeadShape":
        """Return one head of a population: normal, cut off at 2.5 deviations.

        Args:
            seed: The same seed gives the same head.
        """
        rng = np.random.default_rng(seed)
        draws = np.clip(rng.standard_normal(len(_RANGES)), -2.5, 2.5)
        average, values = cls(), dict[str, float]()
        for (name, limits), draw in zip(_RANGES.items(), draws, strict=True):
            least, largest, deviation = limits
            value = getattr(average, name) + deviation * float(draw)
            values[name] = min(max(value, least), largest)
        return cls(**values)
