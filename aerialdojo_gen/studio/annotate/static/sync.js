// The annotations as this tab knows them. What a person does goes into a queue that a reload of the page survives, is
// sent at once, and stays there until the server says that it is on disk. Nobody's change is overwritten unasked.
import { same } from "./dom.js";

const EMPTY = { name: "", category: "", description: "", node: "", anchor: null };
const RETRY_MS = 1000;
// Answers that say something about the operation; with any other one it stays in the queue.
const VERDICTS = new Set([200, 400, 409, 412, 413, 422]);

const kept = (key) => {
  try {
    const queue = JSON.parse(sessionStorage.getItem(key) ?? "[]");
    return Array.isArray(queue) ? queue.filter((item) => item?.operation) : [];
  } catch {
    return [];
  }
};

export class Sync extends EventTarget {
  /** ask(conflict) shows both sides and resolves to "mine" or "theirs". */
  constructor(scene, who, ask) {
    super();
    this.who = who;
    this.ask = ask;
    this.scene = scene;
    this.key = `aerialdojo-annotate-queue-${scene}`;
    this.client = sessionStorage.getItem("aerialdojo-annotate-client") ?? crypto.getRandomValues(new Uint32Array(3)).join("-");
    sessionStorage.setItem("aerialdojo-annotate-client", this.client);
    this.queue = kept(this.key);
    this.doc = null;
    this.sending = null;
    this.status = "saved";
    /** What a person has typed and is not in the queue yet, in words; the page's to say. */
    this.typing = () => "";
  }

  async start() {
    await this.poll();
    while (!this.doc) {
      await pause();
      await this.poll();
    }
    if (this.queue.length) this.flush();
    const tick = async () => {
      try {
        if (!this.sending && !document.hidden) await this.poll();
      } catch (error) {
        console.warn(error);
      }
      this.timer = setTimeout(tick, 1500);
    };
    this.timer = setTimeout(tick, 1500);
  }

  entry(kind, id) { return this.doc[kind].find((entry) => entry.id === id); }

  // ---- reading ----

  async poll() {
    let response;
    try {
      response = await fetch(`/api/document?client=${this.client}`,
        { headers: this.doc ? { "If-None-Match": `"${this.doc.version}"` } : {} });
    } catch {
      this.say("lost", "the server does not answer; what you do is kept here");
      return;
    }
    if (this.sending) return;
    const body = response.status === 304 ? null : await read(response);
    if (body && (!response.ok || this.strange(body))) {
      this.say("lost", response.ok ? this.strange(body) : body.error);
      return;
    }
    if (this.status === "lost") this.say("saved", "saved");
    if (this.queue.length) this.flush();
    if (!body || this.sending) return;
    if (this.doc?.version === body.version) return;
    const before = this.doc;
    this.take(body);
    if (before) this.others(before);
  }

  /** Why a document is not this page's, in words: another server may have taken the port. */
  strange(doc) {
    if (doc.scene === this.scene) return "";
    return doc.scene ? `another scene is served here, ${doc.scene}` : "something else answers here";
  }

  /** The last changes; none where the server does not answer: what they are asked for is of no weight. */
  async history() {
    try {
      const lines = await (await fetch("/api/history")).json();
      return Array.isArray(lines) ? lines : [];
    } catch {
      return [];
    }
  }

  /** Tell of what others have changed. */
  async others(before) {
    const history = await this.history();
    const lines = [];
    for (const line of history) {
      if (line.after === before.version) break;
      if (line.client !== this.client) lines.push(line);
      if (line.before === before.version) break;
    }
    for (const line of lines.slice(0, 3).reverse()) {
      this.dispatchEvent(new CustomEvent("other", { detail: line.action === "outside" ? "The file was changed outside of this tool."
        : `${line.who}: ${line.what}` }));
    }
  }

  take(doc) {
    this.doc = doc;
    this.dispatchEvent(new Event("document"));
  }

  /** Say how things stand; "saved" is never said while anything is not. */
  say(status, text) {
    if (status === "saved" && this.queue.length) [status, text] = ["busy", "saving…"];
    else if (status === "saved" && this.typing()) [status, text] = ["busy", this.typing()];
    this.status = status;
    this.dispatchEvent(new CustomEvent("status", { detail: { status, text } }));
  }

  // ---- changing ----

  /** Ask for an operation; `base` is the entry as the person saw it when they began. Resolves to {done, doc} or null. */
  request(operation, base = null) {
    return new Promise((resolve) => {
      this.queue.push({ operation, base, resolve });
      this.keep();
      this.flush();
    });
  }

  keep() {
    try {
      sessionStorage.setItem(this.key, JSON.stringify(this.queue.map(({ operation, base }) => ({ operation, base }))));
    } catch (error) {
      console.warn("what is not saved yet would not survive a reload", error);
    }
  }

  flush() {
    this.sending ??= this.work().finally(() => {
      this.sending = null;
      if (this.queue.length) this.flush();
    });
    return this.sending;
  }

  /** Send what is in the queue, until there is nothing in it: whatever happens, an item leaves it only when answered. */
  async work() {
    while (this.queue.length) {
      const item = this.queue[0];
      this.say("busy", "saving…");
      let result;
      try {
        result = await this.attempt(item);
      } catch (error) {
        console.warn(error);
        result = { lost: error.message };
      }
      if (result === "again") continue;
      if (result?.lost) {
        this.say("lost", `not saved: ${result.lost}; trying again`);
        await pause();
        continue;
      }
      this.queue.shift();
      this.keep();
      item.resolve?.(result);
    }
    this.say("saved", "saved");
  }

  async attempt(item) {
    const verdict = item.insist ? "fits" : this.compare(item);
    if (verdict === "done") {
      this.take(this.doc);
      return { done: null, doc: this.doc };
    }
    if (verdict === "conflict") return this.settle(item);
    const answer = await this.post("/api/operations", { operation: item.operation });
    if (answer === null) return { lost: "the server does not answer" };
    const { status, body } = answer;
    if (!VERDICTS.has(status) || body.unread) return { lost: body.error };
    const doc = status === 200 ? body : body.state;
    if (doc && this.strange(doc)) return { lost: this.strange(doc) };
    if (status === 200) {
      this.take(body);
      return { done: body.done, doc: body };
    }
    if (status === 412) {
      item.changes = body.changes;
      item.insist = false;
      this.take(body.state);
      if (this.compare(item) === "fits") {
        const names = [...new Set(body.changes.map((change) => change.who).filter(Boolean))].join(", ") || "another program";
        this.dispatchEvent(new CustomEvent("other", { detail: `Merged with changes by ${names}.` }));
      }
      return "again";
    }
    if (body.state) this.take(body.state);
    else this.take(this.doc);
    this.dispatchEvent(new CustomEvent("refused", { detail: body.error }));
    return null;
  }

  /** Whether an operation fits the annotations as they are now: "fits", "done" or "conflict". */
  compare({ operation, base }) {
    const { do: what, kind, id, fields } = operation;
    if (what === "add") {
      const twin = this.doc[kind].find((entry) => entry.node === fields.node);
      if (!twin) return "fits";
      return Object.entries(fields).every(([key, value]) => same(twin[key], value)) ? "done" : "conflict";
    }
    const now = this.entry(kind, id);
    if (what === "remove") return !now ? "done" : changedKeys(base, now).length ? "conflict" : "fits";
    if (!now) return "conflict";
    const keys = Object.keys(fields);
    if (keys.every((key) => same(now[key], fields[key]))) return "done";
    return base && keys.some((key) => !same(now[key], base[key]) && !same(now[key], fields[key])) ? "conflict" : "fits";
  }

  async settle(item) {
    const { do: what, kind, id, fields } = item.operation;
    const theirs = what === "add" ? this.doc[kind].find((entry) => entry.node === fields.node) : this.entry(kind, id);
    const changes = item.changes ?? await this.history();
    const last = changes.find((line) => line.client !== this.client
      && line.edits.some((edit) => edit.kind === kind && edit.id === (theirs?.id ?? id)));
    const choice = await this.ask({ operation: item.operation, base: item.base, theirs, who: last?.who || "Somebody else",
      time: last?.time });
    if (choice !== "mine") {
      this.take(this.doc);
      return null;
    }
    if (what === "add" || !theirs) {
      item.operation = theirs ? { do: "change", kind, id: theirs.id, fields }
        : { do: "add", kind, fields: { ...pickKnown(kind, item.base), ...fields } };
    }
    item.base = theirs ?? null;
    item.insist = true;
    return "again";
  }

  /** Undo or redo; resolves to the line of the history or null. */
  async turn(which) {
    await this.flush();
    for (let tries = 0; tries < 3; tries++) {
      const answer = await this.post(`/api/${which}`, {});
      if (answer === null) {
        this.say("lost", "the server does not answer");
        return null;
      }
      const { status, body } = answer;
      if (status === 200) {
        this.take(body);
        return body.done;
      }
      if (body.state) this.take(body.state);
      if (status !== 412) {
        const why = status === 409 ? `${body.error}: it is not taken back` : body.error;
        this.dispatchEvent(new CustomEvent("refused", { detail: why }));
        return null;
      }
    }
    return null;
  }

  async post(url, body) {
    try {
      const response = await fetch(url, {
        method: "POST",
        headers: { "Content-Type": "application/json", "If-Match": `"${this.doc.version}"` },
        body: JSON.stringify({ who: this.who(), client: this.client, ...body }),
        keepalive: true,
      });
      return { status: response.status, body: await read(response) };
    } catch {
      return null;
    }
  }
}

const pause = () => new Promise((resolve) => setTimeout(resolve, RETRY_MS));

/** The answer's JSON; of one without, what it says as an error. */
const read = async (response) => {
  const text = await response.text();
  try {
    const body = JSON.parse(text);
    return response.ok ? body : { ...body, error: body?.error ?? `the server answers ${response.status}` };
  } catch (error) {
    if (response.ok) throw error;
    return { unread: true, error: text.length && text.length < 200 && !text.startsWith("<") ? text : `the server answers ${response.status}` };
  }
};

const changedKeys = (base, now) => Object.keys(EMPTY).filter((key) => key in now && base && !same(now[key], base[key]));

const pickKnown = (kind, entry) => {
  const keys = kind === "landmarks" ? ["name", "node"] : ["name", "category", "description", "node", "anchor"];
  return Object.fromEntries(keys.filter((key) => entry?.[key] != null).map((key) => [key, entry[key]]));
};
