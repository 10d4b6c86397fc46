// A small behavior tree in JavaScript: enough to make a run whose states are those of the real engine.

export const IDLE = 0;
export const RUNNING = 1;
export const SUCCESS = 2;
export const FAILURE = 3;

/** Builders: `leaf(name, type, ports, ticks, results)`; a leaf runs for `ticks` ticks, then returns the next of `results`. */
export const leaf = (type, { name = type, ports = {}, ticks = 1, results = [SUCCESS], why = null, category = "action", then = null } = {}) =>
  ({ type, name, ports, ticks, results, why, category, then, children: [] });
export const condition = (type, options = {}) => leaf(type, { ticks: 0, category: "condition", ...options });
const composite = (type, category) => (name, children, ports = {}) => ({ type, name, ports, category, children });
export const sequence = composite("Sequence", "control");
export const fallback = composite("Fallback", "control");
export const reactive = composite("ReactiveSequence", "control");
export const subtree = (id, name, child, ports = {}) => ({ type: id, name, ports, category: "subtree", children: [child] });
export const retry = (name, attempts, child) =>
  ({ type: "RetryUntilSuccessful", name, ports: { num_attempts: String(attempts) }, category: "decorator", attempts, children: [child] });
export const succeed = (name, child) => ({ type: "ForceSuccess", name, ports: {}, category: "decorator", children: [child] });

/** The nodes in pre-order, with uids from 1, as the server tells them; each plan node learns its uid. */
export function numbered(root) {
  const records = [];
  const visit = (node, parent, path, scope) => {
    node.uid = records.length + 1;
    const mine = path === "" ? node.name : `${path}/${node.name}`;
    records.push({ uid: node.uid, parent, name: node.name, type: node.type, category: node.category, path: mine, ports: node.ports, scope });
    const inside = node.category === "subtree" ? mine : scope;
    node.children.forEach((child) => visit(child, node.uid, mine, inside));
  };
  visit(root, null, "", "");
  return records;
}

export class TickedTree {
  constructor(root) {
    this.root = root;
    this.records = numbered(root);
    const size = this.records.length + 1;
    this.states = new Array(size).fill(IDLE);
    this.results = new Array(size).fill(0);
    this.statistics = this.states.map(() => [0, 0, 0, 0]);
    this.messages = {};
    this.progress = new Map();
    this.returned = new Map();
    this.forced = new Map();
    this.hook = () => {};
  }

  /** One tick; the uids that changed. */
  tick() {
    this.changed = new Set();
    const result = this.#run(this.root);
    if (result !== RUNNING) this.#reset(this.root);
    return { result, changed: [...this.changed] };
  }

  #set(uid, state) {
    if (this.states[uid] === state) return;
    if (state === RUNNING) {
      this.results[uid] = 0;
      this.statistics[uid][0]++;
    }
    if (state === SUCCESS || state === FAILURE) {
      this.results[uid] = state;
      if (this.states[uid] !== RUNNING) this.statistics[uid][0]++;
      this.statistics[uid][state === SUCCESS ? 1 : 2]++;
    }
    this.states[uid] = state;
    this.changed.add(uid);
  }

  #reset(node) {
    this.#set(node.uid, IDLE);
    this.progress.delete(node.uid);
    node.children.forEach((child) => this.#reset(child));
  }

  #run(node) {
    const forced = this.forced.get(node.uid);
    this.forced.delete(node.uid);
    const result = forced ?? this.#logic(node);
    if (result !== FAILURE) delete this.messages[node.uid];
    this.#set(node.uid, result);
    return result;
  }

  #logic(node) {
    const at = this.progress.get(node.uid) ?? 0;
    if (node.children.length === 0) {
      if (at < node.ticks) {
        this.progress.set(node.uid, at + 1);
        this.hook(node, at);
        return RUNNING;
      }
      this.progress.delete(node.uid);
      const times = this.returned.get(node.uid) ?? 0;
      this.returned.set(node.uid, times + 1);
      const result = node.results[times % node.results.length];
      if (result === FAILURE) this.messages[node.uid] = node.why ?? "it did not work";
      this.hook(node, -1, result);
      return result;
    }
    this.#set(node.uid, RUNNING);
    if (node.type === "RetryUntilSuccessful") {
      const result = this.#run(node.children[0]);
      if (result === RUNNING) return RUNNING;
      this.#reset(node.children[0]);
      if (result === SUCCESS) return SUCCESS;
      this.progress.set(node.uid, at + 1);
      if (at + 1 < node.attempts) return RUNNING;
      this.progress.delete(node.uid);
      return FAILURE;
    }
    if (node.type === "ForceSuccess") return this.#run(node.children[0]) === RUNNING ? RUNNING : SUCCESS;
    if (node.type === "Parallel") {
      const open = node.children.filter((child) => ![SUCCESS, FAILURE].includes(this.states[child.uid]));
      const going = open.map((child) => this.#run(child)).filter((result) => result === RUNNING);
      if (going.length > 0) return RUNNING;
      node.children.forEach((child) => this.#reset(child));
      return SUCCESS;
    }
    const wanted = node.type === "Fallback" ? FAILURE : SUCCESS;
    for (let i = node.type === "ReactiveSequence" ? 0 : at; i < node.children.length; i++) {
      const result = this.#run(node.children[i]);
      this.progress.set(node.uid, i);
      if (result === wanted) continue;
      if (result !== RUNNING) this.progress.delete(node.uid);
      if (result !== RUNNING) node.children.forEach((child) => this.#reset(child));
      return result;
    }
    this.progress.delete(node.uid);
    node.children.forEach((child) => this.#reset(child));
    return wanted;
  }
}
