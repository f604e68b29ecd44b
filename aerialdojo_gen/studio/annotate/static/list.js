// The list on the left: landmarks and objects, what is unfinished, and how far all of it is.
import { byId, h } from "./dom.js";

export const unfinished = (entry) => entry.lacks.length > 0;

/** Whether the sampler chooses the anchor: it takes the best candidate where no person has chosen one. */
const sampled = (entry) => entry.anchor === null;

const FILTERS = {
  all: () => true,
  unfinished,
  text: (entry) => ["name", "category"].some((key) => entry.lacks.includes(key)),
  check: (entry) => entry.faults.length > 0,
  anchor: sampled,
};

const WORDS = { name: "name", category: "category", check: "check", person: "a person" };

export class List {
  constructor(select) {
    this.select = select;
    this.shown = [];
    for (const id of ["filter", "find"]) byId(id).addEventListener("input", () => this.render(this.doc, this.current));
  }

  render(doc, current) {
    this.doc = doc;
    this.current = current;
    const wanted = FILTERS[byId("filter").value], words = byId("find").value.trim().toLowerCase();
    const found = (entry) => !words || `${entry.id} ${entry.name} ${entry.node}`.toLowerCase().includes(words);
    const landmarks = byId("filter").value === "all" ? doc.landmarks.filter(found) : [];
    const objects = doc.objects.filter((entry) => found(entry) && wanted(entry));
    this.shown = [...landmarks.map((e) => ["landmarks", e.id]), ...objects.map((e) => ["objects", e.id])];
    const focused = document.activeElement?.closest?.("nav li")?.dataset.key;
    this.fill("landmarks", landmarks, doc.landmarks.length ? "none of these" : "none yet: pick a thing, press L");
    this.fill("objects", objects, doc.objects.length ? "none of these" : "none yet: pick a thing, press O");
    if (focused) document.querySelector(`nav li[data-key="${focused}"] button`)?.focus({ preventScroll: true });
    byId("n-landmarks").textContent = doc.landmarks.length;
    byId("n-objects").textContent = objects.length === doc.objects.length ? doc.objects.length : `${objects.length} of ${doc.objects.length}`;
    byId("general").textContent = doc.objects.length + doc.landmarks.length ? doc.faults.join(" ") : "";
    this.progress(doc);
  }

  fill(kind, entries, none) {
    const items = entries.map((entry) => {
      const current = this.current?.kind === kind && this.current.id === entry.id;
      const lacks = kind === "objects" ? entry.lacks : [];
      const wrong = entry.faults.some((fault) => !lacks.includes(fault.field));
      const state = wrong ? "wrong" : lacks.length ? "" : "done";
      const where = entry.landmark ? `${entry.direction} of the ${entry.landmark}` : "";
      const more = lacks.length ? `lacks ${lacks.map((key) => WORDS[key]).join(", ")}`.replace(/lacks check$/, "see the warning")
        .replace(", check", "; see the warning") : where;
      const whole = [entry.name || "no name yet", more, kind === "objects" && sampled(entry) ? "anchor chosen by the sampler" : "", entry.node];
      return h("li", { "data-key": `${kind}-${entry.id}` },
        h("button", { "aria-current": current ? "true" : null, onclick: () => this.select({ kind, id: entry.id }), title: whole.filter(Boolean).join("\n") },
          h("span", { class: `dot ${state}`, role: "img", "aria-label": wrong ? "warning" : state || "unfinished" }),
          h("span", { class: "id" }, String(entry.id)),
          h("span", { class: entry.name ? "name" : "name none" }, entry.name || "no name yet"),
          more ? h("span", { class: "more" }, more) : null));
    });
    byId(kind).replaceChildren(...(items.length ? items : [h("li", { class: "empty" }, none)]));
  }

  progress({ objects }) {
    const done = objects.filter((entry) => !unfinished(entry)).length;
    byId("progress").max = Math.max(1, objects.length);
    byId("progress").value = done;
    const lacking = (key) => objects.filter((entry) => entry.lacks.includes(key)).length;
    const parts = [["name", "lack", "a name"], ["check", "have", "a warning"]]
      .map(([key, verb, what]) => [lacking(key), verb, what]).filter(([n]) => n)
      .map(([n, verb, what]) => `${n} ${n === 1 ? { lack: "lacks", have: "has" }[verb] : verb} ${what}`);
    const left = objects.filter(sampled).length;
    if (left) parts.push(left === objects.length ? "anchors chosen by the sampler" : `${left} ${left === 1 ? "anchor" : "anchors"} chosen by the sampler`);
    byId("progress-text").textContent = [`${done} of ${objects.length} objects done`, ...parts].join(" · ");
    byId("progress-text").title = byId("progress-text").textContent;
  }

  /** The entry after (or before) the current one in the list as it is shown. */
  step(by) {
    if (!this.shown.length) return;
    const at = this.shown.findIndex(([kind, id]) => this.current?.kind === kind && this.current.id === id);
    const next = at < 0 ? (by > 0 ? 0 : this.shown.length - 1) : (at + by + this.shown.length) % this.shown.length;
    this.select({ kind: this.shown[next][0], id: this.shown[next][1] });
  }

  /** The next unfinished object after the current one, around the end; where all are done, the next whose anchor nobody has chosen. */
  nextUnfinished() {
    const objects = this.doc.objects;
    const at = this.current?.kind === "objects" ? objects.findIndex((entry) => entry.id === this.current.id) : -1;
    const order = [...objects.slice(at + 1), ...objects.slice(0, at + 1)];
    const other = (entry) => entry.id !== (this.current?.kind === "objects" ? this.current.id : null);
    return order.find((entry) => unfinished(entry) && other(entry)) ?? order.find(unfinished)
      ?? order.find((entry) => sampled(entry) && other(entry)) ?? order.find(sampled) ?? null;
  }

  reveal() {
    document.querySelector('nav li button[aria-current="true"]')?.scrollIntoView({ block: "nearest" });
  }
}
