"""The footprint of a base: the convex hull, in the plane, of the collision shapes that ride on it rigidly."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.robot_model.shape_outline import outline


def footprint(links: Iterable[ET.Element], base_from_link: dict[str, Pose]) -> tuple[tuple[float, float], ...]:
    """Corners (x, y) in the base frame, metres, counter-clockwise, to a tenth of a millimetre."""
    clouds = [np.zeros((0, 2))]
    for link in links:
        pose = base_from_link[link.get("name", "")]
        for collision in link.findall("collision"):
            corners = pose.apply(origin_pose(collision).apply(outline(collision.find("geometry"))))
            clouds.append(corners[:, :2])
    corners = convex_hull(np.concatenate(clouds).round(4))
    return tuple((float(x), float(y)) for x, y in corners)


def convex_hull(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners (M, 2) of the convex hull of points (N, 2), counter-clockwise, none on an edge (A. Andrew, 1979)."""
    ordered = np.unique(points, axis=0)
    if len(ordered) < 3:
        return ordered
    chains = []
    for chain_points in (ordered, ordered[::-1]):
        chain: list[NDArray[np.float64]] = []
        for point in chain_points:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 1e-6:
                chain.pop()
            chain.append(point)
        chains += chain[:-1]
    return np.array(chains)


def _turn(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> float:
    return float((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]))


def origin_pose(element: ET.Element) -> Pose:
    """The pose that an element's ``<origin>`` gives."""
    origin = element.find("origin")
    if origin is None:
        return Pose()
    xyz, rpy = (np.array(origin.get(key, "0 0 0").split(), dtype=float) for key in ("xyz", "rpy"))
    return Pose.from_xyz_rpy(xyz, rpy)
