// Node, blackboard, robot and log: tabs where there is room for one, side by side on wide screens.

import { computed } from "@preact/signals";
import { shown } from "./monitor";
import type { Run } from "./run";
import { BlackboardPanel } from "./panels/BlackboardPanel";
import { LogPanel } from "./panels/LogPanel";
import { NodePanel } from "./panels/NodePanel";
import { RobotPanel } from "./panels/RobotPanel";
import { openPanel, panel, PANELS, phoneTree, type Panel } from "./view_options";
import { columns } from "./width";

const BODIES: Record<Panel, (props: { run: Run }) => preact.JSX.Element> = {
  node: NodePanel, blackboard: BlackboardPanel, robot: RobotPanel, log: LogPanel,
};

/** Which panels share a column. */
const SHARED: Record<number, Panel[][]> = {
  1: [["node", "blackboard", "robot", "log"]],
  2: [["node", "log"], ["blackboard", "robot"]],
  3: [["node"], ["blackboard", "log"], ["robot"]],
};

/** Beside two trees there is room for one column. */
const wide = computed(() => (shown.value.length > 1 ? 1 : columns.value));

/** Which of two runs the panels speak of. */
function letter(run: Run): "A" | "B" | null {
  if (shown.value.length < 2) return null;
  return shown.value[0] === run ? "A" : "B";
}

export function Panels({ run }: { run: Run }) {
  const shared = SHARED[wide.value]!;
  return (
    <aside class={`panels columns-${shared.length}`} aria-label={letter(run) === null ? "Details" : `Details of run ${letter(run)}`}>
      {shared.map((panels) => <Column key={panels.join()} run={run} panels={panels} />)}
    </aside>
  );
}

function Column({ run, panels }: { run: Run; panels: Panel[] }) {
  if (wide.value > 1) {
    return (
      <div class="column">
        {panels.map((id) => {
          const Body = BODIES[id];
          return (
            <section key={id} class={`panel panel-${id}`} aria-labelledby={`head-${id}`} tabIndex={-1}>
              <h2 id={`head-${id}`}>{PANELS.find((candidate) => candidate.id === id)!.title}</h2>
              <div class="panel-body"><Body run={run} /></div>
            </section>
          );
        })}
      </div>
    );
  }
  const Body = BODIES[panel.value];
  const next = (way: number): void => {
    const at = panels.indexOf(panel.value);
    const id = panels[(at + way + panels.length) % panels.length]!;
    openPanel(id);
    document.getElementById(`tab-${id}`)?.focus();
  };
  return (
    <div class="column">
      <div class="tabs" role="tablist" aria-label="Details">
        {letter(run) !== null && <span class="letter" role="presentation">{letter(run)}</span>}
        {panels.map((id) => {
          const chosen = panel.value === id;
          return (
            <button
              type="button" key={id} role="tab" id={`tab-${id}`} aria-selected={chosen} aria-controls={chosen ? "tab-body" : undefined} tabIndex={chosen ? 0 : -1}
              onClick={() => openPanel(id)}
              onKeyDown={(event) => {
                if (event.key === "ArrowRight") next(1);
                else if (event.key === "ArrowLeft") next(-1);
                else return;
                event.stopPropagation();
              }}
            >
              {PANELS.find((candidate) => candidate.id === id)!.title}
            </button>
          );
        })}
      </div>
      <section class={`panel panel-${panel.value}`} id="tab-body" role="tabpanel" aria-labelledby={`tab-${panel.value}`} tabIndex={0}>
        <div class="panel-body"><Body run={run} /></div>
      </section>
    </div>
  );
}

/** On a phone: the tree or one of the panels. */
export function PhoneTabs() {
  return (
    <nav class="phone-tabs" aria-label="Parts of the page">
      <button type="button" aria-pressed={phoneTree.value} onClick={() => (phoneTree.value = true)}>Tree</button>
      {PANELS.map(({ id, title }) => (
        <button type="button" key={id} aria-pressed={!phoneTree.value && panel.value === id} onClick={() => openPanel(id)}>{title}</button>
      ))}
    </nav>
  );
}
