"""Strict reader of 3MF: build items, their components, and the transforms of both."""

import io
import posixpath
import re
import zipfile
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np

from geometry.arrays import Array, Ints

from .reading import FormatError, RawMesh, ScenePart, joined, numbers, whole

_NAMESPACE = "http://schemas.microsoft.com/3dmanufacturing/"
_CORE = f"{{{_NAMESPACE}core/2015/02}}"
# Extensions that may be required and change no triangle, or are read here.
_UNDERSTOOD = ("production/", "material/", "core/")
_MAX_BYTES = 1 << 31
_MAX_PARTS = 100_000
_Mesh = tuple[Array, Ints]
# Its own meshes, and the components that it is made of.
_Object = tuple[list[_Mesh], list[ElementTree.Element]]


def read_three_mf(data: bytes) -> RawMesh:
    """Return what a 3MF file builds."""
    try:
        package = _Package(zipfile.ZipFile(io.BytesIO(data)))
    except zipfile.BadZipFile as error:
        raise FormatError(f"can't be read as 3MF: {error}") from None
    root = package.model(package.root)
    items = root.findall(f"{_CORE}build/{_CORE}item")
    if not items:
        raise FormatError("its build lists no object")
    parts: list[ScenePart] = []
    for item in items:
        _collect(package, package.root, item, np.eye(4), (), parts)
    return joined(parts, root.get("unit", "millimeter"))


class _Package:
    """The models of the archive, parsed when first asked for."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive
        self._names = {name.lower().strip("/"): name for name in archive.namelist()}
        self._models: dict[str, ElementTree.Element] = {}
        self._objects: dict[str, dict[str, _Object]] = {}
        self.root = self._root()

    def _root(self) -> str:
        if "_rels/.rels" in self._names:
            for link in self._xml("_rels/.rels").iter():
                if link.get("Type", "").endswith("/3dmodel"):
                    return link.get("Target", "").lower().strip("/")
        models = [name for name in self._names if name.endswith("3d/3dmodel.model")]
        if len(models) != 1:
            raise FormatError("it holds no 3D/3dmodel.model")
        return models[0]

    def _xml(self, name: str) -> ElementTree.Element:
        if name not in self._names:
            raise FormatError(f"it holds no '{name[:60]}'")
        try:
            with self._archive.open(self._names[name]) as stream:
                data = stream.read(_MAX_BYTES + 1)
        except (RuntimeError, NotImplementedError, zipfile.BadZipFile) as error:
            raise FormatError(f"can't be read as 3MF: {error}") from None
        if len(data) > _MAX_BYTES:
            raise FormatError(f"'{name[:60]}' unpacks to more than 2 GiB")
        if b"<!DOCTYPE" in data:
            raise FormatError("its XML has a document type, which 3MF forbids")
        try:
            return ElementTree.fromstring(data)
        except ElementTree.ParseError as error:
            raise FormatError(f"can't be read as 3MF: {error}") from None

    def model(self, name: str) -> ElementTree.Element:
        if name not in self._models:
            root = self._xml(name)
            if root.tag != f"{_CORE}model":
                raise FormatError(f"'{name[:60]}' is no 3MF model")
            self._check_extensions(name, root)
            self._models[name] = root
        return self._models[name]

    def _check_extensions(self, name: str, root: ElementTree.Element) -> None:
        needed = root.get("requiredextensions", "").split()
        if not needed:
            return
        # The parser drops the prefixes that this attribute is written in.
        with self._archive.open(self._names[name]) as stream:
            head = stream.read(1 << 16).decode("utf-8", errors="replace")
        known = dict(re.findall(r"xmlns:(\w+)\s*=\s*[\"']([^\"']*)[\"']", head))
        for prefix in needed:
            space = known.get(prefix, "").removeprefix(_NAMESPACE)
            if not space.startswith(_UNDERSTOOD):
                raise FormatError(
                    f"it requires the extension '{space[-60:] or prefix[:60]}', "
                    "which isn't read"
                )

    def object(self, name: str, number: str) -> _Object:
        if name not in self._objects:
            self._objects[name] = {}
            for entry in self.model(name).iter(f"{_CORE}object"):
                identity = entry.get("id", "")
                if identity in self._objects[name]:
                    raise FormatError(f"two objects have the id '{identity[:20]}'")
                self._objects[name][identity] = _object(entry)
        if number not in self._objects[name]:
            raise FormatError(f"its build names object '{number[:20]}', not there")
        return self._objects[name][number]


def _collect(
    package: _Package,
    model: str,
    reference: ElementTree.Element,
    world_from_parent: Array,
    above: Sequence[tuple[str, str]],
    parts: list[ScenePart],
) -> None:
    """Append the parts of an item or component and of all that it is made of."""
    path = [v for k, v in reference.attrib.items() if k.endswith("}path")]
    if path:
        model = posixpath.normpath(path[0]).lower().strip("/")
    key = (model, reference.get("objectid", ""))
    if key in above:
        raise FormatError(f"its object '{key[1][:20]}' is a component of itself")
    if len(above) > 50 or len(parts) > _MAX_PARTS:
        raise FormatError("its components are nested or repeated without end")
    world_from_object = world_from_parent @ _transform(reference.get("transform"))
    meshes, components = package.object(*key)
    parts += [ScenePart(v, f, world_from_object) for v, f in meshes]
    for component in components:
        _collect(package, model, component, world_from_object, (*above, key), parts)


def _transform(text: str | None) -> Array:
    if text is None:
        return np.eye(4)
    values = numbers(text.split())
    if len(values) != 12 or not np.all(np.isfinite(values)):
        raise FormatError("a transform isn't twelve numbers")
    # Four rows of three, for row vectors.
    matrix = np.eye(4)
    matrix[:3] = values.reshape(4, 3).T
    return matrix


def _object(entry: ElementTree.Element) -> _Object:
    meshes = [_mesh(mesh) for mesh in entry.findall(f"{_CORE}mesh")]
    components = entry.findall(f"{_CORE}components/{_CORE}component")
    if not meshes and not components:
        raise FormatError(
            f"its object '{entry.get('id', '')[:20]}' is neither mesh nor components"
        )
    return meshes, components


def _mesh(mesh: ElementTree.Element) -> _Mesh:
    for child in mesh:
        if child.tag.endswith(("beamlattice", "}volumedata")):
            raise FormatError("it stores a beam lattice or volume, which isn't read")
    vertices = _table(mesh, "vertices", "vertex", ("x", "y", "z"))
    faces = _table(mesh, "triangles", "triangle", ("v1", "v2", "v3"))
    return vertices, whole(faces)


def _table(
    mesh: ElementTree.Element, group: str, row: str, keys: Sequence[str]
) -> Array:
    groups = mesh.findall(f"{_CORE}{group}")
    if len(groups) != 1:
        raise FormatError(f"a mesh has {len(groups)} lists of {group}, must have one")
    words: list[str] = []
    for child in groups[0]:
        if child.tag != f"{_CORE}{row}":
            raise FormatError(f"its {group} hold something that isn't a {row}")
        words += [child.get(key, "") for key in keys]
    return numbers(words).reshape(-1, len(keys))
