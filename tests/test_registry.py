"""Registries name classes as text: every name leads to what it promises, and wrong names are answered."""

from __future__ import annotations

import dataclasses
import inspect
from importlib import import_module
from importlib.metadata import EntryPoint
from typing import Any

import pytest

from bestman_bt.engine import ManualClock, Node
from bestman_bt.manipulation.motion_planning.ompl_planners import KPIECE, OmplPlanner
from bestman_bt.registry import (
    ALGORITHMS,
    BEHAVIOURS,
    BUILDERS,
    CONNECTIONS,
    DRIVERS,
    Registry,
    UnknownNameError,
    suggestion,
)
from bestman_bt.task_planning.builders.base import TreeBuilder
from hal.api import Robot
from hal.hardware.connection import Connection
from hal.twins.twin_host import TWINS


@pytest.mark.parametrize("name", BEHAVIOURS.names())
def test_every_behaviour_is_a_node_of_that_name_with_a_description(name: str) -> None:
    leaf = BEHAVIOURS.resolve(name)
    assert issubclass(leaf, Node)
    assert leaf.__name__ == name
    assert inspect.getdoc(leaf)


@pytest.mark.parametrize("name", ALGORITHMS.names())
def test_every_algorithm_is_a_concrete_class_in_the_folder_of_its_slot(name: str) -> None:
    slot, _, _ = name.partition("/")
    algorithm = ALGORITHMS.resolve(name)
    assert not inspect.isabstract(algorithm)
    assert slot in algorithm.__module__.split(".")
    assert inspect.getdoc(algorithm)


@pytest.mark.parametrize("name", DRIVERS.names())
def test_every_driver_is_a_robot(name: str) -> None:
    assert issubclass(DRIVERS.resolve(name), Robot)


@pytest.mark.parametrize("name", CONNECTIONS.names())
def test_every_connection_is_one_and_has_a_twin(name: str) -> None:
    connection = CONNECTIONS.resolve(name)
    assert issubclass(connection, Connection)
    assert connection.driver == name
    assert dataclasses.is_dataclass(connection.options_type)
    assert inspect.getdoc(connection.options_type)
    assert name in TWINS


@pytest.mark.parametrize("name", BUILDERS.names())
def test_every_tree_builder_is_a_described_dataclass(name: str) -> None:
    builder = BUILDERS.resolve(name)
    assert issubclass(builder, TreeBuilder)
    assert dataclasses.is_dataclass(builder)
    assert "``" in str(inspect.getdoc(builder))


def test_every_skill_of_the_library_is_registered() -> None:
    """A class beside those that trees can name would be a leaf that nobody can use."""
    modules = {BEHAVIOURS.resolve(name).__module__ for name in BEHAVIOURS}
    leaves = {
        value.__name__
        for module in modules
        for value in vars(import_module(module)).values()
        if isinstance(value, type)
        and issubclass(value, Node)
        and value.__module__.startswith(("behaviours.", "bestman_bt.task_planning."))
    }
    bases = {name for name in leaves if name.startswith("_")} | {"ErrorReporting", "Nav2Errors", "ArmNode", "RobotNode"}
    bases |= {"Skill", "InstantSkill", "SkillCondition", "FindBasePlacement", "FindStandAtFurniture", "WatchesGoals"}
    assert leaves - bases == set(BEHAVIOURS)


def test_an_unknown_name_is_answered_by_the_closest() -> None:
    with pytest.raises(UnknownNameError, match="unknown robot driver 'pybulet'; did you mean 'pybullet'"):
        DRIVERS.resolve("pybulet")
    assert suggestion("zzz", ["one", "two"]) == "known: one, two"
    assert suggestion("zzz", []) == "known: none"


def test_a_name_can_be_added_and_is_resolved_when_it_is_used() -> None:
    registry = Registry("bestman_bt.nothing", "thing", {})
    registry.add("clock", "no.such.module:Clock")
    assert registry.names() == ["clock"]
    with pytest.raises(ModuleNotFoundError):
        registry.resolve("clock")
    registry.add("clock", "bestman_bt.engine:ManualClock")
    assert registry.resolve("clock").__name__ == "ManualClock"


def test_names_of_third_parties_are_found_by_entry_points_and_replace_none_of_ours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[str] = []

    def found(group: str) -> list[EntryPoint]:
        asked.append(group)
        return [EntryPoint("ours", "evil:Thing", group), EntryPoint("theirs", "bestman_bt.engine:WallClock", group)]

    monkeypatch.setattr("bestman_bt.registry.entry_points", found)
    registry = Registry("some.group", "thing", {"ours": "bestman_bt.engine:ManualClock"})
    assert registry.resolve("theirs").__name__ == "WallClock"
    assert registry.resolve("ours").__name__ == "ManualClock"
    assert list(registry) == ["ours", "theirs"]
    assert asked == ["some.group"]


def test_entries_of_a_kind_are_named_by_what_comes_after_it_each_with_what_its_preset_sets() -> None:
    entries: dict[str, Any] = {
        "clock/manual": "bestman_bt.engine:ManualClock",
        "clock/late": KPIECE,
        "clocks/wall": "bestman_bt.engine:WallClock",
    }
    registry = Registry("bestman_bt.nothing", "thing", entries)
    found = registry.of_kind("clock")
    assert (set(found), found["manual"]) == ({"late", "manual"}, (ManualClock, {}))
    assert (found["late"][0], found["late"][1]["planner"]) == (OmplPlanner, "kpiece")
    registry.add("clock/more", "bestman_bt.engine:WallClock")
    assert "clock/more" not in entries


def test_what_a_decorator_names_is_found() -> None:
    registry = Registry("bestman_bt.nothing", "thing", {})

    @registry.adding("clock/mine")
    class Mine: ...

    assert registry.resolve("clock/mine") is Mine
    assert registry.names() == ["clock/mine"]
