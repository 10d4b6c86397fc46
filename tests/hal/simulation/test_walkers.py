"""People who walk: moved by motors, seen by the lidar, and told apart from the robot's own doing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.evaluation.audit import audit
from bestman_bt.messages import Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import GripperModel, RobotModel
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.scene import Walker, World
from hal.api import Lidar, MobileBase
from hal.simulation.bodies import BodyState
from hal.simulation.contact_watcher import ContactWatcher
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.observation import SimulationState
from hal.simulation.robot import SimulatedRobot
from hal.simulation.scene_recorder import SceneRecorder
from tests.default_engine import DefaultRobot

START = Pose2D(-1.5, 0.0, 0.0)
THERE = [(x, 0.0) for x in np.arange(0.8, -2.6, -0.1)]


@pytest.fixture(scope="module")
def model() -> RobotModel:
    return load_robot_model("diff_panda")


@pytest.fixture(scope="module")
def kitchen() -> World:
    return replace(draw_world(load_scene("kitchen"), 0), robot_start=START, objects=())


@pytest.fixture
def world_with(kitchen: World) -> Callable[..., World]:
    def make(considerate: bool, speed: float = 0.7, route: list[tuple[float, float]] | None = None) -> World:
        way = route or THERE
        points = tuple((float(x), float(y)) for x, y in (*way, *way[::-1]))
        return replace(kitchen, walkers=(Walker("walker_1", 0.22, 1.7, 70.0, speed, points, considerate),))

    return make


class Truth(GroundTruth):
    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__(robot)
        self._recorder = SceneRecorder(robot)

    def walker(self, name: str) -> np.ndarray:
        """(2,) metres: where its middle is in the map frame."""
        return self._recorder.scene_snapshot().walker_poses[name].position[:2]


@contextmanager
def running(model: RobotModel, world: World) -> Iterator[tuple[SimulatedRobot, Truth]]:
    with DefaultRobot(model, world) as robot:
        yield robot, Truth(robot)


def drive(robot: SimulatedRobot, speed: float, seconds: float) -> None:
    base = robot.part("base", MobileBase)
    for _ in range(round(20 * seconds)):
        if speed:
            base.set_velocity(speed, 0.0, 0.0)
        robot.clock.sleep(0.05)


def test_a_walker_goes_its_round_at_its_speed_and_the_audit_stays_clean(
    model: RobotModel, world_with: Callable[..., World]
) -> None:
    route = [(x, 1.0) for x in np.arange(0.4, 2.2, 0.1)]
    with running(model, world_with(True, 0.5, route)) as (robot, truth):
        places = []
        for _ in range(20):
            robot.clock.sleep(0.1)
            places.append(truth.walker("walker_1"))
        record = robot.audit_record()
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / 0.1
    assert np.median(speeds) == pytest.approx(0.5, rel=0.05)
    assert np.abs(np.array(places)[:, 1] - 1.0).max() < 0.02
    judged = audit(record)
    assert judged.honest
    assert not judged.collisions
    assert "walker_1 walks a round of" in judged.disturbances[0]


def test_the_lidar_sees_a_walker_come(model: RobotModel, world_with: Callable[..., World]) -> None:
    with running(model, world_with(True, 0.3)) as (robot, truth):
        lidar = robot.part("lidar", Lidar)
        for _ in range(2):
            robot.clock.sleep(0.8)
            ahead = float(lidar.scan().ranges[180])
            expected = truth.walker("walker_1")[0] - START.x - 0.22
            assert ahead == pytest.approx(expected, abs=0.05)


@pytest.mark.slow
def test_a_considerate_walker_stops_before_the_robot_and_goes_back(
    model: RobotModel, world_with: Callable[..., World]
) -> None:
    with running(model, world_with(True)) as (robot, truth):
        robot.clock.sleep(3.0)
        waiting = truth.walker("walker_1")[0] - START.x
        robot.clock.sleep(4.5)
        assert truth.walker("walker_1")[0] - START.x > waiting + 0.3
        record = robot.audit_record()
    assert 0.7 < waiting <= 1.15
    assert not record.contacts
    assert ["stops before the robot" in event.text or "turns round" in event.text for event in record.disturbances[1:3]]


def test_a_person_walking_into_a_robot_at_rest_is_not_counted_against_the_run(
    model: RobotModel, world_with: Callable[..., World]
) -> None:
    with running(model, world_with(False)) as (robot, truth):
        before = truth.base_pose().to_pose2d()
        robot.clock.sleep(5.0)
        assert truth.base_pose().to_pose2d().distance_to(before) < 0.05
        record = robot.audit_record()
    assert [contact.by_walker for contact in record.contacts] == [True]
    judged = audit(record)
    assert (len(judged.collisions), len(judged.contacts_by_walkers)) == (0, 1)
    assert not judged.faults(max_penetration=0.002)
    assert judged.honest
    document = judged.to_document()
    assert (document["collisions"], document["contacts_by_walkers"]) == (0, 1)


@pytest.mark.slow
def test_people_who_run_into_each_other_are_not_held_against_the_run(
    model: RobotModel, world_with: Callable[..., World]
) -> None:
    (there,) = world_with(False, route=[(x, 1.0) for x in np.arange(0.4, 2.2, 0.1)]).walkers
    back = replace(
        there, name="walker_2", route=there.route[len(there.route) // 2 :] + there.route[: len(there.route) // 2]
    )
    world = replace(world_with(False), walkers=(there, back))
    with running(model, world) as (robot, truth):
        apart = 10.0
        for _ in range(60):
            robot.clock.sleep(0.05)
            places = [np.array(truth.walker(name)) for name in ("walker_1", "walker_2")]
            apart = min(apart, float(np.linalg.norm(places[0] - places[1])))
        record = robot.audit_record()
    assert apart < 2 * there.radius + 0.01
    assert not record.contacts
    assert not [
        overlap for overlap in record.penetrations if {"walker_1", "walker_2"} == {overlap.first, overlap.second}
    ]


def test_a_considerate_walker_stops_behind_a_slower_one_and_does_not_push_it(
    model: RobotModel, world_with: Callable[..., World]
) -> None:
    (fast,) = world_with(True, speed=0.8, route=[(x, 1.0) for x in np.arange(0.4, 2.2, 0.1)]).walkers
    slow = replace(fast, name="walker_2", speed=0.2, route=fast.route[8:] + fast.route[:8])  # 0.8 m ahead
    with running(model, replace(world_with(True), walkers=(fast, slow))) as (robot, truth):
        gaps = []
        for _ in range(60):
            robot.clock.sleep(0.05)
            places = [np.array(truth.walker(name)) for name in ("walker_1", "walker_2")]
            gaps.append(float(np.linalg.norm(places[0] - places[1])) - slow.radius - fast.radius)
    assert gaps[0] > 0.2
    assert 0.0 < min(gaps) < 0.16


@pytest.mark.parametrize("considerate", [True, False])
def test_a_robot_that_drives_into_a_walker_has_collided(
    model: RobotModel, world_with: Callable[..., World], considerate: bool
) -> None:
    with running(model, world_with(considerate)) as (robot, _):
        drive(robot, 0.3, 4.0)
        judged = audit(robot.audit_record())
    assert judged.collisions[0].second == "walker_1"
    assert not judged.contacts_by_walkers
    assert "collision of base_link with walker_1" in judged.faults(max_penetration=0.1)[0]


def test_a_robot_that_pushes_on_into_who_came_into_it_is_blamed_for_that(
    model: RobotModel, world_with: Callable[..., World]
) -> None:
    """Looks as the monitor has them: a walker presses on the front, and the base stands, or drives on into him."""
    with running(model, world_with(considerate=False)) as (robot, _):
        simulation, front = robot.simulation, (0.3, 0.0, 0.5)
        built = simulation.built
        walker, link, upright = built.walkers["walker_1"][0], built.links[model.base_frame], (0.0, 0.0, 0.0, 1.0)
        pressing = (built.robot, walker, link, -1, front, front, (-1.0, 0.0, 0.0), 0.0, 20.0)
        for speed, blamed in ((0.0, False), (0.1, True)):
            watcher = ContactWatcher(simulation)
            for look in range(60):
                velocity = (speed if look > 20 else 0.0, 0.0, 0.0)
                bodies = {built.robot: BodyState((0.0, 0.0, 0.0), upright, velocity, (0.0, 0.0, 0.0))}
                watcher.watch(SimulationState(look / 60, bodies, [pressing], simulation.joint_states(), {}))
            assert [incident.by_walker for incident in watcher.incidents()] == [not blamed]


def test_a_contact_is_as_hard_and_as_deep_as_it_was_at_most_and_after_a_quarter_of_a_second_it_is_another(
    model: RobotModel, world_with: Callable[..., World]
) -> None:
    """Looks as the monitor has them: seconds, and newtons with which a walker presses on the front."""
    with running(model, world_with(considerate=False)) as (robot, _):
        simulation, front = robot.simulation, (0.3, 0.0, 0.5)
        built, still = simulation.built, (0.0, 0.0, 0.0)
        walker, link = built.walkers["walker_1"][0], built.links[model.base_frame]
        bodies = {built.robot: BodyState(still, (0.0, 0.0, 0.0, 1.0), still, still)}
        watcher = ContactWatcher(simulation)
        for stamp, force in ((0.0, 2.0), (0.1, 30.0), (0.2, 5.0), (0.4, 4.0), (0.66, 0.0), (0.7, 8.0), (0.8, 0.9)):
            pressing = (built.robot, walker, link, -1, front, front, (-1.0, 0.0, 0.0), -1e-4 * force, force)
            watcher.watch(SimulationState(stamp, bodies, [pressing], simulation.joint_states(), {}))
        found = [(incident.start, incident.end, incident.peak_force) for incident in watcher.incidents()]
        (deepest,) = watcher.penetrations()
    assert found == [(0.0, 0.4, 30.0), (0.7, 0.7, 8.0)]
    assert (deepest.depth, deepest.stamp) == (pytest.approx(0.003), 0.1)


@pytest.mark.parametrize("walker_first", [True, False])
@pytest.mark.parametrize("fingers", [1, 2])
def test_what_two_fingers_press_on_is_held_and_what_presses_on_that_is_noted_whichever_body_is_reported_first(
    model: RobotModel, world_with: Callable[..., World], fingers: int, walker_first: bool
) -> None:
    world = replace(world_with(considerate=False), objects=draw_world(load_scene("kitchen"), 0).objects)
    with running(model, world) as (robot, _):
        simulation, still = robot.simulation, (0.0, 0.0, 0.0)
        built, (hand,) = simulation.built, model.of(GripperModel).values()
        cup, walker = built.objects["cup"], built.walkers["walker_1"][0]

        def pressing(body_a: int, link_a: int, body_b: int) -> tuple[object, ...]:
            return (body_a, body_b, link_a, -1, still, still, (-1.0, 0.0, 0.0), 0.0, 5.0)

        contacts = [pressing(built.robot, built.links[link], cup) for link in hand.part.finger_links[:fingers]]
        contacts += [pressing(walker, -1, cup) if walker_first else pressing(cup, -1, walker)]
        bodies = {built.robot: BodyState(still, (0.0, 0.0, 0.0, 1.0), still, still)}
        watcher = ContactWatcher(simulation)
        watcher.watch(SimulationState(0.0, bodies, contacts, simulation.joint_states(), {}))
        fallen, deep = ContactWatcher(simulation), [(*c[:7], -0.004, 5.0) for c in contacts]
        fallen.watch(SimulationState(0.0, bodies, deep, simulation.joint_states(), {}), falling=("cup",))
        overlaps = {overlap.first for overlap in fallen.penetrations()}
        found = {(incident.first, incident.second) for incident in watcher.incidents()}
    held = {("cup", "walker_1")} if fingers == 2 else set()
    assert found == {(link, "cup") for link in hand.part.finger_links[:fingers]} | held
    assert overlaps == set(hand.part.finger_links[:fingers])  # into what falls the robot may not press


@pytest.mark.slow
def test_a_robot_that_drives_away_is_not_blamed_for_who_runs_it_down(
    model: RobotModel, world_with: Callable[..., World]
) -> None:
    with running(model, world_with(False, 0.8)) as (robot, _):
        drive(robot, -0.2, 4.5)
        judged = audit(robot.audit_record())
    assert (len(judged.collisions), len(judged.contacts_by_walkers)) == (0, 1)


@pytest.mark.slow
def test_equal_seeds_walk_equally(model: RobotModel, world_with: Callable[..., World]) -> None:
    ends = []
    for _ in range(2):
        with running(model, world_with(True)) as (robot, truth):
            robot.clock.sleep(1.0)
            ends.append(truth.walker("walker_1"))
    assert np.array_equal(*ends)
