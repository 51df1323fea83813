"""What a benchmark ran on, in a line."""

import os
import platform

import numpy as np


def machine() -> str:
    """Return the processor, its cores, and the versions of Python and numpy."""
    return (
        f"machine: {platform.processor() or platform.machine()}, {os.cpu_count()} "
        f"cores, python {platform.python_version()}, numpy {np.__version__}"
    )
