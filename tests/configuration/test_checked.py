"""Documents become frozen dataclasses, or one error that lists everything that is wrong."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import FrozenInstanceError, dataclass, field
from typing import Annotated, Any, Literal

import pytest

from bestman_bt.configuration.checked import check, is_whole, numbered, override, salvage
from bestman_bt.configuration.document import Document, parse_document
from bestman_bt.configuration.errors import ConfigurationError, ProblemCollector, UnreadError, up_to_unread_field
from bestman_bt.configuration.quantity import Length, Mass, WholeNumber
from bestman_bt.messages.shapes import NotBelow, check_bounds


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
    ratio: float = 1.0
    axles: tuple[Wheel, ...] = ()
    pair: tuple[Wheel, Wheel] | None = None


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
        (GOOD + "ratio: .inf\n", "cart.yaml:5: ratio: should be a finite number, got inf"),
        (GOOD + "axles: [{radius: 1}, {radus: 1}]\n", "cart.yaml:5: axles[1].radus: unknown field; did you mean"),
        (GOOD + "pair: [{radius: 1}, {radus: 1}]\n", "cart.yaml:5: pair[1].radus: unknown field; did you mean"),
        (GOOD + "pair: [{radius: 1}]\n", "cart.yaml:5: pair: should have 2 entries, got [{'radius': 1}]"),
    ],
)
def test_a_fault_is_named_with_file_line_and_field(text: str, fault: str) -> None:
    found = faults(text)
    assert any(entry.startswith(fault) for entry in found), found


def test_a_name_that_is_a_number_is_refused_where_text_is_owed() -> None:
    document = Document({"wheels": {1: {"radius": 1.0}}}, {("wheels",): ("cart.yaml", 3)})
    with pytest.raises(ConfigurationError) as error:
        check(document, Cart)
    assert str(error.value) == "cart.yaml:3: wheels.1: a name should be text: write '1' in quotes"


@pytest.mark.parametrize(
    ("text", "wheels", "spare", "count"),
    [
        ("wheels: {left: 5 s, right: {radius: 1}}\n", {"right": Wheel(1.0)}, None, 1),
        ("wheels: {left: {radius: 1, mass: 5 s}}\nspare: x\n", {"left": Wheel(1.0)}, None, 2),
        ("wheels: {left: {radius: 1}}\nspare: {radius: 2, mass: x}\n", {"left": Wheel(1.0)}, Wheel(2.0), 1),
        ("wheels: {left: 3}\nspare: {radius: 2, mass: x}\nseats: -1\n", {}, Wheel(2.0), 3),
    ],
)
def test_what_is_wrong_is_left_out_of_a_salvaged_value(
    text: str, wheels: dict[str, Wheel], spare: Wheel | None, count: int
) -> None:
    document = parse_document(text, "cart.yaml")
    before = copy.deepcopy(document.data)
    value, problems = salvage(document, Cart)
    assert value is not None
    assert (dict(value.wheels), value.spare, value.seats) == (wheels, spare, 0)
    assert len(problems) == count
    assert document.data == before


def test_what_is_owed_and_wrong_is_asked_for_in_vain_and_everything_else_can_be_read() -> None:
    text = "wheels: 3\nspare: {radius: x, mass: 2 kg}\nratio: 2\n"
    value, problems = salvage(parse_document(text, "cart.yaml"), Cart)
    assert [problem.field for problem in problems] == ["wheels", "spare.radius"]
    assert isinstance(value, Cart)
    assert isinstance(value.spare, Wheel)
    assert (value.ratio, value.spare.mass) == (2.0, 2.0)
    assert not is_whole(value)
    assert not is_whole({"a": (value.spare,)})
    assert is_whole(salvage(parse_document("wheels: {a: {radius: 1}}\nseats: x\n", "cart.yaml"), Cart)[0])
    for asked in (lambda: value.wheels, lambda: value.spare.radius):
        with pytest.raises(UnreadError, match="could not be read") as error:
            asked()
        assert error.value.problems == ()


def test_a_check_of_something_salvaged_ends_where_it_asks_for_what_could_not_be_read() -> None:
    value, problems = salvage(parse_document("wheels: 3\nratio: 2\n", "cart.yaml"), Cart)

    @up_to_unread_field
    def ratios(cart: Cart) -> Iterator[float]:
        yield cart.ratio
        yield len(cart.wheels)

    assert list(ratios(value)) == [2.0]
    faults = ProblemCollector(problems)
    with faults.step():
        _ = value.wheels
    assert len(faults.problems) == 1


def test_entries_of_a_list_keep_their_numbers_where_others_are_left_out() -> None:
    value, problems = salvage(
        parse_document("axles: [3, {radius: 1}, x, {radius: 2}]\nwheels: {}\n", "cart.yaml"), Cart
    )
    assert list(numbered(value.axles)) == [(1, Wheel(1.0)), (3, Wheel(2.0))]
    assert [problem.field for problem in problems] == ["axles[0]", "axles[2]"]
    whole, _ = salvage(parse_document("axles: {radius: 1}\nwheels: {}\n", "cart.yaml"), Cart)
    assert list(numbered(whole.axles)) == [(0, Wheel(1.0))], "what was meant as its only entry"


def test_all_faults_are_reported_at_once() -> None:
    found = faults("wheels: {left: {radius: 5 s, mas: 1}}\nseats: x\nfoo: 1\n")
    assert [entry.split(": ")[1] for entry in found] == ["wheels.left.radius", "wheels.left.mas", "seats", "foo"]


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


def test_the_faults_of_all_overrides_are_reported_and_a_list_that_is_replaced_is_of_the_command_line() -> None:
    document = parse_document(GOOD, "cart.yaml")
    with pytest.raises(ConfigurationError) as error:
        override(document, Cart, {"seets": 1, "seats": 2, "kinds": 3})
    assert [problem.source for problem in error.value.problems] == ["--set seets=1", "--set kinds=3"]
    changed = override(document, Cart, {"path": [[0, "1 s"]]})
    with pytest.raises(ConfigurationError, match=r"^--set path=\[\[0, '1 s'\]\]: path\[0\]\[1\]: expected a length"):
        check(changed, Cart)


@dataclass(frozen=True)
class Speeds:
    slow: float = 0.1
    fast: Annotated[float, NotBelow("slow")] = 1.0

    def __post_init__(self) -> None:
        check_bounds(self)


@dataclass(frozen=True)
class Machine:
    speeds: Speeds = field(default_factory=Speeds)
    rate: float = 1.0


def test_what_does_not_fit_to_a_default_after_something_was_left_out_is_no_second_fault() -> None:
    document = Document({"speeds": {"slow": 2.0, "fast": "x"}, "rate": 3.0})
    value, problems = salvage(document, Machine)
    assert value == Machine(Speeds(), 3.0)
    assert [problem.field for problem in problems] == ["speeds.fast"]
    with pytest.raises(ConfigurationError, match="speeds.slow: slow .2. should not be larger than fast .1."):
        check(Document({"speeds": {"slow": 2.0}}), Machine)
