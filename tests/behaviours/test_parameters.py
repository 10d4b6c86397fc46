"""The parameters of skills: set by a task or ``--set``, refused if wrong, read where they are used."""

from __future__ import annotations

import dataclasses
import re
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import behaviours
from behaviours.arm_motion import timed_path, with_held_margin
from behaviours.manipulation.push import push_tool_poses, spread
from behaviours.parameters import SkillParameters
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunRequest, dump_run, load_run, read_run, run_of_options
from bestman_bt.engine import SUCCESS
from bestman_bt.messages import Pose
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.world_model.world_model import HeldObject
from tests.behaviours.scripted import ASKEW, load, run, scripted_skills

DEFAULTS = {
    f"{family.name}.{name}": value
    for family in dataclasses.fields(SkillParameters)
    for name, value in vars(getattr(SkillParameters(), family.name)).items()
}


def other(value: Any) -> Any:
    """A value that is not the default, as it is written in a file."""
    if isinstance(value, tuple):
        return [0.9 * one for one in value]
    return value + 1 if isinstance(value, int) else 0.9 * value


def test_every_parameter_can_be_set_and_is_written_and_read_with_the_run(tmp_path: Path) -> None:
    config = load_run("fetch_cup", settings=[f"skills.{key}={other(value)}" for key, value in DEFAULTS.items()])
    (tmp_path / "run.yaml").write_text(dump_run(config))
    parameters = prepare(read_run(tmp_path / "run.yaml")).skill_parameters
    for key, value in DEFAULTS.items():
        found, wanted = attrgetter(key)(parameters), other(value)
        assert (list(found) if isinstance(value, tuple) else found) == wanted, key
    assert scripted_skills("fetch_cup").parameters == SkillParameters()


def test_every_parameter_is_read_by_a_skill() -> None:
    files = [path for path in Path(behaviours.__path__[0]).rglob("*.py") if path.name != "parameters.py"]
    read = set(re.findall(r"\.(\w+)\b", "".join(path.read_text() for path in files)))
    assert {key.partition(".")[2] for key in DEFAULTS} <= read


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("skills.place.hower_height=1", "skills.place.hower_height: unknown field; did you mean 'hover_height'?"),
        ("skills.plase.descent=1", "skills.plase: unknown field; did you mean 'place'?"),
        ("skills.place.set_down_force=0", "skills.place.set_down_force: should be greater than 0, got 0"),
        ("skills.grasp=3", "skills.grasp: should hold fields (name: value), got 3"),
    ],
)
def test_a_wrong_parameter_is_refused_with_the_option_that_set_it(setting: str, told: str) -> None:
    config = run_of_options(RunRequest(task="fetch_cup", settings=[setting]))
    with pytest.raises(ConfigurationError) as raised:
        prepare(config)
    assert str(raised.value) == f"--set {setting}: {told}"


def test_what_fingers_grip_again_with_is_set() -> None:
    skills = scripted_skills("fetch_cup", ASKEW, "skills.place.regrip_force=2.5")
    skills.held = HeldObject("cup", skills.world.models["cup"], Pose(), 0.06)
    skills.base_from_tool = lambda: Pose([0.6, -0.2, 0.9])
    skills.gripper.ends["release"] = [SimpleNamespace(width=0.06), SimpleNamespace(width=0.08)]
    assert run(skills, load(skills, '<Release object="cup" surface="table/top"/>')) == SUCCESS
    assert skills.gripper.asked[1] == ("close", 2.5)


def test_speed_and_clearance_of_the_arm_are_set() -> None:
    settings = ("skills.arm_motion.free_speed=0.2", "skills.arm_motion.held_clearance=0.05")
    skills = scripted_skills("fetch_cup", ASKEW, *settings)
    asked: list[Any] = []
    skill: Any = SimpleNamespace(skills=skills, compute=lambda *arguments: asked.extend(arguments))
    world: Any = None
    next(timed_path(skill, np.zeros((2, 7)), world, speed=0.5))
    assert (asked[-1].velocity, asked[-1].acceleration) == pytest.approx((0.1, 0.5 * 0.35))
    held = HeldObject("cup", skills.world.models["cup"], Pose(), 0.06)
    attached = with_held_margin(
        skills.planning_scene().holding(_attached()), held, skills.parameters.arm_motion
    ).attached
    assert attached is not None
    assert attached.padding == 0.05


def _attached() -> Any:
    from bestman_bt.manipulation.collision.planning_scene import AttachedObject

    return AttachedObject("cup", (), "panda_hand", Pose(), frozenset())


def test_where_and_how_wide_fingers_push_is_set() -> None:
    settings = ("skills.push.tip_height=0.05", "skills.push.finger_spread=0.25")
    parameters = prepare(load_run("push_object", settings=settings)).skill_parameters.push
    model = scripted_skills().world.models["cup"]
    (first, *_) = push_tool_poses(model, Pose([1.0, 2.0, 0.8]), np.array([0.6, 0.8, 0.0]), parameters)
    assert first.position[2] == pytest.approx(0.8 + model.bounds()[0, 2] + 0.05)
    assert spread(model, 1.0, parameters) == pytest.approx(0.25 * min(model.size[:2]))
