// The anchors of an object: the candidates as pictures, one to choose, or one placed by hand.
import { ask, byId, h, picture, same } from "./dom.js";

const cache = new Map();

/** The candidates of an object, computed once; a promise. */
export function candidatesOf(entry) {
  const key = `${entry.id} ${entry.node}`;
  if (!cache.has(key)) {
    cache.set(key, ask(`/api/objects/${entry.id}/anchors`).catch((error) => { cache.delete(key); throw error; }));
  }
  return cache.get(key);
}

const poseOf = ({ position_m, yaw_deg }) => ({ position_m, yaw_deg });

export class AnchorChooser {
  constructor(page, entry) {
    this.page = page;
    this.id = entry.id;
    this.cards = h("div", { class: "anchors", role: "group", "aria-label": "Anchors to choose from" });
    this.note = h("p", { class: "hint", role: "status" }, "Looking for viewpoints…");
    this.placing = h("div", { class: "placing", hidden: true });
    this.clear = h("button", { onclick: () => this.choose(null) }, "Leave it to the sampler");
    this.element = h("section", { "aria-label": "Anchor" }, h("h3", {}, "Anchor: where the search ends"), this.cards, this.note,
      h("div", { class: "row" }, h("button", { id: "place", onclick: () => this.fromView() }, "Place from this view ", h("kbd", {}, "V")),
        h("button", { id: "place-numbers", onclick: () => this.fromNumbers() }, "By numbers"), this.clear), this.placing);
    this.candidates = [];
    candidatesOf(entry).then((found) => {
      if (this.closed) return;
      this.candidates = found;
      this.note.textContent = found.length ? "" : "No viewpoint around it can be reached and sees it: place one by hand, or choose another thing.";
      this.refresh(this.page.sync.entry("objects", this.id));
    }, (error) => { this.note.textContent = error.message; });
  }

  close() {
    this.closed = true;
    byId("preview").hidden = true;
    this.page.view.remove("anchors");
    this.page.view.remove("sights");
  }

  /** Draw the cards anew for what is chosen now. */
  refresh(entry) {
    if (!entry || this.closed) return;
    this.clear.disabled = !entry.anchor;
    if (this.candidates.length) this.note.textContent = entry.anchor ? "" : "Chosen by the sampler: its best candidate. Choose one yourself with a click or 1, 2, 3.";
    const at = entry.anchor ? this.candidates.findIndex((c) => same(poseOf(c), poseOf(entry.anchor))) : -1;
    const cards = this.candidates.map((candidate, k) => ({ viewpoint: candidate, title: String(k + 1), chosen: k === at, key: k + 1 }));
    if (!entry.anchor && cards.length) cards[0].sampled = true;
    if (entry.anchor && at < 0) cards.push({ viewpoint: this.own(entry.anchor), title: "by hand", chosen: true });
    this.shown = cards;
    const state = JSON.stringify(cards);
    if (state === this.state) return;
    this.state = state;
    const keep = this.cards.contains(document.activeElement) ? [...this.cards.children].indexOf(document.activeElement) : -1;
    this.cards.replaceChildren(...cards.map((card) => this.card(card, entry)));
    this.cards.children[keep]?.focus();
    this.mark(entry);
  }

  /** What is known of a chosen anchor that is none of the candidates: asked for once. */
  own(anchor) {
    const key = JSON.stringify(anchor);
    if (this.ownKey !== key) {
      this.ownKey = key;
      this.ownFacts = { ...anchor, faults: [] };
      ask(`/api/objects/${this.id}/viewpoint`, anchor).then((facts) => {
        this.ownFacts = facts;
        this.refresh(this.page.sync.entry("objects", this.id));
      }, () => {});
    }
    return this.ownFacts;
  }

  card({ viewpoint, title, chosen, sampled, key }, entry) {
    const seen = viewpoint.visible_fraction;
    const wrong = viewpoint.faults.length ? `It will not do: ${viewpoint.faults.join("; ")}` : null;
    return h("button", {
      "aria-pressed": String(chosen), title: wrong ?? `${viewpoint.surface_distance_m?.toFixed(2)} m from the surface, clearance ${viewpoint.clearance_m?.toFixed(2)} m`,
      onclick: () => this.choose(poseOf(viewpoint)), onmouseenter: () => this.regard(entry, viewpoint, title), onfocus: () => this.regard(entry, viewpoint, title),
      onmouseleave: () => this.regard(entry), onblur: () => this.regard(entry),
    }, picture(viewpoint, this.page.facts.picture_px, `${entry.name || "object"} seen from anchor ${title}`),
    h("span", { class: "caption" }, h("span", {}, key ? h("kbd", {}, title) : title), chosen ? h("span", { class: "chosen" }, "✓ chosen")
      : sampled ? h("span", { class: "sampled", title: "Nobody has chosen one: the sampler takes the best candidate" }, "sampler’s")
      : h("span", { class: "hint" }, seen == null ? "" : `sees ${Math.round(100 * seen)} %`)),
    wrong ? h("span", { class: "faults" }, wrong) : null);
  }

  /** Show a candidate large beside the panel, and where it is. */
  regard(entry, viewpoint = null, title = "") {
    const large = byId("preview");
    large.hidden = !viewpoint;
    large.replaceChildren(...(viewpoint ? [picture(viewpoint, this.page.facts.picture_px, `seen from anchor ${title}`)] : []));
    this.mark(entry, viewpoint);
  }

  /** Show the viewpoints in the scene, with a line to the object from the one in hand. */
  mark(entry, viewpoint = null) {
    const view = this.page.view, chosen = viewpoint ?? this.shown.find((card) => card.chosen)?.viewpoint;
    const cards = this.placing.hidden ? this.shown : [...this.shown, { viewpoint: this.facts, title: "here" }];
    view.addMarkers("anchors", cards.map(({ viewpoint: { position_m }, title, chosen: is }) => (
      { id: title, position: position_m, colour: is ? "#4ade80" : "#7dd3fc", size: 14, label: title })), { pickable: false });
    if (chosen && entry.position_m) {
      view.addRoutes("sights", [{ id: 0, points: [...chosen.position_m, ...entry.position_m], colour: "#fde047" }], { width: 2, pickable: false });
    } else view.remove("sights");
  }

  /** Choose by number, 1 to 3. */
  pick(number) {
    const candidate = this.candidates[number - 1];
    if (candidate) this.choose(poseOf(candidate));
  }

  async choose(anchor) {
    const entry = this.page.sync.entry("objects", this.id);
    this.placing.hidden = true;
    byId("preview").hidden = true;
    const result = await this.page.sync.request({ do: "change", kind: "objects", id: this.id, fields: { anchor } }, structuredClone(entry));
    if (result?.done && anchor) this.page.say(`Anchor of object ${this.id} chosen.`);
  }

  // ---- by hand ----

  async fromView() {
    const eye = this.page.view.camera.position.toArray();
    await this.judge({ position_m: eye, snap: true });
  }

  async fromNumbers() {
    const entry = this.page.sync.entry("objects", this.id);
    await this.judge(entry.anchor ?? (this.candidates[0] ? poseOf(this.candidates[0]) : { position_m: this.page.view.camera.position.toArray(), snap: true }));
    this.placing.querySelector("input")?.focus();
  }

  async judge(asked) {
    let facts;
    try {
      facts = await ask(`/api/objects/${this.id}/viewpoint`, asked);
    } catch (error) {
      this.page.say(error.message, true);
      return;
    }
    if (this.closed) return;
    const focused = document.activeElement?.dataset?.number;
    const number = (label, value, step, k) => h("label", { class: "field" }, h("span", {}, label),
      h("input", { type: "number", step, value: value.toFixed(k === 3 ? 1 : 2), "data-number": k, onchange: () => this.typed(k === 3) }));
    const verdict = facts.faults.length ? h("div", { role: "status" }, h("ul", { class: "faults" }, ...facts.faults.map((text) => h("li", {}, `${text}.`))))
      : h("p", { class: "ok", role: "status" }, `It will do: ${facts.surface_distance_m.toFixed(2)} m from the surface, sees ${Math.round(100 * facts.visible_fraction)} %, clearance ${facts.clearance_m.toFixed(2)} m.`);
    this.facts = facts;
    this.placing.replaceChildren(
      h("div", { class: "large" }, picture(facts, this.page.facts.picture_px, "what the drone's camera sees from there")),
      h("div", { class: "numbers" }, ...["x m", "y m", "z m"].map((label, k) => number(label, facts.position_m[k], 0.1, k)), number("yaw °", facts.yaw_deg, 5, 3)),
      verdict,
      h("div", { class: "row" },
        h("button", { id: "choose-placed", class: "main", disabled: facts.faults.length > 0, onclick: () => this.choose(poseOf(this.facts)) }, "Choose this one"),
        h("button", { onclick: () => this.typed(false) }, "Face the object"),
        h("button", { onclick: () => { this.placing.hidden = true; this.refreshMarks(); } }, "Cancel")));
    this.placing.hidden = false;
    if (focused != null) this.placing.querySelector(`[data-number="${focused}"]`)?.focus();
    else this.placing.scrollIntoView({ block: "nearest" });
    this.mark(this.page.sync.entry("objects", this.id), facts);
  }

  refreshMarks() { this.mark(this.page.sync.entry("objects", this.id)); }

  typed(withYaw) {
    const [x, y, z, yaw] = [...this.placing.querySelectorAll("input")].map((input) => Number(input.value));
    if ([x, y, z, yaw].some((value) => !Number.isFinite(value))) return;
    this.judge({ position_m: [x, y, z], ...(withYaw ? { yaw_deg: yaw } : {}) });
  }
}
