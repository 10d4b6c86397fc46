from __future__ import annotations

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.records.timeline import Timeline


def test_spans_that_became_one_say_so_and_tell_what_the_work_came_to() -> None:
    timeline = Timeline(max_spans=8)
    timeline.add_node(1)
    for second in range(100):
        timeline.change(1, RUNNING, float(second))
        timeline.change(1, FAILURE if second == 40 else SUCCESS, second + 0.8)
        timeline.change(1, IDLE, second + 0.9)

    spans = timeline.document(100.0)["spans"]

    merged = [span for span in spans if span.get("merged")]
    assert merged
    assert {span["state"] for span in merged} == {SUCCESS, FAILURE}
    assert [span["state"] for span in merged if span["from"] <= 40.8 <= span["to"]] == [FAILURE]


def test_a_span_of_its_own_is_not_called_merged() -> None:
    timeline = Timeline()
    timeline.add_node(1)
    timeline.change(1, RUNNING, 0.0)
    timeline.change(1, SUCCESS, 2.0)

    spans = timeline.document(3.0)["spans"]

    assert spans == [
        {"uid": 1, "state": RUNNING, "from": 0.0, "to": 2.0},
        {"uid": 1, "state": SUCCESS, "from": 2.0, "to": 3.0},
    ]
