"""All inverse kinematics solutions of a pose: its branches, and of a redundant arm samples of each self-motion.

The preimage of a pose is a finite number of self-motion manifolds: Burdick, "On the inverse kinematics of redundant
manipulators: characterization of the self-motion manifolds", ICRA 1989.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits, joint_vector
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.messages import Pose


@dataclass(frozen=True)
class AllSolutionsParameters:
    """``attempts``: start positions of the search. ``step``: rad (Euclidean) between samples of a self-motion.

    ``family``: most samples of one branch. ``same``: rad per joint within which a solution belongs to a known branch.
    """

    attempts: int = 60
    step: float = 0.2
    family: int = 60
    same: float = 0.2

    def __post_init__(self) -> None:
        for name in ("attempts", "step", "family", "same"):
            if not getattr(self, name) > 0:
                raise ManipulationError(f"AllSolutionsParameters {name} should be above 0 but is {getattr(self, name)}")


@dataclass(frozen=True, eq=False)
class SolutionBranch:
    """``positions``: (n,) radians, the member nearest to the reference. ``family``: (K, n), samples of the self-motion.

    The family is in order along the motion and holds ``positions``; one row for an arm without redundancy. Within it
    the arm can move without moving its tool; from branch to branch it cannot, as far as the samples tell.
    """

    positions: NDArray[np.float64]
    family: NDArray[np.float64]


def all_solutions(
    kinematics: InverseKinematics,
    base_from_tool: Pose,
    reference: ArrayLike,
    limits: JointLimits,
    rng: np.random.Generator,
    is_valid: Callable[[NDArray[np.float64]], bool] | None = None,
    parameters: AllSolutionsParameters | None = None,
) -> tuple[SolutionBranch, ...]:
    """The branches of a pose, nearest to ``reference`` (n,) first; empty where it is out of reach.

    ``is_valid``: members that it refuses are left out, branches without any member are. Raises ManipulationError as
    ``InverseKinematics.solve``.
    """
    parameters = parameters or AllSolutionsParameters()
    origin = joint_vector(reference, len(kinematics.joint_names), "reference of arm joints")
    solutions = kinematics.solve(
        base_from_tool, origin, rng, count=parameters.attempts, attempts=parameters.attempts
    ).solutions
    families: list[NDArray[np.float64]] = []
    for solution in solutions:
        if any(_belongs(solution, family, parameters) for family in families):
            continue
        families.append(_self_motion(kinematics, base_from_tool, solution, limits, parameters))
    branches = []
    for family in families:
        members = family if is_valid is None else np.array([q for q in family if is_valid(q)])
        if len(members):
            nearest = members[np.argmin(np.linalg.norm(members - origin, axis=1))]
            branches.append(SolutionBranch(nearest, members))
    return tuple(sorted(branches, key=lambda branch: float(np.linalg.norm(branch.positions - origin))))


def _belongs(solution: NDArray[np.float64], family: NDArray[np.float64], parameters: AllSolutionsParameters) -> bool:
    """Whether a solution lies between samples of a family: a step apart, or as near as two solutions may be alike."""
    distances = np.linalg.norm(family - solution, axis=1)
    return bool(distances.min() <= parameters.step or np.abs(family - solution).max(axis=1).min() <= parameters.same)


def _self_motion(
    kinematics: InverseKinematics,
    pose: Pose,
    solution: NDArray[np.float64],
    limits: JointLimits,
    parameters: AllSolutionsParameters,
) -> NDArray[np.float64]:
    """Walk along the null space both ways, until a limit, a singularity, or where the walk began.

    Where the null space has more than one dimension, along one line in it.
    """
    if len(solution) <= 6:
        return solution[None]
    direction = _null_direction(kinematics, solution)
    forth, closed = _walk(kinematics, pose, solution, direction, limits, parameters)
    back = [] if closed else _walk(kinematics, pose, solution, -direction, limits, parameters)[0]
    return np.array([*reversed(back), solution, *forth])


def _walk(
    kinematics: InverseKinematics,
    pose: Pose,
    solution: NDArray[np.float64],
    direction: NDArray[np.float64],
    limits: JointLimits,
    parameters: AllSolutionsParameters,
) -> tuple[list[NDArray[np.float64]], bool]:
    """The samples that follow ``solution``, and whether the walk came back to it."""
    members: list[NDArray[np.float64]] = []
    here = solution
    for _ in range(parameters.family // 2):
        seed = here + parameters.step * direction
        if np.any(seed < limits.lower) or np.any(seed > limits.upper):
            return members, False
        following = kinematics.track(pose, seed)
        if following is None or np.linalg.norm(following - here) < 0.3 * parameters.step:
            return members, False
        if len(members) > 2 and np.linalg.norm(following - solution) < 0.75 * parameters.step:
            return members, True
        members.append(following)
        ahead = _null_direction(kinematics, following)
        direction = ahead if ahead @ (following - here) >= 0.0 else -ahead
        here = following
    return members, False


def _null_direction(kinematics: InverseKinematics, positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """The unit vector of joint motion that moves the tool least."""
    direction: NDArray[np.float64] = np.linalg.svd(kinematics.jacobian(positions))[2][-1]
    return direction
