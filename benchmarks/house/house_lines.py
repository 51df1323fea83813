"""Print the size of the house: files, lines and lines of code of each room.

Usage: python -m benchmarks.house.house_lines [ROOT]       (a checkout)

Code is what is left of a file without blank lines, comments and docstrings. The last
columns are the median and the largest length of a function, in lines.
"""

import ast
import io
import statistics
import sys
import tokenize
from collections import defaultdict
from pathlib import Path

PACKAGES = ("planning", "geometry", "solvers")


def main() -> int:
    """Print the table."""
    root = Path(sys.argv[1] if len(sys.argv) > 1 else __file__).resolve()
    root = root if root.is_dir() else root.parents[2]
    rows: dict[str, list[tuple[int, int, list[int]]]] = defaultdict(list)
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            size = _size(path.read_text(encoding="utf-8"))
            inside = path.relative_to(root).parent.parts
            rows["/".join(inside[:2])].append(size)
            rows[f"{package}, all"].append(size)
            rows["all"].append(size)
    print("| room | files | lines | of code | function: median | longest |")
    print("|---|---|---|---|---|---|")
    for room in sorted(rows, key=lambda name: (name == "all", name)):
        files = rows[room]
        lengths = [n for *_, functions in files for n in functions] or [0]
        print(
            f"| {room} | {len(files)} | {sum(n for n, *_ in files):,} | "
            f"{sum(code for _, code, _ in files):,} | "
            f"{statistics.median(lengths):.0f} | {max(lengths)} |"
        )
    return 0


def _size(source: str) -> tuple[int, int, list[int]]:
    """Return lines, lines of code, and the length of each function."""
    tree = ast.parse(source)
    documented: set[int] = set()
    lengths: list[int] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            lengths.append((node.end_lineno or 0) - node.lineno + 1)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                documented.update(range(first.lineno, (first.end_lineno or 0) + 1))
    code: set[int] = set()
    left_out = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT}
    left_out |= {tokenize.DEDENT, tokenize.ENDMARKER, tokenize.ENCODING}
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in left_out:
            code.update(range(token.start[0], token.end[0] + 1))
    return len(source.splitlines()), len(code - documented), lengths


if __name__ == "__main__":
    sys.exit(main())
