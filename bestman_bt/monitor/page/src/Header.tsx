// Which run one looks at, how it stands, and the controls. The emergency stop is always here.

import { barred, declineMotion, emergencyStop, halt, pauseOrResume, setSpeed, SPEEDS, startMotion, step } from "./actions";
import { seconds } from "./describe";
import { Icon } from "./Icon";
import { connected, current, everConnected, runs, summary } from "./monitor";
import type { Run } from "./run";
import { RunChip } from "./RunChip";
import { isDark, turnTheme } from "./theme";
import { helpOpen, pickerOpen } from "./view_options";

export function Header() {
  const run = current.value;
  return (
    <header class="top">
      <button type="button" class="run-button" aria-haspopup="dialog" onClick={() => (pickerOpen.value = true)}>
        <img class="mark" src="./icon.svg" alt="" />
        {run === null ? <span class="run-title">{runs.value.length === 0 ? "No runs yet" : "Choose a run"}</span> : <Title run={run} />}
        <Icon name="down" />
      </button>
      {run !== null && <Facts run={run} />}
      <span class="spacer" />
      {!connected.value && <span class="offline" role="alert">{everConnected.value ? "Connection lost; trying again…" : "Connecting…"}</span>}
      {run !== null && <Controls run={run} />}
      <div class="group page-tools">
        <button type="button" class="tool" aria-label={isDark.value ? "Light theme (T)" : "Dark theme (T)"} title="Theme (T)" onClick={turnTheme}>
          <Icon name={isDark.value ? "sun" : "moon"} />
        </button>
        <button type="button" class="tool" aria-label="Keys (?)" title="Keys (?)" onClick={() => (helpOpen.value = true)}><Icon name="help" /></button>
      </div>
      {run !== null && <Stop run={run} />}
    </header>
  );
}

function Title({ run }: { run: Run }) {
  const info = summary(run);
  return <h1 class="run-title">{info?.task ?? info?.tree ?? run.id}</h1>;
}

function Facts({ run }: { run: Run }) {
  const info = summary(run);
  void run.beat.value;
  if (info === undefined) return <span class="chip chip-failure">gone</span>;
  return (
    <div class="run-facts">
      <RunChip run={info} />
      {info.robot && <span class="fact">{info.robot}</span>}
      {info.source && <span class="fact">{info.source}</span>}
      {info.scene && <span class="fact">{info.scene}</span>}
      {!info.source && info.seed !== null && info.seed !== undefined && <span class="fact">seed {info.seed}</span>}
      <span class="fact numbers" data-testid="clock">{seconds(run.time)}</span>
      {info.kind === "live" && !info.source?.startsWith("groot2") && <span class="fact numbers" data-testid="tick">tick {run.tick}</span>}
    </div>
  );
}

function Controls({ run }: { run: Run }) {
  const reason = barred(run, "ticks");
  const paused = run.paused.value !== null;
  const off = reason !== null;
  const fixed = barred(run, "process");
  return (
    <div class="group controls" role="toolbar" aria-label="Controls of the execution" title={reason ?? undefined}>
      <button type="button" class="button" disabled={off} title={paused ? "Resume (Space)" : "Pause (Space)"} aria-label={paused ? "Resume" : "Pause"} aria-keyshortcuts="Space" onClick={() => pauseOrResume(run)}>
        <Icon name={paused ? "play" : "pause"} /><span>{paused ? "Resume" : "Pause"}</span>
      </button>
      <button type="button" class="button" disabled={off} title="One tick (N)" aria-label="Step one tick" aria-keyshortcuts="N" onClick={() => step(run)}>
        <Icon name="step" /><span>Step</span>
      </button>
      <button type="button" class="button" disabled={fixed !== null} title={fixed ?? "Halt the run (Shift H)"} aria-label="Halt the run" aria-keyshortcuts="Shift+H" onClick={() => halt(run)}>
        <Icon name="halt" /><span>Halt</span>
      </button>
      <Speed run={run} off={fixed !== null} />
    </div>
  );
}

function Speed({ run, off }: { run: Run; off: boolean }) {
  void run.beat.value;
  const share = run.robot.speed;
  if (share === undefined) return null;
  const shares = SPEEDS.includes(share) ? SPEEDS : [...SPEEDS, share].sort((a, b) => a - b);
  return (
    <select
      class="button speed" disabled={off} aria-label="Speed of the robot" title="Speed of the robot, also of motions under way"
      value={String(share)} onChange={(event) => setSpeed(run, Number(event.currentTarget.value))}
    >
      {shares.map((one) => <option key={one} value={String(one)}>{Math.round(100 * one)}% speed</option>)}
    </select>
  );
}

function Stop({ run }: { run: Run }) {
  const reason = barred(run, "process");
  return (
    <button
      type="button" class="emergency" disabled={reason !== null} title={reason ?? "Emergency stop (Shift X): the robot stops at once"}
      aria-label="Emergency stop" aria-keyshortcuts="Shift+X" onClick={() => emergencyStop(run)}
    >
      <Icon name="stop" /><span>STOP</span>
    </button>
  );
}

/** A line under the header while the execution stands still, with the reason. */
export function Standing() {
  const run = current.value;
  const paused = run?.paused.value ?? null;
  const tree = run?.tree.value;
  if (run === null || paused === null || !tree) return <div class="standing" role="status" hidden />;
  if (paused.reason === "confirm") {
    const off = barred(run, "process") !== null;
    return (
      <div class="standing" role="status">
        <Icon name="pause" />
        <span>A motion waits for you. {paused.words}</span>
        <span class="spacer" />
        <button type="button" class="button primary" disabled={off} onClick={() => startMotion(run)}>Start it</button>
        <button type="button" class="button" disabled={off} onClick={() => declineMotion(run)}>Decline it</button>
      </div>
    );
  }
  const index = paused.reason === "breakpoint" ? tree.find(paused.node) : -1;
  const node = tree.nodes[index];
  return (
    <div class="standing" role="status">
      <Icon name="pause" />
      {node === undefined ? <span>Paused. The robot stands still until you resume.</span> : (
        <span>
          Stopped {paused.when ?? "before"} <button type="button" class="link" onClick={() => run.show(index)}>{node.name}</button>, at a breakpoint.
        </span>
      )}
    </div>
  );
}
