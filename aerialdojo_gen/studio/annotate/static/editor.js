// The panel on the right: what is picked, or the fields of an entry, with warnings while somebody types.
import { AnchorChooser } from "./anchors.js";
import { byId, h, same } from "./dom.js";

const CHECK_MS = 250, SAVE_MS = 800;
const MOST = { name: 120, category: 120, description: 2000 };

export class Editor {
  constructor(page) {
    this.page = page;
    this.panel = byId("panel");
    // Texts that are too long to be saved, by entry and field: they stay until somebody shortens them.
    this.drafts = new Map();
    page.sync.typing = () => this.typing();
    window.addEventListener("pagehide", () => this.saveAll());
  }

  /** Show a selection: null, {node: facts} or {kind, id}. */
  show(selection) {
    this.saveAll();
    this.fields = {};
    this.anchors?.close();
    this.anchors = null;
    this.selection = selection;
    if (!selection) this.welcome();
    else if (selection.node) this.picked(selection.node);
    else this.form();
    this.panel.scrollTop = 0;
  }

  get entry() {
    const { kind, id } = this.selection ?? {};
    return kind ? this.page.sync.entry(kind, id) : null;
  }

  welcome() {
    this.panel.replaceChildren(
      h("div", { class: "head" }, h("h2", {}, "Nothing selected")),
      h("p", { class: "hint" }, "Click a thing in the scene, then press ", h("kbd", {}, "O"), " to make it an object that is to be found, or ",
        h("kbd", {}, "L"), " to make it a landmark that objects are told from."),
      h("p", { class: "hint" }, h("kbd", {}, "N"), " leads to the next unfinished object, ", h("kbd", {}, "?"), " shows all keys."));
  }

  picked(facts) {
    const looks = Object.entries(facts.attributes);
    this.panel.replaceChildren(
      h("div", { class: "head" }, h("h2", {}, facts.word), h("button", { onclick: () => this.page.view.focusOn(facts.node) }, "Go to ", h("kbd", {}, "G"))),
      h("p", { class: "node" }, facts.node),
      h("dl", {}, h("dt", {}, "Category"), h("dd", {}, facts.category),
        ...looks.flatMap(([key, value]) => [h("dt", {}, key), h("dd", {}, value)]),
        h("dt", {}, "Size"), h("dd", {}, `${facts.size_m.map((v) => v.toFixed(1)).join(" × ")} m`),
        h("dt", {}, "Location"), h("dd", {}, facts.landmark ? `${facts.direction} of the ${facts.landmark}` : "no landmark yet")),
      h("div", { class: "row" },
        h("button", { id: "make-object", class: "main", onclick: () => this.page.add("objects") }, "Make it an object ", h("kbd", {}, "O")),
        h("button", { id: "make-landmark", onclick: () => this.page.add("landmarks") }, "Make it a landmark ", h("kbd", {}, "L")),
        this.page.facts.imported && h("button", { id: "box-out", onclick: () => this.page.boxOut() }, "Box out a part ", h("kbd", {}, "B")),
        facts.boxed && h("button", { id: "uncut", class: "danger", onclick: () => this.page.box.uncut(facts.node) }, "Take the box away")));
  }

  form() {
    const { kind, id } = this.selection, entry = this.entry;
    const object = kind === "objects";
    const head = h("div", { class: "head" }, h("h2", {}, `${object ? "Object" : "Landmark"} ${id}`),
      h("button", { onclick: () => this.page.view.focusOn(entry.node) }, "Go to ", h("kbd", {}, "G")),
      h("button", { id: "remove", class: "danger", onclick: () => this.page.remove() }, "Remove"));
    this.task = h("div", { class: "task" });
    this.other = h("ul", { class: "faults" });
    const name = this.field("name", "Name", h("input", { spellcheck: "true",
      title: object ? "What a person would call it" : "What a person would call it, unique in the scene" }));
    this.panel.replaceChildren(head, h("p", { class: "node" }, entry.node));
    if (!object) this.panel.append(name);
    else {
      const category = h("input", { list: "categories", readonly: !this.page.facts.imported,
        title: this.page.facts.imported ? "Of the catalogue, or the scene's own" : "The mesh says what it is" });
      this.panel.append(
        h("div", { class: "pair" }, name, this.field("category", "Category", category)),
        this.field("description", "Description", h("textarea", { rows: 5, spellcheck: "true" }),
          "optional: what it looks like, what stands by it; without one the program writes it"),
        this.task);
      this.anchors = new AnchorChooser(this.page, entry);
      this.panel.append(this.anchors.element);
    }
    this.panel.append(h("div", { role: "status" }, this.other));
    this.refresh();
  }

  field(key, label, control, hint) {
    const faults = h("ul", { class: "faults", id: `faults-${key}` });
    control.id = `field-${key}`;
    control.setAttribute("aria-describedby", faults.id);
    const state = { key, control, faults, base: null, timers: [], draft: `${this.selection.kind}-${this.selection.id}-${key}` };
    this.fields[key] = state;
    if (this.drafts.has(state.draft)) {
      control.value = this.drafts.get(state.draft);
      state.base = structuredClone(this.entry);
    }
    control.addEventListener("focus", () => { if (!this.drafts.has(state.draft)) state.base = structuredClone(this.entry); });
    control.addEventListener("input", () => {
      this.page.sync.say("busy", "typing…");
      state.timers.forEach(clearTimeout);
      state.timers = [setTimeout(() => this.check(state), CHECK_MS), setTimeout(() => this.save(state), SAVE_MS)];
    });
    control.addEventListener("change", () => this.save(state));
    control.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && control.tagName === "INPUT") this.save(state);
    });
    return h("div", { class: "field" }, h("label", {}, h("span", {}, label, hint ? ` (${hint})` : ""), control), h("div", { role: "status" }, faults));
  }

  /** What stands in the fields and is not on its way to the disk, in words; empty where there is nothing of the kind. */
  typing() {
    if (this.drafts.size) return `not saved: ${[...this.drafts.keys()].map((key) => key.replace("s-", " ").replace("-", ", ")).join("; ")} too long`;
    return Object.values(this.fields ?? {}).some((state) => state.timers.length) ? "typing…" : "";
  }

  /** How much too long a text is, in words; empty where it is not. */
  excess(state) {
    const length = [...this.value(state)].length;
    return length > MOST[state.key] ? `too long to be saved: ${length} characters, ${MOST[state.key]} at most` : "";
  }

  value(state) { return state.control.value.split(/\s+/).filter(Boolean).join(" "); }

  saveAll() { for (const state of Object.values(this.fields ?? {})) this.save(state); }

  async save(state) {
    state.timers.forEach(clearTimeout);
    state.timers = [];
    const value = this.value(state), { kind, id } = this.selection;
    const base = state.base;
    if (base && this.excess(state)) {
      this.drafts.set(state.draft, state.control.value);
      this.page.sync.say("saved", "saved");
      if (this.entry) this.tell(this.entry);
      return;
    }
    if (this.drafts.delete(state.draft) && this.entry) this.tell(this.entry);
    if (!base || same(base[state.key], value)) {
      if (this.page.sync.status === "busy") this.page.sync.say("saved", "saved");
      return;
    }
    state.base = { ...base, [state.key]: value };
    const result = await this.page.sync.request({ do: "change", kind, id, fields: { [state.key]: value } }, base);
    if (this.selection?.kind !== kind || this.selection.id !== id || !this.entry) return;
    state.base = structuredClone(this.entry);
    if (result === null) state.control.value = this.entry[state.key];
    this.refresh();
  }

  /** Ask what the checks of annotate-import would say of what stands in the fields now. */
  async check(state) {
    if (this.excess(state)) {
      this.tell(this.entry);
      return;
    }
    const { kind, id } = this.selection;
    const operation = { do: "change", kind, id, fields: { [state.key]: this.value(state) } };
    const answer = await this.page.sync.post("/api/draft", { operation });
    if (answer?.status === 200 && this.selection?.id === id && this.selection.kind === kind) this.tell(answer.body);
  }

  /** Bring the form up to date with the annotations; a field in use is left alone. */
  refresh() {
    const entry = this.entry;
    if (!this.selection || this.selection.node) return;
    if (!entry) {
      this.page.select(null);
      return;
    }
    for (const state of Object.values(this.fields)) {
      const used = document.activeElement === state.control || state.timers.length || this.drafts.has(state.draft);
      if (!used) state.control.value = entry[state.key];
    }
    if (!Object.values(this.fields).some((state) => state.timers.length)) this.tell(entry);
    this.anchors?.refresh(entry);
  }

  tell(entry) {
    const rest = [];
    for (const state of Object.values(this.fields)) {
      const excess = this.excess(state);
      const own = excess ? [{ message: excess }] : entry.faults.filter((fault) => fault.field === state.key);
      const empty = own.length && !this.value(state);
      // An empty field says by itself that something is to be written into it.
      fill(state.faults, empty ? [] : own.map((fault) => fault.message));
      state.control.setAttribute("aria-invalid", own.length && !empty ? "true" : "false");
    }
    for (const fault of entry.faults) if (!this.fields[fault.field]) rest.push(fault.message);
    fill(this.other, rest);
    if (this.selection.kind !== "objects") return;
    const where = entry.landmark ? `${entry.direction} of the ${entry.landmark}` : "(no landmark yet)";
    this.task.replaceChildren(h("strong", {}, "As the task will say it"), `${entry.name || "…"}, ${where}. [the description]`);
  }
}

const fill = (list, messages) => {
  if (same([...list.children].map((item) => item.textContent), messages)) return;
  list.replaceChildren(...messages.map((message) => h("li", {}, message)));
};
