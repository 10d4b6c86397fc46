"""Base classes of skills: coroutine execution, error reporting, cancellation that stops all motion."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeAlias, TypeVar

from behaviours.contacts import Contact
from behaviours.context import SkillContext
from behaviours.failure import MOTION_FAILS, READING_FAILS, SEEING_FAILS, NodeFailure
from behaviours.parts import WORDS, kinds_for_skills
from bestman_bt.control import Motion, MotionStatus
from bestman_bt.control.joint_state import READING_ERRORS
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, Condition, In, Node, NodeError, Out, StatefulAction, SyncAction
from bestman_bt.engine.bounds import Named
from bestman_bt.engine.core.ports import declared_ports
from bestman_bt.engine.own_files import defined_at, raise_missing_name
from bestman_bt.errors import Error, MissingExtraError, WrongResultError
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.messages import Failure, Goals, Pose, Pose2D
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.registry import PREDICATES, suggestion

ObjectName = Annotated[str, Named("object")]
SurfaceName = Annotated[str, Named("surface")]
FurnitureName = Annotated[str, Named("furniture")]
ArticulationName = Annotated[str, Named("articulation")]
ArmName = Annotated[str, Named("arm")]
PostureName = Annotated[str, Named("posture")]


Result = TypeVar("Result")


SkillCoroutine: TypeAlias = Generator[Motion[Any], Any, Result]
"""What ``execute`` and its parts return: it yields the motion, or computation, to wait for and receives its result."""

ALGORITHM_ERRORS = (ManipulationError, PerceptionError, MissingExtraError, WrongResultError, *READING_ERRORS)
"""Errors of algorithms, perception and readings; uncaught ones end the skill with FAILURE and their code."""


_ONE = re.compile(r"\band\b|;")
"""Separator between the facts of one effect."""


class SkillFailure(Error):
    """Raised to end a skill with FAILURE. ``code``: error code for programs. ``failure``: failure of the robot's part
    that caused it, if any.
    """

    def __init__(self, code: str, text: str, failure: Failure | None = None) -> None:
        super().__init__(text)
        self.code = code
        self.failure = failure

    @classmethod
    def of(cls, failure: Failure | None) -> SkillFailure:
        """Return the failure of a skill whose motion failed; without ``failure``, the reason is unknown."""
        failed = failure or Failure("fault", "the controller failed without a reason")
        return cls(str(failed.code), str(failed), failed)


@dataclass(frozen=True)
class Declaration:
    """Preconditions and effects of a skill, in terms of its ports: ``holding({object})``, ``at({goal})``.

    ``pre``: must hold at the start. ``hold``: must hold throughout. ``effects``: hold after success; ``not`` negates.
    ``parameters``: port → type (object, place, container) for leaves that task planners may use; None: only part of
    such abilities. ``cost``: for planners. ``parts``: parts of the robot in use: arm, base; the hand belongs to the
    arm.
    """

    pre: tuple[str, ...] = ()
    hold: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    parameters: Mapping[str, str] | None = None
    cost: float = 1.0
    parts: tuple[str, ...] = ()


class RobotNode(Node):
    """A node that uses the robot of its tree.

    ``REQUIRES``: kinds of parts that it needs; a tree with it is refused on a robot that lacks one. ``USES``: kinds of
    parts that it uses if available.
    """

    REQUIRES: ClassVar[tuple[str, ...]] = ()
    USES: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        """Raise TypeError if ``REQUIRES`` or ``USES`` is not a tuple of kinds of parts."""
        super().__init_subclass__(**options)
        for name in ("REQUIRES", "USES"):
            kinds = getattr(cls, name)
            # The registry, which looks for installed plug-ins, is only asked for kinds without a word of their own.
            if not isinstance(kinds, tuple) or any(
                kind not in WORDS and kind not in kinds_for_skills() for kind in kinds
            ):
                right = f"a tuple of kinds of parts ({', '.join(kinds_for_skills())})"
                raise TypeError(f"{cls.__name__}.{name} should be {right}, got {kinds!r}")

    @property
    def skills(self) -> SkillContext:
        """The robot's controllers, algorithms and beliefs; with several arms those of the default one."""
        return self.robot_skills

    @property
    def robot_skills(self) -> SkillContext:
        """The robot's ``skills``, independent of the node's arm. Raises TypeError without a SkillContext."""
        context = self.context
        if not isinstance(context, SkillContext):
            raise TypeError(f"skills need a SkillContext as the tree's context, not {type(context).__name__}")
        return context

    def skills_of(self, arm: str) -> SkillContext:
        """Return the context of one arm, by name. Raises SkillFailure (``bad_input``) for an unknown arm."""
        try:
            return self.robot_skills.for_arm(arm)
        except KeyError as error:
            raise SkillFailure("bad_input", f"port 'arm': {error.args[0]}") from error


class ArmNode(RobotNode):
    """A node that works with one arm, its hand and the held object; ``skills`` is the context of that ``arm``."""

    arm = In[str](
        ArmName, "which arm, by its name in the robot's file; by default the only one, or its default_arm", default=""
    )

    @property
    def skills(self) -> SkillContext:
        """The context of the arm. Raises SkillFailure (``bad_input``) for an unknown arm."""
        return self.skills_of(self.arm)


class ErrorReporting(RobotNode):
    """Base of skills and conditions whose failures have a code and a message.

    ``FAILS``: the codes, each with advice for the tree in terms of leaves; those of base classes are added.
    """

    FAILS: ClassVar[Mapping[str, str]] = {"bad_input": "invalid value of a port: correct the tree"}

    def __init_subclass__(cls, **options: Any) -> None:
        """Raise TypeError if ``FAILS`` is not a mapping, or ``DECLARATION`` is not a Declaration of existing ports."""
        super().__init_subclass__(**options)
        declared = getattr(cls, "DECLARATION", Declaration())
        if not isinstance(declared, Declaration):
            raise TypeError(f"{cls.__name__}.DECLARATION should be a Declaration, got {declared!r}")
        ports = declared_ports(cls)
        for field in ("pre", "hold", "effects", "parameters"):
            said: Iterable[str] = getattr(declared, field) or ()
            named = said if field == "parameters" else re.findall(r"{(\w+)}", " ".join(said))
            for port in named:
                if port not in ports:
                    what = f"{cls.__name__}.DECLARATION: {field} name the port {port!r}, which the skill does not have"
                    raise TypeError(f"{what}; {suggestion(port, list(ports))}")
        if not isinstance(cls.FAILS, Mapping):
            raise TypeError(f"{cls.__name__}.FAILS should map codes to advice for the tree, got {cls.FAILS!r}")

    error_code = Out(str, "why it failed, for programs; empty if not")
    error_message = Out(str, "why it failed")

    def get_input(self, port: str) -> Any:
        """Return the value of a port. Raises SkillFailure (``bad_input``) for NaN, or a pose too far away."""
        value = super().get_input(port)
        if any(math.isnan(number) for number in _numbers(value)):
            raise SkillFailure("bad_input", f"{port} is {value}; finite numbers are accepted")
        for pose in value if isinstance(value, Goals) else (value,):
            if isinstance(pose, Pose2D) and pose.fault:
                raise SkillFailure("bad_input", f"port '{port}': {pose.fault}")
        return value

    def wrong_input(self, message: str) -> Exception:
        """Return a SkillFailure (``bad_input``) for a value that a port does not accept."""
        return SkillFailure("bad_input", message)

    def explain(self, code: str, why: str, failure: Failure | None = None) -> int:
        """Record why the leaf fails, and the failed part of the robot; returns FAILURE."""
        self.feedback_message = why
        self.error_code = code
        self.error_message = why
        skills = self.robot_skills
        failed = NodeFailure(self.path, code, why, self.where, skills.clock.now())
        if failure is not None:
            failed = replace(failed, part=failure.part, vendor_code=failure.vendor_code, obstacle=skills.met(failure))
        skills.failures.append(failed)
        return FAILURE

    def _mistake(self, method: Callable[..., object], what: str) -> NodeError:
        """Return the error for a method that breaks the interface of its base class, with file and line."""
        return self.error(f"{type(self).__name__}.{method.__name__} {what} (at {defined_at(method)})")

    def explain_error(self, error: Error) -> int:
        """Record an error with the failure that it carries; returns FAILURE."""
        return self.explain(str(error.code), str(error), getattr(error, "failure", None))

    def succeed(self, why: str = "") -> int:
        """Clear the error outputs; returns SUCCESS."""
        self.feedback_message = why
        self.error_code = ""
        self.error_message = ""
        return SUCCESS


class Skill(ErrorReporting, StatefulAction):
    """A skill that takes several ticks: ``execute`` yields the motions to wait for; a halt cancels them and runs the
    ``finally`` clauses.
    """

    FAILS: ClassVar = {
        **MOTION_FAILS,
        **SEEING_FAILS,
        "failed": "an algorithm lacks its input: see the message",
        "missing_extra": "install the package in the message",
        "wrong_result": "your own algorithm violates its interface: correct it at the line in the message",
    }
    DECLARATION: ClassVar[Declaration] = Declaration()

    _steps: SkillCoroutine[None] | None = None
    _pending: Motion[Any] | None = None

    def execute(self) -> SkillCoroutine[None]:
        """Do the work: ``result = yield motion`` waits for a motion. Raise SkillFailure to fail."""
        raise NotImplementedError(f"{type(self).__name__} does not define execute()")

    def compute(self, what: str, work: Any, *arguments: Any, **options: Any) -> Motion[Any]:
        """Submit ``work(*arguments, **options)``; ``what`` names its configured cost."""
        skills = self.skills
        return skills.computation.submit(lambda: work(*arguments, **options), skills.costs[what])

    @contextmanager
    def touching(self, *contacts: Contact) -> Iterator[None]:
        """Declare intended contacts for the duration of the block; all others count as collisions.

        A contact that began within the block may continue after it: a grasped object stays in the hand. Raises
        NodeError for an unknown object, door or drawer, or more than ``MOST_FORCE``.
        """
        skills = self.skills
        known = [*skills.world.models, *skills.world.objects]
        pieces = skills.world.map.furniture.values()
        articulations = [f"{piece.name}/{door.name}" for piece in pieces for door in piece.articulations]
        for contact in contacts:
            if fault := contact.fault(known, articulations):
                raise self._mistake(self.execute, f"declares an invalid contact, {contact.kind}: {fault}")
        declared = [replace(contact, skill=self.path) for contact in contacts]
        skills.contacts += declared
        for contact in declared:
            if contact.kind in ("grasp", "push"):
                skills.handled = contact.thing
        try:
            yield
        finally:
            skills.contacts[:] = [contact for contact in skills.contacts if contact not in declared]

    def on_start(self) -> int:
        """Start ``execute``."""
        self.feedback_message = ""
        steps: object = self.execute()
        if not isinstance(steps, Generator):
            got = f"it has no yield and returned {steps!r:.60}"
            raise self._mistake(self.execute, f"should wait by yield, at least once (yield from ()); {got}")
        self._steps, self._pending = steps, None
        return self._advance(None, None)

    def on_running(self) -> int:
        """Continue once the awaited motion has ended."""
        pending = self._pending
        if pending is None:
            return RUNNING
        try:
            if not pending.done:
                return RUNNING
            value = _outcome(pending)
        except (SkillFailure, *ALGORITHM_ERRORS) as error:
            return self._advance(None, error)
        return self._advance(value, None)

    def on_halted(self) -> None:
        """Stop all motions of this skill."""
        if self._pending is not None:
            self._pending.cancel()
            self._pending = None
        if self._steps is not None:
            self._steps.close()
            self._steps = None

    def cancel(self) -> None:
        """Cancel the awaited motion on behalf of another node; the skill then ends with the failure of that motion."""
        if self._pending is not None:
            self._pending.cancel()

    def _not_awaited(self, steps: SkillCoroutine[None], value: object) -> NodeError:
        """Return the error for a yielded value that is not a Motion, with file and line."""
        inner: Any = steps
        while isinstance(inner.gi_yieldfrom, Generator):
            inner = inner.gi_yieldfrom
        place = f"{inner.gi_code.co_filename}:{inner.gi_frame.f_lineno}"
        what = "a Motion, as controllers and self.compute() return"
        return self.error(f"{type(self).__name__}.execute should yield {what}, got {value!r:.60} (at {place})")

    def _bring_about(self) -> None:
        """Record the declared effects of an ability that have no predicate function; they are believed from then on."""
        effects = "; ".join(filter(_has_no_function, self.DECLARATION.effects))
        if self.DECLARATION.parameters is None or not effects:
            return
        for port in self.DECLARATION.parameters:
            effects = effects.replace(f"{{{port}}}", str(self.get_input(port)))
        self.robot_skills.world.record_effects(effects)

    def _advance(self, value: Any, error: Error | None) -> int:
        steps = self._steps
        assert steps is not None
        while True:
            try:
                pending = steps.send(value) if error is None else steps.throw(error)
            except StopIteration:
                self._steps = self._pending = None
                self._bring_about()
                return self.succeed(self.feedback_message)
            except (SkillFailure, *ALGORITHM_ERRORS) as failure:
                self._steps = self._pending = None
                return self.explain_error(failure)
            if not isinstance(pending, Motion):
                raise self._not_awaited(steps, pending)
            self._pending = pending
            value, error = None, None
            try:
                if not pending.done:
                    return RUNNING
                value = _outcome(pending)
            except (SkillFailure, *ALGORITHM_ERRORS) as failure:
                error = failure


class SkillCondition(ErrorReporting, Condition):
    """A condition leaf: ``check`` returns None if it is true, else ``(code, why)``."""

    FAILS: ClassVar = READING_FAILS

    def check(self) -> tuple[str, str] | None:
        """Return None if the condition is true, else ``(code, why)``; only read beliefs and encoders."""
        raise NotImplementedError(f"{type(self).__name__} does not define check()")

    def on_tick(self) -> int:
        """Return SUCCESS if the condition is true."""
        try:
            refusal = self.check()
        except (SkillFailure, *READING_ERRORS) as error:
            return self.explain_error(error)
        if refusal is None:
            return self.succeed()
        if not isinstance(refusal, tuple) or [type(words) for words in refusal] != [str, str]:
            raise self._mistake(self.check, f"should return None if it is true, else (code, why); got {refusal!r:.60}")
        return self.explain(*refusal)


class InstantSkill(ErrorReporting, SyncAction, ABC):
    """A leaf that finishes within one tick and moves nothing: implement ``act``, which raises SkillFailure to fail."""

    FAILS: ClassVar = READING_FAILS

    @abstractmethod
    def act(self) -> None:
        """Perform the action."""

    def on_tick(self) -> int:
        """Return SUCCESS if ``act`` succeeds."""
        try:
            self.act()
        except (SkillFailure, *READING_ERRORS) as error:
            return self.explain_error(error)
        return self.succeed(self.feedback_message)


def _has_no_function(effect: str) -> bool:
    """Return whether an effect, ``forall p - place: in(p) -> not clean(p)``, says a fact that no function decides."""
    said = [re.split(r"->|:|\bnot\b", one)[-1].strip(" (").partition("(")[0].strip() for one in _ONE.split(effect)]
    return any(
        name not in PREDICATES.names() or getattr(PREDICATES.resolve(name), "holds", None) is None for name in said
    )


def _numbers(value: Any) -> Iterator[float]:
    """Yield the numbers of a value, also in nested lists; none for values without numbers."""
    match value:
        case float():
            yield value
        case Pose():
            yield from (*value.position.tolist(), *value.quaternion.tolist())
        case Pose2D():
            yield from (value.x, value.y, value.theta)
        case list() | tuple():
            for entry in value:
                yield from _numbers(entry)


def _outcome(pending: Motion[Any]) -> Any:
    result = pending.result  # a computation that has failed raises here
    if pending.status is not MotionStatus.SUCCEEDED:
        raise SkillFailure.of(pending.failure)
    return result


_RENAMED = {
    "Explained": "ErrorReporting",
    "OnArm": "ArmNode",
    "OnRobot": "RobotNode",
    "Steps": "SkillCoroutine",
    "StepsTo": "SkillCoroutine",
}

if not TYPE_CHECKING:

    def __getattr__(name):
        """Raise an error with the new name of a class that was renamed."""
        raise_missing_name(__name__, name, _RENAMED)
