"""Documents become frozen dataclasses, or one error that lists everything that is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import FrozenInstanceError, dataclass, field
from typing import Any, Literal

import pytest

from bestman_bt.configuration import ConfigurationError, check, override, parse_document
from bestman_bt.configuration.quantity import Length, Mass, WholeNumber


@dataclass(frozen=True)
class Wheel:
    radius: Length
    mass: Mass = 1.0


@dataclass(frozen=True)
class Cart:
    wheels: Mapping[str, Wheel]
    kind: Literal["two wheels", "four wheels"] = "two wheels"
    path: tuple[tuple[Length, Length], ...] = ()
    spare: Wheel | None = None
    seats: WholeNumber = 0
    extras: Mapping[str, Any] = field(default_factory=dict)


GOOD = "wheels:\n  left: {radius: 5 cm}\n  right: {radius: 0.06, mass: 2 kg}\npath: [[0, 1 m]]\n"


def faults(text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as error:
        check(parse_document(text, "cart.yaml"), Cart)
    return [str(problem) for problem in error.value.problems]


def test_a_good_document_becomes_a_frozen_value() -> None:
    cart = check(parse_document(GOOD, "cart.yaml"), Cart)
    assert cart.wheels == {"left": Wheel(0.05), "right": Wheel(0.06, 2.0)}
    assert cart.path == ((0.0, 1.0),)
    with pytest.raises(FrozenInstanceError):
        cart.seats = 3  # type: ignore[misc]


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (GOOD + "sets: 3\n", "cart.yaml:5: sets: unknown field; did you mean 'seats'?"),
        (GOOD + "spare: {radus: 1}\n", "cart.yaml:5: spare.radus: unknown field; did you mean 'radius'?"),
        (GOOD + "spare: {mass: 1}\n", "cart.yaml:5: spare.radius: is missing"),
        (GOOD + "spare: 3\n", "cart.yaml:5: spare: should hold fields (name: value), got 3"),
        (GOOD + "kind: car\n", "cart.yaml:5: kind: should be 'two wheels' or 'four wheels', got 'car'"),
        (GOOD + "seats: -1\n", "cart.yaml:5: seats: should be greater than or equal to 0, got -1"),
        (GOOD + "seats: many\n", "cart.yaml:5: seats: should be a whole number, got 'many'"),
        (GOOD.replace("2 kg", "2 m"), "cart.yaml:3: wheels.right.mass: expected a mass in kg (kg, g), got '2 m'"),
        (GOOD.replace("2 kg", "-2 kg"), "cart.yaml:3: wheels.right.mass: should be greater than 0"),
        (GOOD.replace("1 m", "1 s"), "cart.yaml:4: path[0][1]: expected a length in m (m, cm, mm), got '1 s'"),
        ("{}", "cart.yaml:1: wheels: is missing"),
    ],
)
def test_a_fault_is_named_with_file_line_and_field(text: str, fault: str) -> None:
    found = faults(text)
    assert any(entry.startswith(fault) for entry in found), found


def test_all_faults_are_reported_at_once() -> None:
    found = faults("wheels: {left: {radius: 5 s, mas: 1}}\nseats: x\nfoo: 1\n")
    assert [entry.split(": ")[1] for entry in found] == ["wheels.left.mas", "foo", "wheels.left.radius", "seats"]


def test_an_override_sets_a_nested_field() -> None:
    document = parse_document(GOOD, "cart.yaml")
    changed = override(document, Cart, {"wheels.left.mass": "3 kg", "spare.radius": 0.1, "extras.anything.at.all": 1})
    cart = check(changed, Cart)
    assert (cart.wheels["left"], cart.spare) == (Wheel(0.05, 3.0), Wheel(0.1))
    assert cart.extras == {"anything": {"at": {"all": 1}}}
    assert document.data["wheels"]["left"] == {"radius": "5 cm"}


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("seets", "unknown key 'seets'; did you mean 'seats'?"),
        ("wheels.lft.mass", "unknown key 'wheels.lft'; did you mean 'left'?"),
        ("wheels.left.mas", "unknown key 'wheels.left.mas'; did you mean 'wheels.left.mass'?"),
        ("seats.x", "'seats' has no fields"),
        ("spare.radus", "unknown key 'spare.radus'; did you mean 'spare.radius'?"),
    ],
)
def test_an_override_of_an_unknown_key_suggests_the_closest(key: str, message: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        override(parse_document(GOOD, "cart.yaml"), Cart, {key: 1}, prefix="cart.")
    assert str(error.value) == f"--set cart.{key}=1: {message}"


def test_a_wrong_value_of_an_override_is_located_on_the_command_line() -> None:
    changed = override(parse_document(GOOD, "cart.yaml"), Cart, {"seats": "x"})
    with pytest.raises(ConfigurationError, match="--set seats=x: seats: should be a whole number"):
        check(changed, Cart)
