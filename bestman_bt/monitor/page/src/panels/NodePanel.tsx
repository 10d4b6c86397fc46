// One node: how it stands and why, its ports with what they read now, its counts, and what one may do to it.

import { useSignal } from "@preact/signals";
import { barred, breakpointAt, force, toggleBreakpoint } from "../actions";
import { Icon, StateShape } from "../Icon";
import { isLive, seek, summary } from "../monitor";
import { seconds, shownText } from "../describe";
import type { Run } from "../run";
import { RunChip } from "../RunChip";
import { FAILURE, kindSign, stateName } from "../states";
import type { Tree, TreeNode } from "../tree";

export function NodePanel({ run }: { run: Run }) {
  const tree = run.tree.value;
  void run.beat.value;
  if (tree === null) return <p class="empty">No tree yet.</p>;
  const node = tree.nodes[run.selected.value];
  return node === undefined ? <Overview run={run} tree={tree} /> : <Chosen key={node.index} run={run} tree={tree} node={node} />;
}

/** What runs now, and what failed last: shown while no node is chosen. */
function Overview({ run, tree }: { run: Run; tree: Tree }) {
  const running = run.runningLeaves();
  // A condition's no is an answer, unless the whole tree has failed by it.
  const counts = (index: number) => tree.nodes[index]?.category !== "condition" || run.shownState(0) === FAILURE;
  const failed = [...run.messages].filter(([index]) => run.shownState(index) === FAILURE && counts(index)).slice(-8).reverse();
  return (
    <div class="node-panel">
      <Ending run={run} tree={tree} />
      <h3>Runs now</h3>
      {running.length === 0 && <p class="hint">Nothing runs at this moment.</p>}
      <ul class="node-list">{running.map((index) => <NodeLink key={index} run={run} node={tree.nodes[index]!} />)}</ul>
      <h3>Failed, and why</h3>
      {failed.length === 0 && <p class="hint">No node stands at failure.</p>}
      <ul class="node-list">
        {failed.map(([index, why]) => <NodeLink key={index} run={run} node={tree.nodes[index]!} why={why} />)}
      </ul>
      <p class="hint">Choose a node in the tree to see its ports, counts and breakpoints.</p>
    </div>
  );
}

/** How a run that is over came out, and why. */
function Ending({ run, tree }: { run: Run; tree: Tree }) {
  const info = summary(run);
  if (info === undefined || isLive(run)) return null;
  const failure = info.outcome === "success" ? undefined : run.lastFailure;
  return (
    <section class="ending" aria-label="How it came out">
      <h3>How it came out</h3>
      <RunChip run={info} />
      {failure !== undefined && (
        <div class="why failed">
          <h4>{failure.code || "Last failure"}, at {seconds(failure.time)}</h4>
          <p>{failure.message}</p>
          <button type="button" class="button" onClick={() => {
            seek(run, failure.time);
            run.show(tree.find(failure.node));
          }}>Show {failure.where || String(failure.node).split("/").at(-1)}</button>
        </div>
      )}
    </section>
  );
}

function NodeLink({ run, node, why }: { run: Run; node: TreeNode; why?: string }) {
  return (
    <li>
      <button type="button" class="node-link" onClick={() => run.show(node.index)}>
        <StateShape state={run.shownState(node.index)} faint={run.isFaint(node.index)} named />
        <span>
          <strong>{node.name}</strong>
          {why !== undefined && <em>{why}</em>}
        </span>
      </button>
    </li>
  );
}

function Chosen({ run, tree, node }: { run: Run; tree: Tree; node: TreeNode }) {
  const state = run.states[node.index]!;
  const failed = run.shownState(node.index) === FAILURE;
  const why = run.messages.get(node.index);
  const numbers = run.statistics.get(node.index);
  const ports = Object.entries(node.ports ?? {});
  return (
    <div class="node-panel">
      <header class="node-head">
        <StateShape state={run.shownState(node.index)} faint={run.isFaint(node.index)} />
        <div>
          <h3 class="node-name">{node.name}</h3>
          <p class="node-kind">{kindSign(node.type, node.category)} {node.type} · {node.category}{node.placeholder && " · its code is not here"}</p>
        </div>
        <span class={`chip chip-${stateName(state).toLowerCase()}`} data-node-state={stateName(state)}>{stateName(state)}</span>
      </header>
      {run.isFaint(node.index) && <p class="hint">It returned {stateName(run.results[node.index]!)} and was reset by its parent.</p>}
      {why !== undefined && (
        <div class={failed ? "why failed" : "why"}>
          <h4>{failed ? "Why it failed" : "It says"}</h4>
          <p>{why}</p>
        </div>
      )}
      <nav class="crumbs" aria-label="Above this node">
        {tree.ancestors(node.index).reverse().map((index) => (
          <button type="button" key={index} onClick={() => run.show(index)}>{tree.nodes[index]!.name}</button>
        ))}
        <span aria-current="true">{node.name}</span>
      </nav>
      <dl class="counts">
        <Count name="Starts" value={numbers?.[0]} />
        <Count name="Successes" value={numbers?.[1]} />
        <Count name="Failures" value={numbers?.[2]} />
        <Count name="Time running" value={numbers === undefined ? undefined : seconds(numbers[3])} />
      </dl>
      <Actions run={run} node={node} />
      {ports.length > 0 && (
        <>
          <h4>Ports</h4>
          <table class="facts">
            <thead><tr><th scope="col">Port</th><th scope="col">Given</th><th scope="col">Value now</th></tr></thead>
            <tbody>
              {ports.map(([name, text]) => (
                <tr key={name}><th scope="row">{name}</th><td><code>{text}</code></td><td>{resolved(run, node, text)}</td></tr>
              ))}
            </tbody>
          </table>
        </>
      )}
      <p class="path-line" title="Path of the node">{node.path}</p>
    </div>
  );
}

function Count({ name, value }: { name: string; value: number | string | undefined }) {
  return <div><dt>{name}</dt><dd>{value ?? "–"}</dd></div>;
}

/** What `{key}` reads at this moment, in the scope of the node or above it. */
function resolved(run: Run, node: TreeNode, text: string): string {
  const key = /^\{(@?[^{}]+)\}$/.exec(text)?.[1];
  if (key === undefined) return "";
  const name = key.replace(/^@/, "");
  const scopes = key.startsWith("@") ? [] : [node.scope ?? ""];
  for (const scope of [...scopes, "", ...Object.keys(run.blackboard)]) {
    const entry = run.blackboard[scope]?.[name];
    if (entry !== undefined) return shownText(entry);
  }
  return "not set";
}

function Actions({ run, node }: { run: Run; node: TreeNode }) {
  const condition = useSignal("");
  const once = useSignal(false);
  const reason = barred(run, "node");
  return (
    <fieldset class="node-actions" disabled={reason !== null} title={reason ?? undefined}>
      <legend>Break and force</legend>
      <div class="buttons">
        {(["before", "after"] as const).map((when) => {
          const set = breakpointAt(run, node, when);
          return (
            <button
              type="button" key={when} class="button" aria-pressed={set !== undefined}
              onClick={() => toggleBreakpoint(run, node, when, condition.value, once.value)}
            >
              <span class="stop-dot" /> Break {when}
            </button>
          );
        })}
      </div>
      <div class="break-options">
        <input
          type="text" aria-label="Condition of the breakpoint" placeholder="only if, e.g. attempts > 1" value={condition.value}
          onInput={(event) => (condition.value = event.currentTarget.value)} spellcheck={false}
        />
        <label><input type="checkbox" checked={once.value} onChange={(event) => (once.value = event.currentTarget.checked)} /> once</label>
      </div>
      {run.breakpoints.value.filter((point) => point.node === node.uid && point.condition).map((point) => (
        <p class="hint" key={point.when}>Breaks {point.when} it if <code>{point.condition}</code></p>
      ))}
      <div class="buttons">
        <button type="button" class="button" onClick={() => force(run, node, "SUCCESS")}><StateShape state={2} /> Succeed once</button>
        <button type="button" class="button" onClick={() => force(run, node, "FAILURE")}><StateShape state={3} /> Fail once</button>
      </div>
      {reason !== null && <p class="hint"><Icon name="halt" /> {reason}.</p>}
    </fieldset>
  );
}
