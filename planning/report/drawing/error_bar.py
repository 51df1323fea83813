"""What points will be off by, term by term, as a bar in the picture."""

from PIL import ImageDraw

from planning.model.document.coverage_records import PredictedSigma

from .panel import INK, PALE, font
from .picture_view import SUPERSAMPLING, Colour

_COLOURS: dict[str, Colour] = {
    "edges": (120, 120, 125),
    "light": (215, 170, 20),
    "phase": (120, 60, 150),
    "rings": (150, 120, 90),
    "linearity": (90, 140, 80),
    "camera": (0, 90, 160),
    "projector": (200, 80, 0),
}
_LEAST_PX = 240
# Of the line above the bar; where it has no room in the smallest it goes without terms.
_SIZES = (13.0, 11.5, 10.0)


def draw_error_bar(
    draw: ImageDraw.ImageDraw,
    sigma: PredictedSigma | None,
    box: tuple[float, float, float, float],
) -> None:
    """Draw each term as wide as its share of the variance, into a box [fine px].

    Nothing is drawn where no term is known, or where there is no room.
    """
    left, top, right, bottom = box
    terms = {} if sigma is None else sigma.terms_rms_m
    whole = sum(value**2 for value in terms.values())
    if not whole or right - left < _LEAST_PX * SUPERSAMPLING:
        return
    middle = top + 0.52 * (bottom - top)
    each = ", ".join(f"{name} {1e3 * value:.3f}" for name, value in terms.items())
    text = f"sigma {1e3 * whole**0.5:.3f} mm rms"
    for size in _SIZES:
        if draw.textlength(f"{text}: {each}", font(size)) <= right - left:
            text = f"{text}: {each}"
            break
    else:
        size = _SIZES[0]
    draw.text((left, middle - 3 * SUPERSAMPLING), text, PALE, font(size), "ld")
    for name, value in terms.items():
        end = left + (right - box[0]) * value**2 / whole
        draw.rectangle((left, middle, end, bottom), fill=_COLOURS.get(name, INK))
        if draw.textlength(name, font(12.0)) < end - left - 4 * SUPERSAMPLING:
            spot = (0.5 * (left + end), 0.5 * (middle + bottom))
            draw.text(spot, name, (255, 255, 255), font(12.0), "mm")
        left = end
