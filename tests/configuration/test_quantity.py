"""Quantities with units become SI numbers; wrong units are refused by name."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bestman_bt.configuration.quantity import parse_quantity


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("5 cm", "length", 0.05),
        ("5cm", "length", 0.05),
        ("-2.5e1 mm", "length", -0.025),
        ("47 deg", "angle", math.radians(47)),
        ("90°", "angle", math.pi / 2),
        ("3 kg", "mass", 3.0),
        ("500 g", "mass", 0.5),
        ("2 min", "time", 120.0),
        ("30 N m", "torque", 30.0),
        ("0.6 m/s²", "acceleration", 0.6),
        ("90 deg/s", "angular speed", math.pi / 2),
        ("1e-3", "length", 0.001),
        (".5", "length", 0.5),
        (7, "length", 7.0),
    ],
)
def test_a_quantity_becomes_its_si_number(text: object, dimension: str, value: float) -> None:
    assert parse_quantity(text, dimension) == pytest.approx(value)


@pytest.mark.parametrize(
    ("value", "dimension", "message"),
    [
        ("3 m", "mass", "expected a mass in kg (kg, g), got '3 m': 'm' is a unit of length"),
        ("3 parsec", "length", "expected a length in m (m, cm, mm), got '3 parsec': unknown unit 'parsec'"),
        ("three", "angle", "expected an angle in rad (rad, deg, °), got 'three'"),
        (True, "length", "expected a length in m (m, cm, mm), got True"),
        ([1], "length", "expected a length in m (m, cm, mm), got [1]"),
        (10**400, "length", "expected a number below 1e308, got one of 401 digits"),
        (float("nan"), "length", "expected a finite number, got nan"),
        ("1e999", "length", "expected a finite number, got '1e999'"),
    ],
)
def test_a_wrong_quantity_is_refused_with_what_would_be_accepted(value: object, dimension: str, message: str) -> None:
    with pytest.raises(ValueError) as error:  # noqa: PT011 (the whole message is compared)
        parse_quantity(value, dimension)
    assert str(error.value) == message


def test_a_plain_number_takes_no_unit() -> None:
    with pytest.raises(ValueError, match="expected a number without a unit, got '3 m'"):
        parse_quantity("3 m")


@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_millimetres_are_thousandths_of_metres(number: float) -> None:
    assert parse_quantity(f"{number} mm", "length") == pytest.approx(number * 0.001)
