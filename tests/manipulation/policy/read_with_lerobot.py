"""Print every frame of a dataset as LeRobot's own loader reads it, a line of JSON each.

python read_with_lerobot.py FOLDER
"""

from __future__ import annotations

import json
import sys

from lerobot.datasets.lerobot_dataset import LeRobotDataset

dataset = LeRobotDataset("local/set", root=sys.argv[1], video_backend="pyav")
quantiles = {name: dataset.meta.stats["action"][name].tolist() for name in ("q01", "q99")}
for frame in dataset:
    read = {
        "action": frame["action"].tolist(),
        "node": frame["node"],
        "task": frame["task"],
        "episode": int(frame["episode_index"]),
        "index": int(frame["index"]),
        "brightness": float(frame["observation.images.head"].mean()),
        "subtasks": [row["content"] for row in frame.get("language_persistent", ())],
        "quantiles": quantiles,
    }
    sys.stdout.write(json.dumps(read) + "\n")
