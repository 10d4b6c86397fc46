"""One judged run: connect, tick the tree, let the world come to rest, judge, audit."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from py_trees.behaviour import Behaviour

from behaviours.failure import NodeFailure
from bestman_bt.configuration.errors import Problem, naming_python_parameters
from bestman_bt.configuration.run import RunConfig
from bestman_bt.engine import FAILURE, RUNNING, Node, StateChanges, Tree
from bestman_bt.engine.models.foreign import missing_nodes
from bestman_bt.engine.status import state_code
from bestman_bt.evaluation.audit import Audit, audit
from bestman_bt.evaluation.declared_contacts import ContactLog
from bestman_bt.evaluation.disturbances import Disturbances
from bestman_bt.evaluation.episode_measures import DrivenPath, Durations, MotionLog
from bestman_bt.evaluation.judge import find_judge
from bestman_bt.evaluation.recording import Pictures, Recording
from bestman_bt.evaluation.result import NO_GOAL, Outcome, RunResult
from bestman_bt.evaluation.versions import versions
from bestman_bt.extras import EXTRA_OF_SIMULATOR, is_installed, missing_extra
from bestman_bt.facts.evidence import Verdict
from bestman_bt.records.keeping import RecordingErrors
from bestman_bt.records.reader import RecordError, read_result
from bestman_bt.records.writer import RESULT_FILE
from bestman_bt.robot_model.model import GripperModel
from bestman_bt.runtime.executor import Execution, ExecutionWatcher, Executor, TerminationReason
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare
from bestman_bt.runtime.robot_session import RobotSession, open_session
from bestman_bt.runtime.world_file import WORLD_NAME, write_world
from bestman_bt.visualization.rerun.recorder import RECORDING_NAME
from hal.api import Robot
from hal.replay.recorder import RecordedRobot
from hal.replay.robot import ReplayRobot
from hal.replay.tape import TAPE_NAME
from hal.simulation.audit_record import AuditRecord, DisturbanceEvent
from hal.simulation.disturbance_injector import DisturbanceInjector
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot
from hal.simulation.scene_recorder import SceneRecorder
from hal.twins.remote_truth import RemoteTruth

Watcher = Callable[[RobotSession, Tree], Callable[[], None]]
"""Called with the session and its tree before the first tick; returns a function to call after each tick."""


RECORDING_OVER = "recording_over"
"""Failure code of a replay that continues after the end of its recording."""

AFTER_RECORDING = 1.0
"""Seconds after the end of a recording within which a replay may still end normally."""


class _Observers:
    """The outside views of the simulation; created right after connecting. Afterwards no view can be added without
    cost.
    """

    def __init__(
        self,
        disturbed: bool,
        folder: Path | None,
        judge: Path | None,
        prepare_robot: Callable[[Robot], None] | None,
        keeping: RecordingErrors,
    ) -> None:
        self._keeping = keeping
        self._disturbed, self._folder, self._judge, self._prepare_robot = disturbed, folder, judge, prepare_robot
        self.robot: SimulatedRobot | None = None
        self.truth: GroundTruth | None = None
        self.scene: SceneRecorder | None = None
        self.pictures: Pictures | None = None
        self.driven: DrivenPath | None = None
        self.contacts: ContactLog | None = None
        self.began = 0.0
        self.injector: DisturbanceInjector | None = None
        self.disturbances: Disturbances | None = None

    def attach(self, robot: Robot) -> None:
        if self._prepare_robot is not None:
            self._prepare_robot(robot)
        if isinstance(robot, SimulatedRobot):
            self.robot = robot
            self.truth = GroundTruth(robot)
            self.scene = SceneRecorder(robot)
            if self._folder is not None:
                self.pictures = Pictures(robot, self.truth, self._folder, self._keeping)
            if self._disturbed:
                self.injector = DisturbanceInjector(robot)
            robot.close_truth()
        elif self._judge is not None:
            self.truth = RemoteTruth(self._judge)
        if self.truth is not None:
            self.driven = DrivenPath(self.truth)

    def watch_contacts(self, session: RobotSession) -> Callable[[], None]:
        """Record the contacts that skills declare, on the clock of the monitor; return the hook to call after each
        tick.
        """
        now = self.truth.now if isinstance(self.truth, RemoteTruth) else session.robot.clock.now
        skills, hands = session.skills, len(session.setup.robot_model.of(GripperModel))
        self.contacts, self.began = ContactLog(lambda: skills.contacts, now, hands), now()
        return self.contacts.after_tick

    @property
    def script(self) -> tuple[DisturbanceEvent, ...]:
        """The effects of the task's disturbances so far."""
        return self.disturbances.events if self.disturbances is not None else ()

    def audit_record(self) -> AuditRecord | None:
        """Return the record of the world's monitor, or None without one."""
        if self.robot is not None:
            return self.robot.audit_record()
        return self.truth.audit_record() if isinstance(self.truth, RemoteTruth) else None


class _FailedLeaf:
    """Notices which leaf of a tree has failed last."""

    def __init__(self, tree: Tree) -> None:
        self._leaves = {state_code(node.uid, FAILURE): node for node in tree.nodes if not node.children}
        self.node: Node | None = None
        tree.subscribe(self._look)

    def _look(self, changes: StateChanges) -> None:
        self.node = next((self._leaves[code] for code in reversed(changes.codes) if code in self._leaves), self.node)


class _EndsWithRecording(ExecutionWatcher):
    """Cancels an execution where the one that it replays was cancelled, or when it continues after the recording.

    ``last_tick``: seconds until where it was cancelled, None if it was not: nothing is recorded of how it went on.
    ``why``: when, and at which node, it went on after the recording; empty where it did not.
    """

    def __init__(self, executor: Executor, robot: ReplayRobot, last_tick: float | None) -> None:
        self._executor, self._robot = executor, robot
        self._cancelled_at = math.inf if last_tick is None else executor.clock.now() + last_tick
        self.why = ""

    def after_tick(self) -> None:
        if self._executor.clock.now() >= self._cancelled_at:
            self._executor.cancel("the run that is replayed was cancelled here")
            return
        end = self._robot.tape.end
        if self._robot.moment() <= end + AFTER_RECORDING:
            return
        nodes = self._executor.tree.nodes
        running = [node.where or node.path for node in nodes if node.state == RUNNING and not node.children]
        if running:
            self.why = (
                f"the recording is over at {end - self._robot.tape.start:.2f} s, and {', '.join(running)} still ran"
            )
            self._executor.cancel(self.why)


def _last_tick_replayed(config: RunConfig) -> float | None:
    """Return the seconds until the last tick of a replayed, cancelled run; None for any other run.

    In doubt it is a tick too early: a later tick would show motions that were already stopped.
    """
    try:
        result = read_result(Path(config.recording)) if config.recording else {}
    except RecordError:
        return None
    if result.get("outcome") != Outcome.CANCELLED:
        return None
    return float(result["sim_time_s"]) - 1.01 / config.task.tick_rate


def prepare_episode(config: RunConfig, known_faults: Iterable[Problem] = ()) -> ResolvedConfig:
    """Check everything that a judged run needs, without starting anything.

    ``known_faults``: as for ``prepare``. Raises the errors of ``prepare``, and TreeLoadError if the tree reads entries
    that neither it nor the task fills.
    """
    known = [*known_faults, *_missing_extras(config)]
    return prepare(config, all_entries=True, known_faults=known, check=partial(find_judge, known=known))


def _missing_extras(config: RunConfig) -> Iterable[Problem]:
    extra = EXTRA_OF_SIMULATOR.get(config.driver)
    if extra is not None and not is_installed(extra):
        yield Problem("driver", None, "", str(missing_extra("simulation", extra)))
    if config.record and not is_installed("rerun"):
        yield Problem("record", None, "", str(missing_extra("a recording", "rerun")))


class JudgedSession:
    """An open session whose runs are judged, one after the other in the same world; the audit covers all of them."""

    def __init__(self, session: RobotSession, observers: _Observers) -> None:
        self.session, self._observers = session, observers
        self._watch_contacts: Callable[[], None] | None = None

    def run(
        self,
        tree: str | Path | Behaviour | Tree | None = None,
        folder: Path | None = None,
        watch: Watcher | None = None,
        recording: Path | None = None,
        to_the_end: ExitStack | None = None,
        keeping: RecordingErrors | None = None,
    ) -> RunResult:
        """Load a tree, by default that of the task, tick it to its end and judge the outcome.

        ``folder``, ``watch``, ``recording``: as for ``run_episode``; ``result.json`` is not written yet.
        ``to_the_end``: protects the following steps from Ctrl-C. Raises the errors of ``Session.load``, before anything
        moves.
        """
        observers, wall_start, keeping = self._observers, time.perf_counter(), keeping or RecordingErrors()
        setup = self.session.setup_for(tree)
        session = replace(self.session, setup=setup, entries=self.session.entries_of(setup))
        with ExitStack() as stack:
            loaded = session.load(tree)
            pretended = {name: info.known_from for name, info in missing_nodes(loaded).items()}
            judge = None if pretended else find_judge(setup.config)
            durations, failed = Durations(loaded), _FailedLeaf(loaded)
            if observers.truth is not None and self._watch_contacts is None:
                self._watch_contacts = observers.watch_contacts(session)
            driven_before = observers.driven.length if observers.driven is not None else 0.0
            watching = None if watch is None else partial(watch, session, loaded)
            after_tick = self._after_tick(stack, loaded, folder, watching, recording, durations, keeping)
            executor = session.executor(loaded, after_tick)
            recorded: _EndsWithRecording | None = None
            if isinstance(session.robot, ReplayRobot):
                recorded = _EndsWithRecording(executor, session.robot, _last_tick_replayed(setup.config))
                executor.watchers.append(recorded)
            telemetry = stack.enter_context(session.telemetry(executor, folder, keeping))
            stack.enter_context(session.control_channel(executor, telemetry).serving(folder))
            (to_the_end or stack).enter_context(executor.interrupts())
            at_start: Verdict | None = None
            if judge is not None and observers.truth is not None:
                at_start = judge(session, observers.truth, None, 0.0)
            execution = executor.run()
            verdict: Verdict | None = None
            if execution.ending is TerminationReason.CANCELLED:
                session.robot.stop()
                session.robot.clock.sleep(0.5)
            elif judge is not None and observers.truth is not None:
                driven = observers.driven.length - driven_before if observers.driven is not None else 0.0
                verdict = judge(session, observers.truth, session.robot.clock, driven)
            if observers.pictures is not None:
                observers.pictures.take("end", _object(setup))
            record = observers.audit_record()
            audited = _audit(setup, observers, record) if record is not None else None
            wall_time = time.perf_counter() - wall_start
            result = judged_result(session, execution, verdict, audited, wall_time, failed.node)
            result = replace(
                result,
                durations=durations.seconds,
                interventions=telemetry.interventions,
                held_at_start=at_start.holds if at_start is not None else None,
                moved_by_others=moved_by_others(setup, observers.script, record) if record is not None else [],
            )
            result = _pretended(result, pretended)
            if recorded is not None and recorded.why:
                result = replace(
                    result,
                    outcome=Outcome.ERROR,
                    failure=NodeFailure("", RECORDING_OVER, recorded.why),
                    not_judged=result.not_judged
                    if judge is None
                    else "not judged: the recording ended before its tree",
                )
            why = result.failure.why if result.failure is not None else result.not_judged
            telemetry.end(str(result.outcome), result.tree_status, why, execution.sim_time_s)
            if folder is not None:
                world = session.skills.world
                keeping.write(WORLD_NAME, lambda: write_world(folder / WORLD_NAME, setup, world))
        return replace(result, not_kept=dict(keeping.lost))

    def _recorders(
        self, tree: Tree, folder: Path | None, recording: Path | None, keeping: RecordingErrors
    ) -> Iterator[MotionLog | Recording]:
        session, scene = self.session, self._observers.scene
        if scene is None:
            return
        if folder is not None:
            yield MotionLog(folder, scene, keeping=keeping)
            if recording is None and session.setup.config.record:
                recording = folder / RECORDING_NAME
        if recording is not None:
            yield Recording(recording, session, tree, scene, keeping=keeping)

    def _after_tick(
        self,
        stack: ExitStack,
        tree: Tree,
        folder: Path | None,
        watch: Callable[[], Callable[[], None]] | None,
        recording: Path | None,
        durations: Durations,
        keeping: RecordingErrors,
    ) -> Callable[[], None]:
        session, observers = self.session, self._observers
        calls: list[Callable[[], None]] = [durations.after_tick]
        for recorder in self._recorders(tree, folder, recording, keeping):
            recorder.open()
            stack.callback(recorder.close)
            calls.append(recorder.after_tick)
        if self._watch_contacts is not None:
            calls.append(self._watch_contacts)
        if observers.driven is not None and session.setup.config.task.asked("at_goal") is not None:
            calls.append(observers.driven.after_tick)
        if observers.injector is not None and observers.truth is not None:
            observers.disturbances = Disturbances(session, observers.truth, observers.injector)
            calls.append(observers.disturbances.after_tick)
        if observers.pictures is not None:
            calls.append(_picture_of_the_grasp(session, observers.pictures))
        if watch is not None:
            calls.append(watch())

        def after_tick() -> None:
            for call in calls:
                call()

        return after_tick


@contextmanager
def open_judged(
    config: RunConfig | ResolvedConfig,
    folder: Path | None = None,
    pictures: bool = False,
    gui: bool = False,
    twin_judge: Path | None = None,
    prepare_robot: Callable[[Robot], None] | None = None,
    keeping: RecordingErrors | None = None,
) -> Iterator[JudgedSession]:
    """Connect the configured robot for judged runs; arguments and errors are those of ``run_episode``."""
    with naming_python_parameters():
        setup = prepare_episode(config) if isinstance(config, RunConfig) else config
    disturbed = bool(setup.config.task.disturbances)
    keeping = keeping or RecordingErrors()
    observers = _Observers(disturbed, folder if pictures else None, twin_judge, prepare_robot, keeping)
    with ExitStack() as stack:
        recorder = _recorder(stack, setup, folder, keeping)
        yield JudgedSession(stack.enter_context(open_session(setup, observers.attach, gui, recorder)), observers)


def run_episode(
    config: RunConfig | ResolvedConfig,
    folder: Path | None = None,
    pictures: bool = False,
    watch: Watcher | None = None,
    gui: bool = False,
    twin_judge: Path | None = None,
    prepare_robot: Callable[[Robot], None] | None = None,
    recording: Path | None = None,
) -> RunResult:
    """Run a task once and judge it.

    ``folder``: receives ``result.json``, ``transitions.btlog``, ``world.yaml`` (final beliefs) and, if configured,
    ``recording.rrd`` (of a simulated run) and the readings for the driver ``replay``; ``pictures``: also ``start.png``,
    ``grasp.png`` and ``end.png``. ``twin_judge``: the socket of the twins' judge; without it, a robot that is not
    simulated here is not judged. ``prepare_robot``: called right after connecting, the last moment to create a view of
    the ground truth whose reads do not count. ``recording``: file to record a simulated run to. Raises the errors of
    ``prepare_episode``, before anything starts.
    """
    wall_start, keeping = time.perf_counter(), RecordingErrors()
    with ExitStack() as to_the_end:
        with open_judged(config, folder, pictures, gui, twin_judge, prepare_robot, keeping) as judged:
            result = judged.run(None, folder, watch, recording, to_the_end, keeping)
            result = replace(result, wall_time_s=round(time.perf_counter() - wall_start, 3))
        if folder is not None:
            keeping.write(RESULT_FILE, lambda: result.write(folder / RESULT_FILE))
    return replace(result, not_kept=dict(keeping.lost))


def _recorder(
    stack: ExitStack, setup: ResolvedConfig, folder: Path | None, keeping: RecordingErrors
) -> Callable[[Robot], Robot] | None:
    """Return the recorder of all readings and commands for the driver ``replay``, or None if not requested."""
    if folder is None or not setup.config.record:
        return None

    def wrap_robot(robot: Robot) -> Robot:
        recorded = RecordedRobot(robot, folder / TAPE_NAME, partial(keeping.mark_lost, TAPE_NAME))
        stack.callback(recorded.close)
        return recorded

    return wrap_robot


def _picture_of_the_grasp(session: RobotSession, pictures: Pictures) -> Callable[[], None]:
    """Write ``start.png`` now, and ``grasp.png`` when the robot believes that it holds an object."""
    subject = _object(session.setup)
    pictures.take("start", subject)
    taken = False

    def after_tick() -> None:
        nonlocal taken
        if not taken and session.skills.world.hands:
            pictures.take("grasp", subject)
            taken = True

    return after_tick


def moved_by_others(setup: ResolvedConfig, script: Collection[DisturbanceEvent], record: AuditRecord) -> list[str]:
    """Return the subjects of the goal that a disturbance moved and that neither the robot nor an object in contact
    touched.
    """
    moved = {event.name for event in script}
    touched = {name for contact in record.contacts for name in (contact.first, contact.second, contact.articulation)}
    return [name for name in setup.subjects if name in moved - touched]


def _audit(setup: ResolvedConfig, observers: _Observers, record: AuditRecord) -> Audit:
    declared = observers.contacts.declared if observers.contacts is not None else ()
    models = {thing.name: thing.model.name for thing in setup.world.objects}
    return audit(record, setup.config.task.allowed_contacts, observers.script, declared, models, observers.began)


def _object(setup: ResolvedConfig) -> str | None:
    return setup.goals[0].object if setup.goals else None


def judged_result(
    session: RobotSession,
    execution: Execution,
    verdict: Verdict | None,
    audited: Audit | None,
    wall_time: float,
    failed: Node | None = None,
) -> RunResult:
    """Return the result of an execution: by ground truth if the task has goals, else by the tree's status."""
    config = session.setup.config
    failure = _failure(session, execution, verdict, audited, failed)
    holds = verdict.holds if verdict is not None else None
    success = execution.succeeded and holds is not False and failure is None
    outcome = Outcome.SUCCESS if success else Outcome.FAILURE
    if execution.ending is TerminationReason.CANCELLED:
        outcome = Outcome.CANCELLED
    elif execution.ending is TerminationReason.ERROR:
        outcome = Outcome.ERROR
    return RunResult(
        task=config.name,
        seed=config.seed,
        success=success,
        outcome=outcome,
        tree_status=execution.tree_status,
        predicate=holds,
        failure=failure,
        audit=audited.to_document() if audited is not None else {},
        metrics={name: round(value, 4) for name, value in verdict.metrics.items()} if verdict is not None else {},
        sim_time_s=round(execution.sim_time_s, 4),
        wall_time_s=round(wall_time, 3),
        versions=versions(),
        not_judged=_why_not_judged(config, execution) if verdict is None else "",
    )


def _pretended(result: RunResult, types: dict[str, str]) -> RunResult:
    """Return the result of a run whose leaves of these types, if any, were simulated: not a success, regardless of its
    outcome.
    """
    if not types:
        return result
    why = f"leaves without code here were simulated: {', '.join(types)}"
    failure = result.failure or NodeFailure("", "pretended", why)
    outcome = Outcome.FAILURE if result.success else result.outcome
    return replace(
        result, success=False, outcome=outcome, failure=failure, pretended=types, not_judged=f"not judged: {why}"
    )


def _why_not_judged(config: RunConfig, execution: Execution) -> str:
    if not config.task.predicates:
        facts = config.task.asked("facts")
        return NO_GOAL if facts is None else f"not judged: no ground truth shows whether {facts['goal']}"
    if execution.ending is TerminationReason.CANCELLED:
        return "not judged: it was cancelled"
    return "not judged: no ground truth is available here"


def _failure(
    session: RobotSession, execution: Execution, verdict: Verdict | None, audited: Audit | None, failed: Node | None
) -> NodeFailure | None:
    """Return the failure by cheating, else of the responsible leaf, else of the judge or the audit, else None.

    ``failed``: the leaf that failed last.
    """
    if execution.ending is not TerminationReason.FINISHED:
        return NodeFailure("", str(execution.ending), execution.why)
    objections = () if audited is None else audited.objections(session.setup.config.task.max_penetration)
    if audited is not None and not audited.honest:
        missed = "" if verdict is None or verdict.holds else f"; besides, {verdict.why}"
        return NodeFailure("audit", "audit", "; ".join(objections) + missed)
    if not execution.succeeded:
        node_failures: list[NodeFailure] = session.skills.failures
        if node_failures:
            return node_failures[-1]
        if failed is not None:
            why = failed.feedback_message or f"{failed.type_id} failed and gave no reason"
            return NodeFailure(failed.path, "tree_failed", why, failed.where)
        return NodeFailure("", "tree_failed", "the tree failed, though none of its leaves did")
    if verdict is not None and not verdict.holds:
        return NodeFailure("judge", "predicate", verdict.why)
    return NodeFailure("audit", "audit", "; ".join(objections)) if objections else None
