// The blackboard by scope. What changed within the last moments glows; a click on a value sets it.

import { useSignal } from "@preact/signals";
import { barred, setEntry } from "../actions";
import { seconds } from "../describe";
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
  const editing = useSignal<string | null>(null);
  const age = entry.changed_at === undefined ? Infinity : run.time - entry.changed_at;
  const reason = barred(run);
  const send = async (): Promise<void> => {
    if (editing.value !== null && (await setEntry(run, scope, name, editing.value))) editing.value = null;
  };
  return (
    <tr class={age >= 0 && age < FRESH ? "fresh" : undefined} data-key={name}>
      <th scope="row"><span class="key">{name}</span><span class="entry-type">{entry.type}</span></th>
      <td class="value">
        {editing.value === null ? (
          <button
            type="button" class="value-button" disabled={reason !== null} title={reason ?? "Set this entry"}
            aria-label={`${name}: ${entry.text}${reason === null ? "; set this entry" : ""}`} onClick={() => (editing.value = entry.text)}
          >
            <span>{entry.text}</span>
            {reason === null && <Icon name="edit" />}
          </button>
        ) : (
          <form class="set-form" onSubmit={(event) => {
            event.preventDefault();
            void send();
          }}>
            <input
              type="text" aria-label={`New value of ${name}`} value={editing.value} spellcheck={false}
              ref={(input) => { if (input !== null && document.activeElement !== input && input.dataset["met"] === undefined) { input.dataset["met"] = "1"; input.select(); } }}
              onInput={(event) => (editing.value = event.currentTarget.value)}
              onKeyDown={(event) => { if (event.key === "Escape") editing.value = null; }}
            />
            <button type="submit" class="button primary">Set</button>
            <button type="button" class="button" aria-label="Leave it" onClick={() => (editing.value = null)}><Icon name="close" /></button>
          </form>
        )}
      </td>
      <td class="numbers when">{entry.changed_at === undefined ? "" : seconds(entry.changed_at)}</td>
    </tr>
  );
}
