"""The controls over HTTP: as the page's, with its token, and for no foreign page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tests.monitor.conftest import FakeExecutor, Monitor, wait_until

pytestmark = pytest.mark.real_time

StartMonitor = Callable[..., Monitor]
ID = "4242-abc"
TOKEN = "0123456789abcdef-token"


def listed(monitor: Monitor, **headers: str) -> Monitor:
    """As soon as it knows the run."""

    def knows() -> bool:
        with monitor.http() as http:
            return [run["id"] for run in http.get("/api/runs", headers=headers).json()["runs"]] == [ID]

    wait_until(knows, "the run is listed")
    return monitor


@pytest.mark.parametrize(
    ("control", "body", "asked"),
    [
        ("pause", None, {"do": "pause"}),
        ("step", None, {"do": "step"}),
        ("resume", {}, {"do": "resume"}),
        ("stop", None, {"do": "stop"}),
        ("speed", {"share": 0.3}, {"do": "speed", "share": 0.3}),
        ("clear_breakpoint", None, {"do": "clear_breakpoint"}),
        ("clear_breakpoint", {}, {"do": "clear_breakpoint"}),
        ("set", {"key": "c", "value": "red"}, {"do": "set", "key": "c", "value": "red"}),
        (
            "breakpoint",
            {"node": "main/grasp"},
            {"do": "breakpoint", "node": "main/grasp", "when": "before", "once": False},
        ),
    ],
)
def test_a_control_that_is_posted_reaches_the_executor_and_its_answer_comes_back(
    executor: FakeExecutor, start_monitor: StartMonitor, control: str, body: Any, asked: dict[str, Any]
) -> None:
    with listed(start_monitor()).http() as http:
        answer = (
            http.post(f"/api/runs/{ID}/{control}", json=body)
            if body is not None
            else http.post(f"/api/runs/{ID}/{control}")
        )
    assert (answer.status_code, answer.json()["ok"]) == (200, True)
    assert executor.asked[-1] == asked


def test_what_cannot_be_done_is_reported(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with listed(start_monitor()).http() as http:
        assert http.get(f"/api/runs/{ID}").json()["ok"]
        assert http.post("/api/runs/none/pause").status_code == 404
        no_value = http.post(f"/api/runs/{ID}/set", json={"key": "cup"})
        assert (no_value.status_code, no_value.json()) == (409, {"error": "set requires a value"})
        misspelt = http.post(f"/api/runs/{ID}/set", json={"kay": "cup", "value": 1})
        assert misspelt.json() == {"error": "set has no field 'kay'; did you mean 'key'?"}
        assert "it takes no field" in http.post(f"/api/runs/{ID}/pause", json={"node": 1}).json()["error"]
        unknown = http.post(f"/api/runs/{ID}/paus")
        assert (unknown.status_code, unknown.json()) == (
            404,
            {"error": "unknown control 'paus'; did you mean 'pause'?"},
        )
        assert "known: status, pause" in http.post(f"/api/runs/{ID}/explode").json()["error"]


def test_every_refusal_is_json(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with listed(start_monitor()).http() as http:
        for answer, status in (
            (http.get("/api/nothing"), 404),
            (http.get("/runs/none/images/1.jpg"), 404),
            (http.get(f"/api/runs/{ID}/pause"), 405),
            (http.post("/api/runs"), 405),
            (http.get("/health", headers={"Host": "elsewhere.example"}), 403),
            (http.post(f"/api/runs/{ID}/stop", headers={"Origin": "http://elsewhere.example"}), 403),
        ):
            assert (answer.status_code, list(answer.json())) == (status, ["error"])


def test_no_foreign_page_and_nobody_without_the_token_controls_a_run(
    executor: FakeExecutor, start_monitor: StartMonitor
) -> None:
    known = {"Authorization": f"Bearer {TOKEN}"}
    monitor = listed(start_monitor(token=TOKEN), **known)
    before = len(executor.asked)
    with monitor.http() as http:
        assert http.post(f"/api/runs/{ID}/stop").status_code == 401
        foreign = {"Origin": "http://elsewhere.example"}
        assert http.post(f"/api/runs/{ID}/stop", headers={**known, **foreign}).status_code == 403
        for kind in ({}, {"Content-Type": "text/plain"}, {"Content-Type": "application/x-www-form-urlencoded"}):
            text = http.post(f"/api/runs/{ID}/set", content='{"key": "a", "value": 1}', headers=known | kind)
            assert (text.status_code, "Content-Type" in text.json()["error"]) == (409, True)
        assert [asked for asked in executor.asked[before:] if asked["do"] in ("stop", "set")] == []
        assert http.post(f"/api/runs/{ID}/stop", headers=known).status_code == 200


def test_a_read_only_monitor_controls_nothing(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with listed(start_monitor(read_only=True)).http() as http:
        assert http.get(f"/api/runs/{ID}").status_code == 200
        assert http.post(f"/api/runs/{ID}/stop").status_code == 403
