"""Output folders: found to be unwritable before the work is done, not after it."""

import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

import click


@contextmanager
def writable(folder: Path) -> Generator[None]:
    """Fail before the work, not after it; leave no empty folder where it fails.

    Raises:
        click.UsageError: If nothing can be written into the folder.
    """
    missing = [f for f in (folder, *folder.parents) if not f.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise click.UsageError(
            f"can't write to {folder}: {error.strerror}; choose another folder with -o"
        ) from None
    try:
        yield
    except BaseException:
        for made in missing:
            with suppress(OSError):
                made.rmdir()
        raise
