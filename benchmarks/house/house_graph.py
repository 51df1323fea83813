"""Draw the rooms and their imports, floor above floor; refuse a circle.

Usage: python -m benchmarks.house.house_graph [OUT.svg]       (from a checkout's root)

A room is a folder right below one of the three packages; modules beside the folders
make one room, named after the package. Its floor is one above the highest that it
imports. Arrows that another path implies are left out of the picture, not of the count.
Returns 1 if rooms, folders inside them or modules import each other in a circle, or if
there are more than `FLOORS` floors.
"""

import sys
from collections import defaultdict
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "images" / "house.svg"
PACKAGES = ("planning", "geometry", "solvers")
FLOORS = 10
_COLOURS = {"planning": "#dbe9f6", "geometry": "#e3f1dc", "solvers": "#f8e8d4"}
_WIDTH, _HEIGHT, _GAP, _RISE = 118, 30, 16, 64

Graph = dict[str, set[str]]


def main() -> int:
    """Draw the picture; print floors, arrows and circles."""
    sys.path.insert(0, str(ROOT))
    modules = grimp.build_graph(*PACKAGES, include_external_packages=False)
    rooms = _between(modules, depth=2, loose=False)
    circles = [c for depth in (2, 3, 4) for c in _circles(_between(modules, depth))]
    if circles:
        print("\n".join(f"circle: {' -> '.join(circle)}" for circle in circles))
        return 1
    floors = _floors(rooms)
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE
    out.write_text(_svg(rooms, floors), encoding="utf-8")
    height = 1 + max(floors.values())
    for floor in range(height - 1, -1, -1):
        names = sorted(room for room in rooms if floors[room] == floor)
        print(f"{floor:2d}  {'  '.join(names)}")
    arrows = sum(len(below) for below in rooms.values())
    print(f"{len(rooms)} rooms, {arrows} arrows, {height} floors, no circle")
    return int(height > FLOORS)


def _between(modules: grimp.ImportGraph, depth: int, *, loose: bool = True) -> Graph:
    """Return which room imports which; rooms are the first `depth` parts of a name.

    Modules that lie beside folders are rooms of their own if they are `loose`.
    """
    rooms: Graph = defaultdict(set)
    for module in sorted(modules.modules):
        room = _room(modules, module, depth, loose)
        if room is None:
            continue
        rooms[room] |= {
            other
            for imported in modules.find_modules_directly_imported_by(module)
            if (other := _room(modules, imported, depth, loose)) not in (None, room)
        }
    return dict(rooms)


def _room(
    modules: grimp.ImportGraph, module: str, depth: int, loose: bool
) -> str | None:
    """Return where a module lives; a package's own file exports what is inside it."""
    parts = module.split(".")
    if len(parts) == 1 or module.endswith("._siblings"):
        return None
    if len(parts) <= depth and modules.find_children(module):
        return module
    if len(parts) <= depth and not loose:
        return parts[0]
    return ".".join(parts[:depth])


def _circles(rooms: Graph) -> list[list[str]]:
    """Return a circle through each room that reaches itself, each circle once."""
    seen: set[frozenset[str]] = set()
    circles: list[list[str]] = []
    for start in sorted(rooms):
        paths = [[start]]
        visited: set[str] = set()
        while paths:
            path = paths.pop(0)
            for below in sorted(rooms.get(path[-1], ())):
                if below == start and frozenset(path) not in seen:
                    seen.add(frozenset(path))
                    circles.append([*path, start])
                elif below not in visited:
                    visited.add(below)
                    paths.append([*path, below])
    return circles


def _floors(rooms: Graph) -> dict[str, int]:
    floors: dict[str, int] = {}

    def floor(room: str) -> int:
        if room not in floors:
            floors[room] = 1 + max((floor(below) for below in rooms[room]), default=-1)
        return floors[room]

    for room in rooms:
        floor(room)
    return floors


def _implied(rooms: Graph, room: str, below: str) -> bool:
    """Whether another import of the room leads to the same one."""
    waiting, visited = [r for r in rooms[room] if r != below], set[str]()
    while waiting:
        via = waiting.pop()
        if via == below:
            return True
        if via not in visited:
            visited.add(via)
            waiting.extend(rooms[via])
    return False


def _svg(rooms: Graph, floors: dict[str, int]) -> str:
    height = 1 + max(floors.values())
    storeys = [sorted(r for r in rooms if floors[r] == f) for f in range(height)]
    columns = max(len(storey) for storey in storeys)
    width = columns * (_WIDTH + _GAP) + _GAP
    total = height * _RISE + _GAP
    corner: dict[str, tuple[float, float]] = {}
    for floor, storey in enumerate(storeys):
        indent = (width - len(storey) * (_WIDTH + _GAP) + _GAP) / 2
        for place, room in enumerate(storey):
            x, y = indent + place * (_WIDTH + _GAP), total - (floor + 1) * _RISE
            corner[room] = (x, y)
    lines: list[str] = []
    for room, imports in sorted(rooms.items()):
        for below in sorted(imports):
            if not _implied(rooms, room, below):
                (x, y), (u, v) = corner[room], corner[below]
                lines.append(
                    f'<line x1="{x + _WIDTH / 2:.0f}" y1="{y + _HEIGHT:.0f}" '
                    f'x2="{u + _WIDTH / 2:.0f}" y2="{v:.0f}" stroke="#8a94a0"/>'
                )
    for room, (x, y) in sorted(corner.items()):
        package, _, name = room.partition(".")
        name = name or package
        lines.append(
            f'<rect x="{x:.0f}" y="{y:.0f}" width="{_WIDTH}" height="{_HEIGHT}" '
            f'rx="4" fill="{_COLOURS[package]}" stroke="#5b6670"/>'
            f'<text x="{x + _WIDTH / 2:.0f}" y="{y + 19:.0f}">{name}</text>'
        )
    for place, (package, colour) in enumerate(_COLOURS.items()):
        x = width / 2 + (place - 1) * _WIDTH
        lines.append(
            f'<rect x="{x - 50:.0f}" y="{total + 2}" width="12" height="12" '
            f'fill="{colour}" stroke="#5b6670"/>'
            f'<text x="{x:.0f}" y="{total + 12}">{package}</text>'
        )
    body = "\n".join(lines)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{total + 20}"'
        f' font-family="sans-serif" font-size="12" text-anchor="middle">\n'
        f'<rect width="100%" height="100%" fill="white"/>\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    sys.exit(main())
