"""Run the README's first command on the sample and put what it printed into the README.

Usage: python -m benchmarks.house.readme_run   (from the project's root, ringrig
    installed)
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_BLOCK = re.compile(
    r"(<!-- output: [^\n]* -->\n```\n).*?(```\n<!-- end of output -->)", re.S
)


def main() -> int:
    """Run, rewrite the README's block and the picture; return the exit code."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(ROOT / "face.obj", folder)
        words = ["--mesh", "face.obj", "--max-projectors", "3", "--quiet"]
        command = [
            sys.executable,
            "-c",
            "from planning.cli.main import main; main()",
            *words,
        ]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if done.returncode != 0:
            print(done.stdout, done.stderr)
            return done.returncode
        picture = ROOT / "docs" / "images" / "rig.png"
        shutil.copy(Path(folder) / "face-plan" / "rig.png", picture)
    readme = ROOT / "README.md"
    text = readme.read_text(encoding="utf-8")
    changed, n = _BLOCK.subn(lambda m: m[1] + done.stdout + m[2], text)
    if n != 1:
        print("README.md must hold one output block", file=sys.stderr)
        return 1
    readme.write_text(changed, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
