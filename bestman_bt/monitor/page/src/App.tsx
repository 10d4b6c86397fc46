// The whole page.

import { Dialogs } from "./Dialogs";
import { Header, Standing } from "./Header";
import { Icon, StateShape } from "./Icon";
import { comparison, current, everConnected, runs, seek, show, shown } from "./monitor";
import { Panels, PhoneTabs } from "./Panels";
import type { Run } from "./run";
import { Timeline } from "./timeline/Timeline";
import { TreePane } from "./TreePane";
import { STATE_NAMES } from "./states";
import { following, pickerOpen, phoneTree } from "./view_options";
import { phone } from "./width";

export function App() {
  const run = current.value;
  return (
    <div class={`page${phone.value ? " phone" : ""}`}>
      <Header />
      <Standing />
      {run === null ? <Welcome /> : <Shown run={run} />}
      <Dialogs />
    </div>
  );
}

function Shown({ run }: { run: Run }) {
  const two = shown.value.length === 2;
  const [a, b] = shown.value;
  const tree = !phone.value || phoneTree.value;
  return (
    <>
      {two && <Parting a={a!} b={b!} />}
      <main class={two ? "main two" : "main"}>
        {tree && (
          <div class="trees">
            {shown.value.map((each, place) => <TreePane key={each.id} run={each} place={place} />)}
            <Legend />
          </div>
        )}
        {(!phone.value || !phoneTree.value) && <Panels key={run.id} run={run} />}
      </main>
      <footer class="bottom">
        {shown.value.map((each) => <Timeline key={each.id} run={each} follow={two ? (each === a ? b! : a!) : null} />)}
        {phone.value && <PhoneTabs />}
      </footer>
    </>
  );
}

function Legend() {
  return (
    <ul class="legend" aria-label="States">
      {STATE_NAMES.map((name, state) => <li key={name}><StateShape state={state} />{name.toLowerCase()}</li>)}
    </ul>
  );
}

/** Where two runs parted. */
function Parting({ a, b }: { a: Run; b: Run }) {
  const found = comparison.value;
  const go = (): void => {
    const parted = found?.parted;
    if (!parted) return;
    following.value = false;
    seek(a, parted.time_a);
    seek(b, parted.time_b);
    a.show(a.tree.value?.find(parted.path) ?? -1);
    b.show(b.tree.value?.find(parted.path_b ?? parted.path) ?? -1);
  };
  return (
    <div class="parting" role="status">
      <Icon name="compare" />
      {found === null && <span>Comparing…</span>}
      {found !== null && found.parted === null && <span>They never parted: {found.words}.</span>}
      {found?.parted && (
        <>
          <span><strong>They parted</strong> {found.parted.words}</span>
          <button type="button" class="button" onClick={go}>Show this moment</button>
        </>
      )}
      <span class="spacer" />
      <button type="button" class="button" onClick={() => show([a.id])}>Only A</button>
      <button type="button" class="button" onClick={() => show([b.id])}>Only B</button>
    </div>
  );
}

function Welcome() {
  return (
    <main class="welcome">
      <img class="mark" src="./icon.svg" alt="" />
      {!everConnected.value && <p>Connecting to the monitor…</p>}
      {everConnected.value && runs.value.length === 0 && (
        <>
          <h1>Nothing runs yet</h1>
          <p>This page shows every executor of this machine as soon as it starts:</p>
          <pre><code>bestman-bt run TREE --monitor</code></pre>
          <p>and finished runs with time travel:</p>
          <pre><code>bestman-bt monitor runs/…</code></pre>
        </>
      )}
      {runs.value.length > 0 && (
        <>
          <h1>{runs.value.length} runs</h1>
          <button type="button" class="button primary" onClick={() => (pickerOpen.value = true)}>Choose one</button>
        </>
      )}
    </main>
  );
}
