"""The appearance of states in all viewers; the colours are in ``palette.json``, which the live page also uses.

The hues follow Okabe and Ito, so that they are distinguishable for colour-blind people.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from bestman_bt.engine.core.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.records.states import NO, NodeStates

Color = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""
_GREY, _KEPT = 120, 0.6
"""What was is shown as a mixture of its colour with grey; the share of the colour."""
_PALETTE: dict[str, dict[str, str]] = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Look:
    """``icon``: one character; ``word``: for plain text; ``light`` and ``dark``: colours on such a ground."""

    word: str
    icon: str
    light: Color
    dark: Color


def _look(name: str) -> Look:
    told = _PALETTE[name]
    light, dark = (tuple(bytes.fromhex(told[ground][1:])) for ground in ("light", "dark"))
    return Look(told["word"], told["icon"], (light[0], light[1], light[2]), (dark[0], dark[1], dark[2]))


def _past(look: Look, word: str) -> Look:
    light, dark = ([round(_KEPT * value + (1 - _KEPT) * _GREY) for value in color] for color in (look.light, look.dark))
    return Look(word, look.icon, (light[0], light[1], light[2]), (dark[0], dark[1], dark[2]))


STATE_NAMES = {IDLE: "idle", RUNNING: "running", SUCCESS: "success", FAILURE: "failure", SKIPPED: "skipped", NO: "no"}
LOOKS = {state: _look(name) for state, name in STATE_NAMES.items()}
"""Of the engine's states, and of NO: a condition has answered, which is its work, and no fault."""
HALTED = _look("halted")
WAS_HALTED = _past(HALTED, "halted")
WAS = {
    SUCCESS: _past(LOOKS[SUCCESS], "succeeded"),
    FAILURE: _past(LOOKS[FAILURE], "failed"),
    NO: _past(LOOKS[NO], "was no"),
}


def look_of(nodes: NodeStates, uid: int) -> Look:
    """Return the look of a node. An idle node has the look of its last result, dimmed, as in Groot2."""
    state, result = int(nodes.states[uid]), int(nodes.results[uid])
    if state != IDLE:
        return LOOKS[state]
    if result == IDLE and nodes.starts[uid]:
        return WAS_HALTED
    return WAS.get(result, LOOKS[IDLE])


def css_variables() -> str:
    """Return ``--running: #0967c4; …`` for light and dark colour schemes."""
    light, dark = (" ".join(f"--{name}: {told[g]};" for name, told in _PALETTE.items()) for g in ("light", "dark"))
    return f":root {{ {light} }}\n@media (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n"
