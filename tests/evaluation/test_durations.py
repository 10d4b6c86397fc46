"""Durations by family: which leaf counts to which, and how time adds up."""

from __future__ import annotations

import importlib
import pkgutil

import behaviours
from behaviours.navigation.navigate import NavigateTo
from behaviours.perception.perceive import DetectObject
from behaviours.skill import Skill
from bestman_bt.engine import RUNNING, SUCCESS, NodeRegistry, StatefulAction, load_tree
from bestman_bt.engine.clock import EngineClock
from bestman_bt.evaluation.episode_measures import Durations, duration_of

UNCOUNTED = {"Skill", "ClearStop", "Wait"}
"""Shipped skills that neither drive nor move the arm nor perceive nor plan."""


class SteppedClock(EngineClock):
    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def sleep(self, duration: float) -> None:
        self.time += duration


class _Lasting(StatefulAction):
    """Runs for one tick and is done in the next."""

    def on_start(self) -> int:
        return RUNNING

    def on_running(self) -> int:
        return SUCCESS


class Drive(_Lasting):
    __module__ = "behaviours.navigation.navigate"


class See(_Lasting):
    __module__ = "behaviours.perception.perceive"


class Other(_Lasting):
    pass


def test_every_shipped_skill_counts_to_a_duration_or_is_known_not_to() -> None:
    uncounted = set()
    for module in pkgutil.walk_packages(behaviours.__path__, "behaviours."):
        for name, found in vars(importlib.import_module(module.name)).items():
            if isinstance(found, type) and issubclass(found, Skill) and duration_of(found) is None:
                uncounted.add(name)
    assert uncounted == UNCOUNTED


def test_a_leaf_derived_from_a_shipped_one_counts_like_it() -> None:
    class Mine(NavigateTo):
        pass

    assert (duration_of(Mine), duration_of(DetectObject)) == ("drive_s", "perception_s")


def test_time_counts_while_a_leaf_of_the_family_is_running() -> None:
    registry = NodeRegistry()
    for leaf in (Drive, See, Other):
        registry.register(leaf)
    clock = SteppedClock()
    leaves = "<Sequence><Drive/><See/><Drive/><Other/></Sequence>"
    xml = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{leaves}</BehaviorTree></root>'
    tree = load_tree(xml, registry=registry, clock=clock)
    durations = Durations(tree)
    while tree.tick_exactly_once() == RUNNING:
        durations.after_tick()
        clock.sleep(0.5)
    durations.after_tick()
    assert durations.seconds == {"drive_s": 1.0, "perception_s": 0.5}
