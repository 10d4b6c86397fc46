"""Wrong input: exit code 2, nothing started, one clear message with file, line, field, and the closest valid name."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bestman_bt.configuration.data import data_root
from hal.simulation.robot import SimulatedRobot
from tests.cli.command_line import Answer, Program, files_in

Command = Callable[..., Answer]


def shipped(path: str) -> str:
    return (data_root() / path).read_text()


def tree(body: str) -> str:
    return f'<root BTCPP_format="4">\n<BehaviorTree ID="Main">\n{body}\n</BehaviorTree>\n</root>'


@pytest.fixture
def refused(bestman_bt: Command, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Run the command; it must refuse. Returns the message."""
    started: list[object] = []
    monkeypatch.setattr(SimulatedRobot, "connect", started.append)

    def refuse(*arguments: object) -> str:
        files = files_in(folder)
        answer = bestman_bt(*arguments)
        assert answer.code == 2, answer.err
        assert answer.out == ""
        assert not started
        assert files_in(folder) == files
        assert "Traceback" not in answer.err
        return answer.err

    return refuse


TREES = {
    "not XML": ("fetch the cup, please", "t.xml:1: not well-formed XML"),
    "unknown node": (
        tree('<NavigateToo goal="1;2;0"/>'),
        "t.xml:3: <NavigateToo>: unknown node 'NavigateToo' (did you mean 'NavigateTo'?)",
    ),
    "unknown explicit node": (
        tree('<Action ID="Grap"/>'),
        "t.xml:3: <Grap>: unknown node 'Grap' (did you mean 'Grasp'?)",
    ),
    "shipped tree as a node": (
        tree('<Pick_Up object="cup"/>'),
        "t.xml:3: <Pick_Up>: unknown node 'Pick_Up' (the shipped tree PickUp is used by <SubTree ID=\"PickUp\"/> and",
    ),
    "shipped tree that is not included": (
        tree('<SubTree ID="PickUp" object="cup"/>'),
        "t.xml:3: <SubTree> 'ID': there is no tree 'PickUp' (the shipped one needs, under <root>, <include path=",
    ),
    "no limit in words of a number": (
        tree("<Sequence><Script code=\"door := 'a/b'\"/><IsOpen articulation='{door}' at_most='inf'/></Sequence>"),
        "t.xml:3: <IsOpen> port 'at_most': inf is not accepted, but a finite number of 0 or more (metres or ",
    ),
    "unknown port": (
        tree('<NavigateTo goal="1;2;0" max_replan="3"/>'),
        "t.xml:3: <NavigateTo>: unknown port 'max_replan' (did you mean 'max_replans'?)",
    ),
    "missing port": (
        tree('\n<NavigateTo/>'),
        "t.xml:4: <NavigateTo> port 'goal': it is required but not given (of type Pose2D)",
    ),
    "literal of the wrong type": (
        tree('<NavigateTo goal="here"/>'),
        "t.xml:3: <NavigateTo> port 'goal': 'here' is not a Pose2D",
    ),
    "number that is none": (
        tree('<Retreat distance="far"/>'),
        "t.xml:3: <Retreat> port 'distance': 'far' is not a number",
    ),
    "SubTree that does not exist": (
        tree('<SubTree ID="Pik"/>').replace(
            "</root>", '<BehaviorTree ID="Pick"><AlwaysSuccess/></BehaviorTree></root>'
        ).replace('BTCPP_format="4"', 'BTCPP_format="4" main_tree_to_execute="Main"'),
        "t.xml:3: <SubTree> 'ID': there is no tree 'Pik' (did you mean 'Pick'?)",
    ),
    "two roots": (
        tree("<AlwaysSuccess/>\n<AlwaysFailure/>"),
        "t.xml:2: <BehaviorTree>: tree 'Main' must have exactly one root node but has 2",
    ),
    "two root elements": (tree("<AlwaysSuccess/>") + "\n<root/>", "t.xml:6: not well-formed XML"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), TREES.values(), ids=TREES)
def test_a_tree_that_does_not_load_is_refused(refused, folder: Path, text: str, message: str) -> None:
    (folder / "t.xml").write_text(text)
    told = refused("run", "t.xml")
    assert f"bestman-bt: nothing was started: {message}" in told
    assert told.count("\n") == 1


def test_of_several_trees_one_is_to_be_chosen(refused, folder: Path) -> None:
    trees = "".join(f'<BehaviorTree ID="{name}"><AlwaysSuccess/></BehaviorTree>' for name in ("A", "B"))
    (folder / "two.xml").write_text(f'<root BTCPP_format="4">{trees}</root>')
    told = "two.xml:1: <root> 'main_tree_to_execute': the attribute is missing, and the file holds 2 trees: A, B"
    assert f'{told} (write main_tree_to_execute="A")' in refused("run", "two.xml")
    include = '<root BTCPP_format="4"><include path="two.xml"/><BehaviorTree ID="'
    uses = '"><SubTree ID="'
    body = f'{include}C{uses}A"/></BehaviorTree><BehaviorTree ID="D{uses}C"/></BehaviorTree></root>'
    (folder / "four.xml").write_text(body)
    assert '(write main_tree_to_execute="D")' in refused("run", "four.xml"), "of its own, the one that no other uses"


def test_an_unknown_node_that_a_file_beside_the_tree_defines_is_brought_as_a_plug_in(refused, folder: Path) -> None:
    nodes = "from bestman_bt.engine import SyncAction, action\nclass Wave(SyncAction):\n    pass\n"
    (folder / "skills.py").write_text(f"{nodes}@action\ndef say_hello() -> bool:\n    return True\n")
    (folder / "t.xml").write_text(tree("<Sequence>\n<Wave/>\n<SayHello/>\n<Nothing_like_it/>\n</Sequence>"))
    told = refused("run", "t.xml").splitlines()[1:]
    assert told[0] == "t.xml:4: <Wave>: unknown node 'Wave' (skills.py defines one: bring it with --plugin skills.py)"
    assert told[1].endswith("unknown node 'SayHello' (skills.py defines one: bring it with --plugin skills.py)")
    assert told[2].endswith("unknown node 'Nothing_like_it' (load your own nodes with --plugin FILE.py)")
    assert "unknown node 'Nothing_like_it'" in refused("run", "t.xml", "--plugin", "skills.py")


def test_all_errors_of_a_task_and_its_tree_are_reported_at_once_in_the_order_of_lines(refused, folder: Path) -> None:
    (folder / "mine.yaml").write_text("""\
tree: t.xml
scene: kitchen
robot: diff_panda
predicate: placedd
tolerances: {position: 2 kg}
goals: [{placed: {at: place, object: cupp, source: tabel, surface: counter}}]
time_limit: -3
algoritms: {}
algorithms:
  motionplanning: {algorithm: prm}
""")
    nodes = (
        '<NavigateTo goal="a;b;c"/>\n<MoveArm posture="cary" sped="3"/>\n<Grap/>\n<SubTree ID="Take" thing="pear"/>\n'
    )
    inner = '<BehaviorTree ID="Take"><CheckHeld object="{thing}"/></BehaviorTree>'
    text = tree(f'<Sequence>\n<FindStandPose surface="countr" stand="{{stand}}"/>\n{nodes}</Sequence>')
    text = text.replace("</root>", f"{inner}</root>").replace("<root ", '<root main_tree_to_execute="Main" ')
    (folder / "t.xml").write_text(text)
    told = refused("run", "--task", "mine.yaml").splitlines()
    places = [
        *("mine.yaml:4: predicate", "mine.yaml:5: tolerances.position", "mine.yaml:6: goals[0].placed.object"),
        *("mine.yaml:6: goals[0].placed.source", "mine.yaml:7: time_limit", "mine.yaml:8: algoritms"),
        *("mine.yaml:10: algorithms.motionplanning", "t.xml:4: <FindStandPose> surface", "t.xml:5: <NavigateTo> goal"),
        *("t.xml:6: <MoveArm>: unknown port 'sped'", "t.xml:6: <MoveArm> posture", "t.xml:7: <Grap>"),
        "t.xml:8: <SubTree> thing: there is no object 'pear'",
    ]
    assert told[0] == f"bestman-bt: {len(places)} errors, nothing was started:"
    assert [line[: len(place)] for line, place in zip(told[1:], places, strict=True)] == places
    without_robot = refused("run", "t.xml", "--robot", "dif_panda", "--scene", "kichen").splitlines()
    assert [line.split(":")[0] for line in without_robot[1:]] == [
        *("--scene kichen", "--robot dif_panda", "t.xml", "t.xml", "t.xml")
    ]


@pytest.mark.parametrize(
    ("options", "others"),
    [((), 0), (("--set", "tick_rat=3"), 1), (("--scene", "kichen"), 1), (("--robot", "dif_panda"), 1)],
)
def test_an_entry_that_nothing_writes_is_reported_with_all_other_faults(
    refused, folder: Path, options: tuple[str, ...], others: int
) -> None:
    nodes = (
        '<DetectObject object="cup" surface="table" pse="{pose}"/>\n<LookAt point="{pose}"/>\n'
        '<Script code="speed := := 2"/>\n<ScriptCondition code="speed &gt; 1"/>\n<NavigateTo goal="{stand}"/>\n'
    )
    (folder / "t.xml").write_text(tree(f"<Sequence>\n{nodes}</Sequence>"))
    told = refused("run", "t.xml", *options).splitlines()
    assert [line.partition(": ")[0] for line in told[1 + others :]] == ["t.xml:4", "t.xml:6", "t.xml:8"]
    assert "reads '{stand}', which nothing in the tree writes" in told[-1]
    if not options:
        last = refused("validate", "t.xml").splitlines()[-1]
        assert last == "t.xml:8: warning: <NavigateTo> port 'goal': reads '{stand}', which nothing in the tree writes"


def test_faults_of_a_python_tree_and_names_that_nothing_bears_are_reported_at_once(refused, folder: Path) -> None:
    (folder / "t.py").write_text(
        "from behaviours.manipulation.move_arm import MoveArm\n"
        "from bestman_bt.engine import Sequence\n\n\ndef build():\n"
        "    return Sequence([\n        MoveArm(postur='home'),\n        MoveArm(posture='cary'),\n    ])\n"
    )
    told = refused("run", "t.py").splitlines()[1:]
    assert [line.partition(": ")[0] for line in told] == ["t.py:7", "t.py:7", "t.py:8"]


def test_run_and_validate_report_the_same_errors_of_a_tree(refused, folder: Path) -> None:
    nodes = (
        '<Timeout><AlwaysSuccess/></Timeout>\n<Sleep msec="2 s"/>\n<Parallel success_count="7"><AlwaysSuccess/>'
        '</Parallel>\n<SubTree ID="Nix"/>\n<NavigateTo sped="3"/>\n<Script code="a := := 2"/>\n<LookAt/>\n<Grab/>\n'
        '<Inverter><AlwaysSuccess/><AlwaysFailure/></Inverter>\n<MoveArm posture="cary"/>\n<SubTree ID="Two"/>\n'
    )
    further = (
        '<BehaviorTree ID="Two"><LookAt point="{p}"/>\n<Wink/></BehaviorTree>\n'
        '<BehaviorTree ID="Unused"><Grasp force="-3" object="cup" grasps="{g}"/></BehaviorTree>\n</root>'
    )
    text = tree(f"<Sequence>\n{nodes}</Sequence>").replace("</root>", further)
    (folder / "t.xml").write_text(text.replace("<root", '<root main_tree_to_execute="Main"'))
    checked = refused("validate", "t.xml", "--robot", "diff_panda").splitlines()
    errors = [line for line in checked if ": warning: " not in line]
    told = refused("run", "t.xml").splitlines()[1:]
    assert [line for line in told if "reads '{p}'" not in line] == errors
    assert len(errors) == 14


def test_all_errors_of_a_tree_are_reported_at_once(refused, folder: Path) -> None:
    (folder / "t.xml").write_text(tree("<Sequence>\n<NavigateTo/>\n<Grap/>\n</Sequence>"))
    told = refused("run", "t.xml").splitlines()
    assert told[0] == "bestman-bt: 2 errors, nothing was started:"
    assert told[1].startswith("t.xml:4: <NavigateTo> port 'goal'")
    assert told[2].startswith("t.xml:5: <Grap>: unknown node")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "missing.xml"], "nothing was started: missing.xml: no such tree file"),
        (["run", "fetch_cop.xml"], "fetch_cop.xml: no such tree file; did you mean 'fetch_cup'?"),
        (["run", "plan_set_tabel"], "unknown tree; did you mean the task 'plan_set_table'?"),
        (["run", "fetch_cop"], "unknown tree 'fetch_cop'; did you mean 'fetch_cup'?"),
        (["run", "--task", "fetch_cop"], "unknown task 'fetch_cop'; did you mean 'fetch_cup'?"),
        (["eval", "fetch_cop"], "unknown task 'fetch_cop'; did you mean 'fetch_cup'?"),
        (["run", "fetch_cup", "--scene", "kichen"], "unknown scene 'kichen'; did you mean 'kitchen'?"),
        (["run", "fetch_cup", "--robot", "dif_panda"], "unknown robot 'dif_panda'; did you mean 'diff_panda'?"),
        (["show", "fetch_cop"], "unknown tree 'fetch_cop'; did you mean 'fetch_cup'?"),
        (["show", "fetch_cup", "--tree", "Piick"], "there is no tree 'Piick' (did you mean 'Pick'?)"),
        (["show", "fetch_cup_python", "--tree", "Pick"], "is a Python file, which defines one tree"),
        (["run", "look", "--real-time", "--driver", "replay"], "--real-time: is for simulated runs"),
        (["nodes", "NavigateToo"], "unknown node 'NavigateToo'; did you mean 'NavigateTo'?"),
        (["validate", "missing.xml"], "missing.xml: no such tree file"),
        (["run"], "give a tree, or --task, or both"),
        (["run", "--driver", "replay"], "--driver replay: give --recording RUN, a run made with --record"),
        (["robot", "show", "omni_base+ur5_am+robotiq_2f85"], "omni_base+ur5_am+robotiq_2f85: parts.arm.part: unknown"),
        (["rnu", "fetch_cup"], "unknown command 'rnu'; did you mean 'run'?"),
        (["run", "fetch_cup", "--sed", "3"], "No such option: --sed"),
        (["run", "fetch_cup", "--seed", "x"], "'--seed'"),
        (["run", "fetch_cup", "--seed", "1.5"], "'--seed': '1.5' is not a valid whole number"),
        (["run", "fetch_cup", "--seed", "-1"], "'--seed': -1 is not in the range 0<=x<=4611686018427387903"),
        (["twin", "--seed", str(2**62)], "'--seed': 4611686018427387904 is not in the range"),
        (["break", "fetch/pick", "--when", "during"], "waits before the node's tick, or with --after behind it"),
        (["eval", "fetch_cup", "--episodes", "0"], "'--episodes'"),
        (["eval", "fetch_cup", "--until", "3"], "--until: should be 95%±N with N from 0.5 to 50 percentage points"),
        (["eval", "fetch_cup", "--until", "95%±3", "--shard", "1/2"], "--until: needs all episodes"),
        (["eval", "fetch_cup", "--launcher", "lokal"], "unknown launcher 'lokal'; did you mean 'local'?"),
        (["eval", "fetch_cup", "--address", "a:1"], "--address: applies only to a cluster; also give its --launcher"),
        (["eval", "fetch_cup", "--slurm", "--launcher", "ray"], "--slurm: contradicts --launcher ray"),
        (["eval", "fetch_cup", "--merge", "nowhere"], "nowhere: has no journal episodes.jsonl with episodes"),
        (["run", "fetch_cup", "--plugin", "nowhere.py"], "--plugin nowhere.py: no such file"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)  # fmt: skip
def test_names_and_options_that_are_wrong_are_refused(refused, arguments: list[str], message: str) -> None:
    assert message in refused(*arguments)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("tick_rat=3", "--set tick_rat=3: unknown key 'tick_rat'; did you mean 'tick_rate'?"),
        ("tick_rate=3 kg", "tick_rate: expected a frequency in Hz (Hz, kHz), got '3 kg': 'kg' is a unit of mass"),
        ("tick_rate", "--set tick_rate: should have the form key=value"),
        ("scene.finger_frction=3", "unknown key 'finger_frction'; did you mean 'finger_friction'?"),
        ("scene.objects.cop=absent", "unknown key 'objects.cop'; did you mean 'cup'?"),
        ("robot.parts.lidr.mount=x", "unknown key 'parts.lidr'; did you mean 'lidar'?"),
        ("robot.parts.arm.part=panda_amr", "parts.arm.part: unknown part 'panda_amr'; did you mean 'panda_arm'?"),
        ("goals.0.placed.surface=conter", "goals[0].placed.surface: the map has no surface 'conter'; did"),
        ("goals.0.placed.source=tabel", "goals[0].placed.source: the map has no surface 'tabel'; did"),
        ("goals.0.placed.object=cub", "goals[0].placed.object: the robot knows no object 'cub'; did you mean 'cup'?"),
        ("goals.0.placed.object=counter_can", "several things of the model 'can', which the robot cannot distinguish"),
        ("goals.0.placed.at=plase", "goals[0].placed.at: the scene has no goal 'plase'; did you mean 'place'?"),
        ("predicate=plced", "predicate: unknown predicate 'plced'; did you mean 'placed'?"),
        ("goals=[]", "goals: the predicate 'placed' needs an entry {placed: …}"),
        ("goals.1.placed.object=cup", "unknown key 'goals.1': 'goals' has 1 entry, goals.0 is the first"),
        ("goals.0.plaecd={}", "unknown key 'goals.0.plaecd'; did you mean 'placed'?"),
        ("algorithms.zebra.algorithm=x", "unknown key 'algorithms.zebra'; known: affordance, base_placement"),
        (
            "algorithms.motion_planning.algorithm=rrt_conect",
            "unknown algorithm 'rrt_conect'; did you mean 'rrt_connect'?",
        ),
        ("algorithms.localization.algorithm=scan_to_mop", "did you mean 'scan_to_map'?"),
        ("algorithms.local_planning.algorithm=pure_pursit", "did you mean 'pure_pursuit'?"),
        (
            "algorithms.motion_planning.max_iteratons=3",
            "algorithms.motion_planning.max_iteratons: unknown field; did you mean 'max_iterations'?",
        ),
        (
            "algorithms.motion_planning.max_iterations=many",
            "algorithms.motion_planning.max_iterations: should be a whole number",
        ),
        ("algorithms.motion_planning.max_iterations=-4", "max_iterations: should be greater than or equal to 1"),
        ("algorithms.localization.iteration=3", "algorithms.localization.iteration: unknown field; did you mean"),
    ],
)  # fmt: skip
def test_a_setting_that_is_wrong_is_refused(refused, setting: str, message: str) -> None:
    told = refused("run", "fetch_cup", "--set", setting)
    assert message in told
    assert told.count("\n") == 1


def test_a_network_that_is_not_there_is_reported_before_anything_starts(refused) -> None:
    told = refused(
        "run",
        "fetch_cup",
        "--set",
        "algorithms.detection.algorithm=onnx",
        "--set",
        "algorithms.detection.model=/nowhere/net.onnx",
    )
    assert "algorithms.detection: no ONNX file '/nowhere/net.onnx'" in told


def test_a_scene_that_has_no_room_is_refused(refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bestman_bt.scene.draw._ATTEMPTS", 2)
    told = refused("run", "fetch_cup", "--set", "scene.clearance=3 m")
    assert "kitchen.yaml:" in told
    assert "in any of 2 draws (scene 'kitchen', seed 0)" in told
    assert "or lower 'clearance' (3 m)" in told


LIDAR = "  lidar:       {part: planar_lidar, mount: base_link, xyz: [0, 0, 25 cm]}\n"
ROBOTS = {
    "unknown part": (
        "part: panda_arm",
        "part: panda_amr",
        "r.yaml:6: parts.arm.part: unknown part 'panda_amr'; did you mean 'panda_arm'?",
    ),
    "unknown field": (
        "mount: column_top}",
        "mount: column_top, xyzz: 3}",
        "r.yaml:6: parts.arm.xyzz: unknown field; did you mean 'xyz'?",
    ),
    "wrong unit": (
        "xyz: [15 cm",
        "xyz: [15 kg",
        "r.yaml:5: parts.column.xyz[0]: expected a length in m (m, cm, mm), got '15 kg': 'kg' is a unit of mass",
    ),
    "mount onto nothing": (
        "mount: column_top",
        "mount: colunm_top",
        "r.yaml:6: parts.arm.mount: no frame 'colunm_top' to mount on; did you mean 'column_top'?",
    ),
    "no lidar": (
        LIDAR,
        "",
        " needs a lidar; robot r has base, arm, gripper,",
    ),
    "not YAML": ("parts:", "parts: [", "r.yaml:5: is not YAML"),
}


@pytest.mark.parametrize(("old", "new", "message"), ROBOTS.values(), ids=ROBOTS)
def test_a_robot_that_is_wrong_is_refused(refused, folder: Path, old: str, new: str, message: str) -> None:
    text = shipped("configs/robots/diff_panda.yaml")
    assert old in text
    (folder / "r.yaml").write_text(text.replace(old, new))
    assert message in refused("run", "fetch_cup", "--robot", "r.yaml")


TASKS = {
    "surface": (
        "surface: counter",
        "surface: conter",
        "goals[0].placed.surface: the map has no surface 'conter'; did you mean 'counter'?",
    ),
    "object": (
        "object: cup",
        "object: cub",
        "goals[0].placed.object: the robot knows no object 'cub'; did you mean 'cup'?",
    ),
    "predicate": (
        "predicate: placed",
        "predicate: plced",
        "predicate: unknown predicate 'plced'; did you mean 'placed'?",
    ),
    "scene": ("scene: kitchen", "scene: kichen", "scene: unknown scene 'kichen'; did you mean 'kitchen'?"),
    "unit": ("tilt: 10 deg", "tilt: 10 cm", "tolerances.tilt: expected an angle in rad (rad, deg, °), got '10 cm'"),
    "algorithm": (
        "tick_rate: 20 Hz",
        "algorithms: {kinematics: {algorithm: magic}}",
        "algorithms.kinematics.algorithm: unknown algorithm 'magic'; known: damped_least_squares",
    ),
}


@pytest.mark.parametrize(("old", "new", "message"), TASKS.values(), ids=TASKS)
def test_a_task_that_is_wrong_is_refused_with_file_and_line(
    refused, folder: Path, old: str, new: str, message: str
) -> None:
    text = shipped("configs/tasks/fetch_cup.yaml")
    line = 1 + next(i for i, content in enumerate(text.splitlines()) if old in content)
    (folder / "mine.yaml").write_text(text.replace(old, new, 1))
    told = refused("run", "--task", "mine.yaml")
    assert f"mine.yaml:{line}: {message}" in told
    assert told == refused("eval", "mine.yaml", "--episodes", "2", "--jobs", "2")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import math\n\nraise RuntimeError('no sensor')\n", "p.py:3: the plug-in raised RuntimeError: no sensor"),
        ("def f(:\n", "p.py:1: the plug-in raised SyntaxError"),
        ("import sys\nsys.exit(7)\n", "p.py:2: the plug-in raised SystemExit: 7"),
    ],
)
@pytest.mark.parametrize("verb", ["run", "eval", "show", "validate"])
def test_a_plug_in_that_raises_is_refused_by_every_verb(
    refused, folder: Path, verb: str, text: str, message: str
) -> None:
    (folder / "p.py").write_text(text)
    assert message in refused(verb, "fetch_cup", "--plugin", "p.py")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def build():\n    raise ValueError('oh')\n", "t.py"),
        ("x = 1\n", "t.py: it defines no function build() that returns the root node"),
    ],
)
def test_a_python_tree_that_does_not_load_is_refused(refused, folder: Path, text: str, message: str) -> None:
    (folder / "t.py").write_text(text)
    assert message in refused("run", "t.py")


def test_run_folders_need_a_folder(refused, folder: Path) -> None:
    (folder / "file").write_text("")
    assert "--runs file: no run folder can be made there: Not a directory" in refused(
        "run", "fetch_cup", "--runs", "file"
    )


def test_a_window_needs_a_display(refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    assert "--gui: needs an X display" in refused("run", "fetch_cup", "--gui")


def test_with_json_a_refusal_leaves_standard_output_empty(refused) -> None:
    assert "unknown tree" in refused("run", "fetch_cop", "--json")


@pytest.mark.slow
def test_the_program_itself_refuses_alike(folder: Path) -> None:
    (folder / "t.xml").write_text(tree('<NavigateToo goal="1;2;0"/>'))
    answer = Program("run", "t.xml", folder=folder).answer()
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.splitlines()[-1] == (
        "bestman-bt: nothing was started: t.xml:3: <NavigateToo>: unknown node 'NavigateToo' "
        "(did you mean 'NavigateTo'?)"
    )
    assert sorted(path.name for path in folder.iterdir()) == ["t.xml"]


def test_a_suite_that_is_misspelt_is_reported_as_a_task_is(refused: Callable[..., str]) -> None:
    assert "manipulatoin: unknown; did you mean the suite 'manipulation'?" in refused("eval", "manipulatoin")
    assert "unknown task 'fetch_cpu'; did you mean 'fetch_cup'?" in refused("eval", "fetch_cpu")


@pytest.mark.slow
def test_a_planner_that_is_not_installed_is_reported_with_what_installs_it(
    refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "up_fast_downward", None)
    assert "up_fast_downward is missing: " in refused("plan", "--goal", "on(cup, table)", "--planner", "fast_downward")


def test_a_replay_without_a_recording_and_a_recording_without_a_replay(refused: Callable[..., str]) -> None:
    assert "bestman-bt run --driver replay --recording RUN" in refused(
        "run", "--task", "fetch_cup", "--driver", "replay"
    )


def test_entries_whose_names_are_no_keys_are_reported_beside_other_faults(refused, folder: Path) -> None:
    nodes = '<SetBlackboard value="3" output_key=""/>\n<UnsetBlackboard key="@@k"/>\n<Sleep msec="x"/>'
    body = f'<BehaviorTree ID="M"><Sequence>\n{nodes}</Sequence></BehaviorTree>'
    (folder / "t.xml").write_text(f'<root BTCPP_format="4" main_tree_to_execute="M">{body}</root>')
    told = refused("validate", "t.xml")
    assert "t.xml:2: <SetBlackboard> port 'output_key': '' is not a key" in told
    assert "t.xml:3: <UnsetBlackboard> port 'key': '@@k' is not a key" in told
    assert "t.xml:4: <Sleep> port 'msec'" in told
