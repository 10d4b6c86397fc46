"""What moves with an open hand is suspect, but for what a drawer takes along while the hand pulls that."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace

import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from hal.simulation.bodies import BodyState
from hal.simulation.monitor import AttachmentCheck, ContactsBetweenObservations
from hal.simulation.observation import SimulationState
from hal.simulation.simulation import Simulation
from tests.default_engine import DefaultRobot

STEP = 0.0005
"""Metres that cup and finger move between two looks."""


class Slide:
    """How far the drawer is open, as the simulation would tell it."""

    def __init__(self) -> None:
        self.position = 0.0

    def joint_states(self, body: int, joints: Sequence[int]) -> tuple[tuple[float], ...]:
        return (self.position,), (0.0,), (0.0,)


@pytest.fixture(scope="module")
def simulation() -> Iterator[Simulation]:
    with DefaultRobot(load_robot_model("diff_panda"), draw_world(load_scene("cup_in_drawer"), 3), seed=3) as robot:
        yield robot.simulation


def findings(
    simulation: Simulation, touches: str, drawer_step: float, pressed: Callable[[int], float] = lambda look: 0.0
) -> list[str]:
    """What is found where the cup, which touches the named drawer, and a finger move alike for half a second.

    ``pressed``: by look, with what share of its weight the robot presses on the cup.
    """
    built, slide = simulation.built, Slide()
    watcher = AttachmentCheck(simulation, slide)
    cup, finger = built.objects["cup"], built.links["panda_leftfinger"]
    body, joint = built.articulations["drawer_chest/drawer_3"]
    contacts = [(cup, body, -1, joint, 0.0)] if touches == "drawer" else [(cup, body, -1, -1, 0.0)]
    still, weight = (0.0, 0.0, 0.0), 9.81 * built.object_masses[cup]
    for look in range(120):
        place = (STEP * look, 0.0, 0.0)
        slide.position = drawer_step * look
        state = BodyState(place, (0.0, 0.0, 0.0, 1.0), still, still)
        watcher.watch(
            SimulationState(look / 60, {cup: state}, contacts, simulation.joint_states(), {finger: place}),
            {cup: weight * pressed(look)},
        )
    return [finding.text for finding in watcher.findings]


@pytest.mark.parametrize(
    ("touches", "drawer_step", "suspect"),
    [("drawer", STEP, False), ("drawer", -STEP, False), ("drawer", 0.0, True), ("body", STEP, True)],
    ids=[
        "the drawer takes it along",
        "a drawer that is pushed shut does, too",
        "the drawer is still",
        "it stands on the chest, not in the drawer",
    ],
)
def test_a_cup_that_moves_with_a_finger_is_suspect_unless_its_drawer_moves(
    simulation, touches, drawer_step, suspect
) -> None:
    found = findings(simulation, touches, drawer_step)
    assert bool(found) == suspect
    assert all("cup moved" in text and "panda_leftfinger" in text for text in found)


@pytest.mark.parametrize(
    ("pressed", "suspect"),
    [
        (lambda look: 0.11, False),
        (lambda look: 0.09, True),
        (lambda look: 0.4 * (look % 5 == 4), True),
        (lambda look: 0.6 * (look % 5 == 1), False),
    ],
    ids=["a tenth of its weight", "less", "now and then, at the moment of the look", "the mean counts"],
)
def test_what_is_pressed_with_a_tenth_of_its_weight_in_the_mean_of_half_a_second_is_carried(
    simulation, pressed, suspect
) -> None:
    assert bool(findings(simulation, "body", 0.0, pressed)) == suspect


class Contacts:
    """Contacts of each body, as the physics engine would report them: the other body, and newtons."""

    def __init__(self) -> None:
        self.now: list[tuple[int, float]] = []

    def contacts(self, body: int) -> list[SimpleNamespace]:
        return [SimpleNamespace(second=other, pressure=force) for other, force in self.now]


def watch(between: ContactsBetweenObservations, reader: Contacts, *steps: list[tuple[int, float]]) -> None:
    for reader.now in steps:
        between.watch_step()


def test_contacts_between_observations_are_those_of_moving_objects_pressed_with_less_than_their_weight(
    simulation,
) -> None:
    built, reader = simulation.built, Contacts()
    cup = built.objects["cup"]
    weight = 9.81 * built.object_masses[cup]
    between = ContactsBetweenObservations(simulation, reader)
    assert (between.touched(), between.mean_forces()) == (set(), {})

    between.begin([cup, built.robot], {cup: 0.5 * weight})
    watch(between, reader, [], [(built.floor, 2.0), (built.robot, 3.0)], [(built.robot, 1.0), (built.robot, 0.0)], [])
    assert between.touched() == {cup}
    assert between.mean_forces() == {cup: pytest.approx(1.0)}

    between.begin([cup], {cup: 1.1 * weight})
    watch(between, reader, [], [(built.floor, weight)])
    assert between.touched() == set()

    between.begin([cup], {})
    watch(between, reader, [(built.floor, 0.0)])
    assert (between.touched(), between.mean_forces()) == (set(), {})


@pytest.mark.parametrize(("share", "touched"), [(1e-6, False), (0.09, False), (0.11, True)])
def test_an_object_is_touched_between_observations_by_a_tenth_of_its_weight_in_the_mean(
    simulation, share, touched
) -> None:
    """Less in one step of several cannot be what keeps it from falling."""
    built, reader = simulation.built, Contacts()
    cup = built.objects["cup"]
    total = 4 * share * 9.81 * built.object_masses[cup]
    between = ContactsBetweenObservations(simulation, reader)
    between.begin([cup], {})
    watch(between, reader, [], [(built.floor, 0.7 * total), (built.robot, 0.3 * total)], [], [])
    assert (cup in between.touched()) == touched
