"""Record demonstrations of the pick in physics, in LeRobot's dataset layout.

    python scripts/record_demonstrations.py FOLDER [--episodes 20] [--seed 0] [--learned] [--cameras]

The expert that taught the shipped policy (or, with --learned, the policy itself) picks the cup in the simulator; what
is kept are the episodes whose pick the judge confirms. Frames are taken at 20 Hz while the policy acts.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from behaviours.manipulation.policy import RunPolicy
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import Tree
from bestman_bt.evaluation.episode import prepare_episode, run_episode
from bestman_bt.manipulation.policy.base import Observation, Policy
from bestman_bt.manipulation.policy.errors import PolicyError
from bestman_bt.manipulation.policy.features import pose_vector
from bestman_bt.manipulation.policy.training.demonstrations import (
    DemonstrationFormat,
    DemonstrationRecorder,
)
from bestman_bt.manipulation.policy.training.picking import ExpertPolicy
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.runtime.policy_experts import picking_expert
from bestman_bt.runtime.robot_session import RobotSession

TASK, OBJECT, WORDS = "policy_pick", "cup", "pick the cup from the table"
FPS = 20


class Frames:
    """Looks over the shoulder of a run: what was seen at each tick at which the policy acts, and what it asked for."""

    def __init__(self, recorder: DemonstrationRecorder, learned: bool) -> None:
        self._recorder, self._learned = recorder, learned

    def watch(self, session: RobotSession, tree: Tree) -> Callable[[], None]:
        """For ``run_episode``."""
        skills, find = session.skills, session.skills.policies
        leaf = next(node for node in tree.root.iterate() if isinstance(node, RunPolicy))

        def policies(name: str, folders: tuple[Path, ...]) -> Policy:
            # Whatever was recorded of an attempt before has failed.
            self._recorder.discard()
            robot = session.setup.robot_model
            return find(name, folders) if self._learned else ExpertPolicy(picking_expert(robot, OBJECT), robot.name)

        def after_tick() -> None:
            motion = leaf.motion
            if motion is None or motion.stream.motion is None:
                return
            map_from_goal: Pose = leaf.get_input("goal")
            seen = Observation(
                skills.arm_positions(),
                skills.base_from_tool(),
                pose_vector(skills.map_from_base.inverse() @ map_from_goal),
                skills.gripper.width(),
                self._pictures(session),
            )
            asked = motion.stream.motion.state(skills.clock.now() + 1.0 / FPS).positions
            self._recorder.add(seen, asked, motion.asked_width)

        skills.policies = policies
        return after_tick

    def _pictures(self, session: RobotSession) -> dict[str, NDArray[np.uint8]]:
        cameras = {"head": session.skills.camera, "wrist": session.skills.wrist_camera}
        wanted = self._recorder.format.cameras
        return {name: camera.capture().image.rgb for name, camera in cameras.items() if name in wanted and camera}


def main() -> None:
    """Read the arguments, record, tell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--episodes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--learned", action="store_true")
    parser.add_argument("--cameras", action="store_true")
    options = parser.parse_args()
    if options.episodes < 1 or options.seed < 0:
        parser.error(f"--episodes should be 1 or more and --seed 0 or more, got {options.episodes} and {options.seed}")
    recorder: DemonstrationRecorder | None = None
    kept = 0
    for seed in range(options.seed, options.seed + options.episodes):
        config = load_run(TASK, seed=seed)
        if recorder is None:
            robot = prepare_episode(config).robot_model
            cameras = {"head": (480, 640), "wrist": (480, 640)} if options.cameras else {}
            frames = DemonstrationFormat(FPS, robot.of(ArmModel)["arm"].joint_names, True, 7, cameras, robot.name)
            try:
                recorder = DemonstrationRecorder(options.folder, frames)
            except PolicyError as error:  # told before the first episode is simulated
                parser.error(str(error))
        result = run_episode(config, watch=Frames(recorder, options.learned).watch)
        if result.success:
            recorder.end_episode(WORDS)
            kept += 1
        else:
            recorder.discard()
        print(f"seed {seed}: {result.outcome.value}, {kept} episodes", flush=True)


if __name__ == "__main__":
    main()
