"""Proportions of the sample head, and a population of them."""

from dataclasses import dataclass, field, fields
from math import isfinite

import numpy as np

from geometry.mesh.mesh import MeshError

# A child of about five beside an adult: all lengths, and beyond that these. Assumed for
# a population to plan for, and no survey's.
_CHILD_SCALE = 0.88
_CHILD = {
    "crown_height": 1.04,
    "face_length": 0.88,
    "jaw_width": 0.94,
    "brow_ridge": 0.4,
    "nose_length": 0.86,
    "nose_projection": 0.8,
    "mouth_width": 0.92,
    "ear_height": 0.95,
    "neck_width": 0.86,
}


def _length(default: float, least: float, largest: float, deviation: float) -> float:
    """A proportion in [mm]: where it is a head's, and its spread as surveys have it."""
    spread = {"limits": (least, largest), "deviation": deviation}
    return field(default=default, metadata=spread)


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

    width: float = _length(154.0, 125.0, 180.0, 6.0)
    depth: float = _length(190.0, 165.0, 220.0, 7.0)
    crown_height: float = _length(113.0, 95.0, 135.0, 5.0)
    face_length: float = _length(113.0, 92.0, 135.0, 6.0)
    cheek_width: float = _length(134.0, 115.0, 152.0, 6.0)
    jaw_width: float = _length(108.0, 88.0, 126.0, 6.0)
    brow_ridge: float = _length(4.0, 0.0, 8.0, 1.5)
    eye_spacing: float = _length(63.0, 54.0, 74.0, 3.5)
    eye_depth: float = _length(13.0, 9.0, 17.0, 1.5)
    nose_length: float = _length(50.0, 40.0, 60.0, 3.5)
    nose_width: float = _length(35.0, 28.0, 46.0, 3.0)
    nose_projection: float = _length(19.0, 12.0, 24.0, 2.2)
    nose_hump: float = _length(1.0, -3.0, 5.0, 1.3)
    mouth_width: float = _length(51.0, 42.0, 62.0, 3.5)
    lip_fullness: float = _length(8.0, 5.0, 12.0, 1.3)
    chin_projection: float = _length(0.0, -7.0, 6.0, 2.5)
    ear_height: float = _length(61.0, 50.0, 76.0, 4.0)
    ear_standoff: float = _length(11.0, 7.0, 22.0, 1.6)
    neck_width: float = _length(104.0, 86.0, 124.0, 7.0)
    neck_length: float = _length(22.0, 14.0, 45.0, 4.0)
    scale: float = _length(1.0, 0.1, 10.0, 0.0)

    def __post_init__(self) -> None:
        for proportion in fields(self):
            least, largest = proportion.metadata["limits"]
            name, value = proportion.name, getattr(self, proportion.name)
            if not (isfinite(value) and least <= value <= largest):
                raise MeshError(
                    f"head {name} is {value}: must lie in {least:g} to {largest:g}"
                )

    @classmethod
    def random(cls, seed: int) -> "HeadShape":
        """Return one head of a population: normal, cut off at 2.5 deviations."""
        return cls._drawn(np.random.default_rng(seed), 1.0)

    @classmethod
    def of_family(cls, seed: int, member: int) -> "HeadShape":
        """Return a member of a family from child to adult, whatever others there are.

        How grown up it is is uniform; proportions are then normal about that age's.
        """
        rng = np.random.default_rng([seed, member])
        return cls._drawn(rng, float(rng.random()))

    @classmethod
    def _drawn(cls, rng: np.random.Generator, grown: float) -> "HeadShape":
        """A head of an age, 0 a child's and 1 an adult's."""
        proportions = fields(cls)
        draws = np.clip(rng.standard_normal(len(proportions)), -2.5, 2.5)
        values: dict[str, float] = {}
        for proportion, draw in zip(proportions, draws, strict=True):
            least, largest = proportion.metadata["limits"]
            share = grown + (1.0 - grown) * _CHILD.get(proportion.name, 1.0)
            middle = share * float(getattr(cls, proportion.name))
            value = middle + proportion.metadata["deviation"] * float(draw)
            values[proportion.name] = min(max(value, least), largest)
        values["scale"] = grown + (1.0 - grown) * _CHILD_SCALE
        return cls(**values)
