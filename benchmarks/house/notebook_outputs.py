"""Run the notebooks and keep their outputs, pictures as small JPEG files.

Usage: python -m benchmarks.house.notebook_outputs [NAME ...]   (from a checkout's root)

Sources are those of `notebooks/NAME.py`. No notebook may name a place of this machine.
"""

import base64
import io
import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jupytext
import nbformat
from nbclient import NotebookClient
from PIL import Image

NOTEBOOKS = Path(__file__).resolve().parents[2] / "notebooks"
_OF_THIS_MACHINE = re.compile(r"/(tmp|home|root|work|usr)/|\b0x[0-9a-f]{6}|Warning")
_WIDEST, _MOST_BYTES = 760, 320_000


def main() -> int:
    """Run those that are named, or all; 1 if one is too large or says too much."""
    names = sys.argv[1:] or sorted(path.stem for path in NOTEBOOKS.glob("*.py"))
    faults = 0
    for name in names:
        begin, path = time.monotonic(), NOTEBOOKS / f"{name}.ipynb"
        notebook = jupytext.read(NOTEBOOKS / f"{name}.py")
        nbformat.validator.normalize(notebook)
        notebook.metadata = nbformat.read(path, as_version=4).metadata
        kept = nbformat.from_dict(dict(notebook.metadata))
        NotebookClient(notebook, timeout=3600).execute()
        notebook.metadata = kept
        for place, cell in enumerate(notebook.cells):
            cell.id = f"{place:02d}"
            cell.metadata = {}
            for output in cell.get("outputs", []):
                _shrink(output.get("data", {}))
        text = nbformat.writes(notebook) + "\n"
        path.write_text(text, encoding="utf-8")
        told = [line for line in _lines(notebook) if _OF_THIS_MACHINE.search(line)]
        print(f"{name}: {len(text)} bytes, {time.monotonic() - begin:.0f} s", *told)
        faults += bool(told) or len(text) > _MOST_BYTES
    return int(faults > 0)


def _lines(notebook: nbformat.NotebookNode) -> Iterator[str]:
    """Yield what the outputs say in words."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            said = output.get("text", ""), output.get("data", {}).get("text/plain", "")
            yield from "".join(said).splitlines()


def _shrink(data: dict[str, Any]) -> None:
    """Keep of a picture a small JPEG, and no other form of it."""
    if "image/png" not in data:
        return
    picture = Image.open(io.BytesIO(base64.b64decode(data["image/png"])))
    if picture.width > _WIDEST:
        height = round(picture.height * _WIDEST / picture.width)
        picture = picture.resize((_WIDEST, height), Image.Resampling.LANCZOS)
    file = io.BytesIO()
    picture.convert("RGB").save(
        file, "JPEG", quality=60, subsampling=1, optimize=True, progressive=True
    )
    data.clear()
    data["image/jpeg"] = base64.b64encode(file.getvalue()).decode()


if __name__ == "__main__":
    sys.exit(main())
