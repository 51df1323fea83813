"""Closed forms of eqs. (9)-(10) on walls, edges, spheres and cylinders."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class RingLimit:
    """Cameras on a ring about a round body.

    Attributes:
        half_angle: eta, azimuth that a camera covers on either side of itself [rad].
        n_min: Fewest cameras that cover the whole turn, floor(pi / eta) + 1.
        d_max: Largest baseline of neighbours, 2 S sin(eta) [m].
    """

    half_angle: float
    n_min: int
    d_max: float


def ring_limit(half_angle: float, ring_radius: float) -> RingLimit:
    """Return the limits of cameras that cover eta [rad] to either side."""
    n_min = int(np.floor(np.pi / half_angle + 1e-9)) + 1
    return RingLimit(half_angle, n_min, float(2.0 * ring_radius * np.sin(half_angle)))


def covered_azimuth(
    radius: float,
    ring_radius: float,
    max_incidence: float,
    half_field: float | None = None,
) -> float:
    """Return eta, to which a camera that faces the centre of a disc covers it [rad].

    It covers the section of a cylinder likewise, to either side of itself.

    ::

        eta = min(theta - asin(rho/S sin theta), asin(S/rho sin alpha) - alpha)

    The second only if sin(alpha) < rho/S: else the whole body is in the field.

    Args:
        radius: rho in [m], less than S.
        ring_radius: S, of the camera centres about the body's centre, in [m].
        max_incidence: theta in [rad].
        half_field: alpha in [rad]; None: no limit.
    """
    ratio = radius / ring_radius
    eta = max_incidence - np.arcsin(ratio * np.sin(max_incidence))
    if half_field is not None and np.sin(half_field) < ratio:
        eta = min(eta, np.arcsin(np.sin(half_field) / ratio) - half_field)
    return float(eta)


def round_body_limit(
    radius: float,
    ring_radius: float,
    max_incidence: float,
    half_field: float | None = None,
) -> RingLimit:
    """Return the limits for a disc or cylinder section, cameras facing its centre."""
    eta = covered_azimuth(radius, ring_radius, max_incidence, half_field)
    return ring_limit(eta, ring_radius)


def flat_limit(half_extent1: float, half_extent2: float) -> float:
    """Return d'_max = C1 + C2 of a flat wall, axes square to it, field-limited [m]."""
    return half_extent1 + half_extent2


def bent_limit(
    standoff1: float,
    half_extent1: float,
    standoff2: float,
    half_extent2: float,
    turn: float,
) -> float:
    """Return d_max over an edge, each axis square to its own plane, field-limited.

    ::

        d_max^2 = s1^2 + C1^2 + s2^2 + C2^2
                  - 2 [(s1 s2 - C1 C2) cos(turn) - (C1 s2 + C2 s1) sin(turn)]

    Args:
        standoff1: s1, the paper's d_1, in [m].
        half_extent1: C1 = s1 tan(b_1) in [m].
        standoff2: s2 in [m].
        half_extent2: C2 in [m].
        turn: Angle between the planes' normals, convex positive [rad].
    """
    s1, c1, s2, c2 = standoff1, half_extent1, standoff2, half_extent2
    mixed = (s1 * s2 - c1 * c2) * np.cos(turn) - (c1 * s2 + c2 * s1) * np.sin(turn)
    return float(np.sqrt(s1**2 + c1**2 + s2**2 + c2**2 - 2.0 * mixed))


def sphere_band_limit(
    radius: float,
    ring_radius: float,
    max_incidence: float,
    latitude: float,
    half_field: float | None = None,
) -> RingLimit:
    """Return the limits for the band within a latitude of a sphere's equator.

    ::

        cos(eta_l) = cos(eta) / cos(latitude)
    """
    cap = round_body_limit(radius, ring_radius, max_incidence, half_field).half_angle
    cosine = np.cos(cap) / np.cos(latitude)
    return ring_limit(float(np.arccos(cosine)), ring_radius)


def cylinder_limit(
    radius: float, ring_radius: float, max_incidence: float, half_height: float
) -> RingLimit:
    """Return the limits for an upright cylinder, cameras at its mid height.

    ::

        cos(eta) = [rho sin^2 theta
                    + cos theta sqrt(S^2 - rho^2 sin^2 theta + z^2)] / S
    """
    s2 = np.sin(max_incidence) ** 2
    root = np.sqrt(ring_radius**2 - radius**2 * s2 + half_height**2)
    cosine = (radius * s2 + np.cos(max_incidence) * root) / ring_radius
    return ring_limit(float(np.arccos(cosine)), ring_radius)
