"""Universal Robots e-series arms through ur-rtde."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation

from bestman_bt.configuration.quantity import Frequency, Lengths3, Mass, PositiveTime
from bestman_bt.messages import Pose, Wrench
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import Payload, arm_payload, flange_of
from bestman_bt.robot_model.sensor_parts import ForceTorquePart, MountedForceTorque
from hal.api import CommandRefusedError, Failure, MotionErrorCode, NoDataError
from hal.hardware.connection import Connection, PartFactory
from hal.hardware.controller_facts import ArmFacts, Identity, compare_payload
from hal.hardware.sensors import HardwareForceTorque
from hal.parts.channels import JointChannel, JointReading
from hal.parts.gate import ToolLimits
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.stop_latch import StopLatch
from hal.ur.arm import URArm
from hal.ur.link import URLink
from hal.ur.release import URRelease
from hal.ur.sdk_process import PLAYING, READY_TIME, RUNNING, Report

Kind = Literal["standard", "configurable", "tool"]
FIRST = {"standard": 0, "configurable": 8, "tool": 16}
COUNT = {"standard": 8, "configurable": 8, "tool": 2}
TIMEOUT = 1.0


class URDigitalIO:
    """Eight standard, eight configurable and two tool channels, numbered from 0."""

    def __init__(self, link: URLink, latch: StopLatch) -> None:
        self._link, self._latch = link, latch

    def set_output(self, kind: Kind, number: int, on: bool) -> None:
        """Switch an output; refused while the robot is stopped. Raises ConnectionFailedError if the controller does
        not answer.
        """
        self._latch.check("digital output", "set_output")
        self._check(kind, number)
        self._link.call("set_output", kind, number, bool(on), timeout=TIMEOUT)

    def output(self, kind: Kind, number: int) -> bool:
        """Return whether an output is on."""
        self._check(kind, number)
        return bool(self._report().digital_outputs >> (FIRST[kind] + number) & 1)

    def input(self, kind: Kind, number: int) -> bool:
        """Return whether an input is on."""
        self._check(kind, number)
        return bool(self._report().digital_inputs >> (FIRST[kind] + number) & 1)

    def _report(self) -> Report:
        report = self._link.report
        if report is None:
            raise NoDataError("the UR has not reported its inputs and outputs yet")
        return report

    @staticmethod
    def _check(kind: str, number: int) -> None:
        if kind not in COUNT or not 0 <= number < COUNT[kind]:
            raise CommandRefusedError(f"there is no {kind} input or output {number}")


Rate = Annotated[Frequency, Field(le=500.0)]
Model = Literal["ur3e", "ur5e", "ur7e", "ur10e", "ur12e", "ur16e", "ur8long", "ur15", "ur20", "ur30"]
Gain = Annotated[float, Field(ge=100.0, le=2000.0)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]
Lookahead = Annotated[PositiveTime, Field(ge=0.03, le=0.2)]


@dataclass(frozen=True)
class UROptions:
    """Options of ``driver: ur``.

    ``model``: the arm model that the controller must report; None: only the pose of its flange is compared. ``rate``:
    rate of set-points and readings, Hz. ``servo_lookahead`` (seconds) and ``servo_gain``: smoothing and gain of the
    controller's ``servoj``. ``payload``, ``payload_center``: mass, kg, and centre of mass, metres in the flange frame,
    of the permanent load; by default the controller's own. ``controller_watchdog``: seconds without a heartbeat from
    the client after which the controller ends its program. ``reduced_scaling``: fraction of the speed in the
    controller's reduced mode, whose limits it does not report. ``longest_delay``: largest sustained delay of readings,
    seconds. ``connect_timeout``: seconds.
    """

    model: Model | None = None
    rate: Rate = 500.0
    servo_lookahead: Lookahead = 0.03
    servo_gain: Gain = 400.0
    payload: Mass | None = None
    payload_center: Lengths3 = (0.0, 0.0, 0.0)
    controller_watchdog: PositiveTime = 0.25
    reduced_scaling: Share = 0.25
    longest_delay: PositiveTime = 0.1
    connect_timeout: PositiveTime = 2.0


SAFETY_MODES = {
    1: "normal",
    2: "reduced",
    3: "protective stop",
    4: "recovery mode",
    5: "safeguard stop",
    6: "system emergency stop",
    7: "robot emergency stop",
    8: "violation of a safety limit",
    9: "fault of the safety system",
    10: "joint identification",
    11: "undefined safety mode",
    12: "automatic mode safeguard stop",
    13: "three-position enabling stop",
}
ROBOT_MODES = {
    -1: "no controller",
    0: "disconnected",
    1: "safety to be confirmed",
    2: "booting",
    3: "power off",
    4: "powering on",
    5: "idle, with closed brakes",
    6: "backdrive",
    7: "running",
    8: "updating firmware",
}
WELL = frozenset({1, 2})
REDUCED = 2
PROGRAM_LIVES = frozenset({PLAYING, 3, 4, 5})
"""Runtime states: playing; pausing, paused and resuming, where motions wait."""
PROTECTIVE_STOP = 3
STOPPED_BY_PEOPLE = frozenset({5, 6, 7, 12, 13})


def fault_of(report: Report) -> Failure | None:
    """Return the fault of a safety or robot mode, an expired heartbeat or an ended program; None without one."""
    safety, mode = report.safety_mode, report.robot_mode
    if safety not in WELL:
        if safety == PROTECTIVE_STOP:
            code = MotionErrorCode.COLLISION
        elif safety in STOPPED_BY_PEOPLE:
            code = MotionErrorCode.STOPPED
        else:
            code = MotionErrorCode.FAULT
        return Failure(code, SAFETY_MODES.get(safety, "unknown safety mode"), vendor_code=f"safety mode {safety}")
    if mode != RUNNING:
        return Failure(
            MotionErrorCode.FAULT, ROBOT_MODES.get(mode, "unknown robot mode"), vendor_code=f"robot mode {mode}"
        )
    if report.lapsed:
        return Failure(MotionErrorCode.STOPPED, f"the arm was braked because {report.lapsed}")
    if report.runtime_state not in PROGRAM_LIVES and not report.busy:
        text = "the program on the controller has ended"
        return Failure(MotionErrorCode.FAULT, text, vendor_code=f"runtime state {report.runtime_state}")
    return None


def scaling_of(report: Report, reduced: float) -> float:
    """Return the time scale of a motion, 0 to 1: the speed slider; 0 while paused; at most ``reduced`` in
    reduced mode.
    """
    if report.runtime_state != PLAYING:
        return 0.0
    return min(report.scaling, reduced) if report.safety_mode == REDUCED else report.scaling


JOINTS = 6


class URConnection(Connection):
    """One arm with its controller, the force-torque sensor in its flange, and its digital inputs and outputs.

    Motions are set-points of ``servoj`` at ``rate`` Hz; the arm's ``move_path``, ``speed_joints`` and ``speed_tool``
    are motions of the controller. If the client disappears, the controller ends its program.
    """

    driver: ClassVar[str] = "ur"
    package: ClassVar[str] = "rtde_control"
    extra: ClassVar[str] = "ur"
    options_type: ClassVar[type] = UROptions
    serves: ClassVar[Mapping[str, tuple[int, int]]] = {"arm": (1, 1), "force_torque": (0, 1)}
    unsupported: Mapping[str, str] = {
        "command(efforts=…)": "the controller takes no joint torques in this mode",
        "measured joint torques": "ur-rtde reads the torques that the controller's model predicts, not measured ones",
    }

    def factories(self) -> Mapping[str, PartFactory]:
        """Return the factories of the arm and of the force-torque sensor in its flange."""
        self._link = URLink(self.name, self.clock)
        self.io = URDigitalIO(self._link, self.latch)
        return {"arm": self._make_arm, "force_torque": self._make_force_torque}

    def _make_arm(self, name: str, model: ArmModel) -> URArm:
        options: UROptions = self.options
        tool, joints = ToolLimits(self.model, name, self.limits), URJoints(self._link, options.reduced_scaling)
        self._arm = URArm(name, model, joints, self.latch, 1.0 / options.rate, tool, self._link)
        self._arm.send_load = self._set_load
        return self._arm

    def _make_force_torque(self, name: str, model: MountedForceTorque) -> URForceTorque:
        return URForceTorque(name, model.part, self._link, self.latch)

    def open(self) -> None:
        """Connect, and start the SDK's program on the controller."""
        if len(self._arm.joint_names) != JOINTS:
            raise ConnectionFailedError(
                f"{self.name}: a UR has {JOINTS} joints, {self._arm.name} has {len(self._arm.joint_names)}"
            )
        self.sdk("rtde_control")  # here only for the words where it is missing
        options: UROptions = self.options
        self._link.open(self.settings.address, self._settings(), options.connect_timeout + READY_TIME)
        reported = URIdentity(*self._link.call("identity", timeout=READY_TIME))
        mismatch = reported.mismatch(self.model, self._arm.name, options.model)
        if mismatch is not None:
            raise ConnectionFailedError(f"{self.name}: {mismatch}")
        self._identity = reported
        self.add_loop("set-points", options.rate, self._cycle)

    def close(self) -> None:
        """End the program on the controller and the SDK's process."""
        self._link.close()

    def identity(self) -> Identity:
        """Return the identity from the dashboard."""
        firmware = str(self._link.call("firmware", timeout=READY_TIME)).removeprefix("URSoftware ").split(" ")[0]
        return Identity(self._identity.model, self._identity.serial_number, firmware)

    def arm_facts(self) -> ArmFacts | None:
        """Return the facts from RTDE; the tool offset is that at connection."""
        joints, tool, payload, torques = self._link.call("arm", timeout=READY_TIME)
        now = replace(self._identity, joints=joints, tool_pose=tool, payload=payload, torques=torques)
        return now.arm_facts()

    def heard(self) -> float:
        """Return the time at which the controller took the newest reading."""
        return self._link.heard

    def reported_fault(self) -> Failure | None:
        """Return the failure for a safety or robot mode, an ended program, or a connection that is too slow."""
        report = self._link.pump()
        if not self._link.alive:
            return Failure(MotionErrorCode.DISCONNECTED, f"the process of {self.name}'s SDK has ended")
        if report is None:
            return None
        fault = fault_of(report)
        if fault is not None:
            return fault
        late = self._link.late(self.options.longest_delay)
        if late is not None:
            return Failure(MotionErrorCode.TIMEOUT, f"readings come {late:.2f} s late")
        return None

    def recover(self) -> None:
        """Start the program again."""
        self._link.call("recover", timeout=READY_TIME)

    def held(self) -> str | None:
        """Return a safety mode or missing power, by the dashboard."""
        return self._release.cause()

    def release(self) -> None:
        """Unlock or restart safety, power on, release the brakes."""
        self._release.release()

    @property
    def _release(self) -> URRelease:
        return URRelease(self.name, self.settings.address, self.options.connect_timeout)

    def abandon(self) -> None:
        """End the SDK's process, which would reconnect automatically."""
        self._link.abandon()

    def _cycle(self, elapsed: float) -> None:
        self._link.beat()
        report = self._link.pump()
        silence = self.clock.now() - self._link.heard
        if report is not None and fault_of(report) is None and silence < self.limits.watchdog:
            self._arm.cycle(elapsed)
        else:
            self._arm.give_way()

    def _set_load(self, mass: float, centre: ArrayLike) -> None:
        options: UROptions = self.options
        hand = None if options.payload is None else Payload(options.payload, np.array(options.payload_center))
        whole = arm_payload(self.model, self._arm.name, mass, centre, hand)
        if self._link.alive:
            self._link.call("set_payload", whole.mass, whole.centre.tolist(), timeout=READY_TIME)

    def _settings(self) -> dict[str, float]:
        """Return the settings of the SDK's process."""
        options: UROptions = self.options
        settings = {
            "rate": options.rate,
            "lookahead": options.servo_lookahead,
            "gain": options.servo_gain,
            "watchdog": 1.0 / options.controller_watchdog,
            "connect_timeout": options.connect_timeout,
            "deceleration": 5.0,
            "longest_step": options.longest_delay * float(max(self._arm.model.velocity)),
            "heartbeat": max(self.limits.heartbeat, self.limits.watchdog),  # which comes from the control loop
        }
        if options.payload is not None:
            settings["payload"] = options.payload
            settings |= {f"payload_{axis}": at for axis, at in zip("xyz", options.payload_center, strict=True)}
        return settings


Array = NDArray[np.float64]


class URJoints(JointChannel):
    """Set-points by ``servoJ``; the torques are those that the controller's model predicts.

    The controller executes ``servoj`` as much more slowly as its speed slider says ("On-Robot speed scaling" of
    ros2_controllers' joint_trajectory_controller), and not at all while its program is paused.
    ``reduced_scaling``: in reduced mode.
    """

    def __init__(self, link: URLink, reduced_scaling: float) -> None:
        self._link, self._reduced_scaling = link, reduced_scaling
        self._of: Report | None = None
        self._reading: JointReading | None = None

    @property
    def age(self) -> float:
        """Return the age of the newest reading, seconds; readings also arrive without set-points."""
        return self._link.age

    @property
    def scaling(self) -> float:
        """Return the speed scaling of the newest report, 0 to 1."""
        report = self._link.report
        return 1.0 if report is None else scaling_of(report, self._reduced_scaling)

    def read(self) -> JointReading:
        """Return the newest reading."""
        report = self._link.report
        if report is None:
            raise NoDataError("the UR has not reported joint positions yet")
        reading = self._reading
        if reading is None or report is not self._of:
            reading = JointReading(*(np.array(v) for v in (report.positions, report.velocities, report.torques)))
            self._of, self._reading = report, reading
        return reading

    def send(self, positions: Array, velocities: Array) -> None:
        """Send one set-point, radians; does not wait."""
        self._link.send(positions.tolist())


class URForceTorque(HardwareForceTorque):
    """Raw readings (``ft_raw_wrench``), weight of the hand included, in the frame of the flange.

    The part must be mounted on the arm's ``tool0`` without an offset.
    """

    def __init__(self, name: str, model: ForceTorquePart, link: URLink, latch: StopLatch) -> None:
        super().__init__(name, model, latch, self._newest)
        self._link = link

    def _newest(self) -> Wrench:
        report = self._link.report
        if report is None:
            raise NoDataError(f"{self.name} has not reported a wrench yet", self.name)
        values = np.array(report.wrench)
        return Wrench(values[:3], values[3:], self._link.heard)


FLANGE_TOLERANCE = 0.01
"""Largest deviation of the flange, metres: above the calibration offsets of one arm, and far below the difference
between two models.
"""


@dataclass(frozen=True)
class URIdentity:
    """The identity reported by the controller.

    ``model``, ``serial_number``: from its dashboard. ``tcp_offset``, ``tool_pose``: of the active tool in the flange,
    and in the controller's base frame; metres and rotation vectors. ``joints``: (6,) rad. ``payload``: configured load
    at its flange, kg. ``torques``: (6,) of the joints by the controller's model, N m; only they reveal the mounting:
    neither RTDE's outputs nor the dashboard contain it, and URScript has ``set_gravity`` but no getter.
    """

    model: str
    serial_number: str
    tcp_offset: list[float]
    joints: list[float]
    tool_pose: list[float]
    payload: float
    torques: list[float]

    def mismatch(self, robot: RobotModel, arm: str, model: str | None) -> str | None:
        """Return, as text, how the arm differs from that of the robot file, or None. ``model``: the expected arm model,
        if the file names one.
        """
        reported = f"the controller calls its arm {self.model}, serial number {self.serial_number}"
        if model is not None and _family(self.model) != _family(model):
            return f"{reported}; the option 'model' says {model}"
        apart = self._flange_apart(robot, arm)
        if apart > FLANGE_TOLERANCE:
            return (
                f"the controller's flange is {1000 * apart:.0f} mm from that of the robot file's arm: it moves "
                f"another arm, or one with another calibration ({reported}). ur3e_arm, ur5e_arm and ur10e_arm are the "
                "e-series; ur5_arm and ur10_arm are the arms before it"
            )
        weighed = compare_payload(robot, arm, self.arm_facts())
        return weighed.text if weighed is not None and not weighed.agrees else None

    def arm_facts(self) -> ArmFacts:
        """Return the same facts in the frames of the URDF, in whose base x and y are reversed."""
        base = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, np.pi))
        tool, offset = base @ _pose(self.tool_pose), _pose(self.tcp_offset)
        torques = np.array(self.torques)
        return ArmFacts(np.array(self.joints), tool, offset, payload=self.payload, holding_torques=torques)

    def _flange_apart(self, robot: RobotModel, arm: str) -> float:
        """Return the distance between the controller's and the robot file's flange, metres."""
        import pinocchio

        description = robot.of(ArmModel)[arm]
        model = pinocchio.buildModelFromXML(robot.urdf)
        data, q = model.createData(), pinocchio.neutral(model)
        for name, position in zip(description.joint_names, self.joints, strict=True):
            q[model.joints[model.getJointId(name)].idx_q] = position
        pinocchio.framesForwardKinematics(model, data, q)
        base = data.oMf[model.getFrameId(description.base_frame)]
        ours = base.actInv(data.oMf[model.getFrameId(flange_of(robot, arm))]).translation
        tool, offset = (
            pinocchio.SE3(pinocchio.exp3(np.array(pose[3:])), np.array(pose[:3]))
            for pose in (self.tool_pose, self.tcp_offset)
        )
        theirs = (tool * offset.inverse()).translation * np.array([-1.0, -1.0, 1.0])  # they count x and y the other way
        return float(np.linalg.norm(ours - theirs))


def _pose(values: list[float]) -> Pose:
    """Return the pose of a position in metres and a rotation vector."""
    return Pose(np.array(values[:3]), Rotation.from_rotvec(values[3:]).as_quat())


def _family(model: str) -> str:
    """Return the model family of the dashboard's name, which has no "e" and depends on the version."""
    return model.strip().upper().removesuffix("E")
