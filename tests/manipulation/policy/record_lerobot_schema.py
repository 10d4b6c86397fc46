"""Write a dataset with LeRobot itself and record its layout; `make test-lerobot` runs it in environments with LeRobot.

python record_lerobot_schema.py FILE.json: info.json, and the columns with types of each kind of parquet file.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
from lerobot.datasets.lerobot_dataset import LeRobotDataset

FEATURES = {
    "observation.state": {"dtype": "float32", "shape": (2,), "names": ["a", "b"]},
    "action": {"dtype": "float32", "shape": (2,), "names": ["a", "b"]},
    "node": {"dtype": "string", "shape": (1,), "names": None},
    "observation.images.head": {"dtype": "video", "shape": (96, 128, 3), "names": ["height", "width", "channels"]},
}

with tempfile.TemporaryDirectory() as folder:
    root = Path(folder) / "set"
    dataset = LeRobotDataset.create("local/set", 10, FEATURES, root=root, robot_type="bench", use_videos=True)
    for step in range(5):
        pair = np.array([step, 0.5], dtype=np.float32)
        picture = np.full((96, 128, 3), 20 * step, np.uint8)
        frame = {"observation.state": pair, "action": pair, "node": "x", "observation.images.head": picture}
        dataset.add_frame({**frame, "task": "pick"})
    dataset.save_episode()
    dataset.finalize()
    schema = {
        kind: {field.name: str(field.type) for field in parquet.read_schema(root / path)}
        for kind, path in (
            ("data", "data/chunk-000/file-000.parquet"),
            ("episodes", "meta/episodes/chunk-000/file-000.parquet"),
            ("tasks", "meta/tasks.parquet"),
        )
    }
    schema["info"] = json.loads((root / "meta/info.json").read_text())
Path(sys.argv[1]).write_text(json.dumps(schema, indent=1, sort_keys=True) + "\n")
