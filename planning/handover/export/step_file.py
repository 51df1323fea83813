"""STEP (AP214): housings as solids, frusta and frames, for CAD."""

from collections.abc import Iterable, Sequence

import numpy as np

from geometry.arrays import Array
from geometry.shapes.boxes import OrientedBox

from .exported_rig import BOX_QUADS, Content, ExportedDevice, ExportedRig

_SCHEMA = "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }"
# Length of a frame's drawn axes [mm].
_ARROW_MM = 50.0


class StepFile:
    """`rig.step`."""

    name = "step"
    what = "STEP AP214"
    notes = (
        "rig.step: millimetres. A part a device: its housing as a solid, and as "
        "curves its frustum (down to the depth of the object's centre) and the "
        "axes, 50 mm long, of its mount, or of its optical centre where the rig "
        "file gives no mount (x right, y down, z ahead). The object isn't in it: "
        "CAD has it already, as a mesh it would be thousands of faces."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return nothing: optics are no matter of CAD."""
        return []

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return `rig.step`."""
        step = _Step()
        for device in rig.devices:
            step.part(device)
        return {"rig.step": step.text(rig.plan.digest).encode("ascii")}


class _Step:
    """A file under construction: numbered entities."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        length = self._added("(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.))")
        angle = self._added("(NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.))")
        solid = self._added("(NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT())")
        exact = self._added(
            f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-6),{length},"
            f"'distance_accuracy_value','')"
        )
        self._context = self._added(
            f"(GEOMETRIC_REPRESENTATION_CONTEXT(3) "
            f"GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({exact})) "
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid})) "
            f"REPRESENTATION_CONTEXT('',''))"
        )
        self._application = self._added(
            "APPLICATION_CONTEXT('core data for automotive mechanical design "
            "processes')"
        )
        self._added(
            f"APPLICATION_PROTOCOL_DEFINITION('international standard',"
            f"'automotive_design',2000,{self._application})"
        )
        self._origin = self._placement("", np.eye(4))

    def part(self, device: ExportedDevice) -> None:
        """Add a device as a part of its own."""
        product = self._product(device.id)
        curves = [self._line(a, b) for a, b in 1e3 * device.frustum_lines]
        pose = device.world_from_mount
        pose = device.world_from_device if pose is None else pose
        origin = 1e3 * pose[:3, 3]
        curves += [
            self._line(origin, origin + _ARROW_MM * pose[:3, axis]) for axis in range(3)
        ]
        frames = [self._placement(f"{device.id} optics", device.world_from_device)]
        if device.world_from_mount is not None:
            frames.append(self._placement(f"{device.id} mount", pose))
        wires = self._added(f"GEOMETRIC_CURVE_SET('{device.id}',({','.join(curves)}))")
        shown = self._added(
            f"GEOMETRICALLY_BOUNDED_WIREFRAME_SHAPE_REPRESENTATION('{device.id} wires',"
            f"({','.join([*frames, wires])}),{self._context})"
        )
        if device.box is not None:
            solid = self._solid(f"{device.id} housing", device.box)
            brep = self._added(
                f"ADVANCED_BREP_SHAPE_REPRESENTATION('{device.id}',"
                f"({self._origin},{solid}),{self._context})"
            )
            self._added(f"SHAPE_REPRESENTATION_RELATIONSHIP('','',{brep},{shown})")
            shown = brep
        self._added(f"SHAPE_DEFINITION_REPRESENTATION({product},{shown})")

    def text(self, digest: str) -> str:
        """Return the file."""
        return "\n".join(
            [
                "ISO-10303-21;",
                "HEADER;",
                f"FILE_DESCRIPTION(('housings and frames of plan {digest}'),'2;1');",
                "FILE_NAME('rig.step','',(''),(''),'ringrig','ringrig','');",
                f"FILE_SCHEMA(('{_SCHEMA}'));",
                "ENDSEC;",
                "DATA;",
                *self._lines,
                "ENDSEC;",
                "END-ISO-10303-21;",
                "",
            ]
        )

    def _product(self, name: str) -> str:
        """Return the shape of a new part."""
        context = self._added(f"PRODUCT_CONTEXT('',{self._application},'mechanical')")
        product = self._added(f"PRODUCT('{name}','{name}','',({context}))")
        self._added(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({product}))")
        version = self._added(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
        stage = self._added(
            f"PRODUCT_DEFINITION_CONTEXT('part definition',{self._application},"
            f"'design')"
        )
        definition = self._added(f"PRODUCT_DEFINITION('design','',{version},{stage})")
        return self._added(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")

    def _solid(self, name: str, box: OrientedBox) -> str:
        """Return a box as a solid: every edge once, in the sense of its first face."""
        corners = 1e3 * box.corners
        vertices = [self._added(f"VERTEX_POINT('',{self._point(p)})") for p in corners]
        edges: dict[tuple[int, int], str] = {}
        faces: list[str] = []
        for quad in BOX_QUADS:
            sides: list[str] = []
            for a, b in zip(quad, (*quad[1:], quad[0]), strict=True):
                sense = ".F." if (b, a) in edges else ".T."
                if sense == ".T.":
                    line = self._ray(corners[a], corners[b])
                    ends = f"{vertices[a]},{vertices[b]}"
                    edges[a, b] = self._added(f"EDGE_CURVE('',{ends},{line},.T.)")
                edge = edges[(a, b) if sense == ".T." else (b, a)]
                sides.append(self._added(f"ORIENTED_EDGE('',*,*,{edge},{sense})"))
            loop = self._added(f"EDGE_LOOP('',({','.join(sides)}))")
            bound = self._added(f"FACE_OUTER_BOUND('',{loop},.T.)")
            plane = self._added(f"PLANE('',{self._across(corners[list(quad)])})")
            faces.append(self._added(f"ADVANCED_FACE('',({bound}),{plane},.T.)"))
        shell = self._added(f"CLOSED_SHELL('',({','.join(faces)}))")
        return self._added(f"MANIFOLD_SOLID_BREP('{name}',{shell})")

    def _across(self, quad: Array) -> str:
        """Return the placement of a face: z outwards, x along its first side."""
        along, up = quad[1] - quad[0], quad[3] - quad[0]
        x, y = along / np.linalg.norm(along), up / np.linalg.norm(up)
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([x, y, np.cross(x, y)])
        pose[:3, 3] = 1e-3 * quad[0]
        return self._placement("", pose)

    def _placement(self, name: str, pose: Array) -> str:
        place = self._point(1e3 * pose[:3, 3])
        z, x = (self._direction(pose[:3, axis]) for axis in (2, 0))
        return self._added(f"AXIS2_PLACEMENT_3D('{name}',{place},{z},{x})")

    def _line(self, start: Array, end: Array) -> str:
        points = ",".join(self._point(point) for point in (start, end))
        return self._added(f"POLYLINE('',({points}))")

    def _ray(self, start: Array, end: Array) -> str:
        length = float(np.linalg.norm(end - start))
        way = self._direction((end - start) / length)
        vector = self._added(f"VECTOR('',{way},{_real(length)})")
        return self._added(f"LINE('',{self._point(start)},{vector})")

    def _point(self, point: Array) -> str:
        return self._added(f"CARTESIAN_POINT('',{_triple(point)})")

    def _direction(self, way: Array) -> str:
        return self._added(f"DIRECTION('',{_triple(way)})")

    def _added(self, entity: str) -> str:
        self._lines.append(f"#{len(self._lines) + 1}={entity};")
        return f"#{len(self._lines)}"


def _triple(values: Sequence[float] | Iterable[float]) -> str:
    return f"({','.join(_real(value) for value in values)})"


def _real(value: float) -> str:
    # STEP's reals have a point, and a capital E.
    text = repr(float(value) + 0.0).upper()
    mantissa, e, exponent = text.partition("E")
    return (mantissa if "." in mantissa else f"{mantissa}.") + e + exponent
