"""Who hides a cheat behind scripted disturbances is found: only what the run's own script has done is forgiven."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.evaluation.audit import Audit, audit
from bestman_bt.messages import Pose
from hal.mujoco.robot import MujocoEngine
from hal.pybullet.client import UNGUARDED_FUNCTIONS
from hal.simulation.audit_record import DisturbanceEvent
from hal.simulation.disturbance_injector import DisturbanceInjector
from hal.simulation.engine import Engine
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot
from tests.default_engine import DefaultRobot

ASIDE = np.array((0.05, 0.25, 0.0))
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Run:
    """A can stands on a table; ``somebody`` is there from the beginning, and the truth is closed."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self.robot, self.truth, self.somebody = robot, GroundTruth(robot), DisturbanceInjector(robot)
        robot.close_truth()
        robot.clock.sleep(0.1)
        self.can = robot.simulation.built.objects["can"]
        self.aside = self.truth.object_pose("can").position + ASIDE

    @property
    def engine(self) -> Engine:
        """Past what counts its calls."""
        return self.robot.simulation._engine

    def teleport(self, position: np.ndarray) -> None:
        self.engine.put(self.can, position.tolist(), UPRIGHT)

    def set_friction(self, sliding: float) -> None:
        self.engine.set_friction(self.can, sliding, self.engine.friction(self.can)[1])

    def lighten(self) -> None:
        if isinstance(self.engine, MujocoEngine):
            self.engine.model.body_mass[self.can] = 0.001
        else:
            UNGUARDED_FUNCTIONS["changeDynamics"](self.can, -1, mass=0.001, physicsClientId=self.engine.client.id)

    def stolen_injector(self) -> DisturbanceInjector:
        owners = (getattr(control, "__self__", None) for control in self.robot.simulation.controls)
        return next(owner for owner in owners if isinstance(owner, DisturbanceInjector))

    def slip(self) -> DisturbanceEvent:
        now = self.robot.clock.now()
        return DisturbanceEvent(now, now + 10.0, "slip", "can", "the can slips in the hand")

    def judged(self, *script: DisturbanceEvent) -> Audit:
        self.robot.clock.sleep(1.2)
        return audit(self.robot.audit_record(), script=script)


@pytest.fixture
def run(robot_model, table_worlds) -> Iterator[Run]:
    with DefaultRobot(robot_model, table_worlds["can"], seed=3) as robot:
        yield Run(robot)


@pytest.mark.slow
def test_disturbances_that_others_than_the_script_report_are_tampering(run: Run) -> None:
    """The cheat reaches the monitor's own ear, and tells it of a teleport as somebody would who disturbs."""
    run.teleport(run.aside)
    now = run.robot.clock.now()
    monitor = run.robot._monitor
    monitor.disturbance_log.announce(
        DisturbanceEvent(now, now, "put", "can", "a person moves the can", (*run.aside, *UPRIGHT))
    )
    judged = run.judged()
    assert judged.teleports == 0  # it was forgiven
    assert judged.tampering == 1
    assert any("not by the task's script: a person moves the can" in finding for finding in judged.findings)


@pytest.mark.slow
def test_nobody_listens_to_who_asks_for_the_monitors_ear_during_a_run(run: Run) -> None:
    run.teleport(run.aside)
    now = run.robot.clock.now()
    run.robot.disturbance_log().announce(
        DisturbanceEvent(now, now, "put", "can", "a person moves the can", (*run.aside, *UPRIGHT))
    )
    assert run.judged().teleports == 1


def test_an_event_of_a_stolen_injector_is_tampering_even_if_its_trace_is_wiped_out(run: Run) -> None:
    event = run.stolen_injector().move_object("can", Pose(run.aside), "table/top")
    assert event is not None
    run.robot.clock.sleep(0.1)
    run.robot._monitor.disturbance_log.events = ()
    judged = run.judged()
    assert judged.tampering == 1
    assert not judged.honest
    assert run.judged(event).honest  # so it is the script that makes the difference


def test_a_deed_whose_trace_is_wiped_out_before_the_monitor_looks_is_a_teleport(run: Run) -> None:
    assert run.stolen_injector().move_object("can", Pose(run.aside), "table/top")
    run.robot._monitor.disturbance_log.events = ()
    assert run.judged().teleports == 1


def test_a_deed_that_the_monitor_was_kept_from_is_tampering(run: Run) -> None:
    event = run.slip()
    judged = run.judged(event)
    assert judged.tampering == 1
    assert any("hidden from the monitor" in finding for finding in judged.findings)


@pytest.mark.slow
def test_reads_with_a_stolen_reader_are_counted(run: Run) -> None:
    thief_reads = run.stolen_injector()._reader.body_pose(run.can)
    assert thief_reads[0] == pytest.approx(run.truth.object_pose("can").position)
    assert run.judged().ground_truth_reads == 1


def test_the_script_itself_and_the_evaluation_read_for_nothing(run: Run) -> None:
    event = run.somebody.move_object("can", Pose(run.aside), "table/top")
    run.truth.object_pose("can")
    assert run.judged(event).ground_truth_reads == 0


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("friction", "lighter"), [(50.0, False), (None, True), (0.0, True)])
def test_what_slips_by_the_script_may_lose_its_friction_and_nothing_else(
    run: Run, friction: float | None, lighter: bool
) -> None:
    event = run.slip()
    run.robot._monitor.disturbance_log.announce(event)
    if friction is not None:
        run.set_friction(friction)
    if lighter:
        run.lighten()
    judged = run.judged(event)
    assert judged.tampering == 1
    assert any("of can changed" in finding for finding in judged.findings)


def test_what_slips_by_the_script_is_not_accused_of_having_no_friction(run: Run) -> None:
    event = run.slip()
    run.robot._monitor.disturbance_log.announce(event)
    run.engine.set_friction(run.can, 0.0, 0.0)
    assert run.judged(event).honest


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("off", [(0.0, 0.1, 0.0), (0.0, 0.0, 0.02)])
def test_what_the_script_has_put_down_has_to_be_where_it_was_put(run: Run, off: tuple[float, ...]) -> None:
    event = run.somebody.move_object("can", Pose(run.aside), "table/top")
    run.teleport(run.aside + np.array(off))
    judged = run.judged(event)
    assert judged.teleports == 1


@pytest.mark.slow
def test_what_has_slipped_long_ago_is_watched_as_ever(run: Run) -> None:
    event = replace(run.slip(), until=run.robot.clock.now() + 0.2)
    run.robot._monitor.disturbance_log.announce(event)
    run.robot.clock.sleep(0.3)
    run.set_friction(0.0)
    assert run.judged(event).tampering == 1
