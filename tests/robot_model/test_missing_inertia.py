"""Links get a mass and an inertia that a body can have."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from bestman_bt.messages import Box
from bestman_bt.robot_model.placed_part import DENSITY, complete_inertial
from bestman_bt.robot_model.urdf_elements import box_inertial, shape

SIZE = (0.2, 0.1, 0.4)


def bare_link(*children: ET.Element) -> ET.Element:
    link = ET.Element("link", name="link")
    link.extend(children)
    return link


def moments(link: ET.Element) -> np.ndarray:
    inertia = link.find("inertial/inertia")
    entries = {key: float(inertia.get(key)) for key in inertia.attrib}
    matrix = [
        [entries["ixx"], entries["ixy"], entries["ixz"]],
        [entries["ixy"], entries["iyy"], entries["iyz"]],
        [entries["ixz"], entries["iyz"], entries["izz"]],
    ]
    return np.linalg.eigvalsh(matrix)


def mass(link: ET.Element) -> float:
    return float(link.find("inertial/mass").get("value"))


def expected(weight: float) -> list[float]:
    x, y, z = SIZE
    return sorted(weight / 12 * (a * a + b * b) for a, b in ((y, z), (x, z), (x, y)))


def test_a_link_that_says_nothing_weighs_as_its_shape() -> None:
    link = bare_link(shape("collision", Box(SIZE), (0.1, 0.0, 0.0)))
    complete_inertial(link)
    assert mass(link) == pytest.approx(DENSITY * np.prod(SIZE))
    np.testing.assert_allclose(moments(link), expected(mass(link)), rtol=1e-6)
    assert link.find("inertial/origin").get("xyz").split()[0] == "0.1"


def test_a_mass_that_is_given_spreads_over_the_shape() -> None:
    link = bare_link(shape("collision", Box(SIZE)))
    complete_inertial(link, 3.0)
    assert mass(link) == 3.0
    np.testing.assert_allclose(moments(link), expected(3.0), rtol=1e-6)


def test_what_the_source_says_stays() -> None:
    link = bare_link(box_inertial(2.0, SIZE), shape("collision", Box(SIZE)))
    before = ET.tostring(link)
    complete_inertial(link)
    assert ET.tostring(link) == before


def test_moments_that_no_body_can_have_are_mended_and_no_more() -> None:
    link = bare_link(box_inertial(2.0, SIZE))
    link.find("inertial/inertia").attrib.update({"ixx": "0.001", "iyy": "0.005", "izz": "0.02"})
    complete_inertial(link)
    low, middle, high = moments(link)
    assert (low, high) == pytest.approx((0.005, 0.02))
    assert low + middle >= high
    assert middle == pytest.approx(0.015, rel=0.01)  # it was 0.001


def test_a_frame_without_a_shape_is_next_to_nothing() -> None:
    link = bare_link()
    complete_inertial(link)
    assert 0.0 < mass(link) <= 0.001
