// The WebSocket: reconnects by itself, and pairs each control with the server's answer.

import type { Control, Request, ServerMessage } from "./protocol";

const FIRST_WAIT = 250;
const LONGEST_WAIT = 4000;
const ANSWER_WAIT = 10_000;

interface Pending {
  resolve: () => void;
  reject: (error: Error) => void;
  timer: number;
}

export class Connection {
  private socket: WebSocket | null = null;
  private wait = FIRST_WAIT;
  private asked = 0;
  private readonly pending = new Map<number, Pending>();

  constructor(
    private readonly receive: (message: ServerMessage) => void,
    private readonly changed: (open: boolean) => void,
  ) {}

  connect(): void {
    const address = new URL("ws", document.baseURI);
    address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    this.socket = socket;
    socket.onopen = () => {
      this.wait = FIRST_WAIT;
      this.changed(true);
    };
    socket.onmessage = (event: MessageEvent<string>) => {
      const message = JSON.parse(event.data) as ServerMessage;
      if (message.type === "answer") this.settle(message.for ?? 0, message.ok ? null : (message.error ?? "refused"));
      else this.receive(message);
    };
    socket.onclose = () => {
      for (const n of [...this.pending.keys()]) this.settle(n, "the monitor went away before it answered");
      this.changed(false);
      window.setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(LONGEST_WAIT, this.wait * 2);
    };
  }

  send(request: Request): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }

  /** Resolves when the executor has done it, rejects with its words when it refused. */
  control(id: string, control: Control): Promise<void> {
    if (this.socket?.readyState !== WebSocket.OPEN) return Promise.reject(new Error("the monitor is not connected"));
    const n = ++this.asked;
    return new Promise((resolve, reject) => {
      const timer = window.setTimeout(() => this.settle(n, "no answer within 10 s"), ANSWER_WAIT);
      this.pending.set(n, { resolve, reject, timer });
      this.send({ ...control, id, n });
    });
  }

  private settle(n: number, error: string | null): void {
    const pending = this.pending.get(n);
    if (pending === undefined) return;
    this.pending.delete(n);
    window.clearTimeout(pending.timer);
    if (error === null) pending.resolve();
    else pending.reject(new Error(error));
  }
}
