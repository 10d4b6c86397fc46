"""Words, signs and colours of the states, from ``palette.json``, which the live page also uses.

The hues follow Okabe and Ito, so that they are distinguishable for colour-blind people.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from bestman_bt.engine.status import STATUS_NAMES

PALETTE: Final[dict[str, dict[str, str]]] = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
_OF_STATES: Final = [PALETTE[name.lower()] for name in STATUS_NAMES]
STATE_MARKS: Final = tuple(state["icon"] for state in _OF_STATES)
"""One character for each status, by its number."""
STATE_COLORS: Final = tuple(state["light"] for state in _OF_STATES)
"""On a white ground, as ``#rrggbb``."""
