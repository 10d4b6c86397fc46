"""Several poses to drive to, one after the other."""

from __future__ import annotations

from bestman_bt.messages.pose import Pose2D


class Goals(tuple[Pose2D, ...]):
    """Poses in the map frame, in driving order; as text, their numbers one after the other: ``x;y;theta;x;y;theta``."""

    __slots__ = ()

    @classmethod
    def from_string(cls, text: str) -> Goals:
        """Parse ``x;y;theta`` of each pose (metres, radians), the form of a port literal."""
        parts = text.split(";") if text.strip() else []
        if len(parts) % 3:
            raise ValueError(f"poses 'x;y;theta;x;y;theta' (metres, radians) expected, got {text!r}")
        return cls(Pose2D.from_string(";".join(parts[i : i + 3])) for i in range(0, len(parts), 3))

    def to_string(self) -> str:
        """The text that ``from_string`` reads."""
        return ";".join(f"{pose.x!r};{pose.y!r};{pose.theta!r}" for pose in self)
