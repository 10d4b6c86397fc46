"""An execution of a small tree before a real control channel; says on standard output what befell it. No robot."""

from __future__ import annotations

import json
import os
import sys
import time

from bestman_bt.engine import ManualClock, load_tree
from bestman_bt.records.events import RunEvent
from bestman_bt.runtime.control_channel import ControlChannel
from bestman_bt.runtime.executor import Executor
from bestman_bt.runtime.telemetry import Telemetry

TREE = """<root BTCPP_format="4"><BehaviorTree ID="Errand">
  <Sequence name="errand">
    <Script name="count" code="rounds := 0"/>
    <Fallback name="have_key"><AlwaysFailure name="holds_key"/><Sleep name="get_key" msec="200"/></Fallback>
    <Repeat name="again" num_cycles="-1"><Sequence name="round">
      <Script name="next" code="rounds += 1"/><Sleep name="walk" msec="500"/><Sleep name="rest" msec="500"/>
    </Sequence></Repeat>
  </Sequence>
</BehaviorTree></root>"""
TICK = 0.05


def say(**what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def main() -> None:
    clock = ManualClock()
    tree = load_tree(TREE, clock=clock)
    tree.blackboard.set("object", "cup")
    executor = Executor(tree, clock, period=TICK, after_tick=lambda: time.sleep(TICK))
    run = RunEvent("errand", "Errand", "", "", 1, "", os.getpid(), time.time(), 1 / TICK, "simulated")

    def stop() -> None:
        say(stopped=True)

    with Telemetry(executor, run) as telemetry, ControlChannel(executor, stop, telemetry).serving():
        execution = executor.run()
        telemetry.end_as(execution)
    say(ending=execution.ending.name, object=tree.blackboard.get("object"), ticks=executor.ticks)


main()
