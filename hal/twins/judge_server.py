"""What is true in the twins' world, for evaluation alone: it asks over a socket of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bestman_bt.messages import Pose
from hal.api import JointGroup
from hal.twins.json_lines import JsonLineServer
from hal.twins.world import TwinWorld


class JudgeServer(JsonLineServer):
    """Answers ``{"ask": …}``: ``objects``, ``object_pose`` (of ``name``), ``base_pose``, ``articulation`` (``name``),
    ``joints`` (of part ``name``: true positions and velocities) and ``honesty``.
    """

    def __init__(self, path: Path, world: TwinWorld) -> None:
        super().__init__(path, self._judge)
        self._world = world
        self._questions: dict[str, Callable[[str], Mapping[str, Any]]] = {
            "time": lambda name: {"time": world.now(), "given_up": world.given_up},
            "objects": lambda name: {"objects": list(world.truth.object_names)},
            "object_pose": lambda name: _pose(world.truth.object_pose(name)),
            "object_speed": lambda name: dict(zip(("speed", "turn_rate"), world.truth.object_speed(name), strict=True)),
            "base_pose": lambda name: _pose(world.truth.base_pose()),
            "articulation": lambda name: {"position": world.truth.articulation_position(name)},
            "joints": self._joints,
            "honesty": lambda name: {"honesty": world.robot.diagnostics()["honesty"]},
        }

    def _judge(self, question: dict[str, Any]) -> Mapping[str, Any]:
        asked = str(question.get("ask", ""))
        if asked not in self._questions:
            raise LookupError(f"cannot tell {asked!r}; ask for {', '.join(self._questions)}")
        return self._world.call(lambda: self._questions[asked](str(question.get("name", ""))))

    def _joints(self, name: str) -> Mapping[str, Any]:
        group = self._world.robot.part(name, JointGroup)  # type: ignore[type-abstract]
        return {"positions": group.positions().tolist(), "velocities": group.velocities().tolist()}


def _pose(pose: Pose) -> dict[str, Any]:
    return {"position": pose.position.tolist(), "quaternion": pose.quaternion.tolist()}
