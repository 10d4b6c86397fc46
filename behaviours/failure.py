"""Why a node failed, as logs, reports and ``result.json`` tell it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NodeFailure:
    """``node``: its path in the tree, ``where``: its name with file and line. ``why``: in words.

    ``stamp``: seconds on the robot's clock. ``part`` and ``vendor_code``: as of ``messages.Failure``. ``error_code`` is
    empty for a leaf that tells none.
    """

    node: str
    error_code: str
    why: str
    where: str = ""
    stamp: float = 0.0
    part: str = ""
    vendor_code: str = ""

    @property
    def named(self) -> str:
        """What people call the node; its path where no file defines it."""
        return self.where or self.node
