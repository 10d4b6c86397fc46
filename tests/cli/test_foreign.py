"""Trees of other BehaviorTree.CPP processes on the command line."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from bestman_bt.cli import simulate_command
from bestman_bt.engine import WallClock
from bestman_bt.engine.models.scenario import Scenario
from bestman_bt.engine.simulation import SimulatedRun, simulate
from bestman_bt.monitor.control_client import socket_folder
from tests.cli.command_line import Answer

Command = Callable[..., Answer]


def written(path: Path, body: str, tree_id: str = "Main") -> None:
    path.write_text(f'<root BTCPP_format="4">\n<BehaviorTree ID="{tree_id}">\n{body}\n</BehaviorTree>\n</root>')


def test_show_draws_what_is_not_here_and_reports_where_it_is_known_from(bestman_bt: Command, folder: Path) -> None:
    written(folder / "t.xml", '<Sequence><OpenLid side="{s}"/><SubTree ID="Pour"/></Sequence>')
    answer = bestman_bt("show", "t.xml")
    assert answer.code == 0
    assert "OpenLid [placeholder]  side={s}" in answer.out
    assert "OpenLid (Action): a guess from its use" in answer.err
    written(folder / "pour.xml", "<AlwaysSuccess/>", "Pour")
    assert "└── AlwaysSuccess" in bestman_bt("show", "t.xml", "--search", ".").out
    assert bestman_bt("show", "t.xml", "--svg", "t.svg").code == 0
    assert "stroke-dasharray" in (folder / "t.svg").read_text()


def test_show_draws_a_tree_with_faults_and_tells_them(bestman_bt: Command, folder: Path) -> None:
    written(folder / "t.xml", '<Sequence><AlwaysSuccess/><Sleep ms="3"/></Sequence>')
    answer = bestman_bt("show", "t.xml")
    assert answer.code == 2
    assert "AlwaysSuccess" in answer.out
    assert "unknown port 'ms'" in answer.err


def test_show_lists_each_fault_that_validate_lists(bestman_bt: Command, folder: Path) -> None:
    written(
        folder / "t.xml",
        '<Sequence><DetectObject object="cup"/>\n<LookAt sufrace="table"/>\n<Sleep ms="3"/></Sequence>',
    )
    found = bestman_bt("validate", "t.xml").err.splitlines()
    shown = [line.removeprefix("bestman-bt: ").strip() for line in bestman_bt("show", "t.xml").err.splitlines()]
    assert [fault for fault in found if fault not in shown and "warning" not in fault] == []
    assert "no code here" not in "".join(shown)


def test_show_of_a_folder_and_of_models_alone(bestman_bt: Command, folder: Path) -> None:
    written(folder / "a.xml", '<SubTree ID="B"/>')
    written(folder / "b.xml", "<AlwaysSuccess/>", "B")
    assert "Main (line 2): 1 nodes; uses B" in bestman_bt("show", ".").out
    assert '"Main" -> "B"' in bestman_bt("show", ".", "--dot").out
    assert "└── AlwaysSuccess" in bestman_bt("show", ".", "--tree", "Main").out
    model = '<Action ID="Pour"><input_port name="cup" type="std::string" default="red">which</input_port></Action>'
    (folder / "m.xml").write_text(f'<root BTCPP_format="4"><TreeNodesModel>{model}</TreeNodesModel></root>')
    told = bestman_bt("show", "m.xml").out
    assert told == "Action Pour\n    cup (input, std::string, default red): which\n"


def test_validate_tells_apart_what_is_wrong_and_what_is_missing_here(bestman_bt: Command, folder: Path) -> None:
    written(folder / "missing.xml", '<Sequence><OpenLid/>\n<OpenLid/><SubTree ID="Pour"/></Sequence>')
    answer = bestman_bt("validate", "missing.xml")
    assert answer.code == 1
    assert answer.out == "missing.xml: nothing is wrong, 3 things are missing here\n"
    assert answer.err.count("OpenLid") == 2, "one line names node and kind"
    written(folder / "wrong.xml", '<Sequence><OpenLid/><Sleep ms="3"/></Sequence>')
    assert bestman_bt("validate", "missing.xml", "wrong.xml").code == 2
    written(folder / "warned.xml", '<Timeout msec="0"><AlwaysSuccess/></Timeout>')
    assert bestman_bt("validate", "warned.xml").code == 0
    refused = bestman_bt("run", "missing.xml")
    assert refused.code == 2
    assert "unknown node 'OpenLid'" in refused.err


def test_validate_of_a_folder_sums_up(bestman_bt: Command, folder: Path) -> None:
    written(folder / "a.xml", '<Sequence><SubTree ID="B"/><OpenLid/></Sequence>')
    written(folder / "b.xml", "<Sequence><OpenLid/><CloseLid/></Sequence>", "B")
    answer = bestman_bt("validate", ".")
    assert (answer.code, answer.err) == (1, "")
    assert ".: 2 files, 2 trees; 0 wrong, 3 missing here, 0 warnings" in answer.out
    assert "        2  OpenLid\n        1  CloseLid" in answer.out
    assert "1 trees that no other uses: Main" in answer.out


def test_simulate_reports_the_outcome_and_what_was_not_tried(bestman_bt: Command, folder: Path) -> None:
    written(folder / "t.xml", '<Fallback><OpenLid side="{s}"/><CallForHelp/></Fallback>')
    (folder / "s.yaml").write_text("nodes: {OpenLid: {result: SUCCESS, duration: 2}, Opn: FAILURE}")
    answer = bestman_bt("simulate", "t.xml", "--scenario", "s.yaml", "--svg", "t.svg")
    assert answer.code == 0
    assert "t.xml: 1 run: 1 success\n  2.00 to 2.00 s of simulated time" in answer.out
    assert "67% of 3 nodes began" in answer.out
    assert "recovery never used: Fallback::1" in answer.out
    assert "the scenario's 'Opn' is not a path, name or type of a node" in answer.err
    assert "stroke-dasharray" in (folder / "t.svg").read_text()


def test_simulate_many_runs_as_json(bestman_bt: Command, folder: Path) -> None:
    written(folder / "t.xml", '<Sequence><IsOpen/><Wave _skipIf="hand == LEFT"/></Sequence>')
    told = json.loads(bestman_bt("simulate", "t.xml", "--runs", "20", "--enum", "LEFT=1", "--json").out)
    assert told["runs"] == sum(told["outcomes"].values()) == 20
    assert set(told["outcomes"]) == {"success", "failure"}
    assert told["coverage"]["share"] == 1.0
    assert bestman_bt("simulate", "t.xml", "--enum", "LEFT=1", "--scenario", "nowhere.yaml").code == 2
    written(folder / "t.xml", "<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>")
    endless = bestman_bt("simulate", "t.xml", "--limit", "5")
    assert endless.code == 1
    assert "possible endless loop: with seed 0" in endless.out


@pytest.mark.parametrize(
    "arguments", [("show", "t.xml"), ("show", "."), ("diff", "t.xml", "t.xml"), ("simulate", "t.xml")]
)
@pytest.mark.parametrize(("svg", "message"), [("gone/t.svg", "does not exist"), (".", "is a folder")])
def test_a_picture_that_cannot_be_written_is_refused_before_the_work(
    arguments: tuple[str, ...], svg: str, message: str, bestman_bt: Command, folder: Path
) -> None:
    written(folder / "t.xml", "<AlwaysSuccess/>")
    answer = bestman_bt(*arguments, "--svg", svg)
    assert (answer.code, answer.out) == (2, "")
    assert message in " ".join(answer.err.split())


@pytest.mark.parametrize("command", ["validate", "show", "simulate"])
def test_further_files_that_are_not_there_or_hold_nothing_are_refused(
    command: str, bestman_bt: Command, folder: Path
) -> None:
    written(folder / "t.xml", "<AlwaysSuccess/>")
    (folder / "none").mkdir()
    for kind in ("Action", "Condition"):
        model = f'<TreeNodesModel><{kind} ID="OpenLid"/></TreeNodesModel>'
        (folder / f"{kind}.xml").write_text(f'<root BTCPP_format="4">{model}</root>')
    for option in ("--models", "--search"):
        assert "does not exist" in bestman_bt(command, "t.xml", option, "gone").err
        answer = bestman_bt(command, "t.xml", option, "none")
        assert answer.code == 2
        assert "there are no tree files in the folder" in answer.err
    answer = bestman_bt(command, "t.xml", "--models", "Action.xml", "--models", "Condition.xml")
    assert answer.code == 2
    assert "its kind is Action at Action.xml:1, and Condition here" in answer.err


@pytest.mark.parametrize("command", ["validate", "show"])
def test_a_folder_without_trees_is_refused(command: str, bestman_bt: Command, folder: Path) -> None:
    (folder / "none").mkdir()
    answer = bestman_bt(command, "none")
    assert answer.code == 2
    assert "none: there are no tree files in the folder" in answer.err


@pytest.mark.parametrize("option", ["--limit", "--period"])
def test_simulated_times_are_finite_numbers(option: str, bestman_bt: Command, folder: Path) -> None:
    written(folder / "t.xml", "<AlwaysSuccess/>")
    answer = bestman_bt("simulate", "t.xml", option, "nan")
    assert answer.code == 2
    assert "should be a finite number" in " ".join(answer.err.split())


def test_simulate_takes_a_tree_of_a_package(bestman_bt: Command, folder: Path) -> None:
    written(folder / "a.xml", '<SubTree ID="B"/>')
    written(folder / "b.xml", '<AlwaysSuccess name="found"/>', "B")
    answer = bestman_bt("simulate", ".", "--tree", "Main")
    assert (answer.code, answer.out.splitlines()[0]) == (0, "a.xml: 1 run: 1 success")
    assert "100% of 2 nodes began" in answer.out
    unnamed = bestman_bt("simulate", ".")
    assert unnamed.code == 2
    assert "name one of its trees: Main, B" in " ".join(unnamed.err.split())
    for command in ("simulate", "show"):
        unknown = bestman_bt(command, ".", "--tree", "Nope")
        assert unknown.code == 2
        assert ".: there is no tree 'Nope' (its trees: Main, B)" in " ".join(unknown.err.split())


def test_simulate_counts_nodes_of_one_name_apart(bestman_bt: Command, folder: Path) -> None:
    written(folder / "t.xml", '<Fallback><Grasp2 name="grasp"/><Lift2/><Grasp2 name="grasp"/></Fallback>')
    (folder / "s.yaml").write_text("default: SUCCESS")
    coverage = json.loads(bestman_bt("simulate", "t.xml", "--scenario", "s.yaml", "--json").out)["coverage"]
    assert coverage["never_ticked"] == ["Lift2::3", "grasp::4"]
    assert [coverage["counts"][name]["began"] for name in ("grasp::2", "Lift2::3", "grasp::4")] == [1, 0, 0]


def test_simulate_refuses_substitution_rules_that_are_wrong(bestman_bt: Command, folder: Path) -> None:
    written(folder / "t.xml", "<OpenLid/>")
    (folder / "rules.json").write_text('{"SubstitutionRules": {"OpenLid": "Opened"}}')
    unknown = bestman_bt("simulate", "t.xml", "--scenario", "rules.json")
    assert (unknown.code, unknown.out) == (2, "")
    what = "'Opened', the replacement of 'OpenLid::1', is not registered"
    assert f"rules.json: SubstitutionRules 'OpenLid': {what}" in unknown.err
    (folder / "rules.json").write_text(
        '{"TestNodeConfigs": {"a": {"return_status": "SUCCESS", "post_script": "x ="}}, '
        '"SubstitutionRules": {"OpenLid": "a"}}'
    )
    wrong_script = bestman_bt("simulate", "t.xml", "--scenario", "rules.json")
    assert (wrong_script.code, wrong_script.out) == (2, "")
    assert "rules.json: TestNodeConfig 'a': post_script: " in wrong_script.err
    (folder / "rules.json").write_text('{"SubstitutionRules": [1]}')
    wrong = bestman_bt("simulate", "t.xml", "--scenario", "rules.json")
    assert (wrong.code, wrong.out) == (2, "")
    assert "rules.json: the rules must be an object with the field 'SubstitutionRules'" in wrong.err


def test_stub_writes_leaves_that_run_with_the_tree(bestman_bt: Command, folder: Path) -> None:
    written(folder / "t.xml", '<Sequence><OpenLid side="{s}"/></Sequence>')
    assert (
        bestman_bt("stub", "t.xml", "-o", "leaves.py").out
        == "leaves.py: 1 added, 0 existed already or are not leaves\n"
    )
    assert bestman_bt("validate", "t.xml", "--plugin", "leaves.py").code == 0
    (folder / "leaves.py").write_text("def f(:")
    refused = bestman_bt("stub", "t.xml", "-o", "leaves.py")
    assert (refused.code, (folder / "leaves.py").read_text()) == (2, "def f(:")


def test_diff_tells_and_draws_what_changed(bestman_bt: Command, folder: Path) -> None:
    written(folder / "a.xml", '<Sequence><OpenLid side="1"/></Sequence>')
    written(folder / "b.xml", '<Sequence><OpenLid side="2"/><Pour/></Sequence>')
    answer = bestman_bt("diff", "a.xml", "b.xml", "--svg", "d.svg")
    assert answer.code == 1
    assert answer.out.splitlines()[2:] == [
        "Main",
        '  changed  Sequence > OpenLid (line 3 → 3): side "1" → "2"',
        "  added    Sequence > Pour (line 3)",
    ]
    assert "#1a7f37" in (folder / "d.svg").read_text()
    assert bestman_bt("diff", "a.xml", "a.xml").code == 0
    (folder / "c.xml").write_text("<robot/>")
    assert bestman_bt("diff", "a.xml", "c.xml").code == 2


def test_convert_writes_version_4_and_reports_what_to_look_at(bestman_bt: Command, folder: Path) -> None:
    tree = '<root>\n<BehaviorTree ID="A"><SubTree ID="B" __shared_blackboard="true"/></BehaviorTree></root>'
    (folder / "old.xml").write_text(tree)
    assert bestman_bt("validate", "old.xml").code == 2
    answer = bestman_bt("convert", "old.xml", "-o", "new.xml", "--canonical")
    assert (answer.code, answer.out) == (0, "new.xml\n")
    assert answer.err.startswith("old.xml:2: the SubTree 'B' had the blackboard of its parent")
    assert '    <BehaviorTree ID="A">\n        <SubTree ID="B" _autoremap="true"/>' in (folder / "new.xml").read_text()


@pytest.mark.slow
def test_a_pretended_run_moves_the_robot_simulates_the_rest_and_is_no_success(
    bestman_bt: Command, folder: Path
) -> None:
    written(
        folder / "t.xml", '<Sequence><SubTree ID="Greet"/>\n<Wait wait_duration="1"/>\n<Wave hand="left"/></Sequence>'
    )
    (folder / "more").mkdir()
    written(folder / "more" / "greet.xml", '<Sing text="hello"/>', "Greet")
    (folder / "s.yaml").write_text("nodes: {Wave: {result: SUCCESS, duration: 2}, Sing: SUCCESS}")
    refused = bestman_bt("run", "t.xml", "--search", "more")
    assert refused.code == 2
    assert "greet.xml:3: <Sing>: unknown node" in refused.err
    answer = bestman_bt("run", "t.xml", "--search", "more", "--pretend", "--scenario", "s.yaml", "--json")
    assert answer.code == 1
    result = answer.document
    assert (result["success"], result["outcome"], result["tree_status"]) == (False, "failure", "SUCCESS")
    assert result["pretended"] == dict.fromkeys(("Sing", "Wave"), "a guess from its use")
    assert (result["failure"]["error_code"], result["predicate"]) == ("pretended", None)
    assert 3.0 <= result["sim_time_s"] < 3.3


def test_pretending_is_for_simulated_runs(bestman_bt: Command, folder: Path) -> None:
    written(folder / "t.xml", "<Wave/>")
    answer = bestman_bt("run", "t.xml", "--pretend", "--driver", "hardware")
    assert (answer.code, "--pretend: is for simulated runs, not for hardware" in answer.err) == (2, True)
    assert "--scenario: needs --pretend" in bestman_bt("run", "t.xml", "--scenario", "s.yaml").err


@pytest.mark.slow
def test_a_simulation_can_be_watched_while_it_runs(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))  # the path of a socket is short
    monkeypatch.setattr(simulate_command, "PAGE_LOOKS", 0.0)
    runs: list[SimulatedRun] = []
    scenario = Scenario.from_mapping({"default": {"result": "SUCCESS", "duration": 30}})
    text = '<root BTCPP_format="4"><BehaviorTree ID="M"><Fly/></BehaviorTree></root>'
    drive = partial(simulate_command.run_shown, name="m.xml", seed=0, period=0.02, limit=60.0)
    thread = threading.Thread(
        target=lambda: runs.append(simulate(text, scenario=scenario, clock=WallClock(), drive=drive))
    )
    thread.start()
    while not (found := list(socket_folder().glob("*.sock"))):
        assert thread.is_alive()
        time.sleep(0.02)
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(10.0)
        connection.connect(str(found[0]))
        stream = connection.makefile("rw")
        for request in ("status", "halt"):
            stream.write(json.dumps({"do": request}) + "\n")
            stream.flush()
            answer = json.loads(stream.readline())
            assert answer["ok"], answer
    thread.join(60.0)
    (run,) = runs
    assert (run.outcome, run.halted) == ("time limit", ["Fly::1"])
    assert run.seconds < 20.0
