"""Worker processes: an episode that kills its process, or hangs, costs only itself."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from bestman_bt.configuration.run import RunConfig, load_run
from bestman_bt.evaluation.code_version import code_fingerprint
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, LaunchOptions
from bestman_bt.evaluation.launchers.local import LocalProcesses
from bestman_bt.evaluation.launchers.worker_process import EpisodeAnswer, WorkerProcess
from bestman_bt.evaluation.result import Outcome

pytestmark = pytest.mark.slow

CHECKOUT = Path(__file__).resolve().parents[3]
TREE = '<root BTCPP_format="4"><BehaviorTree ID="Main"><{leaf}/></BehaviorTree></root>'
DEADLY = '''
import os
import time

from bestman_bt.engine import FAILURE, SyncAction


class Die(SyncAction):
    """Takes its process along."""

    def on_tick(self) -> int:
        os._exit(3)


class Hang(SyncAction):
    """Never gives the turn back."""

    def on_tick(self) -> int:
        time.sleep(600)
        return FAILURE


class Leave(SyncAction):
    """Ends the program as a script does that went well."""

    def on_tick(self) -> int:
        raise SystemExit(0)


class Killed(SyncAction):
    """Is ended by the kernel each time."""

    def on_tick(self) -> int:
        os.kill(os.getpid(), 9)
        return FAILURE


class KilledOnce(SyncAction):
    """Is ended by the kernel the first time."""

    def on_tick(self) -> int:
        try:
            open("killed_once", "x").close()
        except FileExistsError:
            return FAILURE
        os.kill(os.getpid(), 9)
        return FAILURE
'''


def deadly(folder: Path, *leaves: str) -> list[RunConfig]:
    """A run for each leaf, in a tree of its own."""
    (folder / "deadly.py").write_text(DEADLY)
    for leaf in leaves:
        (folder / f"{leaf}.xml").write_text(TREE.format(leaf=leaf))
    return [load_run("fetch_cup", tree=folder / f"{leaf}.xml", plugins=[str(folder / "deadly.py")]) for leaf in leaves]


def started(configs: Sequence[RunConfig], hanging: int | None = None) -> LocalProcesses:
    """``hanging``: which of them is given 10 seconds of wall time instead of minutes."""
    launcher = LocalProcesses(LaunchOptions(2))
    limits = [10.0 if index == hanging else 300.0 for index in range(len(configs))]
    launcher.submit([EpisodeRequest(config, wall_limit=limit) for config, limit in zip(configs, limits, strict=True)])
    return launcher


def test_an_episode_that_kills_its_process_or_hangs_costs_only_itself(tmp_path: Path) -> None:
    configs = deadly(tmp_path, "Die", "AlwaysFailure", "Hang", "AlwaysFailure")
    results = dict(started(configs, hanging=2).results())
    assert [results[i].outcome for i in range(4)] == [Outcome.ERROR, Outcome.FAILURE] * 2
    told = [results[i].failure.why for i in (0, 2) if results[i].failure is not None]
    assert told[0] == "the process ended with code 3"
    assert re.match(r"given up after 1\d\b", told[1])


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_episode_that_ends_the_program_is_an_error_in_each_process(jobs: int, tmp_path: Path) -> None:
    launcher = LocalProcesses(LaunchOptions(jobs))
    launcher.submit([EpisodeRequest(config) for config in deadly(tmp_path, "Leave", "AlwaysFailure")])
    results = dict(launcher.results())
    assert [results[place].outcome for place in range(2)] == [Outcome.ERROR, Outcome.FAILURE]
    assert results[0].failure is not None
    assert re.search(r"\[Leave\]: SystemExit: 0 \(at .*/deadly.py:\d+\)$", results[0].failure.why)


def test_an_episode_whose_worker_is_ended_from_outside_is_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    launcher = started(deadly(tmp_path, "KilledOnce", "AlwaysFailure", "Killed"))
    results = dict(launcher.results())
    assert {place: result.outcome for place, result in results.items()} == dict.fromkeys((0, 1), Outcome.FAILURE)
    why = "its worker was ended by signal 9, often for lack of memory, of which fewer --jobs need less"
    assert launcher.given_up == {2: why}
    assert launcher.notes == [f"3 times an episode was run again: {why}"]


def test_workers_end_with_the_process_that_they_work_for(tmp_path: Path) -> None:
    (tmp_path / "deadly.py").write_text(DEADLY)
    (tmp_path / "hang.xml").write_text(TREE.format(leaf="Hang"))
    program = f"""
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.code_version import code_fingerprint
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, LaunchOptions
from bestman_bt.evaluation.launchers.local import LocalProcesses
if __name__ == "__main__":
    config = load_run("fetch_cup", tree={str(tmp_path / "hang.xml")!r}, plugins=[{str(tmp_path / "deadly.py")!r}])
    launcher = LocalProcesses(LaunchOptions(2))
    launcher.submit([EpisodeRequest(config)])
    list(launcher.results())
"""
    (tmp_path / "program.py").write_text(program)
    parent = subprocess.Popen([sys.executable, str(tmp_path / "program.py")])
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children")
    workers: list[str] = []
    deadline = time.monotonic() + 60.0
    while not workers and time.monotonic() < deadline:
        started = children.read_text().split()
        with suppress(OSError):  # one may have ended meanwhile
            workers = [pid for pid in started if b"worker_process" in Path(f"/proc/{pid}/cmdline").read_bytes()]
        time.sleep(0.05)
    assert workers
    time.sleep(2.0)  # they are at work, or on the way to it
    parent.kill()
    parent.wait()
    while any(is_running(pid) for pid in workers):
        assert time.monotonic() < deadline, "workers are still there"
        time.sleep(0.05)


UNPACKS = '''
from pathlib import Path

from bestman_bt.engine import SUCCESS, SyncAction
from bestman_bt.evaluation import judge


class UnpackAgain(SyncAction):
    """Replaces a file of the code by the same one, as where it is unpacked anew."""

    def on_tick(self) -> int:
        file = Path(judge.__file__)
        content = file.read_bytes()
        file.unlink()
        file.write_bytes(content)
        return SUCCESS
'''


@pytest.mark.parametrize("leaf", ["<UnpackAgain/>", "<Inverter><UnpackAgain/></Inverter>"])
def test_a_result_during_which_the_code_was_unpacked_anew_is_dropped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, leaf: str
) -> None:
    code = tmp_path / "code"
    shutil.copytree(
        CHECKOUT / "bestman_bt", code / "bestman_bt", ignore=shutil.ignore_patterns("node_modules", "__pycache__")
    )
    for name in ("behaviours", "hal", "assets", "configs", "trees", "pyproject.toml"):
        (code / name).symlink_to(CHECKOUT / name)
    monkeypatch.syspath_prepend(str(code))
    (tmp_path / "unpacks.py").write_text(UNPACKS)
    (tmp_path / "t.yaml").write_text("tree: t.xml\nscene: kitchen\nrobot: diff_panda\nplugins: [unpacks.py]\n")
    (tmp_path / "t.xml").write_text(TREE.replace("<{leaf}/>", leaf))
    (tmp_path / "untouched.xml").write_text(TREE.format(leaf="AlwaysSuccess"))
    request = EpisodeRequest(load_run(tmp_path / "t.yaml"), code=code_fingerprint())
    untouched = load_run(tmp_path / "t.yaml", tree=tmp_path / "untouched.xml")
    worker = WorkerProcess()
    answers = []
    for asked in (replace(request, config=untouched), request):
        worker.give(asked.pickled(), 300.0)
        while (answer := worker.answer(1.0)) is None:
            pass
        answers.append(answer)
    assert answers[0].result
    assert answers[1] == EpisodeAnswer(lost="files of the code were replaced while it ran")
    assert not worker.alive


def is_running(pid: str) -> bool:
    """Whether a process has not ended, be it that nobody has asked how yet."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):  # it may end while it is read
        return False


def test_what_a_plug_in_warns_of_is_reported_once_and_not_by_each_episode(tmp_path: Path) -> None:
    (tmp_path / "warns.py").write_text(
        "import logging\nimport warnings\n\nwarnings.warn('mind')\nlogging.getLogger('mine').warning('mind, too')\n"
        "def register(registry): ...\n"
    )
    (tmp_path / "t.xml").write_text(TREE.format(leaf="AlwaysSuccess"))
    (tmp_path / "t.yaml").write_text("tree: t.xml\nscene: kitchen\nrobot: diff_panda\nplugins: [warns.py]\n")
    for jobs in ("1", "2"):
        command = [sys.executable, "-m", "bestman_bt.cli.main", "eval", "t.yaml", "--episodes", "2", "--jobs", jobs]
        done = subprocess.run(
            [*command, "--out", f"out{jobs}"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
        )
        assert done.returncode == 0, done.stderr
        assert "t.yaml, seed 1: success" in done.stderr
        assert [done.stderr.count(words) for words in ("UserWarning: mind", "mind, too")] == [1, 1]


def children() -> set[str]:
    return set(Path(f"/proc/self/task/{threading.get_native_id()}/children").read_text().split())


def test_temporary_files_of_a_worker_go_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = children()
    worker = WorkerProcess()
    (folder,) = tmp_path.iterdir()
    (child,) = children() - before
    assert f"TMPDIR={folder}".encode() in Path(f"/proc/{child}/environ").read_bytes().split(b"\0")
    (folder / "mesh.obj").write_text("of an episode")
    worker.kill()
    assert not list(tmp_path.iterdir())
