"""What an arm weighs in each joint and how hard it is to move, from the masses of its URDF; the base stands level.

R. Featherstone, "Rigid Body Dynamics Algorithms", 2008, by pinocchio: recursive Newton-Euler, composite rigid bodies.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
import pinocchio
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.kinematics.pinocchio_model import arm_order, build_model, configuration, joints_to_lock
from bestman_bt.robot_model import ArmModel, RobotModel

Array = NDArray[np.float64]


class ArmDynamics:
    """Of one arm with what its URDF carries. ``fixed``: positions of joints outside the arm, else they are at zero."""

    def __init__(self, robot: RobotModel, arm: ArmModel, fixed: Mapping[str, float] | None = None) -> None:
        self._robot, self._arm, self._fixed = robot, arm, dict(fixed or {})

    @cached_property
    def _model(self) -> pinocchio.Model:
        full = build_model(self._robot)
        return pinocchio.buildReducedModel(full, joints_to_lock(full, self._arm), configuration(full, self._fixed))

    @cached_property
    def _data(self) -> pinocchio.Data:
        return self._model.createData()

    @cached_property
    def _places(self) -> NDArray[np.intp]:
        """Where each joint of the arm is in the model."""
        order = arm_order(self._model, self._arm)
        return np.arange(self._model.nv) if order is None else np.argsort(order)

    def gravity(self, positions: ArrayLike) -> Array:
        """Torques (n,) N m that hold the arm at ``positions`` (n,) against its weight."""
        q = self._configuration(positions)
        return np.array(pinocchio.computeGeneralizedGravity(self._model, self._data, q))[self._places]

    def mass_matrix(self, positions: ArrayLike) -> Array:
        """The joint-space inertia (n, n), kg m², at ``positions`` (n,)."""
        mass = np.array(pinocchio.crba(self._model, self._data, self._configuration(positions)))
        symmetric = np.triu(mass) + np.triu(mass, 1).T
        return np.asarray(symmetric[np.ix_(self._places, self._places)])

    def _configuration(self, positions: ArrayLike) -> Array:
        q = np.empty(self._model.nq)
        q[self._places] = np.asarray(positions, dtype=float)
        return q
