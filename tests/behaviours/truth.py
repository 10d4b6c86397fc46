"""Sessions whose world can be looked at as it really is, and what happens there while the robot does not look."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from bestman_bt.configuration.run import RunConfig, load_run
from bestman_bt.engine import SUCCESS
from bestman_bt.evaluation.audit import Audit, audit
from bestman_bt.runtime.resolved_config import load_for
from bestman_bt.runtime.robot_session import RobotSession, open_session
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot
from tests.behaviours.at_the_table import failures_of, standing_at_a_table, tick, tree_of

THINGS = """
extends: kitchen
description: A table on which only the named things stand.
objects:
  cup: absent
  can: absent
  box: absent
  counter_can: absent
  counter_box: absent
"""


@contextmanager
def known_world(config: RunConfig) -> Iterator[tuple[RobotSession, GroundTruth]]:
    """A session together with the truth."""
    truths: list[GroundTruth] = []

    def look_behind(robot: object) -> None:
        assert isinstance(robot, SimulatedRobot)
        truths.append(GroundTruth(robot))

    with open_session(config, look_behind) as session:
        yield session, truths[0]


def table_with(
    folder: Path, seed: int = 1, heading: float = 110.0, **things: tuple[str, float, float, float]
) -> RunConfig:
    """A robot that faces ``heading``, degrees, at a table.

    ``things``: model, x, y (metres, from the middle of the table: x away from the robot), yaw (degrees, beside that of
    the table).
    """
    placed = [
        f"  {name}: {{model: {model}, surface: table/top, at: [{x}, {y}, {yaw} deg], region: null, presence: 1}}"
        for name, (model, x, y, yaw) in things.items()
    ]
    kept = [line for line in THINGS.strip().splitlines() if line.split(":")[0].strip() not in things]
    scene = folder / "things.yaml"
    scene.write_text("\n".join([*kept, *placed, "goals: {place: {model: can}}\n"]))
    return load_run(tree="look", scene=scene, robot="diff_panda", seed=seed, settings=standing_at_a_table(heading))


def succeeds(session: RobotSession, body: str, ticks: int = 2000) -> bool:
    """Whether a tree succeeds, whatever it names: skills tell, too, what is not there."""
    tree = load_for(session.setup, tree_of(body), context=session.skills, clock=session.robot.clock)
    for key, value in session.entries.items():
        tree.blackboard.set(key, value)
    return tick(tree, ticks) == SUCCESS


def why_not(session: RobotSession, body: str) -> tuple[str, str]:
    """Run a tree that must fail; code and words of its last failure."""
    assert not succeeds(session, body)
    return failures_of(session)[0]


def put(session: RobotSession, name: str, shift: ArrayLike) -> None:
    """Someone takes a thing and puts it elsewhere, (x, y, z) metres away."""
    simulation = session.robot.simulation  # type: ignore[attr-defined]
    body, engine = simulation.built.objects[name], simulation.engine
    position, quaternion = engine.body_pose(body)
    engine.put(body, np.add(position, shift).tolist(), quaternion)
    session.robot.clock.sleep(0.3)


def audited(session: RobotSession) -> Audit:
    """What the simulation has to object to so far."""
    assert isinstance(session.robot, SimulatedRobot)
    return audit(session.robot.audit_record())
