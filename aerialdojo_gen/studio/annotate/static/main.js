// The annotation page: the scene, the list, the panel, and the keys that connect them.
import { addCompass } from "/static/compass.js";
import { frameNode } from "/static/frame.js";
import { SceneView } from "/static/scene.js";
import { candidatesOf } from "./anchors.js";
import { BoxDrawer } from "./box.js";
import { askConflict, showHelp, showHistory } from "./dialogs.js";
import { ask, byId, h, toast } from "./dom.js";
import { Editor } from "./editor.js";
import { List, unfinished } from "./list.js";
import { Name } from "./name.js";
import { Sync } from "./sync.js";

class Page {
  async start() {
    this.facts = await (await fetch("/api/facts")).json();
    document.title = `annotate ${this.facts.scene}`;
    byId("scene-name").textContent = this.facts.scene;
    byId("export").download = this.facts.file;
    byId("coco").download = `${this.facts.scene}-coco.zip`;
    document.body.append(h("datalist", { id: "categories" },
      ...Object.entries(this.facts.categories).map(([key, word]) => h("option", { value: key }, word))));
    this.view = await SceneView.load(byId("view"), "/api/scene");
    addCompass(this.view, this.view.overlay);
    const name = new Name((text) => this.say(text, true));
    this.sync = new Sync(this.facts.scene, () => name.value, askConflict);
    this.list = new List((selection) => this.select(selection));
    this.editor = new Editor(this);
    this.box = new BoxDrawer(this);
    this.sync.addEventListener("document", () => this.documentChanged());
    this.sync.addEventListener("status", ({ detail }) => this.status(detail));
    this.sync.addEventListener("other", ({ detail }) => toast(detail));
    this.sync.addEventListener("refused", ({ detail }) => toast(detail, true));
    await this.sync.start();
    this.sync.say("saved", "saved");
    this.editor.show(null);
    this.buttons();
    this.keys();
    await this.selectFromAddress();
    this.view.onPick((hit, event) => this.clicked(hit, event));
    this.view.onHover((hit) => this.hover(hit));
    document.body.dataset.ready = "true";
  }

  /** Select what the address names, as before the page was loaded anew. */
  async selectFromAddress() {
    const [what, id] = location.hash.slice(1).split("/"), node = decodeURIComponent(what);
    if (id !== undefined) {
      if (["landmarks", "objects"].includes(what) && this.sync.entry(what, Number(id))) this.select({ kind: what, id: Number(id) });
      return;
    }
    if (!node || !this.view.index.has(node)) return;
    const facts = await this.ask(`/api/nodes/${encodeURIComponent(node)}`);
    if (facts) this.select(this.entryOfNode(node) ?? { node: facts });
    this.view.focusOn(node);
  }

  remember(selection) {
    const place = selection?.kind ? `${selection.kind}/${selection.id}` : encodeURIComponent(selection?.node?.node ?? "");
    history.replaceState(null, "", place ? `#${place}` : location.pathname);
  }

  /** Ask the server for what is shown; undefined, and a word to the person, where it gives none. */
  async ask(url, body, method) {
    try {
      return await ask(url, body, method);
    } catch (error) {
      this.say(error.message, true);
      return undefined;
    }
  }

  say(text, wrong = false) { toast(text, wrong); }

  status({ status, text }) {
    byId("saved").textContent = text;
    byId("saved").title = text;
    byId("saved").className = status === "saved" ? "" : status;
  }

  // ---- what is selected ----

  select(selection, { go = true, focus = false } = {}) {
    this.box.stop();
    this.selection = selection;
    this.remember(selection);
    this.editor.show(selection);
    this.list.render(this.sync.doc, selection);
    this.list.reveal();
    const entry = selection?.kind ? this.sync.entry(selection.kind, selection.id) : selection?.node;
    frameNode(this.view, entry?.node);
    if (entry?.node && go && selection.kind) this.view.focusOn(entry.node);
    if (focus) this.intoFields();
    if (selection?.kind === "objects") this.prefetch();
  }

  /** Have the candidates of the next unfinished object ready before somebody asks. */
  async prefetch() {
    const current = this.selection && this.sync.entry("objects", this.selection.id);
    try {
      if (current) await candidatesOf(current);
      const next = this.list.nextUnfinished();
      if (next) for (const { position_m: [x, y, z], yaw_deg } of await candidatesOf(next)) {
        new Image().src = `/api/picture?${new URLSearchParams({ x, y, z, yaw_deg })}`;
      }
    } catch { /* the panel of that object will say what is wrong */ }
  }

  intoFields() {
    const empty = [...document.querySelectorAll("#panel input, #panel textarea")].find((field) => !field.readOnly && !field.value && field.type !== "number");
    (empty ?? document.querySelector("#panel input, #panel textarea") ?? byId("panel")).focus();
  }

  entryOfNode(node) {
    for (const kind of ["objects", "landmarks"]) {
      const entry = this.sync.doc[kind].find((one) => one.node === node);
      if (entry) return { kind, id: entry.id };
    }
    return null;
  }

  async clicked(hit, event) {
    if (hit?.kind === "marker" && !this.box.active) {
      const [kind, id] = hit.id.split("-");
      this.select({ kind, id: Number(id) }, { go: false });
      return;
    }
    const box = this.view.canvas.getBoundingClientRect();
    await this.pickAt(event.clientX - box.left, event.clientY - box.top);
  }

  /** What the ray through a pixel meets on the mesh is the server's to say. */
  async pickAt(x, y) {
    const [origin_m, direction] = this.view.ray(x, y);
    const facts = await this.ask("/api/pick", { origin_m, direction });
    if (facts === undefined) return;
    if (this.box.active) {
      if (facts) this.box.click(facts.point_m);
      return;
    }
    this.select(facts && (this.entryOfNode(facts.node) ?? { node: facts }), { go: false });
  }

  hover(hit) {
    const box = byId("hover");
    const node = hit?.kind === "marker" ? this.sync.entry(...split(hit.id))?.node : hit?.node;
    const place = node && this.view.nodes[this.view.index.get(node)];
    box.hidden = !place;
    if (!place) return;
    const annotated = this.entryOfNode(node);
    const entry = annotated && this.sync.entry(annotated.kind, annotated.id);
    const what = this.facts.categories[place.category] ?? place.category;
    box.replaceChildren([place.attributes.colour, what].filter(Boolean).join(" "), "  ", h("span", { class: "node" }, node),
      entry ? `  ${annotated.kind === "objects" ? "object" : "landmark"} ${entry.id}${entry.name ? ` “${entry.name}”` : ""}` : "");
  }

  // ---- what changes ----

  documentChanged() {
    const doc = this.sync.doc;
    for (const [id, what] of [["undo", doc.undo], ["redo", doc.redo]]) {
      byId(id).disabled = !what;
      byId(id).title = what ? `${id === "undo" ? "Undo (Ctrl+Z)" : "Redo (Ctrl+Shift+Z)"}: ${what}` : "";
    }
    if (!this.editor) return;
    this.list.render(doc, this.selection);
    this.editor.refresh();
    const colour = (entry) => (entry.faults.some((fault) => !entry.lacks.includes(fault.field)) ? "#fb8585" : unfinished(entry) ? "#fbbf24" : "#4ade80");
    this.view.addMarkers("annotated", [
      ...doc.landmarks.filter((entry) => entry.position_m).map((entry) => ({ id: `landmarks-${entry.id}`, position: entry.position_m,
        colour: "#60a5fa", size: 15, label: entry.name || `landmark ${entry.id}` })),
      ...doc.objects.filter((entry) => entry.position_m).map((entry) => ({ id: `objects-${entry.id}`, position: entry.position_m,
        colour: colour(entry), size: 11 })),
    ]);
  }

  /** Draw a box around a thing without a node; only a mesh of another make lacks nodes. */
  boxOut() {
    if (!this.facts.imported) {
      this.say("Every thing of this scene has a node: pick it.", true);
      return;
    }
    const point = this.selection?.node?.point_m;
    this.select(null);
    this.box.start(point);
  }

  async add(kind) {
    const facts = this.selection?.node;
    if (!facts) {
      this.say("Pick a thing in the scene first.", true);
      return;
    }
    const name = [facts.attributes.colour, facts.word].filter(Boolean).join(" ");
    const fields = kind === "objects" ? { node: facts.node, category: facts.category, name } : { node: facts.node, name: facts.word };
    const result = await this.sync.request({ do: "add", kind, fields });
    const entry = this.sync.doc[kind].find((one) => one.node === facts.node);
    if (result && entry) this.select({ kind, id: entry.id }, { go: false, focus: true });
  }

  async remove() {
    const { kind, id } = this.selection ?? {};
    if (!kind) return;
    // What was being typed is saved first: it is the person's own change, and no conflict.
    this.editor.saveAll();
    await this.sync.flush();
    if (!this.sync.entry(kind, id)) return;
    const entry = structuredClone(this.sync.entry(kind, id));
    const result = await this.sync.request({ do: "remove", kind, id }, entry);
    if (result?.done) {
      this.say(`Removed ${kind === "objects" ? "object" : "landmark"} ${id}. Ctrl+Z brings it back.`);
      this.select(null);
    }
  }

  async turn(which) {
    this.editor.saveAll();
    const done = await this.sync.turn(which);
    if (!done) return;
    this.say(`${which === "undo" ? "Undone" : "Done again"}: ${done.what}`);
    const edit = done.edits.find((one) => one.after);
    if (edit) this.select({ kind: edit.kind, id: edit.id }, { go: false });
    else this.select(null);
  }

  next() {
    this.editor.saveAll();
    const entry = this.list.nextUnfinished();
    if (!entry) {
      this.say(this.sync.doc.objects.length ? "All objects are done, and their anchors chosen." : "There are no objects yet: pick a thing and press O.");
      return;
    }
    this.select({ kind: "objects", id: entry.id });
  }

  async takeOver(file) {
    const text = await file.text();
    await this.sync.flush();
    const answer = await this.sync.post("/api/import", { text });
    if (answer?.status === 200) {
      this.sync.take(answer.body);
      this.select(null);
      this.say(answer.body.done ? `Taken over: ${answer.body.done.what}. Ctrl+Z takes it back.` : "The file says what is here already.");
    } else this.say(answer?.body.error ?? "the server does not answer", true);
    if (answer?.body.state) this.sync.take(answer.body.state);
  }

  async history() {
    const lines = await this.ask("/api/history");
    if (lines) showHistory(lines);
  }

  // ---- buttons and keys ----

  mode() {
    const fly = this.view.controls.mode !== "fly";
    this.view.controls.setMode(fly ? "fly" : "orbit");
    byId("mode").setAttribute("aria-pressed", String(fly));
    this.view.canvas.focus();
  }

  goTo() {
    const entry = this.selection?.kind ? this.sync.entry(this.selection.kind, this.selection.id) : this.selection?.node;
    if (entry?.node) this.view.focusOn(entry.node);
  }

  buttons() {
    const on = { undo: () => this.turn("undo"), redo: () => this.turn("redo"), "show-history": () => this.history(), "show-help": showHelp,
      next: () => this.next(), mode: () => this.mode(), go: () => this.goTo(), top: () => this.view.top(), home: () => this.view.home(),
      aim: () => this.pickAt(this.view.width / 2, this.view.height / 2) };
    for (const [id, act] of Object.entries(on)) byId(id).addEventListener("click", () => act());
    byId("import").addEventListener("change", (event) => {
      if (event.target.files[0]) this.takeOver(event.target.files[0]);
      event.target.value = "";
      byId("files").open = false;
    });
    this.view.canvas.addEventListener("focus", () => { byId("crosshair").hidden = !this.view.canvas.matches(":focus-visible"); });
    this.view.canvas.addEventListener("blur", () => { byId("crosshair").hidden = true; });
    document.addEventListener("pointerdown", (event) => { if (!byId("files").contains(event.target)) byId("files").open = false; });
  }

  keys() {
    const act = {
      o: () => this.add("objects"), l: () => this.add("landmarks"), n: () => this.next(), j: () => this.list.step(1), k: () => this.list.step(-1),
      b: () => this.boxOut(), g: () => this.goTo(), f: () => this.mode(), t: () => this.view.top(), h: () => this.view.home(), v: () => this.editor.anchors?.fromView(),
      1: () => this.editor.anchors?.pick(1), 2: () => this.editor.anchors?.pick(2), 3: () => this.editor.anchors?.pick(3),
      "/": () => byId("find").focus(), "?": showHelp, delete: () => this.remove(), escape: () => this.select(null),
    };
    document.addEventListener("keydown", (event) => {
      if (document.querySelector("dialog[open]")) return;
      const typing = event.target.matches("input, textarea, select"), key = event.key.toLowerCase();
      const control = event.ctrlKey || event.metaKey;
      let done = null;
      if (control && key === "z" && !event.target.matches("textarea, input")) done = () => this.turn(event.shiftKey ? "redo" : "undo");
      else if (control && key === "y" && !typing) done = () => this.turn("redo");
      else if (control && key === "enter") done = () => this.next();
      else if (event.altKey && "123".includes(key)) done = act[key];
      else if (control || event.altKey) return;
      else if (typing && key === "escape") done = () => event.target.blur();
      else if (typing) return;
      else if (key === " " && event.target === this.view.canvas) done = () => this.pickAt(this.view.width / 2, this.view.height / 2);
      else if (key === "enter" && event.target.matches("body, canvas, #panel") && this.selection?.kind) done = () => this.intoFields();
      else done = act[key];
      if (!done) return;
      event.preventDefault();
      done();
    });
  }
}

const split = (key) => [key.split("-")[0], Number(key.split("-")[1])];

const page = new Page();
page.start().catch((error) => {
  byId("saved").textContent = error.message;
  byId("saved").className = "lost";
});
