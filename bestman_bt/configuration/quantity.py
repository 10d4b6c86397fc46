"""Quantities in configurations: text with a unit such as ``5 cm``, ``47 deg``, ``3 kg``, or plain SI numbers.

Limits, rates of sensors, accelerations and jerks, which only robots have, need their unit, unless they are 0.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError

_DEGREE = math.pi / 180
_UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "cm": 0.01, "mm": 0.001},
    "area": {"m²": 1.0, "m^2": 1.0},
    "angle": {"rad": 1.0, "deg": _DEGREE, "°": _DEGREE},
    "mass": {"kg": 1.0, "g": 0.001},
    "time": {"s": 1.0, "ms": 0.001, "min": 60.0},
    "frequency": {"Hz": 1.0, "kHz": 1000.0},
    "speed": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001},
    "angular speed": {"rad/s": 1.0, "deg/s": _DEGREE},
    "acceleration": {"m/s^2": 1.0, "m/s²": 1.0},
    "angular acceleration": {"rad/s^2": 1.0, "rad/s²": 1.0, "deg/s^2": _DEGREE, "deg/s²": _DEGREE},
    "jerk": {"m/s^3": 1.0, "m/s³": 1.0},
    "angular jerk": {"rad/s^3": 1.0, "rad/s³": 1.0, "deg/s^3": _DEGREE, "deg/s³": _DEGREE},
    "force": {"N": 1.0, "kN": 1000.0},
    "torque": {"N m": 1.0, "Nm": 1.0, "N·m": 1.0},
    "inertia": {"kg m²": 1.0, "kg m^2": 1.0},
    "stiffness": {"N/m": 1.0},
    "damping": {"N s/m": 1.0},
    "energy": {"J": 1.0, "Wh": 3600.0, "kWh": 3.6e6},
    "power": {"W": 1.0, "kW": 1000.0},
    "voltage": {"V": 1.0, "mV": 0.001},
    "resistance": {"ohm": 1.0, "Ω": 1.0, "mohm": 0.001, "mΩ": 0.001},
}
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def parse_quantity(value: object, *dimensions: str, needs_unit: bool = False) -> float:
    """Return ``value``, a number or text with a unit of one of the ``dimensions``, in SI units. Without dimensions: a
    plain number.

    ``needs_unit``: only 0 is accepted without a unit. Raises PydanticCustomError (a ValueError) that lists the accepted
    units.
    """
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            return _without_unit(float(value), value, dimensions if needs_unit else ())
        except OverflowError as error:
            raise _error(f"expected a number below 1e308, got one of {len(str(abs(int(value))))} digits") from error
    expected = " or ".join(
        f"{'an' if d[0] in 'aeiou' else 'a'} {d} in {next(iter(_UNITS[d]))} ({', '.join(_UNITS[d])})"
        for d in dimensions
    )
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        raise _error(f"expected {expected or 'a number'}, got {value!r}")
    number, unit = float(match[1]), match[2]
    if not unit:
        return _without_unit(number, value, dimensions if needs_unit else ())
    for dimension in dimensions:
        if unit in _UNITS[dimension]:
            return _finite(number * _UNITS[dimension][unit], value)
    other = next((dimension for dimension, units in _UNITS.items() if unit in units), None)
    reason = f"{unit!r} is a unit of {other}" if other else f"unknown unit {unit!r}"
    raise _error(f"expected {expected or 'a number without a unit'}, got {value!r}: {reason}")


def _without_unit(number: float, value: object, owed: tuple[str, ...]) -> float:
    """Convert a number without unit. ``owed``: the dimensions of which a unit is required."""
    if _finite(number, value) and owed:
        units = list({_UNITS[owed[0]][unit]: unit for unit in reversed(_UNITS[owed[0]])}.values())[::-1]
        units = units[:2] + [next(iter(_UNITS[dimension])) for dimension in owed[1:]]
        forms = " or ".join(f"'{str(value).strip()} {unit}'" for unit in units)
        raise _error(f"needs its unit: {forms}, got {value!r}", "unit")
    return number


def _finite(number: float, value: object) -> float:
    if not math.isfinite(number):
        raise _error(f"expected a finite number, got {value!r}")
    return number


def _error(message: str, kind: Literal["quantity", "unit"] = "quantity") -> PydanticCustomError:
    return PydanticCustomError(kind, "{text}", {"text": message})


def _reader(*dimensions: str, needs_unit: bool = False) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        return parse_quantity(value, *dimensions, needs_unit=needs_unit)

    return read


def _limit(*dimensions: str) -> Callable[[Any], float]:
    return _reader(*dimensions, needs_unit=True)


LIMITS = "limits"
"""Pydantic's error type for two limits in the wrong order."""


def _smaller_first(limits: tuple[float, float]) -> tuple[float, float]:
    if limits[0] > limits[1]:
        raise PydanticCustomError(LIMITS, "the smaller limit comes first")
    return limits


SmallerFirst = AfterValidator(_smaller_first)
"""Check that the smaller of two limits comes first: ``Annotated[tuple[Length, Length], SmallerFirst]``."""


def _four_or_five(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) not in (0, 4, 5):
        raise _error(f"should be k1, k2, p1, p2 and optionally k3, or empty, got {len(values)} numbers")
    return values


Number = Annotated[float, BeforeValidator(_reader())]
Length = Annotated[float, BeforeValidator(_reader("length"))]
Angle = Annotated[float, BeforeValidator(_reader("angle"))]
Mass = Annotated[float, Field(gt=0), BeforeValidator(_reader("mass"))]
Time = Annotated[float, Field(ge=0), BeforeValidator(_reader("time"))]
Frequency = Annotated[float, Field(gt=0), BeforeValidator(_reader("frequency"))]
Speed = Annotated[float, Field(ge=0), BeforeValidator(_reader("speed"))]
AngularSpeed = Annotated[float, Field(ge=0), BeforeValidator(_reader("angular speed"))]
Acceleration = Annotated[float, Field(ge=0), BeforeValidator(_limit("acceleration"))]
AccelerationLimit = Annotated[float, Field(gt=0), BeforeValidator(_limit("acceleration"))]
AngularAccelerationLimit = Annotated[float, Field(gt=0), BeforeValidator(_limit("angular acceleration"))]
Force = Annotated[float, Field(ge=0), BeforeValidator(_reader("force"))]
Torque = Annotated[float, Field(ge=0), BeforeValidator(_reader("torque"))]
Inertia = Annotated[float, Field(ge=0), BeforeValidator(_reader("inertia"))]
Stiffness = Annotated[float, Field(ge=0), BeforeValidator(_reader("stiffness"))]
Damping = Annotated[float, Field(ge=0), BeforeValidator(_reader("damping"))]
Energy = Annotated[float, Field(gt=0), BeforeValidator(_reader("energy"))]
Power = Annotated[float, Field(ge=0), BeforeValidator(_reader("power"))]
Voltage = Annotated[float, Field(ge=0), BeforeValidator(_reader("voltage"))]
Resistance = Annotated[float, Field(ge=0), BeforeValidator(_reader("resistance"))]
JointPosition = Annotated[float, BeforeValidator(_reader("angle", "length"))]
JointTolerance = Annotated[float, Field(gt=0), BeforeValidator(_limit("angle", "length"))]
JointSpeed = Annotated[float, Field(gt=0), BeforeValidator(_limit("angular speed", "speed"))]
Spread = Annotated[float, Field(ge=0), BeforeValidator(_reader("angle", "length"))]
SpreadOfSpeed = Annotated[float, Field(ge=0), BeforeValidator(_reader("angular speed", "speed"))]
Jerk = Annotated[float, Field(gt=0), BeforeValidator(_limit("jerk"))]
AngularJerk = Annotated[float, Field(gt=0), BeforeValidator(_limit("angular jerk"))]
JointAcceleration = Annotated[float, Field(gt=0), BeforeValidator(_limit("angular acceleration", "acceleration"))]
JointEffort = Annotated[float, Field(gt=0), BeforeValidator(_reader("torque", "force"))]
LatchEffort = Annotated[float, Field(ge=0), BeforeValidator(_reader("torque", "force"))]
PositiveLength = Annotated[float, Field(gt=0), BeforeValidator(_reader("length"))]
PositiveAngle = Annotated[float, Field(gt=0), BeforeValidator(_reader("angle"))]
PositiveTime = Annotated[float, Field(gt=0), BeforeValidator(_reader("time"))]
LengthLimit = Annotated[float, BeforeValidator(_limit("length"))]
PositiveLengthLimit = Annotated[float, Field(gt=0), BeforeValidator(_limit("length"))]
AngleLimit = Annotated[float, BeforeValidator(_limit("angle"))]
MassLimit = Annotated[float, Field(gt=0), BeforeValidator(_limit("mass"))]
TimeLimit = Annotated[float, Field(gt=0), BeforeValidator(_limit("time"))]
SpeedLimit = Annotated[float, Field(gt=0), BeforeValidator(_limit("speed"))]
AngularSpeedLimit = Annotated[float, Field(gt=0), BeforeValidator(_limit("angular speed"))]
SpeedLimitOrNone = Annotated[float, Field(ge=0), BeforeValidator(_limit("speed"))]
"""Limit of a direction; 0 if the part cannot move in it; the same for the next one."""
AngularSpeedLimitOrNone = Annotated[float, Field(ge=0), BeforeValidator(_limit("angular speed"))]
ForceLimit = Annotated[float, Field(gt=0), BeforeValidator(_limit("force"))]
TorqueLimit = Annotated[float, Field(ge=0), BeforeValidator(_limit("torque"))]
Rate = Annotated[float, Field(gt=0), BeforeValidator(_limit("frequency"))]
JointLimit = Annotated[float, BeforeValidator(_limit("angle", "length"))]
EffortLimit = Annotated[float, Field(gt=0), BeforeValidator(_limit("torque", "force"))]
Distance = Annotated[float, Field(ge=0), BeforeValidator(_reader("length"))]
Factor = Annotated[float, Field(gt=0), BeforeValidator(_reader())]
Area = Annotated[float, Field(gt=0), BeforeValidator(_reader("area"))]
Share = Annotated[float, Field(ge=0, le=1), BeforeValidator(_reader())]
PositiveShare = Annotated[float, Field(gt=0, le=1), BeforeValidator(_reader())]
Friction = Annotated[float, Field(ge=0), BeforeValidator(_reader())]
WholeNumber = Annotated[int, Field(strict=True, ge=0)]
PositiveWholeNumber = Annotated[int, Field(strict=True, gt=0)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**62)]
"""A seed; the seeds of further episodes, counted from it, also fit into 64 bits."""

Lengths3 = tuple[Length, Length, Length]
Angles3 = tuple[Angle, Angle, Angle]
Size3 = tuple[PositiveLength, PositiveLength, PositiveLength]
Size2 = tuple[PositiveLength, PositiveLength]
Color = tuple[Share, Share, Share]
LensDistortion = Annotated[tuple[Number, ...], AfterValidator(_four_or_five)]
