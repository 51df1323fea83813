"""The frames that a projector shows: what each means, and what they are drawn on."""

from dataclasses import dataclass
from typing import Literal, Protocol

from planning.verify.reconstruction.arrays import Array

Kind = Literal["white", "black", "bit", "root"]


@dataclass(frozen=True)
class Frame:
    """One image of the sequence.

    Attributes:
        number: Place in the sequence, from 0.
        kind: `white`, `black`, a `bit` of the annulus index, or a camera's `root` disc.
        bit: Which bit, from 0 for the one that flips most often; None for the others.
        camera: Whose root disc; None for the others.
        inverse: Bright and dark exchanged, within what is drawn at all.
    """

    number: int
    kind: Kind
    bit: int | None = None
    camera: str | None = None
    inverse: bool = False

    @property
    def name(self) -> str:
        """Name of its files, without the ending."""
        what = {"bit": f"bit{self.bit}", "root": f"root-{self.camera}"}
        name = f"{self.number:02d}-{what.get(self.kind, self.kind)}"
        return f"{name}-inverse" if self.inverse else name


class Panel(Protocol):
    """A projector's image, and where its pixels lie in the plane of the pattern."""

    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height in [px]."""
        ...

    @property
    def beam_radius(self) -> float | None:
        """Radius of a parallel beam [m]; None: none."""
        ...

    def ring_plane(self, pixels: Array) -> Array:
        """Return where pixels (n, 2) lie in the plane that is drawn in, (n, 2)."""
        ...

    def panel_coordinates(self, pixels: Array) -> Array:
        """Return panel coordinates (n, 2) of pixels (n, 2)."""
        ...
