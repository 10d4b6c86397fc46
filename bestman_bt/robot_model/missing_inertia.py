"""Masses and inertias that the source of a part leaves out, from the shapes of its links."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.footprint import origin_pose
from bestman_bt.robot_model.shape_outline import outline
from bestman_bt.robot_model.urdf_elements import TINY_INERTIA, numbers, origin, tiny_inertial

DENSITY = 1000.0
"""kg/m³, of the convex hull of a link whose mass nobody tells: castings with motors in them weigh about as much."""

_ENTRIES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def complete_inertial(link: ET.Element, mass: float | None = None) -> None:
    """Give a link a mass and an inertia that are both positive.

    ``mass``: kilograms, takes the place of the source's. What the source says stays, moments that no body can have are
    mended. Where it says nothing, the link is
    taken as its homogeneous convex hull, of ``DENSITY`` if its mass is unknown, too; a link without a collision shape
    is a mere frame and gets a tiny mass.
    """
    inertial = link.find("inertial")
    known = _mass(inertial)
    if inertial is not None and known is not None and mass is None and _make_possible(inertial):
        return
    if inertial is not None:
        link.remove(inertial)
    corners = _corners(link)
    if len(corners) < 4:
        link.append(tiny_inertial() if mass is None and known is None else _point(mass or known or 0.0))
        return
    volume, centre, unit = _hull_properties(corners.tobytes())
    weight = mass or known or DENSITY * volume
    link.append(_inertial(weight, unit * (weight / volume), centre))


def add_rotor_inertia(link: ET.Element, inertia: float) -> None:
    """Add what the rotor of a geared drive weighs about the joint that it turns, kg m²: its inertia × reduction²."""
    element = link.find("inertial/inertia")
    if element is not None:
        for key in ("ixx", "iyy", "izz"):
            element.set(key, f"{float(element.get(key, '0')) + inertia:.9g}")


def _mass(inertial: ET.Element | None) -> float | None:
    element = None if inertial is None else inertial.find("mass")
    value = 0.0 if element is None else float(element.get("value", "0"))
    return value if value > 0.0 else None


def _make_possible(inertial: ET.Element) -> bool:
    """Whether the principal moments are positive; the smallest is raised to what the sum of two owes the third.

    Simulators take moments that violate this as zero, and the link then spins freely about that axis.
    """
    element = inertial.find("inertia")
    if element is None:
        return False
    ixx, ixy, ixz, iyy, iyz, izz = (float(element.get(key, "0")) for key in _ENTRIES)
    moments, axes = np.linalg.eigh([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    if moments[0] <= 0.0:
        return False
    owed = 1.001 * (moments[2] - moments[1])
    if moments[0] < owed:
        _write_inertia(element, axes @ np.diag([owed, moments[1], moments[2]]) @ axes.T)
    return True


def _corners(link: ET.Element) -> NDArray[np.float64]:
    clouds = [np.zeros((0, 3))]
    clouds.extend(
        origin_pose(collision).apply(outline(collision.find("geometry"))) for collision in link.findall("collision")
    )
    return np.concatenate(clouds)


@lru_cache(maxsize=256)
def _hull_properties(corners: bytes) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Volume, centre (3,) and inertia (3, 3) at unit density of the hull of points."""
    from trimesh.convex import convex_hull

    hull = convex_hull(np.frombuffer(corners).reshape(-1, 3))
    return float(hull.volume), np.array(hull.center_mass), np.array(hull.moment_inertia)


def _inertial(mass: float, inertia: NDArray[np.float64], centre: NDArray[np.float64]) -> ET.Element:
    element = ET.Element("inertial")
    element.append(origin(centre.tolist()))
    ET.SubElement(element, "mass", value=f"{mass:.9g}")
    _write_inertia(ET.SubElement(element, "inertia"), inertia)
    return element


def _write_inertia(element: ET.Element, inertia: NDArray[np.float64]) -> None:
    element.attrib.update({name: numbers([inertia[place]]) for name, place in _ENTRIES.items()})


def _point(mass: float) -> ET.Element:
    moment = max(TINY_INERTIA, mass * 1e-4)  # a ball of 16 mm: something without a shape is small
    return _inertial(mass, np.diag([moment] * 3), np.zeros(3))
