// The socket to the server: messages checked in both directions, commands with replies, back again within a second.
import { fault } from "./check.js";

const AGAIN_MS = 400;

export class Wire {
  constructor(schema, heard, changed) {
    this.schema = schema;
    this.heard = heard;
    this.changed = changed;
    this.view = null;
    this.waiting = new Map();
    this.number = 0;
    this.farewell = "";
  }

  open(view) {
    this.view = view;
    const socket = new WebSocket(new URL("live", location.href.replace(/^http/, "ws").replace(/[?#].*/, "")));
    this.socket = socket;
    socket.onopen = () => this.send({ kind: "hello", secret: document.querySelector("meta[name=secret]").content, view: this.view });
    socket.onmessage = (event) => this.take(JSON.parse(event.data));
    socket.onclose = () => {
      for (const done of this.waiting.values()) done({ ok: false, text: "the connection is lost" });
      this.waiting.clear();
      this.changed(false, this.farewell);
      if (this.farewell.includes("load it anew")) location.reload();
      else setTimeout(() => this.open(this.view), AGAIN_MS);
    };
  }

  take(message) {
    const found = fault(message, this.schema.server);
    if (found) console.error(`from the server: ${found}`);
    if (message.kind === "reply" || message.kind === "forecast") {
      this.waiting.get(message.id)?.(message);
      this.waiting.delete(message.id);
      return;
    }
    if (message.kind === "bye") this.farewell = message.text;
    if (message.kind === "outline") {
      this.farewell = "";
      this.changed(true, "");
    }
    this.heard(message);
  }

  send(message) {
    const found = fault(message, this.schema.client);
    if (found) console.error(`to the server: ${found}`);
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  look(view) {
    this.view = view;
    this.send(view);
  }

  /** Send a command; its reply {ok, text} comes later. */
  command(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return Promise.resolve({ ok: false, text: "not connected" });
    const id = ++this.number;
    return new Promise((done) => {
      this.waiting.set(id, done);
      this.send({ ...message, id });
    });
  }
}
