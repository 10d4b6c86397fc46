"""Fields of parameters say what they may be, and are told where two do not fit together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import pytest

from bestman_bt.configuration.checked import check
from bestman_bt.configuration.document import parse_document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.messages import JointTrajectory
from bestman_bt.messages.shapes import (
    Count,
    Fraction,
    NonNegative,
    NonNegativeInt,
    NotBelow,
    OrderError,
    Positive,
    PositiveFraction,
    Several,
    check_bounds,
)


@dataclass(frozen=True)
class Turning:
    slow: Positive = 0.1
    fast: Annotated[Positive, NotBelow("slow")] = 1.0

    def __post_init__(self) -> None:
        check_bounds(self)


@dataclass(frozen=True)
class Drive:
    speed: Positive = 0.5
    margin: NonNegative = 0.0
    share: Fraction = 0.5
    rate: PositiveFraction = 0.5
    seed: NonNegativeInt = 0
    steps: Count = 10
    knots: Several = 2
    height: float = 0.0
    turning: Turning = field(default_factory=Turning)


def faults(text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as error:
        check(parse_document(text, "drive.yaml"), Drive)
    return [str(problem) for problem in error.value.problems]


def test_values_at_their_limits_are_taken() -> None:
    text = "{speed: 1e-9, margin: 0, share: 1, rate: 1, seed: 0, steps: 1, knots: 2, turning: {slow: 1, fast: 1}}"
    assert check(parse_document(text, "drive.yaml"), Drive).turning == Turning(1.0, 1.0)


@pytest.mark.parametrize(
    ("value", "fault"),
    [
        ("speed: 0", "speed: should be greater than 0, got 0"),
        ("speed: 50 cm/s", "speed: should be a number without a unit (SI: metres, seconds, radians), got '50 cm/s'"),
        ("margin: -0.01", "margin: should be greater than or equal to 0, got -0.01"),
        ("share: 1.01", "share: should be less than or equal to 1, got 1.01"),
        ("rate: 0", "rate: should be greater than 0, got 0"),
        ("seed: -1", "seed: should be greater than or equal to 0, got -1"),
        ("steps: 0", "steps: should be greater than or equal to 1, got 0"),
        ("steps: 2.5", "steps: should be a whole number, got 2.5"),
        ("knots: 1", "knots: should be greater than or equal to 2, got 1"),
        ("height: .nan", "height: should be a finite number, got nan"),
        ("height: nan", "height: should be a finite number, got 'nan'"),
        ("speed: -.inf", "speed: should be a finite number, got -inf"),
        ("turning: {slow: 2}", "turning.slow: slow (2) should not be larger than fast (1)"),
        ("turning: {fast: 0.05}", "turning.fast: slow (0.1) should not be larger than fast (0.05)"),
    ],
)
def test_what_lies_outside_is_refused_with_its_line(value: str, fault: str) -> None:
    assert faults(f"\n{value}\n") == [f"drive.yaml:2: {fault}"]


def test_all_faults_are_told_at_once() -> None:
    assert len(faults("{speed: -1, steps: 0, height: .inf, turning: {slow: 5}}")) == 4


def test_two_fields_that_do_not_fit_are_no_parameters_in_python_either() -> None:
    with pytest.raises(OrderError, match="should not be larger than fast"):
        Turning(slow=2.0)


@pytest.mark.parametrize("field", ["times", "positions", "velocities"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_trajectory_of_what_is_no_finite_number_is_none(field: str, value: float) -> None:
    samples = {"times": np.array([0.0, 1.0]), "positions": np.zeros((2, 1)), "velocities": np.zeros((2, 1))}
    samples[field][-1] = value
    with pytest.raises(ValueError, match=r"finite|rise strictly"):
        JointTrajectory(("a",), **samples)
