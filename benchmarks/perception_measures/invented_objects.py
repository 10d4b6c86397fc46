"""Things that look like known objects but are none, and known objects that are not there: are they named?"""

from __future__ import annotations

import numpy as np

from benchmarks.perception_measures.known_objects import shares_place, wilson
from benchmarks.rendered_table import known_models, random_table
from bestman_bt.perception.detection.base import Detector
from bestman_bt.perception.detection.from_image import ModelRegistration


def measure(seed: int, frames: int = 60, detector: Detector | None = None) -> dict[str, object]:
    """Frames ``seed``, ``seed`` + 1, …: 3 of 5 known objects and 2 unknown things.

    In every other frame these are lookalikes: in the colour of a known object, at most 25 mm larger or smaller.
    """
    detector = detector or ModelRegistration()
    named = {"unknown": [0, 0], "lookalikes": [0, 0]}
    invented = 0
    for frame in range(seed, seed + frames):
        lookalikes = bool(frame % 2)
        models = known_models(frame // 2 % 4)
        scene = random_table(frame, models=models, lookalikes=lookalikes)
        found = detector.detect(scene.view, scene.region, models, np.random.default_rng(frame))
        there = {item.model.name for item in scene.objects if item.known}
        invented += sum(
            detection.name not in there and not any(shares_place(detection, item) for item in scene.objects)
            for detection in found.detections
        )
        for item in scene.objects:
            if not item.known:
                tally = named["lookalikes" if lookalikes else "unknown"]
                tally[0] += any(shares_place(detection, item) for detection in found.detections)
                tally[1] += 1
    report: dict[str, object] = {"invented_objects": invented}
    for kind, (hits, tries) in named.items():
        report[f"{kind}_named_rate"] = round(hits / max(1, tries), 4)
        report[f"{kind}_named_interval"] = wilson(hits, tries)
    return report
