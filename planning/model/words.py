"""Quantities as a person reads them."""

# Areas below this are told in mm² [m²].
_SMALL_M2 = 1e-4


def area_words(area_m2: float) -> str:
    """Return an area in cm², or a small one in mm²."""
    if area_m2 < _SMALL_M2:
        return f"{1e6 * area_m2:.3g} mm²"
    return f"{1e4 * area_m2:.1f} cm²"


def percent(share: float) -> str:
    """Return a share in percent, with one decimal."""
    return f"{100.0 * share:.1f} %"
