"""The twins' world runs in real time, takes work from other threads, and shows what its cameras see."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from copy import copy

import numpy as np
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.api import Arm, Camera, JointGroup
from hal.simulation.robot import SimulatedRobot
from hal.twins.world import LONGEST_DELAY, TwinWorld
from tests.hal.twinned import wait_for

pytestmark = pytest.mark.real_time


@pytest.fixture(scope="module")
def model() -> RobotModel:
    camera = {"width": 160, "height": 120, "noise_base": "0 mm", "noise_quadratic": "0 mm"}
    return load_robot_model("diff_panda", {"parts.head_camera.set": camera})


@pytest.fixture(scope="module")
def world(model: RobotModel, table_worlds: dict[str, World]) -> Iterator[TwinWorld]:
    twin_world = TwinWorld(model, table_worlds["box"], seed=1, cameras=True)
    ready = threading.Event()
    thread = threading.Thread(target=twin_world.run, args=(ready.set,))
    thread.start()
    assert ready.wait(60.0)
    yield twin_world
    twin_world.close()
    thread.join(10.0)
    assert not thread.is_alive()


def test_it_runs_in_real_time(world: TwinWorld) -> None:
    before, start, given_up, begun = time.monotonic(), world.now(), world.watch.given_up, time.monotonic()
    time.sleep(3.0)
    ended, passed = time.monotonic(), world.now() - start + world.watch.given_up - given_up
    assert ended - begun - LONGEST_DELAY - 0.1 < passed < time.monotonic() - before + LONGEST_DELAY + 0.1


def test_work_of_other_threads_is_done_in_the_worlds_thread(world: TwinWorld) -> None:
    threads = {world.call(threading.get_ident) for _ in range(3)}
    assert len(threads) == 1
    assert threading.get_ident() not in threads


def test_what_work_raises_comes_back(world: TwinWorld) -> None:
    with pytest.raises(ZeroDivisionError):
        world.call(lambda: 1 / 0)


def test_ticks_come_before_each_step(world: TwinWorld) -> None:
    times: list[float] = []

    def tick(dt: float) -> None:
        times.append(world.robot.simulation.steps)

    world.post(lambda: world.ticks.append(tick))
    wait_for(lambda: len(times) > 10, "ten steps")
    world.post(lambda: world.ticks.remove(tick))
    assert set(np.diff(times)) == {1}


def test_a_picture_is_that_of_the_simulated_camera_and_physics_goes_on(
    world: TwinWorld, model: RobotModel, table_worlds: dict[str, World]
) -> None:
    head = world.robot.part("head", JointGroup)
    motions = [world.call(lambda: head.move_to([0.2, 0.6]))]
    arm = world.robot.part("arm", Arm)
    motions.append(world.call(lambda: arm.move_to(model.posture("home", arm.joint_names))))
    wait_for(lambda: all(motion.done for motion in motions), "head and arm come to rest")
    time.sleep(0.5)
    went_on = []
    for _ in range(5):
        before, asked = world.now(), time.time()
        image, exposed = world.photograph("head_camera", copy)
        assert exposed - asked == pytest.approx(image.stamp - before, abs=LONGEST_DELAY)  # not when it was developed
        went_on.append(world.now() > before)
        assert image.stamp == pytest.approx(before, abs=0.1)
    assert any(went_on)
    direct = world.call(lambda: world.robot.part("head_camera", Camera).capture())
    known = (image.depth > 0) & (direct.depth > 0)
    assert known.mean() > 0.5
    assert np.median(np.abs(image.depth - direct.depth)[known]) < 0.002
    assert np.mean(np.abs(image.rgb.astype(int) - direct.rgb.astype(int))) < 3.0
    assert isinstance(world.robot, SimulatedRobot)


def test_an_unknown_camera_is_reported(world: TwinWorld) -> None:
    with pytest.raises(LookupError, match="no camera"):
        world.photograph("rear_camera", copy)
