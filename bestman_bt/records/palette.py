"""The appearance of nodes in all viewers, by their states now and before."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.engine.palette import PALETTE
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.records.states import NO, NodeStates

Color = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""
_GREY, _KEPT = 120, 0.6
"""Fraction of the colour in the mixture with grey that shows an earlier state."""


@dataclass(frozen=True)
class Look:
    """The appearance of a node state. ``icon``: one character; ``word``: for plain text; ``light`` and ``dark``:
    colours on a light and a dark background."""

    word: str
    icon: str
    light: Color
    dark: Color


def _look(name: str) -> Look:
    entry = PALETTE[name]
    light, dark = (tuple(bytes.fromhex(entry[ground][1:])) for ground in ("light", "dark"))
    return Look(entry["word"], entry["icon"], (light[0], light[1], light[2]), (dark[0], dark[1], dark[2]))


def _past(look: Look, word: str) -> Look:
    light, dark = ([round(_KEPT * value + (1 - _KEPT) * _GREY) for value in color] for color in (look.light, look.dark))
    return Look(word, look.icon, (light[0], light[1], light[2]), (dark[0], dark[1], dark[2]))


STATE_NAMES = {IDLE: "idle", RUNNING: "running", SUCCESS: "success", FAILURE: "failure", SKIPPED: "skipped", NO: "no"}
LOOKS = {state: _look(name) for state, name in STATE_NAMES.items()}
"""Looks of the engine's states, and of NO, the result of a false condition, which is not a fault."""
HALTED = _look("halted")
WAS_HALTED = _past(HALTED, "halted")
WAS = {
    SUCCESS: _past(LOOKS[SUCCESS], "succeeded"),
    FAILURE: _past(LOOKS[FAILURE], "failed"),
    NO: _past(LOOKS[NO], "was no"),
}


def appearance_of(nodes: NodeStates, uid: int) -> Look:
    """Return the look of a node. An idle node has the look of its last result, dimmed, as in Groot2."""
    state, result = int(nodes.states[uid]), int(nodes.results[uid])
    if state != IDLE:
        return LOOKS[state]
    if result == IDLE and nodes.starts[uid]:
        return WAS_HALTED
    return WAS.get(result, LOOKS[IDLE])


def css_variables() -> str:
    """Return ``--running: #0967c4; …`` for light and dark colour schemes."""
    light, dark = (" ".join(f"--{name}: {entry[g]};" for name, entry in PALETTE.items()) for g in ("light", "dark"))
    return f":root {{ {light} }}\n@media (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n"
