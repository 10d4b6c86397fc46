from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.engine.logs.btlog import Transitions
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.records.timeline import Timeline


def change(timeline: Timeline, state: int, time: float) -> None:
    """Of node 1."""
    timeline.change(Transitions(np.array([time]), np.array([1], np.uint32), np.array([state], np.uint8)))


def test_spans_that_became_one_report_it_and_report_what_the_work_came_to() -> None:
    timeline = Timeline(max_spans=8)
    timeline.add_node(1)
    for second in range(100):
        change(timeline, RUNNING, float(second))
        change(timeline, FAILURE if second == 40 else SUCCESS, second + 0.8)
        change(timeline, IDLE, second + 0.9)

    spans = timeline.document(100.0)["spans"]

    merged = [span for span in spans if span.get("merged")]
    assert merged
    assert {span["state"] for span in merged} == {SUCCESS, FAILURE}
    assert [span["state"] for span in merged if span["from"] <= 40.8 <= span["to"]] == [FAILURE]


def test_a_span_of_its_own_is_not_called_merged() -> None:
    timeline = Timeline()
    timeline.add_node(1)
    change(timeline, RUNNING, 0.0)
    change(timeline, SUCCESS, 2.0)

    spans = timeline.document(3.0)["spans"]

    assert spans == [
        {"uid": 1, "state": RUNNING, "from": 0.0, "to": 2.0},
        {"uid": 1, "state": SUCCESS, "from": 2.0, "to": 3.0},
    ]


@pytest.mark.slow
def test_a_timeline_with_too_many_spans_gets_coarser_and_keeps_failures() -> None:
    timeline = Timeline(max_spans=200)
    timeline.add_node(1)
    for second in range(5000):
        change(timeline, FAILURE if second == 700 else SUCCESS, float(second))
        change(timeline, IDLE, second + 0.5)
    spans = timeline.document(5000.0)["spans"]
    assert len(spans) <= 200
    assert any(span["state"] == FAILURE and span["from"] <= 700 <= span["to"] for span in spans)
    assert max(span["to"] for span in spans) == 4999.5
