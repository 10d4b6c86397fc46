"""Ground truth of the twins' world through the judge's socket, to judge runs on twins like runs in simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import override

from bestman_bt.messages import Pose
from hal.simulation.audit_record import AuditRecord, ContactIncident, DisturbanceEvent, Finding, Penetration
from hal.simulation.ground_truth import GroundTruth
from hal.twins.tcp_server import ask

FINDINGS = (
    "jumps",
    "hidden_constraints",
    "changes",
    "unexplained_forces",
    "joint_limits",
    "velocity_limits",
    "open_hand",
    "disturbances",
)


class RemoteTruth(GroundTruth):
    """A remote ``GroundTruth``; each query is a round trip. Raises LookupError for unknown names."""

    def __init__(self, judge: Path) -> None:
        self._judge = judge
        self.trusted = True  # the judge was there before time ran

    def now(self) -> float:
        """Return the simulated time of the twins' world, seconds."""
        return float(self._ask("time")["time"])

    @property
    @override
    def object_names(self) -> tuple[str, ...]:
        return tuple(self._ask("object_names"))

    @override
    def object_pose(self, name: str) -> Pose:
        return _pose(self._ask("object_pose", name))

    @override
    def object_speed(self, name: str) -> tuple[float, float]:
        speed, turn_rate = self._ask("object_speed", name)
        return speed, turn_rate

    @override
    def furniture_pose(self, name: str) -> Pose:
        return _pose(self._ask("furniture_pose", name))

    @property
    @override
    def articulation_names(self) -> tuple[str, ...]:
        return tuple(self._ask("articulation_names"))

    @override
    def articulation_position(self, name: str) -> float:
        return float(self._ask("articulation_position", name))

    @override
    def base_pose(self) -> Pose:
        return _pose(self._ask("base_pose"))

    def frame_pose(self, frame: str) -> Pose:
        """Return the true pose of a frame of the robot."""
        return _pose(self._ask("frame_pose", frame))

    def touches_robot(self, name: str) -> bool:
        """Return whether the robot presses on an object."""
        return bool(self._ask("touches_robot", name))

    def supports(self, name: str) -> tuple[str, ...]:
        """Return the supports and contacts of an object."""
        return tuple(self._ask("supports", name))

    def audit_record(self) -> AuditRecord:
        """Return the record of the twin world's monitor."""
        record = self._ask("audit_record")
        for name in FINDINGS:
            record[name] = tuple(Finding(**finding) for finding in record[name])
        record["contacts"] = tuple(ContactIncident(**_tupled(contact, "kinds")) for contact in record["contacts"])
        record["penetrations"] = tuple(Penetration(**penetration) for penetration in record["penetrations"])
        record["events"] = tuple(DisturbanceEvent(**_tupled(event, "pose")) for event in record["events"])
        return AuditRecord(**record)

    def _ask(self, question: str, name: str = "") -> Any:
        return ask(self._judge, {"ask": question, "name": name})["answer"]


def _pose(answer: dict[str, Any]) -> Pose:
    return Pose(np.array(answer["position"]), np.array(answer["quaternion"]))


def _tupled(fields: dict[str, Any], name: str) -> dict[str, Any]:
    return {**fields, name: tuple(fields[name])}
