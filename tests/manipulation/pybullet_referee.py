"""An independent judge of arm motions: PyBullet's contacts in the table-and-shelf scene."""

from __future__ import annotations

import json

import numpy as np

from hal.pybullet.package import pybullet
from tests.manipulation.table_and_shelf import DATA, FINGERS, PANDA, Body, boxes


class Referee:
    """Strict as the planning problems define it: no contact deeper than 0.1 mm, the base link with boxes excepted."""

    def __init__(self, bodies: list[Body] | None = None) -> None:
        self.client = pybullet.connect(pybullet.DIRECT)
        flags = pybullet.URDF_USE_SELF_COLLISION
        self.panda = pybullet.loadURDF(str(PANDA), useFixedBase=True, flags=flags, physicsClientId=self.client)
        count = pybullet.getNumJoints(self.panda, physicsClientId=self.client)
        infos = [pybullet.getJointInfo(self.panda, i, physicsClientId=self.client) for i in range(count)]
        self.links = {info[12].decode(): info[0] for info in infos} | {"panda_link0": -1}
        self.joints = {info[1].decode(): info[0] for info in infos}
        pairs = json.loads((DATA / "panda_self_pairs.json").read_text())
        self.self_pairs = [(self.links[f"panda_{a}"], self.links[f"panda_{b}"]) for a, b in pairs]
        self.boxes = []
        for _, half, centre, yaw in boxes() if bodies is None else bodies:
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=self.client)
            orientation = pybullet.getQuaternionFromEuler((0, 0, yaw))
            body = pybullet.createMultiBody(
                0, shape, basePosition=centre, baseOrientation=orientation, physicsClientId=self.client
            )
            self.boxes.append(body)
        for name, value in FINGERS.items():
            pybullet.resetJointState(self.panda, self.joints[name], value, physicsClientId=self.client)

    def place(self, positions: np.ndarray) -> None:
        for i, value in enumerate(positions, start=1):
            joint = self.joints[f"panda_joint{i}"]
            pybullet.resetJointState(self.panda, joint, float(value), physicsClientId=self.client)

    def depth(self, positions: np.ndarray) -> float:
        """Deepest overlap in metres, 0 if nothing overlaps."""
        self.place(positions)
        deepest = 0.0
        for box in self.boxes:
            for point in pybullet.getClosestPoints(self.panda, box, 0.0, physicsClientId=self.client):
                if point[3] != -1:
                    deepest = max(deepest, -point[8])
        for a, b in self.self_pairs:
            for point in pybullet.getClosestPoints(self.panda, self.panda, 0.0, a, b, physicsClientId=self.client):
                deepest = max(deepest, -point[8])
        return deepest

    def tool_pose(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) and quaternion (4,) of the grasp target."""
        self.place(positions)
        state = pybullet.getLinkState(
            self.panda, self.links["panda_grasptarget"], computeForwardKinematics=True, physicsClientId=self.client
        )
        return np.array(state[4]), np.array(state[5])

    def close(self) -> None:
        pybullet.disconnect(physicsClientId=self.client)
