"""A circle about a turntable: what its projector and any cameras do at each angle."""

from dataclasses import dataclass

from .sample_bits import Bits, packed
from .table_sets import Place, TableSets


@dataclass(frozen=True, eq=False)
class Circle:
    """What a projector at place 0 of its circle does at each angle, as bits of samples.

    Attributes:
        lit: Shape (A, b).
        anyone: What any cameras measure with it, shape (A, b).
        measured: What a camera does, by its place, shape (A, b) each.
    """

    lit: Bits
    anyone: Bits
    measured: dict[Place, Bits]

    @classmethod
    def of(cls, sets: TableSets, e: int) -> "Circle":
        """Return what the projector of a circle does."""
        lamp = ((e, 0),)
        return cls(
            packed(sets.steps_of(lamp, ()).lit),
            packed(sets.steps_of(lamp, None).measured),
            {
                eye: packed(sets.steps_of(lamp, (eye,)).measured)
                for eye in sets.near(lamp[0])
            },
        )
