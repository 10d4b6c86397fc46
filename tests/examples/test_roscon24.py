"""The example of the ROSCon 2024 workshop, on a world that PyRoboSim brings; trees in the workshop's form."""

from __future__ import annotations

import importlib
import json
import shutil
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

EXAMPLE = Path(__file__).parents[2] / "examples" / "roscon24"
FAILING = {"navigate": (0.9, 0.5), "pick": (0.5, 5.0), "place": (0.5, 5.0), "open": (0.75, 8.0), "close": (0.75, 8.0)}
"""Action → probability of success, and use of the battery in percent (of a drive: per metre)."""
TREE = """
<root BTCPP_format="4">
  <BehaviorTree ID="MainTree">
    <Sequence>
      <SubTree ID="Bring" from="pantry" thing="bread0"/>
      <SubTree ID="Bring" from="fridge" thing="butter0"/>
      {close}
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="Bring">
    <Sequence>
      <Navigate target="{{from}}"/>
      <Open target="{{from}}"/>
      <DetectObject object="{{thing}}"/>
      <PickObject object="{{thing}}"/>
      <Navigate target="table"/>
      <GetCurrentLocation location="{{here}}"/>
      <ScriptCondition code="here == 'table_tabletop'"/>
      <IsBatteryFull full_threshold="50"/>
      <Inverter><IsBatteryLow/></Inverter>
      <PlaceObject object="{{thing}}"/>
    </Sequence>
  </BehaviorTree>
</root>"""
CLOSE = "".join(f'<Navigate target="{place}"/><Close target="{place}"/>' for place in ("pantry", "fridge"))


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    pytest.importorskip("pyrobosim", reason="the extra pyrobosim is not installed")
    monkeypatch.syspath_prepend(str(EXAMPLE))
    return importlib.import_module("run")


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """The folder of worlds and trees: in world 3 nothing fails, in world 4 actions fail and use the battery."""
    shipped = Path(importlib.import_module("pyrobosim").__path__[0]) / "data"
    worlds = tmp_path / "worlds"
    worlds.mkdir()
    (tmp_path / "trees").mkdir()
    for kind in ("location", "object"):
        shutil.copy(shipped / f"roscon_2024_{kind}_data.yaml", worlds)
    world = yaml.safe_load((shipped / "roscon_2024_workshop_world.yaml").read_text())
    world["robots"][0] = {
        key: value for key, value in world["robots"][0].items() if key in ("name", "radius", "location")
    } | {"path_planner": {"type": "rrt", "bidirectional": True}}
    shut = {"fridge", "pantry", "dumpster"}
    for place in world["locations"]:
        place["is_open"] = place["name"] not in shut
    (worlds / "world3.yaml").write_text(yaml.safe_dump(world))
    world["robots"][0]["action_execution_options"] = {
        kind: {"success_probability": chance, "battery_usage": usage} for kind, (chance, usage) in FAILING.items()
    }
    for hall in world["hallways"]:
        hall["is_open"] = {hall["room_start"], hall["room_end"]} in ({"dining", "kitchen"}, {"dining", "office"})
    (worlds / "world4.yaml").write_text(yaml.safe_dump(world))
    return tmp_path


def result(
    run: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: str
) -> dict[str, Any]:
    monkeypatch.setattr(sys, "argv", ["run.py", "--json", *words])
    run.main()
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


@pytest.mark.slow
def test_a_tree_of_the_workshop_runs_and_is_judged_by_its_goal(
    run: ModuleType, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ("--data", str(data), "--problem", "3")
    (data / "trees" / "problem3.xml").write_text(TREE.format(close=CLOSE))
    found = result(run, monkeypatch, capsys, *given)
    assert (found["succeeded"], found["of"], found["episodes"][0]["actions"]) == (1, 1, 16)
    (data / "trees" / "problem3.xml").write_text(TREE.format(close=""))
    left_open = result(run, monkeypatch, capsys, *given)
    assert left_open["succeeded"] == 0
    assert (left_open["episodes"][0]["tree"], left_open["episodes"][0]["unmet"]) == (
        "success",
        ["not open(fridge)", "not open(pantry)"],
    )


@pytest.mark.slow
def test_a_planned_tree_repeats_what_failed_and_recharges_in_time(
    run: ModuleType, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = result(run, monkeypatch, capsys, "--data", str(data), "--problem", "4", "--planned", "--first-seed", "3")
    (episode,) = found["episodes"]
    assert episode["succeeded"], episode
    assert episode["plans"] > 1  # the battery was low, or three actions failed
    assert 0.0 < episode["battery"] <= 100.0
    assert episode["actions"] >= 20


def test_the_battery_is_empty_when_it_ever_was(
    run: ModuleType, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bring = '<Navigate target="pantry"/><Open target="pantry"/>'
    tree = f'<root BTCPP_format="4"><BehaviorTree ID="MainTree"><Sequence>{bring}</Sequence></BehaviorTree></root>'
    (data / "trees" / "problem4.xml").write_text(tree)
    world = yaml.safe_load((data / "worlds" / "world4.yaml").read_text())
    world["robots"][0]["action_execution_options"]["navigate"] = {"battery_usage": 60.0}
    (data / "worlds" / "world4.yaml").write_text(yaml.safe_dump(world))
    (episode,) = result(run, monkeypatch, capsys, "--data", str(data), "--problem", "4")["episodes"]
    assert (episode["battery_empty"], episode["tree"], episode["succeeded"]) == (True, "failure", False)


def test_a_missing_file_is_named(
    run: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["run.py", "--data", str(tmp_path), "--problem", "2"])
    with pytest.raises(SystemExit) as ended:
        run.main()
    assert ended.value.code == 2
    assert f"there is no {tmp_path / 'worlds' / 'world2.yaml'}" in capsys.readouterr().err
