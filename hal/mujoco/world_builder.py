"""Builds a drawn world and the robot as one MuJoCo model; the only place where bodies, joints and frictions are set.

Bodies are numbered as MuJoCo numbers their root links, links and the joints that carry them as MuJoCo numbers links.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Sphere
from bestman_bt.robot_model.finger_linkage import MimicJoint
from bestman_bt.robot_model.footprint import origin_pose
from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, RobotModel, WheeledBaseModel
from bestman_bt.robot_model.mounting import without_frame_links
from bestman_bt.robot_model.urdf_elements import child_of, parent_of
from bestman_bt.scene.mesh_file import read_triangles
from bestman_bt.scene.scene import PlacedFurniture, PlacedObject, Walker, World, wall_box
from hal.mujoco.package import mujoco
from hal.mujoco.parameters import MujocoParameters
from hal.simulation.bodies import BuiltWorld, SimulationError
from hal.simulation.joint_motors import mass_distribution

Color = tuple[float, float, float, float]
WALL_COLOR: Color = (0.87, 0.87, 0.83, 1.0)
FLOOR_COLOR: Color = (0.62, 0.58, 0.53, 1.0)
WALKER_COLOR: Color = (0.85, 0.45, 0.20, 1.0)
LINK_COLOR: Color = (0.8, 0.8, 0.8, 1.0)
SOLID_AND_SEEN, SEEN, SOLID = 0, 1, 3
"""Groups of geoms: colliding and visible, only visible, only colliding."""
ROBOT, SCENE = 1, 2
"""Bits of collision: the robot's links collide with the scene and not with each other."""
ROBOT_NAME = "robot/"
"""Prefix of the robot's links in the model."""
STIFF = [0.99, 0.99, 0.001, 0.5, 2.0]
"""Time constant of dry friction: with a smaller one a door creeps by a tenth of a millimetre per second. With twice the
time step it stops a door within a step. A larger one would keep a door moving that something else stops.
"""
REACH = 30.0
"""Length of a walker's slides in each direction, metres."""


@dataclass
class Built:
    """A compiled model, its initial state, and the meaning of its indices. ``fingers``: geoms; ``objects``: object →
    geoms.

    ``loads``: inertia or mass that a motor moves beyond MuJoCo's value for its joint, kg m² or kg, by joint.
    """

    model: Any
    data: Any
    world: BuiltWorld
    loads: dict[int, float]


@dataclass
class _Contact:
    """How a geom touches: of two geoms, that of the higher ``priority`` decides. ``condim``: 1 without friction, 3
    with sliding friction, 4 with spinning friction, too. ``rolls``: a wheel, whose cylinder becomes an ellipsoid that
    touches in one point: the two edges of a cylinder rub against each other in every turn, and the wheel slips.
    """

    friction: float
    spinning: float = 0.0
    priority: int = 0
    condim: int = 3
    rolls: bool = False


@dataclass
class Shapes:
    """Adds bodies and shapes to a MuJoCo specification."""

    parameters: MujocoParameters
    spec: Any = field(default_factory=lambda: mujoco.MjSpec())
    meshes: dict[tuple[Any, ...], str] = field(default_factory=dict)

    def light(self) -> None:
        """Add the lights for pictures: at the camera, and from the left behind with shadows."""
        self.spec.visual.quality.offsamples = 0
        headlight = self.spec.visual.headlight
        headlight.ambient, headlight.diffuse, headlight.specular = [0.5] * 3, [0.35] * 3, [0.0] * 3
        self.spec.worldbody.add_light(
            pos=[-2.0, -3.0, 6.0], dir=[2.0, 3.0, -6.0], diffuse=[0.35] * 3, specular=[0.0] * 3
        )

    def body(self, parent: Any, name: str, pose: Pose) -> Any:
        """Return a body that is added to ``parent``."""
        return parent.add_body(name=name, pos=pose.position, quat=_wxyz(pose))

    def geoms(
        self,
        body: Any,
        parts: Sequence[PlacedShape],
        colors: Sequence[Color] | None,
        contact: _Contact | None,
        bit: int = SCENE,
    ) -> list[str]:
        """Add shapes to a body and return their names. Without ``contact``, they are only visible; without colours,
        only colliding.
        """
        names = []
        for part, color in zip(parts, colors or [LINK_COLOR] * len(parts), strict=True):
            name = f"{body.name}#{len(list(body.geoms))}"
            kind, size, mesh = self._shape(part)
            if contact is not None and contact.rolls and isinstance(part.shape, Cylinder):
                kind, size = mujoco.mjtGeom.mjGEOM_ELLIPSOID, [part.shape.radius] * 2 + [part.shape.length / 2]
            values: dict[str, Any] = {"name": name, "type": kind, "pos": part.pose.position, "quat": _wxyz(part.pose)}
            values |= {"rgba": color, "density": 0.0, "contype": 0, "conaffinity": 0, "group": SEEN}
            values |= {"meshname": mesh} if mesh else {"size": size}
            if contact is not None:
                values |= {
                    "contype": bit,
                    "conaffinity": ROBOT | SCENE if bit == SCENE else 0,
                    "group": SOLID if colors is None else SOLID_AND_SEEN,
                    "friction": [contact.friction, contact.spinning, 1e-4],
                    "priority": contact.priority,
                    "condim": contact.condim,
                    "solref": [self.parameters.contact_time, 1.0],
                }
            body.add_geom(**values)
            names.append(name)
        return names

    def _shape(self, part: PlacedShape) -> tuple[Any, list[float], str]:
        geom = mujoco.mjtGeom
        match part.shape:
            case Box(size=(x, y, z)):
                return geom.mjGEOM_BOX, [x / 2, y / 2, z / 2], ""
            case Cylinder(radius=radius, length=length):
                return geom.mjGEOM_CYLINDER, [radius, length / 2, 0.0], ""
            case Sphere(radius=radius):
                return geom.mjGEOM_SPHERE, [radius, 0.0, 0.0], ""
            case Mesh(vertices=vertices, faces=faces):
                return geom.mjGEOM_MESH, [], self._mesh((vertices.tobytes(), faces.tobytes()), vertices, faces)

    def _mesh(self, key: tuple[Any, ...], vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> str:
        if key not in self.meshes:
            self.meshes[key] = f"mesh_{len(self.meshes)}"
            self.spec.add_mesh(
                name=self.meshes[key],
                uservert=np.asarray(vertices, dtype=float).ravel(),
                userface=np.asarray(faces, dtype=np.int32).ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
            )
        return self.meshes[key]


@dataclass(kw_only=True)
class WorldBuilder(Shapes):
    """Builds and compiles a MuJoCo specification. Raises SimulationError naming unsupported elements."""

    robot: RobotModel
    scene: World
    starts: dict[str, float] = field(default_factory=dict)
    """Joint → initial position."""
    fingers: dict[str, float] = field(default_factory=dict)
    """Geom of a finger → its friction."""
    object_geoms: dict[str, float] = field(default_factory=dict)

    def build(self) -> Built:
        """Return the compiled world at the start posture."""
        spec, parameters = self.spec, self.parameters
        spec.compiler.degree = False
        spec.compiler.balanceinertia = True
        spec.compiler.inertiafromgeom = 0
        spec.compiler.boundmass, spec.compiler.boundinertia = 1e-4, 1e-7
        option = spec.option
        option.timestep, option.iterations = parameters.time_step, parameters.solver_iterations
        option.integrator, option.cone = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtCone.mjCONE_ELLIPTIC
        option.impratio = parameters.friction_stiffness
        # A simulation that explodes shall be seen, not begun anew.
        option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.light()
        self._floor()
        for i, wall in enumerate(self.scene.walls):
            box, pose = wall_box(wall)
            body = self.body(spec.worldbody, f"walls/{i}", pose)
            self.geoms(body, [PlacedShape(box, Pose())], [WALL_COLOR], _Contact(0.5))
        for piece in self.scene.furniture:
            self._furniture(piece)
        for placed in self.scene.objects:
            self._object(placed)
        for walker in self.scene.walkers:
            self._walker(walker)
        links = self._robot()
        self._grips()
        try:
            model = spec.compile()
        except ValueError as error:
            raise SimulationError(f"MuJoCo cannot simulate this world: {' '.join(str(error).split())}") from error
        return self._built(model, links)

    def _built(self, model: Any, links: _Links) -> Built:
        def number(name: str) -> int:
            return int(model.body(name).id)

        root = number(ROBOT_NAME + links.root)
        numbers = {name: number(ROBOT_NAME + name) for name in links.parents}
        joints = {name: numbers[link] for name, link in links.children.items()}
        loads: dict[int, float] = {}
        for base in self.robot.of(WheeledBaseModel).values():
            share = float(model.body_subtreemass[root]) * base.part.wheel_radius**2 / len(base.part.wheel_joints)
            loads |= {joints[joint]: share for joint in base.part.wheel_joints}
        for wheel, load in loads.items():
            model.dof_armature[model.body_dofadr[wheel]] = self.parameters.wheel_armature * load
        for gripper in self.robot.of(GripperModel).values():
            for joint in gripper.part.joints:
                dof = model.body_dofadr[joints[joint]]
                model.dof_armature[dof] = self.parameters.finger_armature * model.dof_M0[dof]
        data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        for joint, position in self.starts.items():
            data.qpos[model.joint(joint).qposadr[0]] = position
        mujoco.mj_forward(model, data)
        root_or = {**numbers, links.root: -1}
        objects = {placed.name: number(placed.name) for placed in self.scene.objects}
        articulations = {
            f"{piece.name}/{door.name}": (number(piece.name), number(f"{piece.name}/{door.name}"))
            for piece in self.scene.furniture
            for door in piece.model.articulations
        }
        walkers = {
            walker.name: (number(f"{walker.name}/track"), (number(f"{walker.name}/carrier"), number(walker.name)))
            for walker in self.scene.walkers
        }
        built = BuiltWorld(
            floor=0,
            walls={f"wall_{i}": number(f"walls/{i}") for i in range(len(self.scene.walls))},
            furniture={piece.name: number(piece.name) for piece in self.scene.furniture},
            objects=objects,
            robot=root,
            joints=joints,
            links=root_or,
            frames=links.frames,
            parents={numbers[name]: root_or[parent] for name, parent in links.parents.items()},
            link_masses={link: float(model.body_mass[link]) for link in numbers.values()},
            object_masses={body: float(model.body_mass[body]) for body in objects.values()},
            max_efforts={joints[name]: effort for name, effort in links.efforts.items()},
            articulations=articulations,
            walkers=walkers,
        )
        return Built(model, data, built, loads)

    def _floor(self) -> None:
        self.spec.worldbody.add_geom(
            name="floor",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[15.0, 15.0, 0.1],
            rgba=FLOOR_COLOR,
            contype=SCENE,
            conaffinity=ROBOT | SCENE,
            friction=[self.parameters.floor_friction, 0.0, 1e-4],
            solref=[self.parameters.contact_time, 1.0],
        )

    def _furniture(self, piece: PlacedFurniture) -> None:
        """Add a fixed piece, its doors and drawers open as in the scene, held only by the friction of their joints."""
        model = piece.model
        contact = _Contact(model.friction)
        body = self.body(self.spec.worldbody, piece.name, piece.pose)
        self.geoms(body, model.parts, model.colors, contact)
        doors = []
        for door in model.articulations:
            name = f"{piece.name}/{door.name}"
            origin = Pose(np.array(door.origin))
            child = self.body(body, name, origin)
            parts = [PlacedShape(part.shape, origin.inverse() @ part.pose) for part in door.parts]
            self.geoms(child, parts, door.colors, contact)
            centre, inertia = mass_distribution(parts, door.mass)
            _set_inertia(child, door.mass, centre, inertia)
            self._joint(child, name, door.kind, door.axis, (0.0, door.upper))
            joint = self.spec.joint(name)
            joint.frictionloss = door.friction
            joint.solref_friction, joint.solimp_friction = [2.0 * self.parameters.time_step, 1.0], STIFF
            self.starts[name] = piece.open.get(door.name, 0.0)
            doors.append(name)
        for first, second in combinations([piece.name, *doors], 2):
            self.spec.add_exclude(bodyname1=first, bodyname2=second)

    def _object(self, placed: PlacedObject) -> None:
        model, parameters = placed.model, self.parameters
        body = self.body(self.spec.worldbody, placed.name, placed.pose)
        body.add_freejoint(name=placed.name)
        # Of the two frictions of a contact MuJoCo takes one, Bullet multiplies them.
        friction = model.friction * parameters.support_friction
        contact = _Contact(friction, parameters.object_spinning_friction, priority=1, condim=4)
        for name in self.geoms(body, model.collision, None, contact):
            self.object_geoms[name] = model.friction
        seen = [(part, (*color, 1.0)) for part, color in model.appearance]
        self.geoms(body, [part for part, _ in seen], [color for _, color in seen], None)
        # The centre of mass is the frame's origin, as in the other engine.
        _set_inertia(body, model.mass, np.zeros(3), mass_distribution(model.collision, model.mass)[1])

    def _walker(self, walker: Walker) -> None:
        """Add an upright cylinder on two motorised slides, along x and y, which are at 0 at the start of its route."""
        x, y = walker.route[0]
        track = self.body(self.spec.worldbody, f"{walker.name}/track", Pose(np.array([x, y, 0.0])))
        carrier = self.body(track, f"{walker.name}/carrier", Pose())
        body = self.body(carrier, walker.name, Pose())
        for child, axis, mass in ((carrier, (1.0, 0.0, 0.0), 1.0), (body, (0.0, 1.0, 0.0), walker.mass)):
            self._joint(child, child.name, "prismatic", axis, (-REACH, REACH))
            _set_inertia(child, mass, np.zeros(3), mass * np.eye(3))
        shape = PlacedShape(
            Cylinder(walker.radius, walker.height - 0.01), Pose(np.array([0.0, 0.0, walker.height / 2 + 0.005]))
        )
        self.geoms(body, [shape], [WALKER_COLOR], _Contact(0.5))

    def _joint(
        self, body: Any, name: str, kind: str, axis: Sequence[float], limits: tuple[float, float] | None
    ) -> None:
        """Add a hinge or slide at the body's origin, with a velocity motor; the engine sets its
        stiffness and strength.
        """
        turns = kind in ("revolute", "continuous")
        body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_HINGE if turns else mujoco.mjtJoint.mjJNT_SLIDE,
            axis=axis,
            limited=int(limits is not None),
            range=limits or (0.0, 0.0),
        )
        self.spec.add_actuator(
            name=name,
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            forcelimited=1,
            forcerange=(-1e-9, 1e-9),
            ctrllimited=0,
        )

    def _robot(self) -> _Links:
        urdf, frames = without_frame_links(self.robot.urdf)
        tree = ET.fromstring(urdf)
        self._colors = {
            str(material.get("name")): _numbers(color.get("rgba"))
            for material in tree.iter("material")
            if (color := material.find("color")) is not None
        }
        elements = {str(link.get("name")): link for link in tree.findall("link")}
        joints = {child_of(joint): joint for joint in tree.findall("joint")}
        root = next(name for name in elements if name not in joints)
        contacts, friction = self._contacts(joints)
        links = _Links(root, frames)
        pending = [root]
        while pending:
            name = pending.pop(0)
            pending += [child for child, joint in joints.items() if parent_of(joint) == name]
            if name == root:
                body = self.body(self.spec.worldbody, ROBOT_NAME + name, self.scene.robot_start.to_pose())
                if self.robot.of(BaseModel):
                    body.add_freejoint(name="robot")
            else:
                joint = joints[name]
                body = self.body(self.spec.body(ROBOT_NAME + parent_of(joint)), ROBOT_NAME + name, origin_pose(joint))
                self._robot_joint(body, joint)
                links.take(joint)
            self._link(body, elements[name], contacts.get(name, _Contact(self.parameters.link_friction)))
            if name in friction:
                self.fingers |= {
                    geom.name: friction[name] for geom in self.spec.body(ROBOT_NAME + name).geoms if geom.contype
                }
        self._couple()
        posture = next(
            (self.robot.postures[name] for name in self.parameters.initial_postures if name in self.robot.postures), {}
        )
        for gripper in self.robot.of(GripperModel).values():
            posture = {**posture, **gripper.joint_positions(gripper.max_width)}
        self.starts |= {ROBOT_NAME + joint: position for joint, position in posture.items()}
        if len(self.robot.arm_names) > 1:
            self._let_arms_collide(elements, joints)
        return links

    def _robot_joint(self, body: Any, joint: ET.Element) -> None:
        kind, name = str(joint.get("type")), ROBOT_NAME + str(joint.get("name"))
        if kind == "fixed":
            return
        if kind not in ("revolute", "continuous", "prismatic"):
            raise SimulationError(f"MuJoCo cannot simulate the {kind} joint {joint.get('name')!r} of this robot")
        axis, limit, dynamics = joint.find("axis"), joint.find("limit"), joint.find("dynamics")
        limits = None
        if kind != "continuous" and limit is not None:
            limits = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
        self._joint(body, name, kind, (1.0, 0.0, 0.0) if axis is None else _numbers(axis.get("xyz")), limits)
        if dynamics is not None:
            self.spec.joint(name).damping = [float(dynamics.get("damping", "0")), 0.0, 0.0]  # of the speed alone

    def _link(self, body: Any, link: ET.Element, contact: _Contact) -> None:
        inertial = link.find("inertial")
        mass, pose, inertia = 1e-3, Pose(), 1e-6 * np.eye(3)
        if inertial is not None:
            mass, pose = float(_child(inertial, "mass").get("value", "0")), origin_pose(inertial)
            values = _child(inertial, "inertia")
            xx, yy, zz, xy, xz, yz = (
                float(values.get(f"i{axes}", "0")) for axes in ("xx", "yy", "zz", "xy", "xz", "yz")
            )
            inertia = pose.rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ pose.rotation.T
        _set_inertia(body, mass, pose.position, inertia)
        solid = [self._placed(element) for element in link.findall("collision")]
        seen = link.findall("visual")
        drawn = not any(_file(element).endswith(".dae") for element in seen)
        self.geoms(body, solid, None if drawn else [LINK_COLOR] * len(solid), contact, ROBOT)
        for element in seen if drawn else ():
            self.geoms(body, [self._placed(element)], [self._color(element)], None)

    def _color(self, visual: ET.Element) -> Color:
        material = visual.find("material")
        color: Color = self._colors.get("" if material is None else str(material.get("name")), LINK_COLOR)
        return color

    def _placed(self, element: ET.Element) -> PlacedShape:
        shape, pose = _child(element, "geometry")[0], origin_pose(element)
        match shape.tag:
            case "box":
                return PlacedShape(Box(_numbers(shape.get("size"))), pose)
            case "sphere":
                return PlacedShape(Sphere(float(shape.get("radius", "0"))), pose)
            case "cylinder":
                return PlacedShape(Cylinder(float(shape.get("radius", "0")), float(shape.get("length", "0"))), pose)
        file, scale = str(shape.get("filename")), _numbers(shape.get("scale", "1 1 1"))
        mesh = read_triangles(Path(file))
        return PlacedShape(Mesh(np.asarray(mesh.vertices) * scale, np.asarray(mesh.faces)), pose)

    def _contacts(self, joints: dict[str, ET.Element]) -> tuple[dict[str, _Contact], dict[str, float]]:
        """Collect the contacts of wheels, casters and fingers, by link, and the frictions of fingers, by link."""
        parameters = self.parameters
        carried = {str(joint.get("name")): child for child, joint in joints.items()}
        contacts: dict[str, _Contact] = {}
        for base in self.robot.of(WheeledBaseModel).values():
            grip = parameters.wheel_friction if base.part.wheel_friction is None else base.part.wheel_friction
            contacts |= {carried[joint]: _Contact(grip, priority=3, rolls=True) for joint in base.part.wheel_joints}
            contacts |= {link: _Contact(0.0, priority=4, condim=1) for link in base.part.caster_links}
        fingers: dict[str, float] = {}
        for gripper in self.robot.of(GripperModel).values():
            friction = gripper.part.friction if self.scene.finger_friction is None else self.scene.finger_friction
            fingers |= dict.fromkeys(gripper.part.finger_links, friction)
        for link, friction in fingers.items():
            grip = friction * parameters.support_friction
            contacts[link] = _Contact(grip, parameters.finger_spinning_friction, priority=2, condim=4)
        return contacts, fingers

    def _grips(self) -> None:
        """Add contacts of fingers with objects, whose frictions multiply."""
        parameters = self.parameters
        for finger, one in self.fingers.items():
            for thing, other in self.object_geoms.items():
                spinning = parameters.finger_spinning_friction * other + parameters.object_spinning_friction * one
                self._pair(finger, thing, one * other, spinning)

    def _pair(self, first: str, second: str, friction: float, spinning: float) -> None:
        self.spec.add_pair(
            name=f"{first} {second}",
            geomname1=first,
            geomname2=second,
            condim=4,
            friction=[friction, friction, spinning, 1e-4, 1e-4],
            solref=[self.parameters.contact_time, 1.0],
        )

    def _couple(self) -> None:
        """Couple joints of a hand to others of it, as teeth or the bars of a linkage do."""
        for gripper in self.robot.of(GripperModel).values():
            mimics = list(gripper.followers)
            if len(gripper.part.joints) == 2:
                mimics.append(MimicJoint(*gripper.part.joints))
            for mimic in mimics:
                self.spec.add_equality(
                    type=mujoco.mjtEq.mjEQ_JOINT,
                    objtype=mujoco.mjtObj.mjOBJ_JOINT,
                    name1=ROBOT_NAME + mimic.joint,
                    name2=ROBOT_NAME + mimic.leader,
                    data=[mimic.offset, mimic.multiplier, *[0.0] * 10],
                    solref=[self.parameters.gear_time, 1.0],
                )

    def _let_arms_collide(self, elements: Iterable[str], joints: dict[str, ET.Element]) -> None:
        """Let the links of two arms with their hands collide, except for pairs that the model excludes."""

        def arms_of(link: str) -> frozenset[str]:
            found = set()
            while link in joints:
                found |= {name for name, arm in carriers.items() if link in arm}
                link = parent_of(joints[link])
            return frozenset(found)

        carriers = {
            name: {arm.base_frame, *(child for child, joint in joints.items() if joint.get("name") in arm.joint_names)}
            for name, arm in self.robot.of(ArmModel).items()
        }
        arms = {link: arms_of(link) for link in elements}
        for one, other in combinations(elements, 2):
            apart = arms[one] and arms[other] and arms[one].isdisjoint(arms[other])
            if not apart or {one, other} in self.robot.allowed_self_pairs:
                continue
            solids = [
                [geom.name for geom in self.spec.body(ROBOT_NAME + link).geoms if geom.contype] for link in (one, other)
            ]
            for first in solids[0]:
                for second in solids[1]:
                    self._pair(first, second, self.parameters.link_friction, 0.0)


@dataclass
class _Links:
    """The description of the robot's links in the URDF; ``children``: joint → link, ``parents``: link → link."""

    root: str
    frames: dict[str, tuple[str, Pose]]
    children: dict[str, str] = field(default_factory=dict)
    parents: dict[str, str] = field(default_factory=dict)
    efforts: dict[str, float] = field(default_factory=dict)

    def take(self, joint: ET.Element) -> None:
        """Add a joint whose parent is known."""
        name, limit = str(joint.get("name")), joint.find("limit")
        self.children[name], self.parents[child_of(joint)] = child_of(joint), parent_of(joint)
        self.efforts[name] = 0.0 if limit is None else float(limit.get("effort", "0"))


def _set_inertia(body: Any, mass: float, centre: NDArray[np.float64], inertia: NDArray[np.float64]) -> None:
    """Set the inertia. ``inertia``: (3, 3) about the centre of mass, along the axes of the body, kg m²."""
    body.mass, body.ipos, body.explicitinertial = mass, centre, True
    moments = np.maximum(np.diag(inertia), 1e-9)
    body.fullinertia = [*moments, inertia[0, 1], inertia[0, 2], inertia[1, 2]]


def _wxyz(pose: Pose) -> list[float]:
    x, y, z, w = pose.quaternion.tolist()
    return [w, x, y, z]


def _file(visual: ET.Element) -> str:
    """Return the file of a mesh; Collada needs an additional package, without which the collision shapes are drawn."""
    return str(_child(visual, "geometry")[0].get("filename", "")).lower()


def _numbers(text: str | None) -> Any:
    return tuple(map(float, (text or "").split()))


def _child(element: ET.Element, tag: str) -> ET.Element:
    found = element.find(tag)
    assert found is not None
    return found
