"""How much light a projector sends at each grey level of its input."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.arrays import Array, Grey

WHITE = 255


@dataclass(frozen=True)
class Response:
    """Light at grey levels, a share of white's beyond black's.

    Attributes:
        law: A gamma, light = (level / 255)^gamma with 1 for linear; or measured light
            at evenly spaced levels from black to white, rising.
    """

    law: float | tuple[float, ...] = 1.0

    @cached_property
    def light(self) -> Array:
        """Light at every level, 0 to 1, shape (256,)."""
        levels = np.linspace(0.0, 1.0, WHITE + 1)
        if isinstance(self.law, float):
            return levels**self.law
        table = np.asarray(self.law)
        light = np.interp(levels, np.linspace(0.0, 1.0, len(table)), table)
        return (light - light[0]) / (light[-1] - light[0])

    @property
    def is_linear(self) -> bool:
        """Whether levels are shares of light."""
        return bool(np.allclose(self.light, np.linspace(0.0, 1.0, WHITE + 1)))

    def levels(self, shares: Grey | Array) -> NDArray[np.uint8]:
        """Return the levels whose light is nearest to shares of white, any shape."""
        between = 0.5 * (self.light[1:] + self.light[:-1])
        # Most pixels are dark or white: only the others are searched for.
        levels = (shares >= 1.0) * np.uint8(WHITE)
        grey = (shares > 0.0) & (shares < 1.0)
        levels[grey] = np.searchsorted(between, shares[grey])
        return levels

    @cached_property
    def _left(self) -> NDArray[np.uint8]:
        levels = self.light[:, None] - self.light
        return self.levels(levels).ravel()

    def left(
        self, whole: NDArray[np.uint8], part: NDArray[np.uint8]
    ) -> NDArray[np.uint8]:
        """Return the levels of what whole levels send more than parts, any shape."""
        return self._left.take(whole.astype(np.uint16) * (WHITE + 1) + part)
