// The blackboard by scope. What changed within the last moments glows; a click on a value sets it.

import { useEffect, useRef } from "preact/hooks";
import { useSignal } from "@preact/signals";
import { barred, setEntry } from "../actions";
import { seconds, shownText } from "../describe";
import { Icon } from "../Icon";
import type { Entry } from "../protocol";
import type { Run } from "../run";

const FRESH = 1.5;

export function BlackboardPanel({ run }: { run: Run }) {
  const filter = useSignal("");
  void run.beat.value;
  const scopes = Object.entries(run.blackboard).sort(([a], [b]) => a.localeCompare(b));
  const words = filter.value.toLowerCase();
  const fits = (key: string, entry: Entry): boolean => `${key} ${entry.text}`.toLowerCase().includes(words);
  return (
    <div class="blackboard">
      <input
        type="text" class="filter" placeholder="Filter entries" aria-label="Filter entries" value={filter.value}
        onInput={(event) => (filter.value = event.currentTarget.value)}
      />
      {scopes.length === 0 && <p class="empty">The blackboard is empty.</p>}
      {scopes.map(([scope, entries]) => {
        const rows = Object.entries(entries).filter(([key, entry]) => fits(key, entry));
        if (rows.length === 0) return null;
        return (
          <details key={scope} open class="scope">
            <summary><Icon name="down" /> <span>{scope === "" ? "root" : scope}</span> <span class="badge">{rows.length}</span></summary>
            <table class="entries">
              <colgroup><col class="column-key" /><col /><col class="column-when" /></colgroup>
              <thead class="unseen"><tr><th scope="col">Key</th><th scope="col">Value</th><th scope="col">Changed at</th></tr></thead>
              <tbody>{rows.map(([key, entry]) => <Row key={key} run={run} scope={scope} name={key} entry={entry} />)}</tbody>
            </table>
          </details>
        );
      })}
    </div>
  );
}

function Row({ run, scope, name, entry }: { run: Run; scope: string; name: string; entry: Entry }) {
  const editing = useSignal(false);
  const age = entry.changed_at === undefined ? Infinity : run.time - entry.changed_at;
  const reason = barred(run, "process");
  return (
    <tr class={age >= 0 && age < FRESH ? "fresh" : undefined} data-key={name}>
      <th scope="row"><span class="key">{name}</span><span class="entry-type">{entry.type}</span></th>
      <td class="value">
        {editing.value ? (
          <Editor name={name} text={entry.text} set={(value) => setEntry(run, scope, name, value)} leave={() => (editing.value = false)} />
        ) : (
          <button
            type="button" class="value-button" disabled={reason !== null} title={reason ?? "Set this entry"}
            aria-label={`${name}: ${shownText(entry)}${reason === null ? "; set this entry" : ""}`} onClick={() => (editing.value = true)}
          >
            <span class={entry.text === "" ? "nothing" : undefined}>{shownText(entry)}</span>
            {reason === null && <Icon name="edit" />}
          </button>
        )}
      </td>
      <td class="numbers when">{entry.changed_at === undefined ? "" : seconds(entry.changed_at)}</td>
    </tr>
  );
}

/** Stays open while the executor refuses what was written. */
function Editor({ name, text, set, leave }: { name: string; text: string; set: (value: string) => Promise<boolean>; leave: () => void }) {
  const value = useSignal(text);
  const input = useRef<HTMLInputElement>(null);
  useEffect(() => input.current!.select(), []);
  const send = async (): Promise<void> => {
    if (await set(value.value)) leave();
  };
  return (
    <form class="set-form" onSubmit={(event) => {
      event.preventDefault();
      void send();
    }}>
      <input
        type="text" ref={input} aria-label={`New value of ${name}`} value={value.value} spellcheck={false}
        onInput={(event) => (value.value = event.currentTarget.value)}
        onKeyDown={(event) => { if (event.key === "Escape") leave(); }}
      />
      <button type="submit" class="button primary">Set</button>
      <button type="button" class="button" aria-label="Leave it" onClick={leave}><Icon name="close" /></button>
    </form>
  );
}
