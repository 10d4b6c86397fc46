"""The hand without anything in it: it opens, closes, stands half open, and takes a force."""

from __future__ import annotations

from collections.abc import Iterator

from bestman_bt.bringup.brought_up_robot import BroughtUpRobot
from bestman_bt.bringup.finding import Finding, judged, not_applicable
from hal.api import Gripper

TOLERANCE = 0.005
"""Metres."""
FORCE_SHARE = 0.5


def gripper(subject: BroughtUpRobot) -> Iterator[Finding]:
    """Each gripper behind a connection; it is open afterwards."""
    grippers = {name: part for name, part in subject.robot.parts.items() if isinstance(part, Gripper)}
    if not grippers:
        yield not_applicable(subject.model.name, "no gripper is behind a connection")
    for name, part in grippers.items():
        yield _widths(subject, name, part)
        yield _force(subject, name, part)


def _widths(subject: BroughtUpRobot, name: str, part: Gripper) -> Finding:
    if "a gripper opens and closes" in subject.robot.unsupported:
        return not_applicable(name, subject.robot.unsupported["a gripper opens and closes"])
    narrow, wide = part.model.part.min_width, part.model.max_width
    figures: dict[str, float] = {}
    for what, width in (("open", wide), ("closed", narrow), ("half", 0.5 * (narrow + wide)), ("open again", wide)):
        why = subject.finish(part.move(width))
        figures[what.replace(" ", "_")] = told = part.width()
        if why or abs(told - width) > TOLERANCE:
            text = (
                f"{what}: told to be {1e3 * width:.1f} mm wide, it is {1e3 * told:.1f} mm{f' ({why})' if why else ''}"
            )
            return judged(name, False, text, **figures)
        if what == "closed" and part.state().object_held:
            return judged(name, False, "closed on nothing, it tells that it holds something", **figures)
    text = f"{1e3 * figures['closed']:.1f} to {1e3 * figures['open']:.1f} mm, half {1e3 * figures['half']:.1f} mm"
    return judged(name, True, text, **figures)


def _force(subject: BroughtUpRobot, name: str, part: Gripper) -> Finding:
    missing = subject.robot.unsupported
    if "gripper force" in missing:
        return not_applicable(name, missing["gripper force"])
    force = FORCE_SHARE * part.model.part.max_force
    why = subject.finish(part.close(force)) or subject.finish(part.open())
    text = f"it closes with {force:.0f} N at most, measured by nothing here{f': {why}' if why else ''}"
    return judged(name, not why, text, force_n=force)
