"""The honesty monitor: looks at the simulation 60 times a second and keeps a record of what should not be."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from bestman_bt.scene import World
from hal.simulation.attachment_check import AttachmentCheck
from hal.simulation.audit_record import AuditRecord, DisturbanceEvent, DisturbanceLog, Finding
from hal.simulation.bodies import BodyState
from hal.simulation.contact_watcher import ContactWatcher
from hal.simulation.door_watcher import DoorWatcher
from hal.simulation.guards import ReadPurpose
from hal.simulation.integrity_check import IntegrityCheck
from hal.simulation.motion_watcher import MotionWatcher
from hal.simulation.observation import Observation, Observer
from hal.simulation.simulation import Simulation

FULL_CHECK_EVERY = 60
PUT_THERE = (2e-3, 1e-2)
"""Metres and radians from where somebody has put it, within which an object is at the next look."""


class AuditMonitor:
    """Watches one simulation of ``world`` from the moment its scene is built.

    What ``disturbance_log`` holds is forgiven: it explains what happens to one object, door or drawer for a while. Each
    such event is in the record for good, whatever becomes of the log: whoever evaluates compares it with what the
    task's own script has done.
    """

    def __init__(self, simulation: Simulation, world: World) -> None:
        self._simulation = simulation
        reader = simulation.reader(ReadPurpose.MONITOR)
        self._observer = Observer(simulation, reader)
        self._contacts = ContactWatcher(simulation)
        self._motions = MotionWatcher(simulation, reader)
        self._leaves = DoorWatcher(simulation, world, reader)
        self._open_hand = AttachmentCheck(simulation, reader)
        self._integrity = IntegrityCheck(simulation, reader)
        self.disturbance_log = DisturbanceLog()
        self._events: tuple[DisturbanceEvent, ...] = ()
        self._new: list[DisturbanceEvent] = []
        self._looks = self._steps = 0
        simulation.step_observers.append(self._after_step)
        simulation.observers.append(self._look)

    def record(self) -> AuditRecord:
        """What was seen up to now."""
        simulation, motions, leaves, integrity = self._simulation, self._motions, self._leaves, self._integrity
        stamp, counts = simulation.elapsed, simulation.ledger.counts
        self._take_in_events()
        integrity.watch_everything(stamp, self._forgiven("slip", stamp))
        return AuditRecord(
            duration=stamp,
            resets=counts["resets"],
            constraints=counts["constraints"],
            truth_reads=counts["truth_reads"],
            tampering=counts["tampering"],
            calls=dict(simulation.ledger.calls),
            jumps=tuple(sorted([*motions.jumps, *leaves.jumps, *integrity.jumps], key=lambda finding: finding.stamp)),
            hidden_constraints=tuple(integrity.hidden_constraints),
            changes=tuple(integrity.changes),
            unexplained_forces=(*motions.unexplained_forces, *leaves.unexplained_forces),
            joint_limits=tuple(motions.joint_limits),
            velocity_limits=tuple(motions.velocity_limits),
            open_hand=tuple(self._open_hand.findings),
            contacts=self._contacts.incidents(),
            penetrations=self._contacts.penetrations(),
            disturbances=tuple(
                sorted(
                    (
                        *simulation.walkers.log,
                        *simulation.moving_doors.log,
                        *(Finding(event.stamp, event.text) for event in self._events),
                        *self.disturbance_log.log,
                    ),
                    key=lambda finding: finding.stamp,
                )
            ),
            events=self._events,
            missed_looks=max(0, simulation.steps // simulation.parameters.monitor_every - self._looks)
            + max(0, simulation.steps - self._steps),
        )

    def _after_step(self) -> None:
        self._take_in_events()
        self._motions.integrate()
        self._leaves.watch_step(self._forgiven("push", self._simulation.elapsed))
        self._steps += 1

    def _look(self) -> None:
        motions, contacts = self._motions, self._contacts
        observation = self._observer.observe()
        slipping = self._forgiven("slip", observation.stamp)
        contacts.watch(observation, slipping)
        put_down = self._put_down(observation)
        motions.watch(observation, contacts.touched, contacts.robot_forces, put_down)
        self._open_hand.watch(observation, contacts.robot_forces, put_down)
        self._integrity.watch_constraints(observation.stamp)
        self._looks += 1
        if self._looks % FULL_CHECK_EVERY == 0:
            self._integrity.watch_everything(observation.stamp, slipping)

    def _take_in_events(self) -> None:
        """After every step, and never forgotten."""
        events = self.disturbance_log.events
        if events != self._events:
            new = [event for event in events if event not in self._events]
            self._events += tuple(new)
            self._new += new

    def _forgiven(self, kind: Literal["slip", "push"], now: float) -> frozenset[str]:
        """The objects, or doors and drawers, to which that is being done."""
        return frozenset(
            event.name
            for event in self._events
            if event.kind == kind and event.stamp <= now <= event.until and not self.disturbance_log.rests(event)
        )

    def _put_down(self, observation: Observation) -> set[int]:
        """The objects that somebody has put, since the look before, where they are now."""
        objects = self._simulation.built.objects
        new, self._new = self._new, []
        return {
            objects[event.name]
            for event in new
            if event.kind == "put" and _is_at(observation.bodies[objects[event.name]], event.pose)
        }


def _is_at(state: BodyState, pose: tuple[float, ...]) -> bool:
    cosine = min(1.0, abs(float(np.dot(state.quaternion, pose[3:]))))
    return math.dist(state.position, pose[:3]) < PUT_THERE[0] and 2.0 * math.acos(cosine) < PUT_THERE[1]
