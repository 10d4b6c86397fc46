"""All faults of a robot file come in one go, as docs/robots.md shows it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bestman_bt.configuration.data import data_root
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.robot_model.compose import load_robot_model

ARM = data_root() / "assets" / "robots" / "panda_arm.yaml"
PAGE = Path(__file__).parents[2] / "docs" / "robots.md"
WHOLE = """parts:
  base: {part: differential_base}
  column: {part: column, mount: base}
  arm: {part: xarm6_arm, mount: column}
"""


def faults_of(folder: Path, text: str) -> list[str]:
    path = folder / "my_robot.yaml"
    path.write_text(text)
    with pytest.raises(ConfigurationError) as error:
        load_robot_model(path)
    return [f"{p.line}: {p.field}: {p.message}" for p in error.value.problems]


def test_the_page_shows_what_is_really_told(tmp_path: Path) -> None:
    section = PAGE.read_text().partition("## When something is wrong")[2]
    (robot,) = re.findall(r"```yaml\n(.*?)```", section, re.DOTALL)
    (told,) = re.findall(r"```text\n(.*?)```", section, re.DOTALL)
    shown = [line.removeprefix("my_robot.yaml:") for line in told.splitlines()]
    found = faults_of(tmp_path, robot)
    assert len(found) == len(shown)
    for line, fault in zip(shown, found, strict=True):
        assert re.fullmatch(re.escape(line).replace("…", ".*"), fault)


@pytest.mark.parametrize("name", ["''", "a b/..", "-a", "a.b"])
def test_a_name_that_nothing_can_be_called_by_is_refused(tmp_path: Path, name: str) -> None:
    (fault,) = faults_of(tmp_path, f"{WHOLE}  {name}: {{part: imu, mount: base_link}}\n")
    assert fault.startswith("5: parts.")
    assert "cannot be a part's name" in fault


def test_a_name_that_is_a_number_is_reported_with_its_line(tmp_path: Path) -> None:
    assert faults_of(tmp_path, f"{WHOLE}  7: {{part: imu, mount: base_link}}\n") == [
        "5: parts.7: a name should be text: write '7' in quotes"
    ]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("wheel_radius: -10 cm", "parts.base.set.wheel_radius: should be greater than 0, got '-10 cm'"),
        ("track: 0", "parts.base.set.track: should be greater than 0"),
        ("max_vx: 0", "parts.base.set.max_vx: should be greater than 0, got 0"),
        ("max_acceleration: 0", "parts.base.set.max_acceleration: should be greater than 0, got 0"),
        ("max_angular_acceleration: 0", "parts.base.set.max_angular_acceleration: should be greater than 0, got 0"),
        ("max_vx: 0.6 kg", "parts.base.set.max_vx: expected a speed"),
        ("max_wz: 90", "parts.base.set.max_wz: needs its unit: '90 rad/s' or '90 deg/s', got 90"),
        ("wheel_joints:", "parts.base.set.wheel_joints: should be a list, got nothing"),
    ],
)
def test_a_field_that_the_robot_sets_is_named_as_the_robots(tmp_path: Path, change: str, words: str) -> None:
    (fault,) = faults_of(tmp_path, WHOLE.replace("differential_base", f"differential_base, set: {{{change}}}"))
    assert fault.startswith(f"2: {words}")


def test_a_list_of_limits_without_units_is_one_fault(tmp_path: Path) -> None:
    limits = "{lower: [-1.5, 0, -90 deg], upper: [2, '3', 90 deg], velocity: [1, 2 rad/s, 0]}"
    fields = f"{{kind: joint_group, generated: pan_tilt, joints: [a, b, c], limits: {limits}}}"
    (tmp_path / "head.yaml").write_text(fields)
    faults = faults_of(tmp_path, f"{WHOLE}  head: {{part: {tmp_path}/head.yaml, mount: base}}\n")
    assert [fault.removeprefix("1: limits.") for fault in faults if fault.startswith("1: limits.")] == [
        "lower[0]: needs its unit: '-1.5 rad' or '-1.5 deg' or '-1.5 m', got -1.5",
        "upper[0]: needs its unit: '2 rad' or '2 deg' or '2 m', got 2; the same fault in 1 more of this list",
        "velocity[0]: needs its unit: '1 rad/s' or '1 deg/s' or '1 m/s', got 1",
        "velocity[2]: should be greater than 0, got 0",
        "acceleration: is missing",
        "effort: is missing",
    ]


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        (r"velocity: .*", "velocity: 2 rad", "limits.velocity"),
        (r"velocity: .2.175 rad/s", "velocity: [2 rad", "limits.velocity[0]"),
        (r"home: .0,", "home: [abc,", "states.home[0]"),
        (r"home: .0,", "home: [", "states.home"),
    ],
)
def test_an_entry_that_cannot_be_read_is_no_fault_of_their_number(
    tmp_path: Path, old: str, new: str, field: str
) -> None:
    (tmp_path / "arm.yaml").write_text(re.sub(old, new, ARM.read_text()))
    faults = faults_of(tmp_path, f"{WHOLE}  second: {{part: {tmp_path}/arm.yaml, mount: base_link}}\n")
    assert [fault.split(": ")[1] for fault in faults] == [field]


def test_a_posture_with_an_entry_that_cannot_be_read_is_one_fault(tmp_path: Path) -> None:
    postures = "postures: {carry: {arm: [abc, 0, 0, 0, 0, 0]}}\n"
    (fault,) = faults_of(tmp_path, f"{WHOLE}{postures}")
    assert fault.startswith("5: postures.carry.arm[0]: expected an angle")


@pytest.mark.parametrize(
    ("connection", "words"),
    [
        ("{driver: ur, parts: [arm, column]}", "parts[1]: 'column' is of the kind structure"),
        ("{driver: realsense, parts: [arm]}", "parts[0]: 'arm' is of the kind arm; .* 'realsense' can be: camera"),
        ("{driver: robotiq, parts: [base]}", "parts[0]: 'base' is of the kind base; .* can be: gripper"),
        (
            "{driver: xarm, parts: [arm], options: {payload: 300 kg}}",
            "options.payload: 300 kg is more than 'arm' may carry",
        ),
        ("{driver: xarm, parts: [arm], options: {rate: 251 Hz}}", "options.rate: should be less than or equal to 250"),
    ],
)
def test_a_connection_that_cannot_work_is_refused(tmp_path: Path, connection: str, words: str) -> None:
    (fault,) = faults_of(tmp_path, f"{WHOLE}connections:\n  c: {connection}\n")
    assert re.match(rf"6: connections\.c\.{words.replace('[', chr(92) + '[', 1)}", fault)


def test_a_wrong_base_frame_is_reported_beside_a_part_that_cannot_be_read(tmp_path: Path) -> None:
    faults = faults_of(tmp_path, WHOLE.replace("xarm6_arm", "xarm66_arm") + "base_frame: base_lnk\n")
    assert ["base_frame" in fault or "xarm66_arm" in fault for fault in faults] == [True, True]


def test_an_address_may_come_from_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "my_robot.yaml"
    path.write_text(f"{WHOLE}connections:\n  c: {{driver: xarm, parts: [arm], address: '${{MY_ARM}}'}}\n")
    monkeypatch.setenv("MY_ARM", "10.1.2.3")
    assert load_robot_model(path).connections["c"].address == "10.1.2.3"
    monkeypatch.delenv("MY_ARM")
    assert load_robot_model(path).connections["c"].address == ""


def test_a_fault_of_a_part_hides_no_later_mount_that_is_wrong(tmp_path: Path) -> None:
    arm = re.sub(r"velocity: .*", "velocity: 2 rad", ARM.read_text())
    (tmp_path / "arm.yaml").write_text(arm)
    text = WHOLE.replace("xarm6_arm", f"{tmp_path}/arm.yaml") + (
        "  gripper: {part: panda_hand, mount: panda_link8}\n"
        "  second: {part: panda_arm, mount: column}\n"
        "  camera: {part: rgbd_camera, mount: second_panda_link8}\n"
        "  lidar: {part: planar_lidar, mount: base_lnk}\n"
        "  tool: {part: wsg50, mount: panda_link9}\n"
    )
    faults = faults_of(tmp_path, text)
    assert [fault.split("; ")[0] for fault in faults] == [
        faults[0],
        "8: parts.lidar.mount: no frame 'base_lnk' to mount on",
        "9: parts.tool.mount: no frame 'panda_link9' to mount on",
    ]
    assert "limits.velocity: " in faults[0]
