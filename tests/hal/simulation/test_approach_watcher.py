"""Who came into whom, by looks that a test writes: a robot, and somebody who walks in front of it."""

from __future__ import annotations

import numpy as np
import pytest

from hal.simulation.bodies import BodyState
from hal.simulation.contact_watcher import ApproachWatcher
from hal.simulation.observation import SimulationState

ROBOT, WALKER, LINK = 1, 2, 4
PERIOD = 1 / 60
UPRIGHT, ORIGIN, FRONT = (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.3, 0.0, 0.5)
ROBOT_FIRST = (ROBOT, WALKER, LINK, -1, FRONT, FRONT, (-1.0, 0.0, 0.0), 0.0, 20.0)
WALKER_FIRST = (WALKER, ROBOT, -1, LINK, FRONT, FRONT, (1.0, 0.0, 0.0), 0.0, 20.0)


def is_blamed(contact: tuple[object, ...], *motions: tuple[float, int]) -> bool:
    """Whether a robot that touches a walker at each look is blamed; it drives at m/s for so many looks each."""
    watcher, look = ApproachWatcher(ROBOT), 0
    for speed, looks in motions:
        for _ in range(looks):
            bodies = {ROBOT: BodyState(ORIGIN, UPRIGHT, (speed, 0.0, 0.0), ORIGIN)}
            observation = SimulationState(look * PERIOD, bodies, [contact], np.zeros((3, 0)), {})
            watcher.take(contact, observation, PERIOD)
            watcher.look_ends(observation)
            look += 1
    return watcher.ours(LINK, WALKER)


@pytest.mark.parametrize("contact", [ROBOT_FIRST, WALKER_FIRST], ids=["robot first", "walker first"])
@pytest.mark.parametrize(
    ("motions", "blamed"),
    [
        ([(0.0, 60)], False),
        ([(0.019, 1), (0.0, 59)], False),
        ([(0.021, 1), (0.0, 59)], True),  # it came in
        ([(0.0, 2), (0.1, 5), (0.0, 5)], False),  # 8 mm on
        ([(0.0, 2), (0.1, 7), (0.0, 5)], True),  # 12 mm on
        ([(-0.1, 60)], False),
        ([(-0.1, 20), (0.1, 5), (0.0, 5)], False),  # pushed back, and springs back a little
        ([(-0.1, 20), (0.1, 8), (0.0, 5)], True),  # pushed back, and pushes on from there
    ],
)
def test_a_robot_is_blamed_where_it_comes_in_or_pushes_on_from_the_farthest_it_was_pushed_back(
    contact: tuple[object, ...], motions: list[tuple[float, int]], blamed: bool
) -> None:
    assert is_blamed(contact, *motions) is blamed
