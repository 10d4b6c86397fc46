"""Head control."""

from bestman_bt.control.head.head_controller import HeadController

__all__ = ["HeadController"]
