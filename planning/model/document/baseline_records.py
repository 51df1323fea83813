"""`baselines`: eqs. (9)-(10) for each order of each two neighbouring cameras."""

from .part import Part, Vector3


class BaselineRow(Part):
    """The tightest seam point of a pair; lengths in [m], angles in [rad].

    `docs/method/baselines.md` defines every key; the last three are known only where
    ranges were estimated (`docs/use/ranges.md`).
    """

    cameras: tuple[str, str]
    E: Vector3
    standoff1: float
    standoff2: float
    C1: float
    C2: float
    D1: float
    D2: float
    phi: float
    phi_max: float
    d: float
    d_lateral: float
    d_axial: float
    d_max: float | None
    slack: float
    covered: bool
    limit: str
    beta: tuple[float, float]
    iota: tuple[float, float]
    half_field: tuple[float, float]
    max_incidence: float
    delta_axes: float
    delta_surface: float
    normals: tuple[Vector3, Vector3]
    onward: Vector3
    shares_border: bool
    n_seam: int
    d_max_stated: float | None = None
    d_max_sigma: float | None = None
    covered_at_2_sigma: bool | None = None
