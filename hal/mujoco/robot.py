"""A robot in MuJoCo, and MuJoCo as an engine of ``hal.simulation``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.robot_model.model import LeggedBaseModel, RobotModel
from bestman_bt.scene.scene import World
from hal.mujoco.package import mujoco
from hal.mujoco.parameters import MujocoParameters
from hal.mujoco.renderer import Renderer, render_object
from hal.mujoco.world_builder import SOLID, SOLID_AND_SEEN, WorldBuilder
from hal.simulation.audit_record import CallCounter
from hal.simulation.bodies import ContactPoint, JointStates, LinkMotion, Quaternion, SimulationError, Vector, Viewpoint
from hal.simulation.engine import Engine
from hal.simulation.robot import SimulatedRobot

LEGS = "is a base on legs, which MuJoCo does not simulate here; the driver pybullet does"


class MujocoRobot(SimulatedRobot):
    """A simulated robot in MuJoCo."""

    engine_name: ClassVar[str] = "MuJoCo"
    parameters_class = MujocoParameters
    render_object = staticmethod(render_object)
    _parameters: MujocoParameters

    @classmethod
    def refused_parts(cls, model: RobotModel) -> Mapping[str, str]:
        """Return the parts that MuJoCo does not simulate: bases on legs."""
        return dict.fromkeys(model.of(LeggedBaseModel), LEGS)

    def build(self, model: RobotModel, world: World, gui: bool) -> MujocoEngine:
        """Build the engine. Raises SimulationError for a window, which is not supported, and for unsupported models."""
        if gui:
            raise SimulationError("MuJoCo runs without a window here: omit --gui, or use the driver pybullet")
        return MujocoEngine(model, world, self._parameters)


Array = NDArray[np.float64]
NOT_DRAWN = 0.01
"""Near clipping distance of the renderer, metres."""
STILL = (0.0, 0.0, 0.0)
APPROACH_GAIN = 0.3
"""Fraction of a joint's position error that a motor of ``approach`` corrects per step."""
WRITTEN = {"qpos": "resets", "qvel": "resets", "xfrc_applied": "tampering", "qfrc_applied": "tampering"}
"""The kind under which writes to MuJoCo's data between two steps are counted."""
LEAST_FRICTION = 1e-5
"""MuJoCo's minimum friction; its solver does not accept less."""


class MujocoEngine(Engine):
    """A MuJoCo model with its data. Motors are velocity servos with bounded effort, integrated implicitly.

    A servo's gain is matched to its load, so that it halves a speed error per step and does not oscillate at its bound.
    """

    def __init__(self, model: RobotModel, world: World, parameters: MujocoParameters) -> None:
        built = WorldBuilder(parameters, robot=model, scene=world).build()
        self.ledger = CallCounter()
        self.built, self.model, self.data = built.world, built.model, built.data
        self._renderer = Renderer(self.model, self.data)
        free = np.flatnonzero(np.asarray(self.model.body_dofnum) == 6).tolist()
        self._free = {body: int(self.model.body_dofadr[body]) for body in free}
        """Body that moves freely → where its velocities are."""
        self._names = {self.built.robot: "robot", **self.built.body_names}
        self._root = np.asarray(self.model.body_rootid).copy()
        self._geom_body = self._root[self.model.geom_bodyid]
        self._geom_link = np.where(self._geom_body == self.model.geom_bodyid, -1, self.model.geom_bodyid)
        self._geom_friction = np.asarray(self.model.geom_friction).copy()
        self._pair_friction = np.asarray(self.model.pair_friction).copy()
        self._rays = np.zeros(6, np.uint8)
        self._rays[[SOLID_AND_SEEN, SOLID]] = 1
        self._exploded = [
            int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{name}")) for name in ("QPOS", "QVEL", "QACC", "CTRL")
        ]
        self._set_up_motors(parameters, built.loads)
        self._own = {name: np.zeros_like(getattr(self.data, name)) for name in ("xfrc_applied", "qfrc_applied")}
        """Forces and torques that the engine itself is commanded to exert in the next step."""
        self._keep_state()
        self._contacts: list[ContactPoint] | None = None
        self._moved = True
        """Whether MuJoCo's velocities of links are older than the latest step."""

    def _set_up_motors(self, parameters: MujocoParameters, loads: Mapping[int, float]) -> None:
        model, count = self.model, self.model.nu
        joints = np.asarray(model.actuator_trnid)[:, 0]
        self._slots = {int(model.jnt_bodyid[joint]): slot for slot, joint in enumerate(joints)}
        self._at, self._dofs = np.asarray(model.jnt_qposadr)[joints], np.asarray(model.jnt_dofadr)[joints]
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, self.data, inertia)
        load = np.diag(inertia)[self._dofs] + [loads.get(int(model.jnt_bodyid[joint]), 0.0) for joint in joints]
        self._stiffness = load / parameters.time_step
        model.actuator_gainprm[:, 0], model.actuator_biasprm[:, 2] = self._stiffness, -self._stiffness
        self._target, self._reference = np.zeros(count), np.zeros(count)
        self._feed, self._gain, self._stride = np.zeros(count), np.zeros(count), np.full(count, np.inf)
        self._lead = np.zeros(count)
        """Largest lead of the moving set-point of ``approach``: the distance at which the motor reaches its full
        effort.
        """
        self._period = parameters.time_step

    def step(self) -> None:
        """Execute one step. Raises SimulationError if the simulation is unstable."""
        data = self.data
        self._note_writes()
        at = data.qpos[self._at]
        way = np.clip(self._target - self._reference, -self._stride, self._stride)
        self._reference = np.clip(self._reference + way, at - self._lead, at + self._lead)
        speeds = self._feed + self._gain / self._period * (self._reference - at)
        data.ctrl[:] = speeds + data.qfrc_bias[self._dofs] / self._stiffness
        for name, values in self._own.items():
            getattr(data, name)[:] = values
        mujoco.mj_step(self.model, data)
        for name, values in self._own.items():
            values[:] = 0.0
            getattr(data, name)[:] = 0.0
        mujoco.mj_kinematics(self.model, data)
        self._keep_state()
        self._contacts, self._moved = None, True
        if data.warning.number[self._exploded].any() or not np.isfinite(data.qpos).all():
            text = f"simulation_unstable: at {data.time:.3f} s positions or speeds are not finite or far too large"
            raise UnstableError(text)

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.close()

    def _keep_state(self) -> None:
        self._left = {name: getattr(self.data, name).tobytes() for name in WRITTEN}

    def _note_writes(self) -> None:
        """Count foreign writes to the data since the last step; they take effect, and the watchers see them."""
        for name, kind in WRITTEN.items():
            values = getattr(self.data, name)
            if values.tobytes() != self._left[name]:
                self.ledger.note(kind, name)
                if name in self._own:
                    self._own[name] += values

    @override
    def track(
        self, joints: Sequence[int], positions: Array, velocities: Array, efforts: Sequence[float], gain: float
    ) -> None:
        slots = [self._slots[joint] for joint in joints]
        self._target[slots] = self._reference[slots] = positions
        self._feed[slots], self._gain[slots] = velocities, gain
        self._stride[slots] = self._lead[slots] = np.inf
        self._bound(slots, efforts)

    def approach(self, joint: int, position: float, speed: float, effort: float) -> None:
        """Move towards a set-point that advances at ``speed``, and waits while the motor has its maximum effort."""
        slot = self._slots[joint]
        here = self.data.qpos[self._at[slot]]
        goes_on = np.isfinite(self._stride[slot]) and (position - here) * (self._reference[slot] - here) > 0.0
        if not goes_on:
            self._reference[slot] = here
        self._target[slot], self._feed[slot], self._gain[slot] = position, 0.0, APPROACH_GAIN
        self._stride[slot] = speed * self._period
        lag = speed * self._period / APPROACH_GAIN
        self._lead[slot] = effort * self._period / (self._stiffness[slot] * APPROACH_GAIN) + lag
        self._bound([slot], [effort])

    def turn(self, body: int, joints: Sequence[int], speeds: Sequence[float], efforts: Sequence[float]) -> None:
        """Run velocity servos for the robot; in the scene, dry friction holds joints at rest."""
        slots = [self._slots[joint] for joint in joints]
        self._feed[slots], self._gain[slots] = speeds, 0.0
        if body == self.built.robot:
            self._bound(slots, efforts)
            return
        still = np.asarray(speeds) == 0.0
        self.model.dof_frictionloss[self._dofs[slots]] = np.where(still, efforts, 0.0)
        self._bound(slots, np.where(still, 0.0, efforts))

    def exert(self, joints: Sequence[int], efforts: Array) -> None:
        """Apply efforts in addition to the motors."""
        self._own["qfrc_applied"][self._dofs[[self._slots[joint] for joint in joints]]] += efforts

    def push(self, body: int, link: int, force: Vector, point: Vector) -> None:
        """Apply the force at the centre of mass, with the moment about it."""
        at = body if link < 0 else link
        self._own["xfrc_applied"][at] += (*force, *np.cross(np.subtract(point, self.data.xipos[at]), force))

    def _bound(self, slots: Sequence[int], efforts: Sequence[float] | Array) -> None:
        self.model.actuator_forcerange[slots, 1] = efforts
        self.model.actuator_forcerange[slots, 0] = np.negative(efforts)

    def joint_states(self, body: int, joints: Sequence[int]) -> JointStates:
        """Return joint states; efforts are those of the motors, in the scene with the dry friction of the joints."""
        slots = [self._slots[joint] for joint in joints]
        data, dofs = self.data, self._dofs[slots]
        efforts = data.actuator_force[slots]
        if body != self.built.robot:
            friction, rows = np.zeros(self.model.nv), slice(data.ne, data.ne + data.nf)
            friction[data.efc_id[rows]] = data.efc_force[rows]
            efforts = efforts + friction[dofs]
        return data.qpos[self._at[slots]].tolist(), data.qvel[dofs].tolist(), efforts.tolist()

    def body_pose(self, body: int) -> tuple[Vector, Quaternion]:
        """Return the pose of the body's frame, which is at the centre of mass, except for the robot."""
        data = self.data
        w, x, y, z = data.xquat[body].tolist()
        return tuple((data.xipos if body == self.built.robot else data.xpos)[body].tolist()), (x, y, z, w)

    def body_velocity(self, body: int) -> tuple[Vector, Vector]:
        """Return the velocity that moved the body in the latest step."""
        start = self._free.get(body)
        if start is None:
            return STILL, STILL
        data = self.data
        x, y, z, p, q, r = data.qvel[start : start + 6].tolist()
        a, b, c = (data.xmat[body].reshape(3, 3) @ (p, q, r)).tolist()
        if body == self.built.robot:
            u, v, w = (data.xipos[body] - data.xpos[body]).tolist()
            x, y, z = x + b * w - c * v, y + c * u - a * w, z + a * v - b * u
        return (x, y, z), (a, b, c)

    def link_pose(self, body: int, link: int) -> Pose:
        """Return the pose of the link's frame."""
        at = body if link < 0 else link
        w, x, y, z = self.data.xquat[at]
        return Pose(self.data.xpos[at].copy(), np.array([x, y, z, w]))

    def link_motions(self, body: int, links: Collection[int]) -> Sequence[LinkMotion]:
        """Return link motions after the step; MuJoCo's velocities are those before it, so they are recomputed."""
        if self._moved:
            mujoco.mj_comPos(self.model, self.data)
            mujoco.mj_comVel(self.model, self.data)
            self._moved = False
        motions, velocity = [], np.zeros(6)
        for link in links:
            # Of a body, MuJoCo's frame of the object is that of its inertia.
            mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, link, velocity, 0)
            a, b, c, x, y, z = velocity.tolist()
            motions.append(LinkMotion(tuple(self.data.xipos[link].tolist()), (x, y, z), (a, b, c)))
        return motions

    def contacts(
        self, body: int | None = None, link: int | None = None, other: int | None = None
    ) -> Sequence[ContactPoint]:
        """Return the contact points of the latest step with their forces; arguments as in ``Engine.contacts``."""
        if self._contacts is None:
            self._contacts = self._all_contacts()
        if body is None:
            return self._contacts
        turned = (contact if contact.first == body else _swapped(contact) for contact in self._contacts)
        return [
            contact
            for contact in turned
            if contact.first == body
            and (link is None or contact.first_link == link)
            and (other is None or contact.second == other)
        ]

    def _all_contacts(self) -> list[ContactPoint]:
        data, found = self.data, self.data.contact
        if not data.ncon:
            return []
        geoms = found.geom
        bodies, links = self._geom_body[geoms].tolist(), self._geom_link[geoms].tolist()
        frames = -found.frame.reshape(-1, 3, 3)
        half = 0.5 * found.dist[:, None] * frames[:, 0]
        on_first, on_second = (found.pos + half).tolist(), (found.pos - half).tolist()
        rows, dims, force = found.efc_address.tolist(), found.dim.tolist(), data.efc_force
        points = []
        for i, (axes, distance) in enumerate(zip(frames.tolist(), found.dist.tolist(), strict=True)):
            row, pressure, along, across = rows[i], 0.0, 0.0, 0.0
            if row >= 0:
                pressure = float(force[row])
                if dims[i] >= 3:
                    along, across = float(force[row + 1]), float(force[row + 2])
            normal, first, second = (tuple(axis) for axis in axes)
            points.append(
                ContactPoint(
                    first=bodies[i][0],
                    second=bodies[i][1],
                    first_link=links[i][0],
                    second_link=links[i][1],
                    on_first=tuple(on_first[i]),
                    on_second=tuple(on_second[i]),
                    normal=normal,
                    distance=distance,
                    pressure=pressure,
                    friction=along,
                    direction=first,
                    friction_2=across,
                    direction_2=second,
                )
            )
        return points

    def gaps(self, body: int, other: int, within: float, link: int | None = None) -> Sequence[float]:
        """Return the distances below ``within`` between convex parts, metres."""
        mine = self._solid(self._geom_body == body)
        theirs = self._solid((self._geom_body == other) & (True if link is None else self._geom_link == link))
        found = (
            mujoco.mj_geomDistance(self.model, self.data, one, two, within, None) for one in mine for two in theirs
        )
        return [gap for gap in found if gap < within]

    def _solid(self, which: NDArray[np.bool_]) -> list[int]:
        result: list[int] = np.flatnonzero(which & (self.model.geom_contype > 0)).tolist()
        return result

    def cast_rays(self, starts: Array, ends: Array) -> tuple[NDArray[np.intp], Array]:
        """Cast rays; a body around a ray's start does not stop it."""
        bodies, shares = np.full(len(starts), -1), np.ones(len(starts))
        model, data, geom, normal = self.model, self.data, np.zeros(1, np.int32), np.zeros(3)
        for i, (start, way) in enumerate(zip(starts, ends - starts, strict=True)):
            gone = 0.0
            while True:
                share = mujoco.mj_ray(model, data, start + gone * way, way, self._rays, 1, -1, geom, normal)
                if share < 0.0 or gone + share > 1.0:
                    break
                gone += share
                if normal @ way <= 0.0:
                    bodies[i], shares[i] = self._geom_body[geom[0]], gone
                    break
                gone += 1e-6
        return bodies, shares

    def depth_image(
        self, map_from_optical: Pose, intrinsics: CameraIntrinsics, near: float, far: float, without: int = -1
    ) -> tuple[NDArray[np.uint8], Array]:
        """Render with OpenGL."""
        planes = min(near, NOT_DRAWN), far * 1.001
        rgb, depth = self._renderer.pinhole(map_from_optical, intrinsics, *planes)
        shown = (depth >= near) & (depth <= far)
        if without >= 0:
            colors, _ = self._renderer.pinhole(map_from_optical, intrinsics, *planes, segments=True)
            shown &= self._bodies(colors)[0] != without
        return rgb, np.where(shown, depth, 0.0)

    def photo(self, viewpoint: Viewpoint, width: int, height: int) -> NDArray[np.uint8]:
        """Render with OpenGL."""
        return self._renderer.view(viewpoint, width, height)

    def segments(self, viewpoint: Viewpoint, width: int, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return body and link of each pixel, (H, W) each, by OpenGL."""
        return self._bodies(self._renderer.view(viewpoint, width, height, segments=True))

    def _bodies(self, colors: NDArray[np.uint8]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        geoms = self._renderer.geoms(colors)
        there = geoms >= 0
        return np.where(there, self._geom_body[geoms], -1), np.where(there, self._geom_link[geoms], -1)

    def put(self, body: int, position: Sequence[float], quaternion: Sequence[float]) -> None:
        """Set the pose of a free body."""
        model, data = self.model, self.data
        place, speed = model.jnt_qposadr[model.body_jntadr[body]], self._free[body]
        if body == self.built.robot:
            centre = Pose(np.array(position), np.array(quaternion))
            position = centre.apply(-model.body_ipos[body]).tolist()
        x, y, z, w = quaternion
        data.qpos[place : place + 7] = (*position, w, x, y, z)
        data.qvel[speed : speed + 6] = 0.0
        self._was_put()

    def set_joint(self, body: int, joint: int, position: float) -> None:
        """Set the position of a joint that has a motor."""
        slot = self._slots[joint]
        self.data.qpos[self._at[slot]] = position
        self.data.qvel[self._dofs[slot]] = 0.0
        self._was_put()

    def _was_put(self) -> None:
        mujoco.mj_kinematics(self.model, self.data)
        self._keep_state()
        self._contacts = None

    def friction(self, body: int) -> tuple[float, float]:
        """Return the friction of its first shape, as set for contacts with the scene."""
        geom = self._solid((self._geom_body == body) & (self._geom_link == -1))[0]
        sliding, spinning, _ = self.model.geom_friction[geom].tolist()
        return sliding, spinning

    def set_friction(self, body: int, sliding: float, spinning: float) -> None:
        """Set the friction; contacts with fingers scale by the same factor."""
        geoms = self._solid(self._geom_body == body)
        self.model.geom_friction[geoms, :2] = sliding, spinning
        pairs = np.isin(self.model.pair_geom1, geoms) | np.isin(self.model.pair_geom2, geoms)
        share = sliding / self._geom_friction[geoms[0], 0]
        self.model.pair_friction[pairs] = np.maximum(share * self._pair_friction[pairs], LEAST_FRICTION)

    def constraint_count(self) -> int:
        """Return the number of constraints: the couplings of the robot's joints."""
        return int(self.data.eq_active.sum())

    def constants(self) -> Mapping[str, tuple[Any, ...]]:
        """Return the constants of the model: options, couplings, contacts, masses."""
        model, option = self.model, self.model.opt
        constants: dict[str, tuple[Any, ...]] = {
            "gravity": tuple(option.gravity.tolist()),
            "the time step": (option.timestep,),
            "the number of bodies": (model.nbody,),
            "the flags of the engine": (int(option.disableflags), int(option.enableflags)),
            "couplings of joints": (model.eq_data.tobytes(), model.eq_obj1id.tobytes(), model.eq_obj2id.tobytes()),
        }
        for body, name in self._names.items():
            for link in np.flatnonzero(self._root == body).tolist():
                place = name if link == body else f"{name}, link {link}"
                solid = self._solid(self._geom_body == body) if link == body else []
                constants[f"friction of {place}"] = tuple(model.geom_friction[solid, :2].ravel().tolist())
                constants[f"mass of {place}"] = (float(model.body_mass[link]), *model.body_inertia[link].tolist())
        return constants


class UnstableError(SimulationError):
    """Raised if the simulation is numerically unstable: the run ends and never counts as a success."""

    code = "simulation_unstable"


def _swapped(contact: ContactPoint) -> ContactPoint:
    def turned(axis: Vector) -> Vector:
        return -axis[0], -axis[1], -axis[2]

    return contact._replace(
        first=contact.second,
        second=contact.first,
        first_link=contact.second_link,
        second_link=contact.first_link,
        on_first=contact.on_second,
        on_second=contact.on_first,
        normal=turned(contact.normal),
        direction=turned(contact.direction),
        direction_2=turned(contact.direction_2),
    )
