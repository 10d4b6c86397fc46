"""The script of disturbances: each is done once, when the robot believes something and it is so, at a good place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import Tree
from bestman_bt.evaluation.disturbances import Disturbances
from bestman_bt.evaluation.episode import prepare_episode, run_episode
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession, open_session
from bestman_bt.world_model.world_model import HeldObject, ObjectBelief
from hal.simulation.disturbance_injector import DisturbanceInjector
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot

DRAWER = "drawer_chest/drawer_3"


class Stage:
    """A session in which no tree runs; a test decides what the robot believes."""

    def __init__(self, session: RobotSession, truth: GroundTruth, injector: DisturbanceInjector) -> None:
        self.session, self.truth = session, truth
        self.script = Disturbances(session, truth, injector)

    def believe(self, name: str) -> None:
        placed = next(o for o in self.session.setup.world.objects if o.name == name)
        belief = ObjectBelief(name, placed.model, self.truth.object_pose(name), 1.0, 0.002, 0.0)
        self.session.skills.world.objects[name] = belief

    def hold(self, name: str) -> None:
        model = self.session.skills.world.models[name]
        self.session.skills.held = HeldObject(name, model, Pose(), 0.05)

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            self.session.robot.clock.sleep(0.05)
            self.script.after_tick()

    def told(self) -> list[str]:
        assert isinstance(self.session.robot, SimulatedRobot)
        record = self.session.robot.audit_record()
        assert record.events == self.script.events
        assert not record.jumps
        assert not record.changes
        assert not record.unexplained_forces
        assert not record.calls
        return [event.text for event in record.disturbances]


@contextmanager
def staged(task: str, disturbances: str, *settings: str, seed: int = 3) -> Iterator[Stage]:
    config = load_run(task, seed=seed, settings=[f"disturbances={disturbances}", *settings])
    made: list[tuple[GroundTruth, DisturbanceInjector]] = []
    with open_session(config, lambda robot: made.append((GroundTruth(robot), DisturbanceInjector(robot)))) as session:
        yield Stage(session, *made[0])


@pytest.fixture
def table() -> Iterator[Stage]:
    """A table with a cup on it, the robot at its start, its hand far away."""
    with staged("pick_place_table", "[{kind: moved, object: cup, distance: [10 cm, 25 cm], after: [1, 2]}]") as stage:
        yield stage


def test_an_object_is_moved_on_its_surface_once_it_was_seen_and_only_once(table: Stage) -> None:
    truth, before = table.truth, table.truth.object_pose("cup").position
    table.wait(2.5)
    assert table.told() == []
    table.believe("cup")
    table.wait(0.8)
    assert table.told() == []
    table.wait(2.0)
    after = truth.object_pose("cup")
    assert 0.1 <= np.linalg.norm(after.position - before) <= 0.25
    assert after.position[2] == pytest.approx(before[2], abs=1e-3)
    assert truth.supports("cup") == ("table",)
    assert len(table.told()) == 1
    table.wait(2.5)
    assert len(table.told()) == 1


@pytest.mark.slow
def test_what_the_robot_has_had_in_its_hand_is_not_moved_any_more(table: Stage) -> None:
    table.hold("cup")
    table.wait(0.1)
    table.session.skills.held = None
    table.believe("cup")
    table.wait(3.0)
    assert table.told() == []


@pytest.mark.slow
def test_an_object_is_put_on_another_surface() -> None:
    with staged(
        "plan_swap", "[{kind: elsewhere, object: cup, surface: counter, after: [0, 0]}]", "predicate=null"
    ) as stage:
        stage.believe("cup")
        stage.wait(1.0)
        assert stage.truth.supports("cup") == ("counter",)
        (text,) = stage.told()
        assert text.endswith("on counter/top")


@pytest.mark.slow
def test_a_drawer_is_pushed_shut_once_it_was_opened() -> None:
    asked = f"[{{kind: shut, articulation: {DRAWER}, object: cup, after: [0.5, 0.5]}}]"
    with staged("fetch_from_drawer", asked, "scene.furniture.drawer_chest.open={drawer_3: 28 cm}") as stage:
        stage.wait(1.0)
        assert stage.told() == []  # nobody has opened it yet
        stage.session.skills.world.articulations[DRAWER] = 0.28
        stage.wait(3.0)
        assert stage.truth.articulation_position(DRAWER) < 0.005
        assert stage.told() == [f"a person pushes {DRAWER} shut", f"a person has shut {DRAWER}"]


@pytest.mark.parametrize(
    ("disturbances", "words"),
    [
        ("[{kind: moved}]", "'object' is missing"),
        ("[{kind: moved, object: cup, surface: table}]", "kind 'moved' has no 'surface'"),
        ("[{kind: moved, object: cupp}]", "did you mean 'cup'"),
        ("[{kind: shut, articulation: table/drawer}]", "the map has no door or drawer 'table/drawer'"),
        ("[{kind: elsewhere, object: cup, surface: tabel}]", "did you mean 'table'"),
        ("[{kind: slips, object: cup, after: [3 s, 1 s]}]", "the smaller limit comes first"),
        ("[{kind: explodes, object: cup}]", "'moved', 'elsewhere', 'slips' or 'shut'"),
    ],
)
def test_what_is_wrong_with_a_disturbance_is_reported_before_anything_starts(disturbances: str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        prepare_episode(load_run("pick_place_table", seed=3, settings=[f"disturbances={disturbances}"]))


def test_nothing_is_put_into_a_drawer() -> None:
    asked = f"disturbances=[{{kind: elsewhere, object: cup, surface: {DRAWER}}}]"
    with pytest.raises(ConfigurationError, match="no surface outside doors and drawers called 'drawer_chest/drawer_3'"):
        prepare_episode(load_run("fetch_from_drawer", settings=[asked]))


@pytest.mark.slow
def test_a_grasp_slips_and_the_tree_recovers() -> None:
    names = ("cup", "can", "box", "soup_can")
    asked = ", ".join(f"{{kind: slips, object: {name}, after: [0, 0]}}" for name in names)
    result = run_episode(load_run("pick_place_table", seed=3, settings=[f"disturbances=[{asked}]"]))
    slipped, out = result.audit["disturbances"]
    assert "slips in the hand" in slipped
    assert "is out of the hand" in out
    assert result.success, result.failure
    assert result.audit["teleports"] == result.audit["tampering"] == 0


@pytest.mark.slow
def test_a_task_without_disturbances_forgives_nothing() -> None:
    """A plug-in that makes an injector in time, and uses it during the run, is found by ``run_episode`` itself."""
    made: list[DisturbanceInjector] = []

    def watch(session: RobotSession, tree: Tree) -> Callable[[], None]:
        cup = next(placed for placed in session.setup.world.objects if placed.name == "cup")
        done = []

        def after_tick() -> None:
            if not done:
                done.append(
                    made[0].move_object("cup", Pose(cup.pose.position + np.array((0.0, 0.1, 0.0))), "table/top")
                )

        return after_tick

    config = load_run("pick_place_table", seed=3, settings=["time_limit=1 s", "predicate=null"])
    result = run_episode(config, watch=watch, prepare_robot=lambda robot: made.append(DisturbanceInjector(robot)))
    assert result.audit["tampering"] == 1
    assert any("not by the task's script: a person moves the cup" in finding for finding in result.audit["findings"])
