"""A peer of our planners: OMPL's RRTConnect with its own settings, then its path simplifier for 60 ms of CPU time."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from ompl import base, geometric, util

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.robot_model.model import ArmModel

CHECK_STEP = 0.02
MAX_CHECKS = 60_000


@dataclass(frozen=True, eq=False)
class PeerPath:
    """``path``: (N, n) radians, or None. ``plan_ms``: CPU time of the search alone."""

    path: np.ndarray | None
    plan_ms: float


def ompl_simplified(
    start, goal, world: CollisionWorld, arm: ArmModel, seed: int, seconds: float = 0.06, kind: str = "RRTConnect"
) -> PeerPath:
    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(seed)
    count = len(arm.joint_names)
    space, bounds = base.RealVectorStateSpace(count), base.RealVectorBounds(count)
    for i in range(count):
        bounds.setLow(i, float(arm.lower[i]))
        bounds.setHigh(i, float(arm.upper[i]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    checks = 0

    def is_valid(state) -> bool:
        nonlocal checks
        checks += 1
        return bool(world.is_free(np.array(state[0:count])))

    setup.setStateValidityChecker(is_valid)
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(CHECK_STEP / space.getMaximumExtent())
    ends = information.allocState(), information.allocState()
    for state, values in zip(ends, (start, goal), strict=True):
        for i in range(count):
            state[i] = float(values[i])
    targets = base.GoalStates(information)
    targets.addState(ends[1])
    setup.addStartState(ends[0])
    setup.setGoal(targets)
    setup.setPlanner(getattr(geometric, kind)(information))
    begin = time.process_time()
    setup.solve(base.PlannerTerminationCondition(lambda: checks > MAX_CHECKS))
    plan_ms = 1e3 * (time.process_time() - begin)
    if not setup.haveExactSolutionPath():
        return PeerPath(None, plan_ms)
    end = time.process_time() + seconds
    setup.simplifySolution(base.PlannerTerminationCondition(lambda: time.process_time() > end))
    return PeerPath(np.array([state[0:count] for state in setup.getSolutionPath().getStates()]), plan_ms)
