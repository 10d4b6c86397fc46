"""Plug-ins: one Python file brings leaves and algorithms, and configurations use them by name."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunRequest, dump_run, load_run, read_run, run_of_options
from bestman_bt.registry import ALGORITHMS, BUILDERS, DRIVERS, PLANNERS, PREDICATES, undone
from bestman_bt.runtime.algorithms import Algorithms, make_algorithm
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.runtime.resolved_config import prepare
from bestman_bt.runtime.robot_session import session
from bestman_bt.task_planning.base import made_planner
from bestman_bt.task_planning.state import known_predicates

PLUGIN = '''
"""A leaf that nods and a planner that goes straight."""

from dataclasses import dataclass

import numpy as np

from behaviours.skill import Skill, SkillCoroutine
from bestman_bt.engine import action
from bestman_bt.messages import Path2D
from bestman_bt.navigation.global_planning.base import GlobalPlanner
from bestman_bt.registry import ALGORITHMS


class Nod(Skill):
    """Lower the head and raise it again."""

    def execute(self) -> SkillCoroutine[None]:
        yield self.skills.head.move_to([0.0, 1.0])
        yield self.skills.head.move_to([0.0, 0.8])


@action
def shout(word: str) -> bool:
    """Say it."""
    return bool(word)


@dataclass(frozen=True)
class StraightLine(GlobalPlanner):
    points: int = 2

    def plan(self, start, goal, costmap):
        points = np.linspace(start.xy, goal.xy, self.points)
        return Path2D(points, goal)


ALGORITHMS.add("global_planning/straight_line", f"{__name__}:StraightLine")


def register(registry):
    registry.register(shout, "Shout")
'''


@pytest.fixture
def plugin(tmp_path: Path) -> Iterator[str]:
    path = tmp_path / "straight.py"
    path.write_text(PLUGIN)
    with undone(ALGORITHMS):
        yield str(path)


def test_node_classes_of_a_plug_in_and_what_it_registers_can_be_used(plugin: str) -> None:
    registry = node_registry([plugin])
    assert registry.info("Nod").description == "Lower the head and raise it again."
    assert "word" in registry.info("Shout").ports


def test_a_tree_of_plug_in_leaves_runs_on_the_robot(plugin: str) -> None:
    with session(seed=3, plugins=[plugin]) as opened:
        body = '<Sequence><Nod/><Shout word="done"/></Sequence>'
        execution = opened.run(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>')
        assert execution.succeeded
        assert execution.sim_time_s > 0.2


@pytest.mark.slow
def test_a_configuration_chooses_an_algorithm_of_a_plug_in_with_its_parameters(plugin: str) -> None:
    settings = (
        "algorithms.global_planning.algorithm=straight_line",
        "algorithms.global_planning.points=7",
    )
    with session(seed=3, settings=settings, plugins=[plugin]) as opened:
        planner = opened.skills.global_planning
        assert type(planner).__name__ == "StraightLine"
        assert planner.points == 7
        pose = opened.skills.world.base.pose
        ahead = f"{pose.x + 0.2};{pose.y};{pose.theta}"
        body = f'<NavigateTo goal="{ahead}" path="{{path}}"/>'
        tree = opened.load(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>')
        tree.tick_once()
        opened.robot.clock.sleep(0.1)
        tree.tick_once()
        assert len(tree.blackboard["path"].points) == 7


def test_parameters_of_a_plug_ins_algorithm_are_checked(plugin: str) -> None:
    settings = ("algorithms.global_planning.algorithm=straight_line", "algorithms.global_planning.pionts=7")
    with pytest.raises(ConfigurationError, match="pionts: unknown field; did you mean 'points'"):
        prepare(load_run("fetch_cup", settings=settings, plugins=[plugin]))


def test_the_configuration_of_a_run_names_its_plug_ins(plugin: str, tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(dump_run(load_run("fetch_cup", plugins=[plugin])))
    assert prepare(read_run(path)).registry.info("Nod")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import math\n\nraise RuntimeError('no sensor')\n", "p.py:3: the plug-in raised RuntimeError: no sensor"),
        ("def f(:\n", "p.py:1: the plug-in raised SyntaxError"),
        ("import sys\nsys.exit(7)\n", "p.py:2: the plug-in raised SystemExit: 7"),
        ("import no_such_module\n", "p.py:1: the plug-in raised ModuleNotFoundError"),
        ("import json\n\n\ndef register(registry):\n    json.loads('{')\n", "p.py:5: the plug-in raised JSONDecode"),
        (
            "from bestman_bt.task_planning.base import TaskPlanner as T\nclass Mine(T):\n    def plan(self): ...\n",
            "p.py:2: the plug-in raised TypeError: Mine.plan should take (self, problem), but takes (self) (at ",
        ),
        (
            "from bestman_bt.task_planning.builders.base import TreeBuilder as T\nclass B(T):\n root = lambda s: 1\n",
            "p.py:2: the plug-in raised TypeError: B.root should take (self, plan, goal, writer), but takes (s) (at ",
        ),
    ],
)
@pytest.mark.parametrize("relative", [False, True])
def test_a_plug_in_that_raises_is_named_with_its_line(
    text: str, message: str, relative: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "p.py").write_text(text)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError) as error:
        node_registry(["p.py" if relative else str(tmp_path / "p.py")])
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("text", "brings"),
    [
        ("class Nod: ...\n", False),
        ("from behaviours.manipulation.grasp import Grasp\n", False),
        ("from bestman_bt.engine import SyncAction\n\n\nclass Nod(SyncAction): ...\n", True),
        ("def register(registry): ...\n", True),
        ("from bestman_bt.registry import algorithm\n\n\n@algorithm('slam/mine')\nclass Mine: ...\n", True),
        ("import beside\n", True),
    ],
)
def test_a_plug_in_that_brings_nothing_is_refused_and_told_what_it_could_bring(
    text: str, brings: bool, tmp_path: Path
) -> None:
    (tmp_path / "beside.py").write_text(
        "from bestman_bt.registry import algorithm\n\n\n@algorithm('slam/mine')\nclass Mine: ...\n"
    )
    (tmp_path / "p.py").write_text(text)
    with undone(ALGORITHMS):
        for _ in range(2):
            with nullcontext() if brings else pytest.raises(ConfigurationError, match=r"p\.py: brings nothing; it"):
                node_registry([str(tmp_path / "p.py")])


def test_a_plug_in_of_native_behaviours_is_told_where_these_are_used(tmp_path: Path) -> None:
    (tmp_path / "p.py").write_text("from py_trees.behaviour import Behaviour\n\n\nclass Blink(Behaviour): ...\n")
    with pytest.raises(
        ConfigurationError, match="brings nothing; .*; Blink: a tree in Python uses py_trees' behaviours"
    ):
        node_registry([str(tmp_path / "p.py")])


def test_a_misspelt_slot_is_a_fault_of_the_plug_in_and_one_that_came_otherwise_is_warned_of(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with undone(ALGORITHMS):
        plug_in = tmp_path / "p.py"
        for name, words in (
            ("global_planing/x", "unknown slot 'global_planing'; did you mean 'global_planning'?"),
            ("nothing", "should be a slot and a name, such as 'global_planning/mine'"),
        ):
            plug_in.write_text(f"from bestman_bt.registry import algorithm\n\n\n@algorithm({name!r})\nclass X: ...\n")
            with pytest.raises(ConfigurationError) as raised:
                node_registry([str(plug_in)])
            assert f"p.py:4: the plug-in raised UnknownNameError: @algorithm({name!r}): {words}" in str(raised.value)
        assert not caplog.messages
        ALGORITHMS.add("global_planing/x", "nowhere:X")
        node_registry()
        assert "'global_planing/x' cannot be chosen: unknown slot" in caplog.messages[-1]


def test_a_plug_in_that_is_not_there_is_named() -> None:
    with pytest.raises(ConfigurationError, match=r"--plugin nowhere\.py: no such file"):
        node_registry(["nowhere.py"])


def test_a_plug_in_may_bring_the_driver(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(
        'from bestman_bt.registry import DRIVERS\nDRIVERS.add("mine", "hal.pybullet.robot:PyBulletRobot")\n'
    )
    with undone(DRIVERS):
        assert prepare(load_run("fetch_cup", driver="mine", plugins=[str(path)])).config.driver == "mine"
    with pytest.raises(ConfigurationError, match="unknown robot driver 'mine'"):
        prepare(load_run("fetch_cup", driver="mine"))


@pytest.mark.slow
def test_the_driver_guards_the_physics_before_a_plug_in_can_take_a_call_of_it(tmp_path: Path) -> None:
    path = tmp_path / "cheat.py"
    path.write_text(
        "from pybullet import resetJointState\nprint(resetJointState.__module__)\ndef register(registry): ...\n"
    )
    program = (
        "from bestman_bt.configuration.run import load_run\nfrom bestman_bt.runtime.resolved_config import prepare\n"
    )
    program += f"prepare(load_run('fetch_cup', plugins=[{str(path)!r}]))\n"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert ran.stdout.splitlines()[-1] == "hal.pybullet.client"


DECORATED = """
from bestman_bt.messages import Path2D
from bestman_bt.navigation.global_planning.base import GlobalPlanner
from bestman_bt.registry import algorithm, task_planner, tree_builder
from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.builders.sequence import SequenceBuilder
from bestman_bt.facts.predicate import Predicate
from bestman_bt.task_planning.symbolic.problem import TaskPlan
from stepping import Stepping

@algorithm("global_planning/mine")
class Mine(Stepping, GlobalPlanner):
    def plan(self, start, goal, costmap):
        return Path2D([start.xy, goal.xy], goal)

@task_planner("nothing_to_do")
class Nothing(TaskPlanner):
    def plan(self, problem):
        return TaskPlan(())

@tree_builder("in_a_row")
class InARow(SequenceBuilder):
    pass

STALE = Predicate("stale", {"object": "object"}, "{object} is old", lambda beliefs, name: True)
"""
BESIDE = """
from __future__ import annotations
from dataclasses import dataclass
Metres = float

@dataclass(frozen=True)
class Stepping:
    step: Metres = 0.5
"""


@pytest.fixture
def decorated(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "mine.py").write_text(DECORATED)
    (tmp_path / "stepping.py").write_text(BESIDE)
    with undone(ALGORITHMS, PLANNERS, BUILDERS, PREDICATES):
        yield tmp_path / "mine.py"


def test_decorators_of_a_plug_in_name_its_algorithms_planners_and_builders(decorated: Path) -> None:
    settings = ["algorithms.global_planning.algorithm=mine", "algorithms.global_planning.step=0.25"]
    config = load_run("fetch_cup", settings=settings, plugins=[str(decorated)])
    setup = prepare(config)
    planner = Algorithms(config, setup.robot_model).global_planning
    assert (type(planner).__name__, planner.step) == ("Mine", 0.25)
    assert type(made_planner("nothing_to_do")).__name__ == "Nothing"
    assert BUILDERS.resolve("in_a_row").__name__ == "InARow"
    assert known_predicates()["stale"].words == "{object} is old"


@pytest.mark.parametrize("named", ["mine.py:Mine", "{folder}/mine.py:Mine", "mine:Mine"])
def test_an_algorithm_may_be_named_by_its_file_and_class(
    named: str, decorated: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(decorated.parent)
    named = named.format(folder=decorated.parent)
    config = load_run("fetch_cup", settings=[f"algorithms.global_planning.algorithm={named}"])
    assert type(Algorithms(config, prepare(config).robot_model).global_planning).__name__ == "Mine"


@pytest.mark.slow
def test_an_algorithm_may_be_named_by_module_and_class_or_with_its_slot() -> None:
    for named in ("bestman_bt.navigation.global_planning.theta_star:ThetaStar", "global_planning/theta_star"):
        config = load_run("fetch_cup", settings=[f"algorithms.global_planning.algorithm={named}"])
        assert type(Algorithms(config, prepare(config).robot_model).global_planning).__name__ == "ThetaStar"


def test_a_tasks_algorithm_file_is_counted_from_the_tasks_folder(decorated: Path) -> None:
    task = decorated.parent / "task.yaml"
    chosen = "algorithms:\n  global_planning: {algorithm: 'mine.py:Mine', step: 0.1}\n"
    task.write_text("tree: fetch_cup\nscene: kitchen\nrobot: diff_panda\n" + chosen)
    config = load_run(task)
    assert make_algorithm(config, "global_planning").step == 0.1


@pytest.mark.parametrize(
    ("text", "named", "message"),
    [
        ("class A: ...\n", "p.py:B", "p.py has no class 'B'; known: A"),
        ("x = 1\nclass A: ...\n", "p.py:A", "p.py:2: algorithms.global_planning: A should be a subclass of"),
        (
            "from bestman_bt.navigation.global_planning.base import GlobalPlanner\n\nclass A(GlobalPlanner): ...\n",
            "p.py:A",
            "p.py:3: algorithms.global_planning: A does not define plan, as a GlobalPlanner has to",
        ),
        (
            "from bestman_bt.navigation.global_planning.base import GlobalPlanner\n\nclass A(GlobalPlanner):\n"
            "    def plan(self, start, goal): ...\n",
            "p.py:A",
            "p.py:3: algorithms.global_planning: A.plan should take (self, start, goal, costmap), but takes (self",
        ),
        (
            "class AParameters: ...\nfrom bestman_bt.navigation.global_planning.base import GlobalPlanner\n"
            "class A(GlobalPlanner):\n    def plan(self, start, goal, costmap): ...\n",
            "p.py:A",
            "p.py:1: algorithms.global_planning: the fields of AParameters should match the dataclass fields of A",
        ),
        ("import numpy\nnumpy.zeros(-1)\n", "p.py:A", "p.py:2: it raised ValueError"),
        ("x = (\n", "p.py:A", "p.py:1: it raised SyntaxError"),
        ("", "q.py:A", "no such file: q.py"),
        ("", "no_such_module:A", "no_such_module cannot be imported: ModuleNotFoundError"),
        (
            "from bestman_bt.navigation.global_planning.base import GlobalPlanner\nclass A(GlobalPlanner):\n"
            "    def plan(self, start, goal, costmap): ...\n    def __init__(self):\n        self.x = self.y\n",
            "p.py:A",
            "p.py:5: algorithms.global_planning: A cannot be made: AttributeError: 'A' object has no attribute 'y'",
        ),
    ],
)
def test_what_is_wrong_with_an_own_algorithm_is_one_line_with_its_place(
    text: str, named: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "p.py").write_text(text)
    with pytest.raises(ConfigurationError) as error:
        prepare(load_run("fetch_cup", settings=[f"algorithms.global_planning.algorithm={named}"]))
    assert message in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_two_plug_ins_of_one_name_have_their_own_helpers(tmp_path: Path) -> None:
    plugins = []
    for name in ("One", "Two"):
        place = tmp_path / name
        place.mkdir()
        base = f"from bestman_bt.engine import AlwaysSuccess\nclass Base(AlwaysSuccess):\n    WORD = '{name}'\n"
        (place / "helpers.py").write_text(base)
        (place / "nodes.py").write_text(f"from helpers import Base\nclass {name}(Base): ...\n")
        plugins.append(str(place / "nodes.py"))
    registry = node_registry(plugins)
    assert [registry.info(name).cls.WORD for name in ("One", "Two")] == ["One", "Two"]


def test_a_plug_in_that_a_task_names_is_refused_at_the_tasks_line_and_one_of_an_option_there(tmp_path: Path) -> None:
    task = tmp_path / "t.yaml"
    task.write_text("tree: fetch_cup\nscene: kichen\nrobot: nope\nplugins:\n  - no.py\n")
    faults: list[Problem] = []
    settings = ["goals=[{facts: {goal: 3}}]"]
    config = run_of_options(RunRequest(task, plugins=["other.py"], settings=settings, seed=-1), faults)
    with pytest.raises(ConfigurationError) as raised:
        prepare(config, known_faults=faults)
    told = str(raised.value)
    assert f"{task}:5: plugins[0]: {tmp_path}/no.py: no such file" in told
    assert "--plugin other.py: no such file" in told
    assert "--set goals=[{'facts': {'goal': 3}}]: goals[0].facts.goal: should be text" in told
    assert "--seed -1: seed: should be" in told
    assert "unknown robot 'nope'" in told
