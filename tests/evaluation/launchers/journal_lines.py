"""What a journal tells of each seed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bestman_bt.evaluation.shards import TIMES


def without_times(folder: Path, seeds: int) -> list[dict[str, Any]]:
    """The results in the order of their seeds 0 … ``seeds`` - 1; one that is missing or told twice fails."""
    lines = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    assert sorted(line["seed"] for line in lines) == list(range(seeds))
    results = [line["result"] for line in sorted(lines, key=lambda line: line["seed"])]
    return [{key: value for key, value in one.items() if key not in TIMES} for one in results]
