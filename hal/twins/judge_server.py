"""What is true in the twins' world, for evaluation alone: it asks over a socket of its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bestman_bt.messages import Pose
from hal.api import Gripper, JointGroup
from hal.twins.json_lines import JsonLineServer
from hal.twins.world import TwinWorld


class JudgeServer(JsonLineServer):
    """Answers ``{"ask": QUESTION, "name": NAME}`` by ``{"answer": …}``.

    Questions are the methods of ``hal.simulation.GroundTruth``, ``audit_record``, ``time``, ``joints`` (of a part:
    true positions and velocities) and ``width`` (of a gripper).
    """

    def __init__(self, path: Path, world: TwinWorld) -> None:
        super().__init__(path, self._judge)
        self._world = world
        truth = world.truth
        self._questions: dict[str, Callable[[str], Any]] = {
            "object_names": lambda name: truth.object_names,
            "object_pose": truth.object_pose,
            "object_speed": truth.object_speed,
            "furniture_pose": truth.furniture_pose,
            "articulation_names": lambda name: truth.articulation_names,
            "articulation_position": truth.articulation_position,
            "base_pose": lambda name: truth.base_pose(),
            "frame_pose": truth.frame_pose,
            "touches_robot": truth.touches_robot,
            "supports": truth.supports,
            "audit_record": lambda name: dataclasses.asdict(world.robot.audit_record()),
            "time": lambda name: {"time": world.now(), "given_up": world.given_up},
            "joints": self._joints,
            "width": lambda name: world.robot.part(name, Gripper).width(),
        }

    def _judge(self, question: dict[str, Any]) -> Mapping[str, Any]:
        asked = str(question.get("ask", ""))
        if asked not in self._questions:
            raise LookupError(f"cannot tell {asked!r}; ask for {', '.join(self._questions)}")
        answer = self._world.call(lambda: self._questions[asked](str(question.get("name", ""))))
        return {"answer": _plain(answer)}

    def _joints(self, name: str) -> Mapping[str, Any]:
        group = self._world.robot.part(name, JointGroup)
        return {"positions": group.positions().tolist(), "velocities": group.velocities().tolist()}


def _plain(answer: Any) -> Any:
    if isinstance(answer, Pose):
        return {"position": answer.position.tolist(), "quaternion": answer.quaternion.tolist()}
    return answer
