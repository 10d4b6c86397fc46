"""Checks of joint positions and limits at the entry of the manipulation algorithms."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.errors import ManipulationError


class JointLimits(Protocol):
    """Limits of n joints, as provided by ``ArmModel`` and ``JointGroupModel``.

    ``lower``, ``upper``, ``velocity``, ``acceleration``: (n,) rad, rad/s, rad/s² (metres for prismatic joints).
    """

    @property
    def joint_names(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def lower(self) -> NDArray[np.float64]: ...  # noqa: D102
    @property
    def upper(self) -> NDArray[np.float64]: ...  # noqa: D102
    @property
    def velocity(self) -> NDArray[np.float64]: ...  # noqa: D102
    @property
    def acceleration(self) -> NDArray[np.float64]: ...  # noqa: D102


def joint_vector(values: ArrayLike, count: int, what: str) -> NDArray[np.float64]:
    """Return ``values`` as a new (count,) float64 array.

    Raises ManipulationError naming ``what`` if it does not fit.
    """
    array = np.array(values, dtype=float)
    if array.shape != (count,):
        raise ManipulationError(f"{what} should be {count} joint positions but has shape {array.shape}")
    if not np.isfinite(array).all():
        raise ManipulationError(f"{what} should be finite but is {array}")
    return array


def joint_path(values: ArrayLike, count: int, what: str) -> NDArray[np.float64]:
    """Return ``values`` as a new (N, count) float64 array, N ≥ 1. Raises ManipulationError naming ``what``."""
    array = np.array(values, dtype=float)
    if array.ndim != 2 or array.shape[1] != count or len(array) == 0:
        raise ManipulationError(f"{what} should have shape (N, {count}) but has {array.shape}")
    if not np.isfinite(array).all():
        raise ManipulationError(f"{what} should be finite but holds NaN or infinity")
    return array
