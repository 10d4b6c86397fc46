"""Parallel grippers: opening, closing on objects, releasing them gently."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bestman_bt.control.motion import Confirm, PlannedMotion, declined, start_motion
from hal.api import Gripper, Motion


@dataclass(frozen=True)
class GripperOutcome:
    """The final state of the fingers: ``width`` in metres; ``object_held``: whether they press on an object."""

    width: float
    object_held: bool


@dataclass(frozen=True)
class HeldWidth:
    """Criteria on the width between the fingers for a held object; metres.

    ``tolerance``: difference from the known width of the object. ``shut``: distance above the minimum width up to which
    the hand counts as empty. ``slip``: allowed change during a pull; ``slip_turning``: while a bar rotates in the hand.
    ``let_go``: opening beyond the held width that counts as released.
    """

    tolerance: float = 0.008
    shut: float = 0.003
    slip: float = 0.003
    slip_turning: float = 0.006
    let_go: float = 0.004

    def problem(self, width: float, expected: float) -> str:
        """Return why a closed hand does not hold something ``expected`` metres wide; empty if it may.

        The fingers keep closing: without the object they would close completely.
        """
        if abs(width - expected) <= self.tolerance:
            return ""
        how = "closed to" if width < expected else "stopped at"
        return f"it {how} {1e3 * width:.0f} mm instead of {1e3 * expected:.0f} mm"


HELD_WIDTH = HeldWidth()


@dataclass(eq=False)
class GripperController:
    """Commands one gripper and determines, only from its encoder and motor, whether it presses on something.

    ``closing_speed``, ``release_speed``: largest rates of the width, m/s; faster fingers push objects aside or drag
    them along. ``release_clearance``: metres by which a release opens the fingers. ``confirm``: asks a person before
    each motion, which fails as DECLINED if refused.
    """

    gripper: Gripper
    closing_speed: float = 0.1
    release_speed: float = 0.02
    release_clearance: float = 0.016
    confirm: Confirm | None = None

    def __post_init__(self) -> None:
        self.name, self.model = self.gripper.name, self.gripper.model

    def width(self) -> float:
        """Return the measured opening between the fingers, metres."""
        return self.gripper.width()

    def pressing(self) -> bool:
        """Return whether a closing motion was blocked by something that the fingers still press on."""
        return self.gripper.state().object_held

    def open(self, width: float | None = None, speed: float | None = None) -> Motion[GripperOutcome]:
        """Open to ``width`` (fully by default) at ``speed`` m/s of the width (the gripper's own by default)."""
        target = self.model.max_width if width is None else width
        return self._move(f"open to {1e3 * target:.0f} mm", target, None, speed)

    def close(self, force: float | None = None, speed: float | None = None) -> Motion[GripperOutcome]:
        """Close until blocked or until the fingers meet; both succeed, and the outcome distinguishes them.

        ``force``: newtons, the gripper's own by default; ``speed``: m/s of the width, ``closing_speed`` by default.
        """
        if speed is None:
            speed = min(self.closing_speed, self.model.part.max_speed)
        return self._move("close", self.model.part.min_width, force, speed)

    def release(self) -> Motion[GripperOutcome]:
        """Release: open a little and slowly, so that the object stays in place."""
        width = min(self.width() + self.release_clearance, self.model.max_width)
        return self.open(width, self.release_speed)

    def watch_slip(self, tolerance: float = HELD_WIDTH.slip) -> Callable[[], str | None]:
        """Return a guard of the current grasp: it returns a text once the fingers stop pressing, or close further.

        ``tolerance``: allowed change of the width, metres.
        """
        width = self.width()

        def lost() -> str | None:
            if not self.pressing():
                return f"{self.name} no longer holds anything"
            moved = self.width() - width
            if abs(moved) > tolerance:
                return f"what {self.name} holds slips: the width went by {1000 * moved:+.1f} mm"
            return None

        return lost

    def stop(self) -> None:
        """Stop the fingers immediately; an existing grasp keeps its force."""
        self.gripper.stop()

    def _move(self, words: str, width: float, force: float | None, speed: float | None) -> Motion[GripperOutcome]:
        duration = abs(width - self.width()) / (speed or self.model.part.max_speed) if self.confirm else None
        refused = declined(self.confirm, lambda: PlannedMotion(self.name, words, duration))
        if refused is not None:
            return refused
        return start_motion(self.name, lambda: self.gripper.move(width, force=force, speed=speed), self._outcome)

    def _outcome(self) -> GripperOutcome:
        return GripperOutcome(self.width(), self.pressing())
