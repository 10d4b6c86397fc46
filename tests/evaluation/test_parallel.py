"""Worker processes: an episode that kills its process, or hangs, costs only itself."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration import RunConfig, load_run
from bestman_bt.evaluation.parallel import run_episodes
from bestman_bt.evaluation.result import Outcome

pytestmark = pytest.mark.slow

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
'''


def test_an_episode_that_kills_its_process_or_hangs_costs_only_itself(tmp_path: Path) -> None:
    (tmp_path / "deadly.py").write_text(DEADLY)

    def of(leaf: str) -> RunConfig:
        path = tmp_path / f"{leaf}.xml"
        path.write_text(TREE.format(leaf=leaf))
        return load_run("fetch_cup", tree=path, plugins=[str(tmp_path / "deadly.py")])

    configs = [of("Die"), of("AlwaysFailure"), of("Hang"), of("AlwaysFailure")]
    results = dict(run_episodes(configs, 2, wall_limit=10.0))
    assert [results[i].outcome for i in range(4)] == [Outcome.ERROR, Outcome.FAILURE] * 2
    told = [results[i].failure.why for i in (0, 2) if results[i].failure is not None]
    assert told[0] == "the process ended with code 3"
    assert told[1].startswith("given up after 1")
