"""The server and executors that run: what a page is told, and what it can ask for."""

from __future__ import annotations

import base64
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from bestman_bt.monitor.control_client import link_folder, socket_folder
from bestman_bt.monitor.viewer import MOST_CONTROLS, MOST_OPEN
from bestman_bt.records.timeline import Timeline
from tests.monitor.conftest import FakeExecutor, Message, Monitor, Page, states_event, wait_until

pytestmark = pytest.mark.real_time

StartMonitor = Callable[..., Monitor]
IDLE, RUNNING, SUCCESS, FAILURE = 0, 1, 2, 3
ID = "4242-abc"


def opened(page: Page, identity: str = ID) -> Message:
    """Open a run as soon as it is listed; its state."""
    hello = page.next("hello")
    if identity not in [run["id"] for run in hello["runs"]]:
        page.next("runs", lambda message: identity in [run["id"] for run in message["runs"]])
    page.ask("open", id=identity, n="open")
    return page.next("state")


def all_changes(page: Page, upto: tuple[int, int]) -> list[list[int]]:
    """What the deltas told, up to one with the change ``upto``."""
    told: list[list[int]] = []
    while not any(tuple(change[:2]) == upto for change in told):
        told += page.next("delta")["changes"]
    return told


def test_a_page_is_told_of_the_executors_that_run(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with start_monitor().page() as page:
        opened(page)
        (run,) = page.seen[-1:] and [r for m in page.seen if m["type"] in ("hello", "runs") for r in m["runs"]][-1:]
    assert (run["task"], run["seed"], run["state"], run["kind"]) == ("fetch", 7, "running", "live")


def test_opening_a_run_reports_its_tree_and_all_states(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    executor.first.append(states_event(1.0, (1, RUNNING), (2, SUCCESS), (3, RUNNING), (4, RUNNING)))
    with start_monitor().page() as page:
        state = opened(page)
    tree = next(message for message in page.seen if message["type"] == "tree")
    assert [node["name"] for node in tree["nodes"]] == ["main", "look", "again", "grasp"]
    assert [node["parent"] for node in tree["nodes"]] == [None, 1, 1, 3]
    assert state["states"] == {"0": [RUNNING, SUCCESS, RUNNING, RUNNING]}
    assert (state["time"], state["tick"], state["live"]) == (1.0, 20, True)
    assert state["running"] == [1, 3, 4]


def test_changes_come_as_deltas_with_messages(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with start_monitor().page() as page:
        opened(page)
        executor.tell(states_event(0.5, (1, RUNNING), (2, FAILURE), messages={"2": "nothing seen"}))
        told = all_changes(page, (2, FAILURE))
    assert told == [[1, RUNNING, 0, 0], [2, FAILURE, 0, FAILURE]]
    assert [message["messages"] for message in page.seen if message.get("messages")] == [{"2": "nothing seen"}]


def test_a_node_that_its_parent_reset_at_once_still_shows_what_it_returned(
    executor: FakeExecutor, start_monitor: StartMonitor
) -> None:
    with start_monitor().page() as page:
        opened(page)
        executor.tell(states_event(0.5, (2, SUCCESS), (2, IDLE)))
        assert all_changes(page, (2, IDLE)) == [[2, IDLE, 0, SUCCESS]]


def test_the_past_is_shown_while_the_run_goes_on(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with start_monitor().page() as page:
        opened(page)
        executor.tell(*(states_event(second, (2, RUNNING if second % 2 else SUCCESS)) for second in range(1, 9)))
        page.next("delta", lambda delta: delta["time"] == 8)
        page.ask("seek", id=ID, time=3.4)
        past = page.next("state")
        assert (past["time"], past["live"], past["states"]["0"][1]) == (3.4, False, RUNNING)
        assert past["statistics"]["2"] == [2, 1, 0, pytest.approx(1.4)]
        executor.tell(states_event(9.0, (1, RUNNING)))
        assert page.next("extent", lambda extent: extent["last"] == 9.0)["first"] == 0.0
        page.ask("live", id=ID)
        now = page.next("state")
        assert (now["time"], now["live"], now["states"]["0"][:2]) == (9.0, True, [RUNNING, SUCCESS])
        assert not any(message["type"] == "delta" for message in page.seen[page.seen.index(past) :])


def test_blackboard_changes_are_reported_and_removed_entries_become_null(
    executor: FakeExecutor, start_monitor: StartMonitor
) -> None:
    def board(time_s: float, **entry: Any) -> Message:
        return {"event": "blackboard", "time": time_s, "tick": 1, "entries": {"": {"cup": {"value": None, **entry}}}}

    with start_monitor().page() as page:
        opened(page)
        executor.tell(board(1.0, type="text", text="red"))
        delta = page.next("delta", lambda delta: "blackboard" in delta)
        assert delta["blackboard"][""]["cup"] == {"type": "text", "text": "red", "value": None, "changed_at": 1.0}
        executor.tell(board(2.0, type="", text=""))
        assert page.next("delta", lambda delta: "blackboard" in delta)["blackboard"] == {"": {"cup": None}}
        page.ask("seek", id=ID, time=1.5)
        assert page.next("state")["blackboard"][""]["cup"]["text"] == "red"


def test_robot_scan_and_joint_curves_reach_the_page(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    def robot(time_s: float, angle: float) -> Message:
        place = {"base": [time_s, 0.0, 0.0], "believed_std": [0.01, 0.02], "joints": {"elbow": angle}}
        return {"event": "robot", "time": time_s, "tick": 1, **place}

    with start_monitor().page() as page:
        opened(page)
        executor.tell(robot(1.0, 0.25), robot(2.0, 0.5))
        executor.tell({"event": "scan", "time": 2.0, "base": [2.0, 0.0, 0.0], "points": [[1.0, 2.0], [3.0, 4.0]]})
        assert page.next("delta", lambda delta: "scan" in delta)["scan"]["points"] == [[1.0, 2.0], [3.0, 4.0]]
        page.ask("series", id=ID, joints=["elbow", "no such joint"])
        series = page.next("series")["joints"]
        assert series == {"elbow": [[1.0, 0.25], [2.0, 0.5]], "no such joint": []}
        page.ask("seek", id=ID, time=1.2)
        assert page.next("state")["robot"]["joints"] == {"elbow": 0.25}


def test_pictures_are_asked_for_when_a_run_is_open_and_served_over_http(
    executor: FakeExecutor, start_monitor: StartMonitor
) -> None:
    monitor = start_monitor()
    with monitor.page() as page:
        assert [asked["topics"] for asked in executor.asked if "images" in asked.get("topics", ())] == []
        opened(page)
        wait_until(lambda: ["images"] in [asked.get("topics") for asked in executor.asked], "pictures are asked for")
        wait_until(lambda: len(executor.subscribers) == 2, "two connections")
        picture = {"event": "image", "time": 1.0, "camera": "head", "width": 1, "height": 1}
        executor.tell(picture | {"jpeg": base64.b64encode(b"\xff\xd8picture").decode()})
        image = page.next("image")
        with monitor.http() as http:
            answer = http.get(image["url"])
            assert http.get("/runs/4242-abc/images/99.jpg").status_code == 404
    assert (answer.content, answer.headers["content-type"]) == (b"\xff\xd8picture", "image/jpeg")


@pytest.mark.parametrize(
    ("control", "request_"),
    [
        ({"do": "pause"}, {"do": "pause"}),
        ({"do": "step"}, {"do": "step"}),
        ({"do": "stop"}, {"do": "stop"}),
        ({"do": "set", "key": "cup", "value": "red"}, {"do": "set", "key": "cup", "value": "red"}),
        (
            {"do": "breakpoint", "node": 4, "when": "after", "condition": "x > 1", "once": True},
            {"do": "breakpoint", "node": 4, "when": "after", "condition": "x > 1", "once": True},
        ),
        ({"do": "clear_breakpoint", "node": 4}, {"do": "clear_breakpoint", "node": 4}),
        ({"do": "clear_breakpoint"}, {"do": "clear_breakpoint"}),
        ({"do": "force", "node": 2, "result": "SUCCESS"}, {"do": "force", "node": 2, "result": "SUCCESS"}),
    ],
)
def test_controls_reach_the_executor(
    executor: FakeExecutor, start_monitor: StartMonitor, control: Message, request_: Message
) -> None:
    with start_monitor().page() as page:
        opened(page)
        page.ask(**{"what": control["do"], "id": ID, "n": 5} | {k: v for k, v in control.items() if k != "do"})
        assert page.next("answer", lambda answer: answer["for"] == 5) == {"type": "answer", "for": 5, "ok": True}
    assert executor.asked[-1] == request_


@pytest.mark.parametrize(
    ("control", "why"),
    [
        ({"do": "force", "node": 2, "result": "RUNNING"}, "force requires a result"),
        ({"do": "breakpoint", "node": 99}, "there is no node 99"),
        ({"do": "breakpoint", "node": 1, "when": "during"}, "when is 'before' or 'after'"),
        ({"do": "set", "key": "", "value": 1}, "key is a text"),
        ({"do": "set", "key": "cup"}, "set requires a value"),
        ({"do": "explode"}, "unknown request 'explode'"),
        ({"do": "seek", "time": None}, "time is a number"),
        ({"do": "seek", "time": True}, "time is a number"),
        ({"do": "seek", "time": float("nan")}, "time is a number"),
        ({"do": "seek", "time": float("inf")}, "time is a number"),
        ({"do": "series", "joints": "elbow"}, "joints should be a list"),
        ({"do": "series", "joints": ["elbow"] * 101}, "joints should be a list"),
        ({"do": "breakpoint", "node": True}, "node is the number"),
        ({"do": "breakpoint", "node": 0}, "there is no node 0"),
        ({"do": "breakpoint", "node": 2, "once": 1}, "once is true or false"),
        ({"do": "breakpoint", "node": 2, "condition": "x" * 4097}, "condition is a text of 1 to 4096"),
        ({"do": "set", "key": "cup", "value": 1, "scope": 3}, "scope is a text"),
    ],
)
def test_what_cannot_be_carried_out_is_refused_with_the_reason(
    executor: FakeExecutor, start_monitor: StartMonitor, control: Message, why: str
) -> None:
    with start_monitor().page() as page:
        opened(page)
        count = len(executor.asked)
        page.ask(**{"what": control["do"], "id": ID, "n": 5} | {k: v for k, v in control.items() if k != "do"})
        answer = page.next("answer", lambda answer: answer["for"] == 5)
    assert not answer["ok"]
    assert why in answer["error"]
    assert "subscribe" in {asked["do"] for asked in executor.asked[count:]} or len(executor.asked) == count


def test_a_stop_waits_for_nothing_that_was_asked_before(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    executor.unanswered = {"pause", "step"}
    with start_monitor().page() as page:
        opened(page)
        for number in range(40):
            page.ask("pause" if number % 2 else "step", id=ID, n=number)
        page.ask("stop", id=ID, n="stop")
        answers = [page.next("answer", lambda answer: answer["for"] == "stop")]
        assert not [message for message in page.seen if message["type"] == "answer" and message["for"] in range(40)]
    assert answers[0]["ok"]
    assert executor.asked.count({"do": "stop"}) == 1
    time.sleep(0.2)  # whatever else would come
    assert len([asked for asked in executor.asked if asked["do"] in executor.unanswered]) <= MOST_CONTROLS + 1


def test_a_page_opens_so_many_runs_and_a_run_that_is_closed_makes_room(start_monitor: StartMonitor) -> None:
    names = [f"77-{number}" for number in range(MOST_OPEN + 1)]
    executors = [FakeExecutor(name) for name in names]
    monitor = start_monitor()
    try:
        with monitor.page() as page:
            wait_until(lambda: len(monitor.server.runs.summaries()) == len(executors), "all are listed")
            for number in [*range(MOST_OPEN), 0]:  # the first one twice
                page.ask("open", id=f"77-{number}", n=number)
                assert page.next("answer", lambda answer, n=number: answer["for"] == n)["ok"]
            page.ask("open", id=f"77-{MOST_OPEN}", n="more")
            refused = page.next("answer", lambda answer: answer["for"] == "more")
            assert refused["error"] == f"at most {MOST_OPEN} runs can be open at a time"
            run = monitor.server.runs.get("77-0")
            assert run is not None
            assert len(run.watchers) == 1
            page.ask("close", id="77-0", n="close")
            assert page.next("answer", lambda answer: answer["for"] == "close")["ok"]
            assert run.watchers == set()
            page.ask("open", id=f"77-{MOST_OPEN}", n="again")
            assert page.next("answer", lambda answer: answer["for"] == "again")["ok"]
        wait_until(
            lambda: not any(run.watchers for run in map(monitor.server.runs.get, names) if run),
            "a page that goes looks no more",
        )
    finally:
        for executor in executors:
            executor.close()


def test_so_many_pages_are_served_and_one_that_goes_makes_room(
    start_monitor: StartMonitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bestman_bt.monitor.server.MOST_VIEWERS", 3)
    monitor = start_monitor()
    with ExitStack() as pages:
        opened_pages = [pages.enter_context(monitor.page()) for _ in range(3)]
        for page in opened_pages:
            page.next("hello")
        with monitor.page() as fourth, pytest.raises(ConnectionClosed) as caught:
            fourth.next("hello")
        assert caught.value.rcvd is not None
        assert (caught.value.rcvd.code, caught.value.rcvd.reason) == (1013, "3 pages are open already")
        opened_pages[0].connection.close()

        def is_served() -> bool:
            with monitor.page() as page:
                try:
                    return page.next("hello")["runs"] == []
                except ConnectionClosed:
                    return False

        wait_until(is_served, "there is room")


def test_a_page_that_asks_too_often_is_read_later(
    executor: FakeExecutor, start_monitor: StartMonitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bestman_bt.monitor.viewer.REQUESTS_A_SECOND", 20)
    with start_monitor().page() as page:
        opened(page)
        start = time.monotonic()
        for number in range(40):
            page.ask("live", id=ID, n=number)
        page.next("answer", lambda answer: answer["for"] == 39)
    assert time.monotonic() - start > 0.5, "20 at once, and 20 more within a second"


def test_pictures_are_served_as_what_they_are(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    png = b"\x89PNG\r\n"
    image = {"event": "image", "time": 1.0, "camera": "head", "width": 1, "height": 1}
    executor.first.append(image | {"jpeg": base64.b64encode(png).decode()})
    monitor = start_monitor()
    with monitor.page() as page, monitor.http() as http:
        opened(page)
        answer = http.get(page.next("image")["url"])
        assert http.get(f"/runs/{ID}/images/x.jpg").status_code == 404
        assert "there is no such run" in http.get("/runs/nobody/images/1.jpg").json()["error"]
    assert (answer.content, answer.headers["content-type"]) == (png, "image/png")
    assert answer.headers["cache-control"] == "private, max-age=3600"


def test_what_the_executor_refuses_is_reported(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with start_monitor().page() as page:
        opened(page)
        executor.answer = {"ok": False, "error": "the execution has ended"}
        page.ask("pause", id=ID, n=1)
        answer = page.next("answer", lambda answer: answer["for"] == 1)
    assert answer == {"type": "answer", "for": 1, "ok": False, "error": "the execution has ended"}


def test_a_read_only_monitor_shows_and_controls_nothing(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with start_monitor(read_only=True).page() as page:
        opened(page)
        assert page.seen[0]["read_only"] is True
        for number, what in enumerate(["pause", "stop", "halt", "set", "force", "breakpoint"]):
            page.ask(what, id=ID, n=number)
            assert "--read-only" in page.next("answer", lambda answer, n=number: answer["for"] == n)["error"]
    assert {asked["do"] for asked in executor.asked} == {"subscribe"}


def test_pauses_breakpoints_and_the_end_are_reported(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    point = {"node": 4, "when": "before", "condition": None, "once": False}
    with start_monitor().page() as page:
        opened(page)
        executor.tell({"event": "breakpoints", "breakpoints": [point]})
        assert page.next("delta", lambda delta: "breakpoints" in delta)["breakpoints"] == [point]
        executor.tell({"event": "paused", "time": 1.0, "reason": "breakpoint", "node": "main/grasp", "when": "before"})
        paused = page.next("delta", lambda delta: "paused" in delta)["paused"]
        assert (paused["reason"], paused["node"], paused["time"]) == ("breakpoint", "main/grasp", 1.0)
        page.next("runs", lambda message: message["runs"][0]["state"] == "paused")
        executor.tell({"event": "resumed", "time": 1.0})
        assert page.next("delta", lambda delta: "paused" in delta)["paused"] is None
        executor.tell({"event": "end", "time": 2.0, "outcome": "failure", "tree_status": "FAILURE", "why": "no cup"})
        (run,) = page.next("runs", lambda message: message["runs"][0]["state"] == "ended")["runs"]
        page.ask("pause", id=ID, n=1)
        assert page.next("answer", lambda answer: answer["for"] == 1)["error"] == "the run is over"
    assert (run["outcome"], run["time"]) == ("failure", 2.0)


def test_log_lines_come_with_the_first_ones_marked(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    line = {
        "event": "log",
        "time": 1.0,
        "level": "error",
        "message": "no cup",
        "node": "main/look",
        "where": "",
        "code": "not_found",
    }
    executor.first.append(line)
    with start_monitor().page() as page:
        opened(page)
        first = page.next("log")
        executor.tell(line | {"message": "<script>alert(1)</script>"})
        second = page.next("log")
    assert (first["reset"], [told["message"] for told in first["lines"]]) == (True, ["no cup"])
    assert [told["message"] for told in second["lines"]] == ["<script>alert(1)</script>"]
    added = {"message": "<script>alert(1)</script>", "logger": "tree", "obstacle": None}
    assert second["lines"][0] == line | added


def test_an_executor_that_vanishes_is_lost_and_its_successor_is_found(
    executor: FakeExecutor, start_monitor: StartMonitor
) -> None:
    with start_monitor().page() as page:
        opened(page)
        executor.close()
        page.next("runs", lambda message: [run["state"] for run in message["runs"]] == ["lost"])
        again = FakeExecutor("4242-abd", seed=8)
        try:
            listed = page.next("runs", lambda message: len(message["runs"]) == 2)["runs"]
            page.ask("open", id="4242-abd")
            assert page.next("state", lambda state: state["id"] == "4242-abd")["live"]
        finally:
            again.close()
    assert [(run["seed"], run["state"]) for run in listed] == [(8, "running"), (7, "lost")]


def test_a_broken_connection_is_made_anew_without_counting_twice(
    executor: FakeExecutor, start_monitor: StartMonitor
) -> None:
    executor.first.append(states_event(1.0, (2, SUCCESS)))
    with start_monitor().page() as page:
        opened(page)
        wait_until(lambda: len(executor.subscribers) == 2, "events and pictures are followed")
        broken, executor.subscribers = executor.subscribers, []
        for connection in broken:
            connection.shutdown(socket.SHUT_RDWR)
        wait_until(lambda: len(executor.subscribers) == 2, "the monitor comes again, for events and for pictures")
        executor.tell(states_event(2.0, (3, RUNNING)))
        page.next("delta", lambda delta: [3, RUNNING, 0, 0] in delta["changes"])
        page.ask("live", id=ID)
        state = page.next("state")
    assert state["statistics"]["2"] == [1, 1, 0, 0.0]


def test_trees_loaded_while_running_appear_under_their_leaf(
    executor: FakeExecutor, start_monitor: StartMonitor
) -> None:
    inner = {"uid": 1, "parent": None, "name": "plan", "type": "Sequence", "category": "control", "path": "plan"}
    with start_monitor().page() as page:
        opened(page)
        executor.tell(
            {
                "event": "tree",
                "tree": 3,
                "under": 4,
                "id": "Plan",
                "xml": "",
                "nodes": [
                    {**inner, "ports": {}, "scope": ""},
                    {**inner, "uid": 2, "parent": 1, "ports": {}, "scope": ""},
                ],
            }
        )
        nodes = page.next("tree", lambda tree: len(tree["nodes"]) == 6)["nodes"]
        executor.tell(states_event(1.0, (2, FAILURE), tree=3))
        assert all_changes(page, (6, FAILURE)) == [[6, FAILURE, 0, FAILURE]]
        page.ask("force", id=ID, n=1, node=6, result="SUCCESS")
        refused = page.next("answer", lambda answer: answer["for"] == 1)
    assert [(node["uid"], node["parent"]) for node in nodes[4:]] == [(5, 4), (6, 5)]
    assert "only nodes of the main tree" in refused["error"]
    assert {asked["do"] for asked in executor.asked} == {"subscribe"}


def test_damaged_events_are_left_out_and_the_rest_is_shown(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with start_monitor().page() as page:
        opened(page)
        executor.tell({"event": "states", "time": "late"}, {"no": "event"}, states_event(1.0, tree=77))
        executor.tell(states_event(1.0, (99, SUCCESS), (2, 250), (2, SUCCESS)), {"event": "states", "time": 1e300})
        for connection in executor.subscribers:
            connection.sendall(b"[" * 100_000 + b"\n")
        executor.tell(states_event(2.0, (3, RUNNING)))
        assert all_changes(page, (3, RUNNING)) == [[2, SUCCESS, 0, SUCCESS], [3, RUNNING, 0, 0]]


def test_a_request_that_is_no_request_is_reported_and_the_page_goes_on(
    executor: FakeExecutor, start_monitor: StartMonitor
) -> None:
    with start_monitor().page() as page:
        opened(page)
        for text in (
            "no json",
            "[1, 2]",
            "[" * 10_000,
            '{"do": "open", "id": "../../etc/passwd"}',
            '{"do": 3}',
        ):
            page.connection.send(text)
            assert page.next("problem")["message"]
        page.ask("live", id=ID)
        assert page.next("state")["live"]


def test_many_ticks_a_second_are_merged_to_thirty_messages(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    with start_monitor().page() as page:
        opened(page)
        for tick in range(1, 401):
            executor.tell(states_event(tick / 400, (2, RUNNING if tick % 2 else IDLE)))
        page.next("delta", lambda delta: delta["time"] == 1.0)
        deltas = [message for message in page.seen if message["type"] == "delta"]
        page.ask("live", id=ID)
        statistics = page.next("state")["statistics"]["2"]
    assert len(deltas) < 100
    assert statistics[0] == 200


def test_a_page_that_does_not_read_delays_no_other(executor: FakeExecutor, start_monitor: StartMonitor) -> None:
    text = "x" * 3000
    monitor = start_monitor()
    with monitor.page() as asleep, monitor.page() as page:
        opened(asleep)
        opened(page)
        for tick in range(1, 301):
            executor.tell(
                states_event(tick / 20, (2, tick % 2), messages={str(uid): f"{tick}{text}" for uid in (1, 2, 3)})
            )
        assert page.next("delta", lambda delta: delta["time"] == 15.0)["id"] == ID


@pytest.mark.slow
def test_an_executor_that_was_killed_is_lost_within_seconds_and_its_socket_removed(
    start_monitor: StartMonitor, tmp_path: Path
) -> None:
    """``kill -9`` leaves the socket's file behind, at which nobody listens any more."""
    code = (
        "import time\nfrom tests.monitor.conftest import FakeExecutor\n"
        f"FakeExecutor({ID!r}).first[0]['folder'] = {str(tmp_path)!r}\nprint('ready', flush=True)\ntime.sleep(600)"
    )
    search = {"PYTHONPATH": str(Path(__file__).parents[2])}
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=os.environ | search)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        path = socket_folder() / f"{ID}.sock"
        link_folder(path, tmp_path)
        monitor = start_monitor()
        with monitor.page() as page:
            opened(page)
            process.kill()
            process.wait()
            assert path.exists()
            (run,) = page.next("runs", lambda message: message["runs"][0]["state"] == "lost", seconds=5.0)["runs"]
            page.ask("pause", id=ID, n=1)
            assert page.next("answer", lambda answer: answer["for"] == 1)["error"] == "the run is over"
    finally:
        process.kill()
        process.communicate()
    assert run["id"] == ID
    assert not path.exists()
    assert not (tmp_path / "control.sock").is_symlink()
    wait_until(lambda: monitor.server.runs.is_idle, "the monitor may end", seconds=5.0)


def test_a_request_that_meets_a_mistake_of_ours_is_answered_and_the_page_goes_on(
    executor: FakeExecutor, start_monitor: StartMonitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise OverflowError("too large")

    monkeypatch.setattr(Timeline, "document", broken)
    with start_monitor().page() as page:
        opened(page)
        page.ask("timeline", id=ID, n=1)
        assert "did not expect: OverflowError" in page.next("answer", lambda answer: answer["for"] == 1)["error"]
        page.ask("timeline", id=ID)
        assert "did not expect: OverflowError" in page.next("problem")["message"]
        page.ask("live", id=ID)
        assert page.next("state")["live"]
