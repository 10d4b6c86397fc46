from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from bestman_bt.evaluation.film.filmed_run import FilmedRun, FilmError, read_filmed_run


def test_a_run_is_read_with_its_world_its_subjects_and_its_motion(run: FilmedRun) -> None:
    assert run.config.name == "fetch_from_fridge"
    assert run.subjects[0] == "cup"
    assert run.motion.duration == pytest.approx(1.0, abs=0.01)
    drawn = next(thing.pose for thing in run.world.objects if thing.name == "cup")
    assert run.motion.at(0.0).body_poses["cup"].position == pytest.approx(drawn.position, abs=2e-3)


def test_a_folder_without_motion_reports_what_it_lacks(run_folder: Path, tmp_path: Path) -> None:
    with pytest.raises(FilmError, match="no config.yaml"):
        read_filmed_run(tmp_path)
    shutil.copy(run_folder / "config.yaml", tmp_path)
    with pytest.raises(FilmError, match=r"no motion\.jsonl"):
        read_filmed_run(tmp_path)


def test_a_scene_that_has_changed_since_the_run_is_refused(run_folder: Path, tmp_path: Path) -> None:
    shutil.copytree(run_folder, tmp_path, dirs_exist_ok=True)
    motion = tmp_path / "motion.jsonl"
    head, _, rest = motion.read_text().partition("\n")
    document = json.loads(head)
    document["bodies"][document["bodies"].index("cup")] = "vase"
    motion.write_text(json.dumps(document) + "\n" + rest)

    with pytest.raises(FilmError, match="has changed since the run: cup, vase"):
        read_filmed_run(tmp_path)


@pytest.mark.parametrize("content", [b"\x7fELF", b"BTCPP4-FileLogger2\x01\xff\xff\xff\x7f"])
def test_a_damaged_log_of_states_is_refused_in_words(run_folder: Path, tmp_path: Path, content: bytes) -> None:
    shutil.copytree(run_folder, tmp_path, dirs_exist_ok=True)
    (tmp_path / "transitions.btlog").write_bytes(content)

    with pytest.raises(FilmError, match=r"the running leaves cannot be determined: .*transitions\.btlog"):
        read_filmed_run(tmp_path)


def test_a_damaged_motion_is_refused_with_its_line(run_folder: Path, tmp_path: Path) -> None:
    shutil.copytree(run_folder, tmp_path, dirs_exist_ok=True)
    with (tmp_path / "motion.jsonl").open("a") as motion:
        motion.write("<script>\n")

    with pytest.raises(FilmError, match=r"motion\.jsonl:\d+: no motion"):
        read_filmed_run(tmp_path)
