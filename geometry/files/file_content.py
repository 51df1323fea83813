"""What a file holds; for what isn't one nobody waits."""

import errno
from pathlib import Path


def file_content(path: str | Path) -> bytes:
    """Return a file's bytes; pipes and devices, which may never end, are refused.

    Raises:
        OSError: If it can't be read, or isn't a regular file.
    """
    path = Path(path)
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.EINVAL, "not a regular file; copy it into one", str(path))
    return path.read_bytes()
