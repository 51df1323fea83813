"""Damaged mesh files, made from a seed and a number, and what reading them may do.

`python tests/support/fuzzing.py` is the worker: it reads "seed number" lines, answers
each with a line of JSON, and may die or hang without hurting whoever asked. `run` asks
it.
"""

import base64
import bz2
import gzip
import io
import json
import os
import queue
import resource
import struct
import subprocess
import sys
import tempfile
import threading
import warnings
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
NASTY = ROOT.parent / "shared" / "data" / "nasty"
MEMORY = 4 << 30
SECONDS = 20.0
_SUFFIXES = ("obj", "ply", "stl", "off", "glb", "gltf", "3mf")
# Words that break what counts, indexes or measures.
_WORDS = (
    "nan inf -inf 1e400 -1e400 1e39 0 -0 -1 -2147483649 2147483648 4294967295 "
    "9223372036854775808 99999999999999999999 1,5 1_0 0x10 1.5.2 1e 7"
).split()
# A flipped vertex number or coordinate changes the faces about one vertex.
_DEGREE = 12


@dataclass(frozen=True, eq=False)
class Case:
    """A damaged file.

    Attributes:
        name: File name, with suffix.
        damage: What was done to it.
        data: Its bytes.
        origin: Name and bytes of the file that it was made from.
        verdict: "refused": must not be read; "close": if it is read, all but
            ``changes`` times a vertex's faces must be the origin's; "any": only the
            laws of a mesh hold.
        changes: Number of places that were changed.
    """

    name: str
    damage: str
    data: bytes
    origin: tuple[str, bytes]
    verdict: str
    changes: int


def ball(scale: float = 40.0) -> tuple[np.ndarray, np.ndarray]:
    """Return an octahedron cut twice, on a ball: 66 vertices, 128 faces."""
    vertices = [tuple(v) for v in np.vstack([np.eye(3), -np.eye(3)])]
    faces = [
        f if np.linalg.det([vertices[i] for i in f]) > 0 else f[::-1]
        for x in (0, 3)
        for y in (1, 4)
        for z in (2, 5)
        for f in [(x, y, z)]
    ]
    for _ in range(2):
        index: dict[tuple[float, ...], int] = {v: i for i, v in enumerate(vertices)}

        def middle(a: int, b: int, index: dict = index) -> int:
            m = np.add(vertices[a], vertices[b])
            key = tuple((m / np.linalg.norm(m)).round(6).tolist())
            if key not in index:
                index[key] = len(vertices)
                vertices.append(key)
            return index[key]

        cut: list[tuple[int, ...]] = []
        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            cut += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = cut
    points = np.array(vertices) * scale * (1.0, 0.8, 1.2)
    return points.astype(np.float32).astype(np.float64), np.array(faces)


def _table(rows: np.ndarray, before: str = "") -> str:
    return "".join(before + " ".join(f"{x:g}" for x in row) + "\n" for row in rows)


def _text_files(v: np.ndarray, f: np.ndarray) -> Iterator[tuple[str, bytes]]:
    corners = "".join(f"f {a}/1/1 {b}//1 {c}\n" for a, b, c in f + 1)
    obj = "# ball\no ball\n" + _table(v, "v ") + "vt 0 0\nvn 0 0 1\ns off\n" + corners
    yield "plain.obj", obj.encode()
    back = "".join(f"f {a} {b} {c}\r\n" for a, b, c in f - len(v))
    yield "crlf.obj", _table(v, "v ").replace("\n", "\r\n").encode() + back.encode()
    counts = f"{len(v)} {len(f)} 0\n"
    yield "plain.off", ("OFF\n" + counts + _table(v) + _table(f, "3 ")).encode()
    rows = _table(np.hstack([v, np.full((len(v), 4), 255)]))
    coloured = "COFF\n# colours\n" + counts + rows + _table(f, "3 ")
    yield "colour.off", coloured.encode()
    head = _ply_head("ascii", len(v), len(f))
    yield "text.ply", (head + _table(v) + _table(f, "3 ")).encode()
    mixed = "3 0 1 2 9\n4 0 1 3 2 9\n"
    head = _ply_head("ascii", len(v), len(f) + 2, "property int flag\n")
    nines = _table(np.hstack([f, np.full((len(f), 1), 9)]), "3 ")
    yield "mixed.ply", (head + _table(v) + nines + mixed).encode()
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + _table(v[face], "vertex ")
        + "endloop\nendfacet\n"
        for face in f
    )
    yield "text.stl", f"solid ball\n{facets}endsolid ball\n".encode()


def _ply_head(form: str, n: int, m: int, more: str = "", real: str = "float") -> str:
    return (
        f"ply\nformat {form} 1.0\ncomment made\nelement vertex {n}\n"
        + "".join(f"property {real} {axis}\n" for axis in "xyz")
        + f"element face {m}\nproperty list uchar int vertex_indices\n{more}"
        + "end_header\n"
    )


def _binary_files(v: np.ndarray, f: np.ndarray) -> Iterator[tuple[str, bytes]]:
    for form, order, real in (("little", "<", "float"), ("big", ">", "double")):
        head = _ply_head(f"binary_{form}_endian", len(v), len(f), real=real)
        rows = np.zeros(len(f), [("n", "u1"), ("i", order + "i4", 3)])
        rows["n"], rows["i"] = 3, f
        kind = order + ("f4" if real == "float" else "f8")
        data = v.astype(kind).tobytes() + rows.tobytes()
        yield f"{form}.ply", head.encode() + data
    quads = struct.pack("<B4i", 4, 0, 1, 3, 2) + struct.pack("<B3i", 3, 0, 1, 2)
    head = _ply_head("binary_little_endian", len(v), len(f) + 2)
    rows = np.zeros(len(f), [("n", "u1"), ("i", "<i4", 3)])
    rows["n"], rows["i"] = 3, f
    data = v.astype("<f4").tobytes() + rows.tobytes() + quads
    yield "quads.ply", head.encode() + data
    record = np.zeros(len(f), [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("extra", "<u2")])
    record["v"] = v[f]
    count = struct.pack("<I", len(f))
    yield "binary.stl", b"solid".ljust(80) + count + record.tobytes()
    stored = f.astype("<u2").tobytes() + v.astype("<f4").tobytes()
    yield "two.glb", _glb(_gltf_tree(v, f), stored)
    tree = _gltf_tree(v, f)
    uri = "data:application/octet-stream;base64," + base64.b64encode(stored).decode()
    tree["buffers"] = [{"byteLength": len(stored), "uri": uri}]
    yield "inside.gltf", json.dumps(tree, indent=1).encode()
    yield "parts.3mf", _three_mf(v, f)


def _gltf_tree(v: np.ndarray, f: np.ndarray) -> dict[str, object]:
    size = 6 * len(f)
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"mesh": 0, "scale": [-1, 1, 1], "translation": [-90, 0, 0]},
            {"children": [2], "rotation": [0, 0, 0.6, 0.8]},
            {"mesh": 0, "translation": [0, 1, 0]},
        ],
        "meshes": [
            {
                "extras": {"units": "mm"},
                "primitives": [{"attributes": {"POSITION": 1}, "indices": 0}],
            }
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5123,
                "count": 3 * len(f),
                "type": "SCALAR",
            },
            {
                "bufferView": 1,
                "componentType": 5126,
                "count": len(v),
                "type": "VEC3",
            },
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": size},
            {"buffer": 0, "byteOffset": size, "byteLength": 12 * len(v)},
        ],
        "buffers": [{"byteLength": size + 12 * len(v)}],
    }


def _glb(tree: dict[str, object], stored: bytes) -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    stored += b"\0" * (-len(stored) % 4)
    parts = struct.pack("<I", len(text)) + b"JSON" + text
    parts += struct.pack("<I", len(stored)) + b"BIN\0" + stored
    return b"glTF" + struct.pack("<2I", 2, 12 + len(parts)) + parts


def _three_mf(v: np.ndarray, f: np.ndarray) -> bytes:
    vertices = "".join(f'<vertex x="{x:g}" y="{y:g}" z="{z:g}"/>\n' for x, y, z in v)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>\n' for a, b, c in f)
    model = (
        '<?xml version="1.0"?>\n<model unit="millimeter" xmlns="http://schemas.microsoft'
        '.com/3dmanufacturing/core/2015/02"><resources>\n<object id="1"><mesh>'
        f"<vertices>\n{vertices}</vertices><triangles>\n{faces}</triangles></mesh>"
        '</object>\n<object id="2"><components><component objectid="1" '
        'transform="1 0 0 0 1 0 0 0 1 90 0 0"/></components></object></resources>\n'
        "<build><item "
        'objectid="1"/>\n<item objectid="2"/></build></model>\n'
    )
    return _zipped("3D/3dmodel.model", model.encode())


def _zipped(name: str, data: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo(name), data)
    return buffer.getvalue()


def originals() -> list[tuple[str, bytes]]:
    """Return whole files of every format, made here."""
    v, f = ball()
    return [*_text_files(v, f), *_binary_files(v, f)]


def borrowed() -> list[tuple[str, bytes]]:
    """Return the small files of the shared collection, if it is there."""
    if not NASTY.is_dir():
        return []
    return [
        (path.name, path.read_bytes())
        for path in sorted(NASTY.iterdir())
        if 100 < path.stat().st_size < 60_000 and path.suffix != ".ctm"
    ]


def make(seed: int, number: int) -> Case:
    """Return the damaged file of a number; the shared files serve every fifth."""
    rng = np.random.default_rng([seed, number])
    made, others = originals(), borrowed()
    pool = others if others and number % 5 == 4 else made
    name, data = pool[int(rng.integers(len(pool)))]
    inner = name.endswith(".3mf") and rng.random() < 0.7
    if inner:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            member = next(n for n in archive.namelist() if n.endswith(".model"))
            content = archive.read(member)
        damage, broken, verdict, changes = _damage(rng, "model", content, made)
        broken = _zipped(member, broken)
        if damage == "suffix":
            damage, verdict = "none", "close"
    else:
        damage, broken, verdict, changes = _damage(rng, name, data, made)
    if damage == "suffix":
        name = "x." + str(rng.choice([s for s in _SUFFIXES if not name.endswith(s)]))
        broken = data
    if name.endswith(".zip"):
        return Case(name, damage, broken, (name, data), verdict, changes)
    wrap = rng.choice(["", "", "", "", "", "", ".gz", ".bz2", ".zip"])
    if wrap:
        packed = _wrapped(str(wrap), name, broken)
        if rng.random() < 0.3:
            # The checksum sees it, or the archive isn't one any more.
            at = int(rng.integers(len(packed)))
            packed = packed[:at]
            damage, verdict, changes = f"{damage}, archive cut at {at}", "refused", 1
        broken, name = packed, name + str(wrap)
    return Case(name, damage, broken, pool_entry(pool, name), verdict, changes)


def pool_entry(pool: list[tuple[str, bytes]], name: str) -> tuple[str, bytes]:
    """Return the origin by the name that damage may have lengthened."""
    for entry in pool:
        if name.startswith(entry[0]):
            return entry
    return ("", b"")


def _wrapped(wrap: str, name: str, data: bytes) -> bytes:
    if wrap == ".gz":
        return gzip.compress(data, mtime=0)
    return bz2.compress(data) if wrap == ".bz2" else _zipped(f"folder/{name}", data)


def _is_text(name: str) -> bool:
    return name.startswith(("plain", "crlf", "colour", "text", "mixed", "model"))


def _damage(
    rng: np.random.Generator, name: str, data: bytes, made: list[tuple[str, bytes]]
) -> tuple[str, bytes, str, int]:
    """Return what was done, the bytes, the verdict and the number of changes."""
    kinds = ["flip", "cut", "cut", "suffix", "splice", "zeros", "garbage", "field"]
    if _is_text(name) or name.endswith((".obj", ".off", ".gltf")):
        kinds += ["drop line", "double line", "swap lines", "word", "word"]
        kinds += ["nudge"] * 4
    kind = str(rng.choice(kinds))
    begin = _body(name, data)
    known = _is_text(name) or name in dict(made)
    if kind == "flip":
        broken, k, low = bytearray(data), int(rng.integers(1, 5)), len(data)
        for _ in range(k):
            at = int(rng.integers(len(data)))
            broken[at] ^= 1 << int(rng.integers(8))
            low = min(low, at)
        body = known and low >= begin and not name.endswith((".gltf", "model"))
        return f"{k} bits", bytes(broken), "close" if body else "any", k
    if kind == "cut":
        return _cut(rng, name, data, known)
    if kind == "suffix":
        return kind, data, "any", 0
    if kind == "splice":
        other = made[int(rng.integers(len(made)))][1]
        a, b = int(rng.integers(len(data))), int(rng.integers(len(other)))
        return f"splice {a}, {b}", data[:a] + other[b:], "any", 0
    if kind in ("zeros", "garbage"):
        a, n = int(rng.integers(len(data))), int(rng.integers(1, 40))
        fill = bytes(n) if kind == "zeros" else rng.bytes(n)
        insert = bool(rng.integers(2))
        broken = data[:a] + fill + data[a if insert else a + n :]
        return f"{n} {kind} at {a}", broken, "any", n
    if kind == "field":
        # Counts, offsets and sizes stand near the beginning.
        a = int(rng.integers(min(len(data), 400)))
        value = rng.choice([0, 1, 3, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1])
        fill = struct.pack(str(rng.choice(["<", ">"])) + "I", int(value))
        return f"{value} at {a}", data[:a] + fill + data[a + 4 :], "any", 4
    return _damage_line(rng, kind, name, data, begin, known)


def _body(name: str, data: bytes) -> int:
    """Where positions and faces begin."""
    if name.endswith(".ply"):
        return data.find(b"end_header") + 11
    if name.endswith(".stl"):
        return 84 if name.startswith("binary") else 11
    if name.endswith(".glb"):
        return 28 + int.from_bytes(data[12:16], "little")
    return data.find(b"128 0") + 6 if name.endswith(".off") else 0


def _cut(
    rng: np.random.Generator, name: str, data: bytes, known: bool
) -> tuple[str, bytes, str, int]:
    at = int(rng.integers(len(data)))
    if rng.random() < 0.5:
        ends = [i + 1 for i, byte in enumerate(data[:-1]) if byte == 10]
        bounds = [*ends, 4, 12, 20, 80, 84, _body(name, data), len(data) - 1]
        at = int(rng.choice([b for b in bounds if 0 < b < len(data)]))
    left = data[:at]
    if not known:
        return f"cut at {at}", left, "any", 0
    # OBJ doesn't say how much there is; of the rest every word is counted, only the
    # last one may lose digits, and what follows the last bracket may be missing.
    whole = left.rstrip() == data.rstrip() or not data[at:].strip(b"ball \r\n\0")
    if name.endswith(".obj"):
        return f"cut at {at}", left, "prefix", 1
    last_word = name.endswith((".off", ".ply")) and _is_text(name)
    if whole or (last_word and b"\n" not in data[at:].rstrip()):
        return f"cut at {at}", left, "close", 1
    return f"cut at {at}", left, "refused", 1


def _damage_line(
    rng: np.random.Generator, kind: str, name: str, data: bytes, begin: int, known: bool
) -> tuple[str, bytes, str, int]:
    lines = data.splitlines(keepends=True)
    first = data[:begin].count(b"\n")
    # Half of the time in the header, where a single line matters most.
    high = first + 3 if first and rng.random() < 0.5 else len(lines)
    at = int(rng.integers(min(high, len(lines))))
    body = known and at >= first
    line = lines[at]
    verdict, changes = ("close", 2) if body else ("any", 1)
    if kind == "drop line":
        lines[at] = b""
        counted = name.endswith((".off", ".ply", ".stl")) or line.startswith(b"v ")
        # Numbers that count from the end don't notice a vertex missing at the front.
        if body and counted and not name.startswith("crlf"):
            verdict = "refused"
        elif name.startswith("crlf"):
            verdict = "any"
    elif kind == "double line":
        lines[at] = line + line
        # Where vertices aren't counted, one too many shifts what follows unnoticed.
        if line.startswith(b"<vertex"):
            verdict = "any"
        elif body and name.endswith((".off", ".ply", ".stl")):
            verdict = "refused"
        elif line.startswith(b"v ") or not body:
            verdict = "any"
    elif kind == "swap lines":
        other = int(rng.integers(len(lines)))
        lines[at], lines[other] = lines[other], lines[at]
        verdict = "any"
    else:
        words = line.split()
        numeric = [k for k, word in enumerate(words) if _is_number(word)]
        if kind == "nudge" and numeric:
            which = int(rng.choice(numeric))
            whole = words[which].lstrip(b"-").isdigit()
            value = rng.integers(1, 60) if whole else rng.normal(0, 30)
            words[which] = f"{value:.6g}".encode()
        elif words:
            which = int(rng.integers(len(words)))
            words[which] = str(rng.choice(_WORDS)).encode()
        if words:
            lines[at] = b" ".join(words) + b"\n"
        if name in ("model", "inside.gltf"):
            verdict = "any"
    return f"{kind} {at + 1}: {line[:30]!r}", b"".join(lines), verdict, changes


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


# ---- the worker ----


def judge(case: Case, folder: Path) -> dict[str, object]:
    """Read a damaged file and say what happened; raises what must not happen."""
    from geometry.files.readers import load_mesh
    from geometry.mesh.mesh import MeshError

    path = folder / case.name
    path.write_bytes(case.data)
    try:
        mesh = load_mesh(path)
    except MeshError as error:
        text = str(error)
        assert text.startswith(str(path)), text
        assert "\n" not in text, text
        assert text.isprintable(), ascii(text)
        assert len(text) < len(str(path)) + 300, text
        return {"read": False, "message": text.removeprefix(str(path))}
    finally:
        path.unlink()
    _check_laws(mesh)
    assert case.verdict != "refused", f"read, {len(mesh.faces)} faces"
    if case.verdict in ("close", "prefix"):
        _check_close(case, mesh, folder)
    return {"read": True, "faces": len(mesh.faces)}


def _check_laws(mesh) -> None:
    v, f = mesh.vertices, mesh.faces
    assert np.isfinite(v).all()
    assert f.min() >= 0
    assert f.max() == len(v) - 1
    assert len(np.unique(f)) == len(v)
    assert len(np.unique(v, axis=0)) == len(v)
    assert len(np.unique(np.sort(f, axis=1), axis=0)) == len(f)
    assert np.all(mesh.face_areas > 0)
    np.testing.assert_allclose(np.linalg.norm(mesh.face_normals, axis=1), 1, atol=1e-9)
    assert 1e-3 * (1 - 1e-9) <= np.ptp(v, axis=0).max() <= 100 * (1 + 1e-9)


def _rows(mesh) -> set[tuple[float, ...]]:
    """Faces as their corners' places, whatever their order and winding."""
    corners = (mesh.corners * 1e3).round(3) + 0.0
    return {
        tuple(sorted(map(tuple, face)))
        for face in corners.tolist()  # type: ignore[misc]
    }


def _check_close(case: Case, mesh, folder: Path) -> None:
    from geometry.files.readers import load_mesh

    path = folder / case.origin[0]
    path.write_bytes(case.origin[1])
    whole = load_mesh(path)
    path.unlink()
    was, now = _rows(whole), _rows(mesh)
    bodies = 2 if case.origin[0] in ("two.glb", "inside.gltf", "parts.3mf") else 1
    allowed = _DEGREE * bodies * case.changes
    assert len(now - was) <= allowed, f"{len(now - was)} faces of {len(now)} are new"
    if case.verdict == "close":
        # Words like "nan" may cost a vertex with its faces, and no more.
        assert len(was - now) <= allowed, f"{len(was - now)} of {len(was)} faces gone"


def _exercise(case: Case, folder: Path) -> None:
    """Curvature and regions of what could be read: libigl must live."""
    from geometry.curvature.curvature import principal_curvatures
    from geometry.files.readers import load_mesh
    from geometry.regions.regions import dominant_regions

    path = folder / case.name
    path.write_bytes(case.data)
    mesh = load_mesh(path)
    path.unlink()
    field = principal_curvatures(mesh)
    assert field.k_max.shape == (len(mesh.vertices),)
    assert np.all(np.isfinite(field.k_max))
    assert np.all(np.isfinite(field.k_min))
    regions = dominant_regions(mesh, field)
    assert len(regions.face_region) == len(mesh.faces)


def work() -> None:
    """Answer lines of "seed number" until they end."""
    sys.path.insert(0, str(ROOT))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as folder:
        for line in sys.stdin:
            seed, number = (int(word) for word in line.split())
            case = make(seed, number)
            answer: dict[str, object] = {"file": case.name, "damage": case.damage}
            try:
                answer |= judge(case, Path(folder))
                if answer["read"] and number % 10 < 2:
                    _exercise(case, Path(folder))
                    answer["curved"] = True
            except BaseException as error:
                answer["escaped"] = f"{type(error).__name__}: {error}"[:400]
            print(json.dumps(answer), flush=True)  # noqa: T201


# ---- who asks it ----


class Worker:
    """The worker process, started anew when it dies or hangs."""

    def __init__(self, script: Path = Path(__file__)) -> None:
        self._script = script
        self._process: subprocess.Popen[str] | None = None

    def ask(self, seed: int, number: int) -> dict[str, object]:
        """Return the worker's answer; its death or silence is an escape too."""
        if self._process is None:
            self._start()
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(f"{seed} {number}\n")
        self._process.stdin.flush()
        try:
            line = self._lines.get(timeout=SECONDS)
        except queue.Empty:
            self.close()
            return {"escaped": f"no answer within {SECONDS:.0f} s"}
        if not line:
            code = self._process.wait()
            self.close()
            return {"escaped": f"the worker died with code {code}"}
        return json.loads(line)

    def _start(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(self._script)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(
            target=_forward, args=(self._process.stdout, self._lines), daemon=True
        ).start()

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


def _forward(stream, lines: "queue.Queue[str]") -> None:
    for line in stream:
        lines.put(line)
    lines.put("")


def run(seed: int, numbers: range) -> list[dict[str, object]]:
    """Return the answers for many damaged files, each with its number."""
    worker = Worker()
    try:
        return [{"number": n, **worker.ask(seed, n)} for n in numbers]
    finally:
        worker.close()


if __name__ == "__main__":
    work()
