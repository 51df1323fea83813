"""Shares as people write them."""


def percent_as_share(value: object) -> object:
    """Return 0.95 for "95 %", and anything else as it is.

    Raises:
        ValueError: If what stands before the sign isn't a number.
    """
    if isinstance(value, str) and value.endswith("%"):
        return float(value[:-1]) / 100.0
    return value
