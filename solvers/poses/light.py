"""The two kinds of light that programs know."""

from typing import Literal

Light = Literal["diverging", "parallel"]
