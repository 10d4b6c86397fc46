"""Who may clear a stop: a controller's own is cleared, one that a person asked for holds, whenever it comes."""

from __future__ import annotations

from bestman_bt.control.robot_stop import HELD, RobotStop
from hal.api import RobotError


class Stoppable:
    """As much of a robot as a stop needs. ``while_clearing``: called in the midst of a clear."""

    def __init__(self) -> None:
        self.stopped, self.clears, self.stops = False, 0, 0
        self.while_clearing = lambda: None
        self.trips_again = False

    def stop(self) -> None:
        self.stopped = True
        self.stops += 1

    def clear_stop(self) -> None:
        self.clears += 1
        self.while_clearing()
        self.stopped = self.trips_again


def test_a_stop_of_the_robot_itself_is_reported_and_cleared():
    robot = Stoppable()
    stop = RobotStop(robot)
    assert not stop.latched
    robot.stop()
    assert stop.latched
    assert stop.clear() == ""
    assert not stop.latched
    assert robot.clears == 1


def test_a_stop_that_a_person_asks_for_stops_the_robot_and_cannot_be_cleared():
    robot = Stoppable()
    stop = RobotStop(robot)
    stop.hold()
    assert robot.stopped
    assert stop.clear() == HELD
    assert stop.clear() == HELD
    assert (robot.stopped, robot.clears) == (True, 0)


def test_a_stop_that_a_person_asks_for_while_another_is_cleared_stops_the_robot_again():
    robot = Stoppable()
    stop = RobotStop(robot)
    robot.stop()
    robot.while_clearing = stop.hold
    assert stop.clear() == HELD
    assert robot.stopped
    assert stop.clear() == HELD
    assert robot.clears == 1


def test_what_keeps_a_robot_stopped_is_reported_in_words():
    robot = Stoppable()
    robot.stop()

    def refuse() -> None:
        raise RobotError("the emergency button is pressed")

    robot.while_clearing = refuse
    stop = RobotStop(robot)
    assert stop.clear() == "the emergency button is pressed"
    robot.while_clearing, robot.trips_again = lambda: None, True
    assert stop.clear() == "it was stopped again immediately"
    robot.trips_again = False
    assert stop.clear() == ""
