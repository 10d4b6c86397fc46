"""Handles on generated furniture, and on things without any: how many are found, how well, and what is invented.

A true handle counts where it is in view, at least 60 % unhidden, 0.7 to 1.8 m away and at most 40° to the side of its
front's normal. It is found where a reported handle of its kind lies within 40 mm. A reported handle that lies on no
true one is a false positive; one that lies on a hidden or cut-off handle, or off the middle of one, is neither. Where
two are reported for one true handle, the second is a false positive. Every fourth frame shows no handles. Intervals:
95 %.
"""

from __future__ import annotations

import math
import time
from collections import defaultdict

import numpy as np

from benchmarks.perception_measures.handle_scenes import HandleView, TrueHandle, handle_view
from benchmarks.perception_measures.known_objects import wilson
from bestman_bt.messages import Handle
from bestman_bt.perception.affordance.front_handles import FrontHandles, HandleDetector

MATCH = 0.04


def measure(seed: int, frames: int = 80, detector: HandleDetector | None = None) -> dict[str, object]:
    """Frames ``seed``, ``seed`` + 1, …; times: processor time of one frame, one BLAS thread."""
    detector = detector or FrontHandles()
    tally = Tally()
    for frame in range(seed, seed + frames):
        scene = handle_view(frame)
        if frame == seed:
            detector.detect(scene.view, np.random.default_rng(frame))
        start = time.process_time()
        found = detector.detect(scene.view, np.random.default_rng(frame))
        tally.milliseconds.append((time.process_time() - start) * 1e3)
        tally.add(frame, scene, found.handles)
    return {"frames": frames, **tally.report()}


class Tally:
    """What the frames have shown so far. ``misses``, ``inventions``: in words."""

    def __init__(self) -> None:
        self.seen: dict[str, list[bool]] = defaultdict(list)
        self.false_positives: list[int] = []
        self.without_handles: list[int] = []
        self.position: dict[str, list[float]] = defaultdict(list)
        self.axis: list[float] = []
        self.radius: list[float] = []
        self.normalised: list[float] = []
        self.joint: list[tuple[bool, float]] = []
        self.hinge: list[bool] = []
        self.hinge_distance: list[float] = []
        self.panel: list[float] = []
        self.panel_known: list[bool] = []
        self.milliseconds: list[float] = []
        self.misses: list[str] = []
        self.inventions: list[str] = []

    def add(self, frame: int, scene: HandleView, found: tuple[Handle, ...]) -> None:
        """Compare one frame with the truth."""
        taken: set[int] = set()
        for true in scene.handles:
            index = _match(true.handle, found, taken)
            if index is not None:
                taken.add(index)
            if not true.counted:
                continue
            right = index is not None and found[index].kind == true.handle.kind
            for group in ("all", true.handle.kind, scene.what, *(["shiny"] if scene.shiny else [])):
                self.seen[group].append(right)
            if right and index is not None:
                self._compare(true.handle, found[index])
            else:
                self.misses.append(_words(frame, scene, true.handle, true))
        invented = [
            one
            for index, one in enumerate(found)
            if index not in taken and not any(_lies_on(one, true, found, taken) for true in scene.handles)
        ]
        self.false_positives.append(len(invented))
        if not scene.handles:
            self.without_handles.append(len(invented))
        self.inventions += [_words(frame, scene, one) for one in invented]

    def _compare(self, true: Handle, found: Handle) -> None:
        error = float(np.linalg.norm(found.pose.position - true.pose.position))
        self.position["all"].append(error * 1e3)
        self.position[true.kind].append(error * 1e3)
        self.normalised.append(error / found.position_std)
        if true.kind != "knob":
            self.axis.append(math.degrees(math.acos(min(1.0, abs(float(found.axis @ true.axis))))))
            self.radius.append(abs(found.radius - true.radius) * 1e3)
        self.joint.append((found.joint == true.joint, found.joint_confidence))
        if true.joint == "revolute":
            self.hinge.append(found.hinge_side == true.hinge_side)
            if found.hinge_side == true.hinge_side and found.hinge is not None and true.hinge is not None:
                axis = true.hinge_direction
                assert axis is not None
                self.hinge_distance.append(1e3 * float(np.linalg.norm(np.cross(found.hinge - true.hinge, axis))))
        self.panel_known.append(found.panel_size is not None)
        if found.panel_size is not None and true.panel_size is not None:
            self.panel.append(1e3 * max(abs(a - b) for a, b in zip(found.panel_size, true.panel_size, strict=True)))

    def report(self) -> dict[str, object]:
        """The figures, flat."""
        every = self.seen["all"]
        sure = [right for right, confidence in self.joint if confidence >= 0.8]
        return {
            "handles": len(every),
            "handle_recall": _rate(every),
            "handle_recall_interval": wilson(sum(every), len(every)),
            "handle_recall_by_group": {
                group: [sum(hits), len(hits)] for group, hits in sorted(self.seen.items()) if group != "all"
            },
            "handle_false_positives_per_frame": float(np.mean(self.false_positives)),
            "handle_false_positives_per_frame_interval": _bootstrap(self.false_positives, np.mean),
            "handle_false_positives_per_frame_without_handles": float(np.mean(self.without_handles or [0])),
            "handle_position_mm": _median(self.position["all"]),
            "handle_position_mm_interval": _bootstrap(self.position["all"], np.median),
            "handle_position_mm_p90": _quantile(self.position["all"], 90),
            "handle_position_mm_by_kind": {k: _median(v) for k, v in sorted(self.position.items()) if k != "all"},
            "handle_position_error_over_std": _median(self.normalised),
            "handle_axis_deg": _median(self.axis),
            "handle_axis_deg_p90": _quantile(self.axis, 90),
            "handle_radius_mm": _median(self.radius),
            "handle_joint_rate": _rate([right for right, _ in self.joint]),
            "handle_joint_rate_where_sure": _rate(sure),
            "handle_hinge_side_rate": _rate(self.hinge),
            "handle_hinge_distance_mm": _median(self.hinge_distance),
            "handle_panel_known_rate": _rate(self.panel_known),
            "handle_panel_size_mm": _median(self.panel),
            "handle_ms_per_frame": _median(self.milliseconds),
            "handle_ms_per_frame_p90": _quantile(self.milliseconds, 90),
        }


def _match(true: Handle, found: tuple[Handle, ...], taken: set[int]) -> int | None:
    """The nearest one within reach, those of the true kind first."""
    near = [
        (one.kind != true.kind, float(np.linalg.norm(one.pose.position - true.pose.position)), index)
        for index, one in enumerate(found)
        if index not in taken
    ]
    near = [entry for entry in near if entry[1] <= MATCH]
    return min(near)[2] if near else None


def _lies_on(one: Handle, true: TrueHandle, found: tuple[Handle, ...], taken: set[int]) -> bool:
    """Whether it is a part of a handle that nothing was matched to."""
    if any(np.linalg.norm(found[index].pose.position - true.handle.pose.position) <= MATCH for index in taken):
        return False
    local = true.handle.pose.inverse().apply(one.pose.position[None])[0]
    beyond = max(0.0, abs(float(local[0])) - true.handle.length / 2)
    return math.hypot(beyond, float(local[1]), float(local[2])) < MATCH


def _words(frame: int, scene: HandleView, one: Handle, true: TrueHandle | None = None) -> str:
    where = float(np.linalg.norm(one.pose.position - scene.view.viewpoint))
    text = f"{frame} {scene.what}: {one.kind}, radius {one.radius * 1e3:.1f} mm, length {one.length:.3f} m"
    text += f", standoff {one.standoff:.3f} m, {where:.2f} m away"
    if true is None:
        return f"{text}, confidence {one.confidence:.2f}"
    return f"{text}, {100 * true.seen:.0f} % seen{', shiny' if scene.shiny else ''}"


def _rate(hits: list[bool]) -> float:
    return float(np.mean(hits)) if hits else 0.0


def _median(values: list[float]) -> float | None:
    return round(float(np.median(values)), 3) if values else None


def _quantile(values: list[float], percent: float) -> float | None:
    return round(float(np.percentile(values, percent)), 3) if values else None


def _bootstrap(values: list[float] | list[int], statistic: np.ufunc | object) -> list[float] | None:
    if not values:
        return None
    assert callable(statistic)
    array = np.array(values, dtype=float)
    drawn = array[np.random.default_rng(0).integers(len(array), size=(1000, len(array)))]
    low, high = np.percentile(statistic(drawn, axis=1), [2.5, 97.5])
    return [round(float(low), 4), round(float(high), 4)]
