"""The server and an executor that runs: what a page is told, and what it can ask for."""

from __future__ import annotations

from collections.abc import Callable

from tests.monitor.conftest import FakeExecutor, Monitor, states_event

StartMonitor = Callable[..., Monitor]


def test_a_page_is_told_of_the_executors_that_run(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with start_monitor().page() as page:
        hello = page.next("hello")
        runs = hello["runs"] or page.next("runs", lambda message: bool(message["runs"]))["runs"]
    assert [(run["task"], run["seed"], run["state"]) for run in runs] == [("fetch", 7, "running")]
