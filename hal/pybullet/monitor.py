"""The honesty monitor: looks at the simulation 60 times a second and keeps a record of what should not be."""

from __future__ import annotations

from bestman_bt.scene import World
from hal.pybullet.client import ReadPurpose
from hal.pybullet.contact_watcher import ContactWatcher
from hal.pybullet.honesty_record import HonestyRecord
from hal.pybullet.leaf_watcher import LeafWatcher
from hal.pybullet.motion_watcher import MotionWatcher
from hal.pybullet.observation import Observer
from hal.pybullet.open_hand_watcher import OpenHandWatcher
from hal.pybullet.simulation import Simulation
from hal.pybullet.tamper_watcher import TamperWatcher

FULL_CHECK_EVERY = 60


class HonestyMonitor:
    """Watches one simulation of ``world`` from the moment its scene is built."""

    def __init__(self, simulation: Simulation, world: World) -> None:
        self._simulation = simulation
        client = simulation.client
        reader = client.reader(ReadPurpose.MONITOR)
        self._observer = Observer(simulation, reader)
        self._contacts = ContactWatcher(simulation)
        self._motions = MotionWatcher(simulation, reader)
        self._leaves = LeafWatcher(simulation, world, reader)
        self._open_hand = OpenHandWatcher(simulation, client, reader)
        self._tampering = TamperWatcher(simulation, client, reader)
        self._looks = self._steps = 0
        simulation.step_observers.append(self._after_step)
        simulation.observers.append(self._look)

    def record(self) -> HonestyRecord:
        """What was seen up to now."""
        simulation, motions, leaves, tampering = self._simulation, self._motions, self._leaves, self._tampering
        stamp = simulation.steps * simulation.parameters.time_step
        tampering.watch_everything(stamp)
        counts = simulation.client.counts
        return HonestyRecord(
            duration=stamp,
            resets=counts["resets"],
            constraints=counts["constraints"],
            truth_reads=counts["truth_reads"],
            tampering=counts["tampering"],
            calls=dict(simulation.client.calls),
            jumps=tuple(sorted([*motions.jumps, *leaves.jumps, *tampering.jumps], key=lambda finding: finding.stamp)),
            hidden_constraints=tuple(tampering.hidden_constraints),
            changes=tuple(tampering.changes),
            unexplained_forces=(*motions.unexplained_forces, *leaves.unexplained_forces),
            joint_limits=tuple(motions.joint_limits),
            velocity_limits=tuple(motions.velocity_limits),
            open_hand=tuple(self._open_hand.findings),
            contacts=self._contacts.incidents(),
            penetrations=self._contacts.penetrations(),
            disturbances=tuple(
                sorted(
                    (*simulation.walkers.log, *simulation.moving_doors.log, *simulation.interference.log),
                    key=lambda finding: finding.stamp,
                )
            ),
            missed_looks=max(0, simulation.steps // simulation.parameters.monitor_every - self._looks)
            + max(0, simulation.steps - self._steps),
        )

    def _after_step(self) -> None:
        self._motions.integrate()
        self._leaves.watch_step()
        self._steps += 1

    def _look(self) -> None:
        motions, contacts = self._motions, self._contacts
        observation = self._observer.observe()
        contacts.watch(observation)
        put_down = self._simulation.interference.put_down
        motions.watch(observation, contacts.touched, contacts.robot_forces, put_down)
        self._open_hand.watch(observation, contacts.robot_forces, put_down)
        put_down.clear()
        self._tampering.watch_constraints(observation.stamp)
        self._looks += 1
        if self._looks % FULL_CHECK_EVERY == 0:
            self._tampering.watch_everything(observation.stamp)
