"""Record examples/language_planner/bring_the_mug.jsonl anew, from answers as a model gives them: after the prompt, an
ability or the kitchen has changed. ``python -m tests.cli.record_shipped_transcript``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from bestman_bt.cli.main import main
from tests.task_planning.language.misbehaving_server import says, serving

TRANSCRIPT = Path(__file__).parents[2] / "examples" / "language_planner" / "bring_the_mug.jsonl"
INSTRUCTION = "bring the mug from the drawer to the table"
DRAWER = "drawer_chest/drawer_1"
PROPOSED = {
    "refusal": None,
    "goal": ["on(mug, table/top)"],
    "given_places": [f"on(mug, {DRAWER})"],
    "plan": [
        {"ability": "OpenContainer", "arguments": {"container": DRAWER}},
        {"ability": "Search", "arguments": {"object": "mug", "place": DRAWER}},
        {"ability": "PickUp", "arguments": {"object": "mug", "place": DRAWER}},
        {"ability": "PutAt", "arguments": {"object": "mug", "place": "table/top"}},
    ],
}
HASTY = {**PROPOSED, "plan": PROPOSED["plan"][1:]}
"""It forgets that the drawer is shut; that is what the first question's answer is like."""

if __name__ == "__main__":
    with serving(says(HASTY), says(PROPOSED)) as server:
        os.environ |= {"BESTMAN_LLM_BASE_URL": server.base_url, "BESTMAN_LLM_MODEL": "recorded"}
        sys.argv = ["bestman-bt", "plan", INSTRUCTION, "--planner", "language", "--record", str(TRANSCRIPT)]
        main()
