"""Quantities with units become SI numbers; wrong units are refused by name."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from bestman_bt.configuration import quantity
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


@settings(deadline=None, derandomize=True)
@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_millimetres_are_thousandths_of_metres(number: float) -> None:
    assert parse_quantity(f"{number} mm", "length") == pytest.approx(number * 0.001)


UNITS = {
    "length": "m 1, cm 1e-2, mm 1e-3",
    "area": "m² 1, m^2 1",
    "angle": "rad 1, deg 0.017453292519943295, ° 0.017453292519943295",
    "mass": "kg 1, g 1e-3",
    "time": "s 1, ms 1e-3, min 60",
    "frequency": "Hz 1, kHz 1e3",
    "speed": "m/s 1, cm/s 1e-2, mm/s 1e-3",
    "angular speed": "rad/s 1, deg/s 0.017453292519943295",
    "acceleration": "m/s^2 1, m/s² 1",
    "angular acceleration": "rad/s^2 1, rad/s² 1, deg/s^2 0.017453292519943295, deg/s² 0.017453292519943295",
    "jerk": "m/s^3 1, m/s³ 1",
    "angular jerk": "rad/s^3 1, rad/s³ 1, deg/s^3 0.017453292519943295, deg/s³ 0.017453292519943295",
    "force": "N 1, kN 1e3",
    "torque": "N m 1, Nm 1, N·m 1",
    "inertia": "kg m² 1, kg m^2 1",
    "stiffness": "N/m 1",
    "damping": "N s/m 1",
    "energy": "J 1, Wh 3600, kWh 3600000",
    "power": "W 1, kW 1e3",
    "voltage": "V 1, mV 1e-3",
    "resistance": "ohm 1, Ω 1, mohm 1e-3, mΩ 1e-3",
}


@pytest.mark.parametrize("dimension", UNITS)
def test_every_unit_is_worth_what_the_si_says(dimension: str) -> None:
    units = dict(entry.rsplit(" ", 1) for entry in UNITS[dimension].split(", "))
    for unit, factor in units.items():
        assert parse_quantity(f"-2.5 {unit}", dimension) == pytest.approx(-2.5 * float(factor), rel=1e-12)
        assert parse_quantity(f"4{unit}", "mass", dimension) == pytest.approx(4 * float(factor), rel=1e-12)
    with pytest.raises(ValueError, match="got '1 furlong'") as error:
        parse_quantity("1 furlong", dimension)
    assert f"({', '.join(units)})" in str(error.value)


@pytest.mark.parametrize(
    ("name", "at_least", "unit"),
    [
        ("Mass", ">0", "kg"),
        ("Time", ">=0", "s"),
        ("PositiveTime", ">0", "s"),
        ("Frequency", ">0", "Hz"),
        ("Speed", ">=0", "m/s"),
        ("AngularSpeed", ">=0", "rad/s"),
        ("Acceleration", ">=0", "m/s²"),
        ("AccelerationLimit", ">0", "m/s²"),
        ("AngularAccelerationLimit", ">0", "rad/s²"),
        ("SpeedLimit", ">0", "m/s"),
        ("AngularSpeedLimit", ">0", "rad/s"),
        ("SpeedLimitOrNone", ">=0", "m/s"),
        ("AngularSpeedLimitOrNone", ">=0", "rad/s"),
        ("ForceLimit", ">0", "N"),
        ("Force", ">=0", "N"),
        ("Torque", ">=0", "N m"),
        ("JointSpeed", ">0", "rad/s"),
        ("JointSpeed", ">0", "m/s"),
        ("JointAcceleration", ">0", "m/s²"),
        ("JointAcceleration", ">0", "rad/s²"),
        ("JointEffort", ">0", "N m"),
        ("JointEffort", ">0", "N"),
        ("LatchEffort", ">=0", "N"),
        ("Jerk", ">0", "m/s³"),
        ("AngularJerk", ">0", "rad/s³"),
        ("PositiveLength", ">0", "m"),
        ("PositiveAngle", ">0", "rad"),
        ("Distance", ">=0", "m"),
        ("Spread", ">=0", "m"),
        ("SpreadOfSpeed", ">=0", "m/s"),
        ("Energy", ">0", "J"),
        ("Power", ">=0", "W"),
        ("Voltage", ">=0", "V"),
        ("Resistance", ">=0", "ohm"),
        ("Stiffness", ">=0", "N/m"),
        ("Damping", ">=0", "N s/m"),
        ("Inertia", ">=0", "kg m²"),
        ("Area", ">0", "m²"),
        ("Factor", ">0", ""),
        ("Friction", ">=0", ""),
        ("Length", "", "m"),
        ("Angle", "", "rad"),
        ("JointPosition", "", "m"),
        ("JointPosition", "", "rad"),
        ("Number", "", ""),
    ],
)
def test_a_quantity_is_taken_down_to_its_bound(name: str, at_least: str, unit: str) -> None:
    adapter = TypeAdapter(getattr(quantity, name))
    assert adapter.validate_python(f"1e-9 {unit}") == 1e-9
    for value, taken in (("0", at_least != ">0"), ("-1e-9", not at_least)):
        if taken:
            assert adapter.validate_python(f"{value} {unit}") == float(value)
        else:
            with pytest.raises(ValidationError):
                adapter.validate_python(f"{value} {unit}")


@pytest.mark.parametrize(("name", "lowest"), [("Share", 0.0), ("PositiveShare", 1e-9)])
def test_a_share_is_at_most_one(name: str, lowest: float) -> None:
    adapter = TypeAdapter(getattr(quantity, name))
    assert [adapter.validate_python(value) for value in (lowest, 1)] == [lowest, 1.0]
    for value in (1.0 + 1e-9, lowest - 1e-8):
        with pytest.raises(ValidationError):
            adapter.validate_python(value)


@pytest.mark.parametrize(("count", "taken"), [(0, True), (3, False), (4, True), (5, True), (6, False)])
def test_a_lens_has_four_or_five_coefficients_or_none(count: int, taken: bool) -> None:
    adapter = TypeAdapter(quantity.LensDistortion)
    values = [0.1 * i for i in range(count)]
    if taken:
        assert adapter.validate_python(values) == tuple(values)
    else:
        with pytest.raises(ValidationError, match=f"got {count} numbers"):
            adapter.validate_python(values)
