"""``bestman-bt monitor``, and ``--monitor`` of the verbs that run something."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from bestman_bt.cli.started_monitor import show_in_monitor
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.engine import load_tree
from bestman_bt.monitor.groot2.publisher import Groot2Publisher
from bestman_bt.monitor.recorded import identity_of
from bestman_bt.records.reader import read
from tests.cli.command_line import Program, wait_for
from tests.monitor.conftest import wait_until
from tests.rigs.free_port import free_port


@pytest.fixture(autouse=True)
def own_sockets(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The monitors of these tests see nobody's robots."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def ended(port: int) -> Iterator[None]:
    """Ends the monitor that a test has started on the free port."""
    yield
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if b"monitor" in words and str(port).encode() in words:
            os.kill(int(process.name), signal.SIGTERM)


def refusal(folder: Path, *arguments: object) -> str:
    answer = Program("monitor", *arguments, "--no-browser", folder=folder).answer()
    assert (answer.code, answer.out) == (2, "")
    return answer.err


def address_of(program: Program) -> str:
    assert program.process.stdout is not None
    line = program.process.stdout.readline()
    assert line.startswith("monitor: http://")
    return line.split()[1]


@pytest.mark.slow
def test_what_cannot_be_shown_is_reported_before_anything_starts(tmp_path: Path, port: int) -> None:
    assert "is not a run folder or log, and contains none" in refusal(tmp_path, tmp_path / "nothing")
    assert "at least 16 characters" in refusal(tmp_path, "--token", "short")
    with socket.socket() as other:
        other.bind(("127.0.0.1", port))
        other.listen()
        assert f"--port {port}: cannot listen there" in refusal(tmp_path, "--port", port)


@pytest.mark.slow
def test_another_host_than_loopback_prints_a_token_and_a_name_that_open_the_page(tmp_path: Path) -> None:
    program = Program("monitor", "--host", "0.0.0.0", "--port", 0, "--no-browser", folder=tmp_path)
    try:
        address = address_of(program)
        found = re.fullmatch(r"http://([^/:]+):(\d+)/\?token=([\w-]{32})", address)
        assert found is not None
        assert found[1] == socket.gethostname()
        local = f"http://127.0.0.1:{found[2]}/"
        with pytest.raises(HTTPError, match="401"):
            urlopen(local)
        with urlopen(f"{local}health") as answer:
            assert json.load(answer) == {"service": "bestman-bt monitor"}
        with urlopen(Request(f"{local}health", headers={"Authorization": f"Bearer {found[3]}"})) as answer:
            assert json.load(answer)["sockets"].startswith(os.environ["XDG_RUNTIME_DIR"])
    finally:
        program.interrupt()
    answer_ = program.answer()
    assert (answer_.code, answer_.err) == (130, "")


@pytest.mark.slow
def test_a_monitor_ends_by_itself_where_nobody_needs_it(tmp_path: Path) -> None:
    program = Program("monitor", "--port", 0, "--no-browser", "--end-when-idle", 1, folder=tmp_path)
    assert address_of(program)
    assert program.answer(60.0).code == 0


@pytest.mark.usefixtures("ended")
def test_a_monitor_is_started_once_and_found_again(port: int, capsys: pytest.CaptureFixture[str]) -> None:
    show_in_monitor(port)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(subprocess, "Popen", None)
        show_in_monitor(port)
    assert capsys.readouterr().err == f"monitor: http://127.0.0.1:{port}/\n" * 2


@pytest.mark.slow
@pytest.mark.usefixtures("ended")
def test_runs_that_begin_together_share_the_monitor_that_one_of_them_starts(
    port: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with ThreadPoolExecutor(2) as runs:
        list(runs.map(show_in_monitor, [port, port]))
    assert capsys.readouterr().err == f"monitor: http://127.0.0.1:{port}/\n" * 2


@pytest.mark.slow
@pytest.mark.usefixtures("ended")
def test_a_monitor_with_a_token_is_found_by_who_knows_it_and_told_to_who_does_not(
    port: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BESTMAN_BT_MONITOR_TOKEN", "sixteen & more #s")
    for _ in range(2):
        show_in_monitor(port)
    told = f"monitor: http://127.0.0.1:{port}/?token=sixteen%20%26%20more%20%23s\n"
    assert capsys.readouterr().err == told * 2
    monkeypatch.delenv("BESTMAN_BT_MONITOR_TOKEN")
    with pytest.raises(ConfigurationError, match="demands another token: set BESTMAN_BT_MONITOR_TOKEN"):
        show_in_monitor(port)


def test_a_port_that_another_program_has_is_reported(port: int) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", port))
        other.listen()
        told = f"^--monitor: the monitor does not start on port {port}: cannot listen there: .*--monitor-port"
        with pytest.raises(ConfigurationError, match=told):
            show_in_monitor(port)


@pytest.mark.slow
def test_one_or_two_recorded_runs_are_opened_at_once(tmp_path: Path) -> None:
    runs = [tmp_path / name for name in ("a", "b")]
    for run in runs:
        run.mkdir()
        (run / "transitions.btlog").write_bytes(b"")
    program = Program("monitor", *runs, "--port", 0, "--no-browser", "--end-when-idle", 1, folder=tmp_path)
    address = address_of(program)
    assert program.answer(60.0).code == 0
    assert address.endswith(f"/#{identity_of(runs[0])}&{identity_of(runs[1])}")


@pytest.mark.slow
@pytest.mark.parametrize(("ends_by", "options"), [(signal.SIGTERM, []), (signal.SIGINT, ["--states-only"])])
def test_a_process_that_is_watched_leaves_a_run_folder_with_an_end(
    tmp_path: Path, ends_by: signal.Signals, options: list[str]
) -> None:
    xml = '<root BTCPP_format="4"><BehaviorTree ID="Nap"><Sleep name="nap" msec="60000"/></BehaviorTree></root>'
    port, tree = free_port(), load_tree(xml)
    connected = ("--connect", f"groot2://127.0.0.1:{port}", "--runs", "kept")
    with Groot2Publisher(tree, port):
        program = Program("monitor", "--port", 0, "--no-browser", *connected, *options, folder=tmp_path)
        assert address_of(program)
        tree.tick_exactly_once()
        found = wait_for(tmp_path, "kept/*-Nap/transitions.btlog")
        wait_until(lambda: read(found.parent).states.now.running() == [1], "the leaf runs")
        program.process.send_signal(ends_by)
        assert program.answer().code == {signal.SIGTERM: 0, signal.SIGINT: 130}[ends_by]
    history = read(found.parent)
    assert history.end is not None
    assert (history.end["outcome"], history.end["why"]) == ("cancelled", "the watching ended")
    assert any("changes are not recorded" in line.message for _, line in history.log) == bool(options)


@pytest.mark.slow
@pytest.mark.parametrize("address", ["127.0.0.1:1667", "groot2://:1667", "groot2://robot:0", "groot1://robot:1667"])
def test_an_address_that_is_none_starts_nothing(tmp_path: Path, address: str) -> None:
    assert f"--connect: '{address}'" in refusal(tmp_path, "--connect", address)


def test_states_only_without_a_process_is_refused(tmp_path: Path) -> None:
    assert "--states-only: applies only to processes watched with --connect" in refusal(tmp_path, "--states-only")
