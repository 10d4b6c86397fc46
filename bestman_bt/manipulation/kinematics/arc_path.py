"""Following a sequence of tool poses on one branch of inverse kinematics, with free rotation about the held part.

Dynamic programming over the sampled rotation of the hand (in the manner of Descartes planners: De Maeyer, Moyaers and
Demeester, "Cartesian path planning for arc welding robots: evaluation of the Descartes algorithm", ETFA 2017);
redundancy keeps the joints from their limits (Liégeois, "Automatic supervisory control of the configuration and
behavior of multibody mechanisms", 1977).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import JointLimits, joint_vector
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.messages import Pose
from bestman_bt.messages.shapes import NonNegativeInt, Positive

Stations = Sequence[Sequence[Pose]]
"""For each station its allowed tool poses, ordered by the hand's rotation."""

IsFreeAt = Callable[[NDArray[np.float64], int], bool]
"""Whether joint positions (n,) are free at the station with that number (a door has a different position at each)."""


@dataclass(frozen=True)
class ArcSearch:
    """Finds joint paths that follow an arc of the tool.

    ``turn``: largest change of the option between stations. ``max_step``: rad, largest joint motion between stations.
    ``centring``: rad per station by which redundancy moves a joint away from its limit; ``limit_margin``: rad from the
    limit where this ends. ``margin_weight``: cost of a joint at its limit, relative to rad² of motion.
    """

    turn: NonNegativeInt = 1
    max_step: Positive = 0.4
    centring: float = 0.1
    limit_margin: float = 0.02
    margin_weight: float = 0.1

    def path(
        self,
        kinematics: InverseKinematics,
        stations: Stations,
        start: ArrayLike,
        limits: JointLimits,
        is_free: IsFreeAt | None = None,
    ) -> ArcPath:
        """Return the joint path from ``start`` (n,) through all ``stations`` (tool poses in the base frame).

        The tool at ``start`` has to be within one smooth step of a pose of the first station. Raises ManipulationError
        if there is no station, one of them is empty, or ``start`` has the wrong shape or is not finite.
        """
        check_stations(stations)
        origin = _Node(joint_vector(start, len(kinematics.joint_names), "start of an arc"), -1, 0.0)
        return self._search(kinematics, stations, [origin], limits, is_free, first=0)

    def path_through(
        self,
        kinematics: InverseKinematics,
        stations: Stations,
        middle: int,
        option: int,
        positions: NDArray[np.float64],
        limits: JointLimits,
        is_free: IsFreeAt | None = None,
    ) -> ArcPath:
        """Return the path through all stations that passes ``positions`` (n,), a solution of one pose of station
        ``middle``.

        If it is incomplete, ``path`` starts at station 0, or is empty.
        """
        root = _Node(positions, option, 0.0)
        last = len(stations) - 1
        back = self._search(
            kinematics,
            stations[middle::-1],
            [root],
            limits,
            None if is_free is None else lambda q, i: is_free(q, middle - i),
        )
        if not back.complete:
            return ArcPath(
                np.zeros((0, len(positions))), (), last + 1, f"backwards from station {middle}: {back.failure}", 0.0
            )
        ahead = self._search(
            kinematics,
            stations[middle:],
            [root],
            limits,
            None if is_free is None else lambda q, i: is_free(q, middle + i),
        )
        return ArcPath(
            np.vstack([back.path[::-1], ahead.path[1:]]),
            back.options[::-1] + ahead.options[1:],
            last + 1,
            ahead.failure and f"onwards from station {middle}: {ahead.failure}",
            min(back.margin, ahead.margin),
        )

    def _search(
        self,
        kinematics: InverseKinematics,
        stations: Stations,
        layer: list[_Node],
        limits: JointLimits,
        is_free: IsFreeAt | None,
        first: int = 1,
    ) -> ArcPath:
        """Layer by layer; ``first``: the first station to be reached (1 where ``layer`` stands at station 0 already).

        Nodes come cheapest first, so that those are passed over from which a pose can hardly be reached at less cost:
        the strain in it is about the same from anywhere.
        """
        failure = ""
        for station in range(first, len(stations)):
            following: dict[int, _Node] = {}
            refused = 0
            for node in sorted(layer, key=lambda node: node.cost):
                seed = node.positions + self._push(kinematics, node.positions, limits)
                for option in _reachable_options(node.option, len(stations[station]), self.turn):
                    if option in following and following[option].cost - following[option].strain <= node.cost:
                        continue
                    positions = kinematics.track(stations[station][option], seed)
                    if positions is None or np.abs(positions - node.positions).max() > self.max_step:
                        continue
                    moved = positions - node.positions
                    strain = self.margin_weight * (1.0 - joint_margin(positions, limits)) ** 4
                    cost = node.cost + float(moved @ moved) + strain
                    if option in following and following[option].cost <= cost:
                        continue
                    if is_free is not None and not is_free(positions, station):
                        refused += 1
                        continue
                    following[option] = _Node(positions, option, cost, strain, node)
            if not following:
                cause = "refused by the validity check" if refused else "no smooth inverse kinematics"
                failure = f"{cause} at station {station} of {len(stations)}"
                break
            layer = list(following.values())
        return _traced(min(layer, key=lambda node: node.cost), len(stations), failure, limits)

    def _push(
        self, kinematics: InverseKinematics, positions: NDArray[np.float64], limits: JointLimits
    ) -> NDArray[np.float64]:
        """Return a motion in the null space that brings joints away from their limits, the stronger the nearer they
        are.
        """
        middle, half = 0.5 * (limits.upper + limits.lower), 0.5 * (limits.upper - limits.lower)
        away = -self.centring * ((positions - middle) / half) ** 3
        jacobian = kinematics.jacobian(positions)
        push: NDArray[np.float64] = away - np.linalg.pinv(jacobian, rcond=1e-3) @ (jacobian @ away)
        lower = np.minimum(positions, limits.lower + self.limit_margin)
        upper = np.maximum(positions, limits.upper - self.limit_margin)
        return np.clip(positions + push, lower, upper) - positions


@dataclass(frozen=True, eq=False)
class ArcPath:
    """A joint path ``path`` (N, n), radians, one row per reached station. ``options``: the chosen pose of each station.

    ``stations``: their number. ``failure``: why it ended early; empty if complete. ``margin``: smallest distance of a
    joint from its limits, as a fraction of half its range.
    """

    path: NDArray[np.float64]
    options: tuple[int, ...]
    stations: int
    failure: str
    margin: float

    @property
    def complete(self) -> bool:
        """Whether every station is reached."""
        return not self.failure

    @property
    def fraction(self) -> float:
        """Fraction of the stations that are reached."""
        return len(self.path) / self.stations


@dataclass(frozen=True, eq=False)
class _Node:
    positions: NDArray[np.float64]
    option: int
    cost: float
    strain: float = 0.0
    before: _Node | None = None


def check_stations(stations: Stations) -> None:
    """Raise ManipulationError if there is no station, a station without poses, or a pose that is not finite."""
    if not stations or any(len(poses) == 0 for poses in stations):
        raise ManipulationError("stations should hold at least one station, each with at least one tool pose")
    finite = np.isfinite([pose.position for poses in stations for pose in poses]).all()
    if not finite:
        raise ManipulationError("stations should be finite but hold NaN or infinity")


def joint_margin(positions: NDArray[np.float64], limits: JointLimits) -> float:
    """Return the smallest joint margin as a fraction of half the range: 0 at a limit, 1 if all joints are centred."""
    room = np.minimum(positions - limits.lower, limits.upper - positions) / (limits.upper - limits.lower)
    return float(np.clip(2.0 * room.min(), 0.0, 1.0))


def _reachable_options(option: int, count: int, turn: int) -> range:
    return range(count) if option < 0 else range(max(0, option - turn), min(count, option + turn + 1))


def _traced(node: _Node, stations: int, failure: str, limits: JointLimits) -> ArcPath:
    nodes: list[_Node] = []
    step: _Node | None = node
    while step is not None:
        if step.option >= 0:
            nodes.append(step)
        step = step.before
    nodes.reverse()
    path = np.array([n.positions for n in nodes]).reshape(len(nodes), len(node.positions))
    margin = min((joint_margin(n.positions, limits) for n in nodes), default=0.0)
    return ArcPath(path, tuple(n.option for n in nodes), stations, failure, margin)
