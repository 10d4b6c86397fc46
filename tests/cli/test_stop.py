"""bestman-bt stop: every executor is asked, and one that does not obey is told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from bestman_bt.cli import control_commands
from bestman_bt.monitor.control_client import ControlError
from tests.cli.command_line import Answer


@pytest.mark.parametrize("refusing", [0, 1, 2])
def test_an_executor_that_does_not_obey_is_reported_and_the_others_are_stopped_all_the_same(
    bestman_bt: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch, refusing: int
) -> None:
    executors = [Path(f"{name}.sock") for name in "abc"]
    asked = []

    def request(path: Path, what: dict[str, str]) -> dict[str, object]:
        asked.append((path, what))
        if path == executors[refusing]:
            raise ControlError("it does not answer")
        return {"task": path.stem, "pid": 7, "ticks": 40}

    monkeypatch.setattr(control_commands, "running_executors", lambda: executors)
    monkeypatch.setattr(control_commands, "request", request)
    answer = bestman_bt("stop")
    assert asked == [(path, {"do": "stop"}) for path in executors]
    assert answer.code == 1
    assert answer.err == f"{executors[refusing].name}: it does not answer\n"
    stopped = [path.stem for index, path in enumerate(executors) if index != refusing]
    assert answer.out.splitlines() == [f"stopped {name} (process 7, tick 40)" for name in stopped]


def test_where_all_obey_the_exit_code_is_0_and_where_nothing_runs_too(
    bestman_bt: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(control_commands, "running_executors", lambda: [Path("a.sock")])
    monkeypatch.setattr(control_commands, "request", lambda *_: {"task": "a", "pid": 7, "ticks": 40})
    assert bestman_bt("stop").code == 0
    monkeypatch.setattr(control_commands, "running_executors", list)
    answer = bestman_bt("stop")
    assert (answer.code, answer.out) == (0, "nothing is running\n")


def test_a_named_run_is_stopped_and_no_other(
    bestman_bt: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    executors, stopped = [Path(f"{name}.sock") for name in "abc"], list[Path]()

    def request(path: Path, what: dict[str, str]) -> dict[str, object]:
        stopped.extend([path] * (what["do"] == "stop"))
        return {"task": path.stem, "pid": 7, "ticks": 40, "folder": ""}

    monkeypatch.setattr(control_commands, "running_executors", lambda: executors)
    monkeypatch.setattr(control_commands, "request", request)
    assert bestman_bt("stop", "b").out == "stopped b (process 7, tick 40)\n"
    assert stopped == executors[1:2]
    assert bestman_bt("stop", "d").code == 2
    assert stopped == executors[1:2]
