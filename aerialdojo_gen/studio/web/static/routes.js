// The routes of the page: which of them the filters leave, how they are drawn, what the colours say.
import { clearanceColour, clearanceStops, SETTING } from "./colours.js";
import { hasWords, make, words } from "./dom.js";

const FILTERS = ["setting", "split", "modality", "target", "colour", "most"];
// So many are drawn as broad lines, more as thin ones, that cost a tenth.
const MOST_BROAD = 400, MANY = 1500;
const $ = (id) => document.getElementById(id);
const painted = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));

export class Routes {
  /** changed(rows) is told what the filters leave. */
  constructor(view, index, busy, changed) {
    Object.assign(this, { view, index, busy, changed, words: [], faded: false, asked: 0 });
    const names = new Map(index.objects.map((object) => [object.object_id, object.name]));
    const { routes } = index;
    this.start = routes.start_object_id.map((id) => names.get(id) ?? "?");
    this.target = routes.target_object_id.map((id) => names.get(id) ?? "?");
    this.row = new Map(routes.nav_id.map((nav, k) => [nav, k]));
    this.byTarget = new Map(index.objects.map((object) => [object.object_id, []]));
    routes.target_object_id.forEach((target, k) => this.byTarget.get(target)?.push(k));
    for (const id of FILTERS) $(id).addEventListener("change", () => this.draw());
  }

  /** One route of the index as a row. */
  at(k) {
    const row = Object.fromEntries(Object.entries(this.index.routes).map(([key, column]) => [key, column[k]]));
    return { ...row, start: this.start[k], target: this.target[k] };
  }

  line(k) {
    const { routes } = this.index;
    return `${words(routes.setting[k])}, ${routes.length_m[k].toFixed(1)} m: ${this.start[k]} → ${this.target[k]}`;
  }

  /** Rows of the index that the filters leave, in its order. */
  wanted() {
    const { routes } = this.index, [setting, split, modality, target] = FILTERS.slice(0, 4).map((id) => $(id).value);
    const rows = target === "" ? [...routes.nav_id.keys()] : this.byTarget.get(Number(target));
    return rows.filter((k) => (!setting || routes.setting[k] === setting) && (!split || routes.split[k] === split)
      && (!modality || routes.modality[k].includes(modality)) && this.says(k));
  }

  says(k, wish = this.words) {
    if (!wish.length) return true;
    const nav = this.index.routes.nav_id[k].toLowerCase();
    return hasWords(`${this.start[k]} ${this.target[k]}`, wish) || wish.every((word) => nav.includes(word.replace(/-[si]$/, "")));
  }

  /** How many routes have these words. */
  count(wish) { return this.start.reduce((sum, _, k) => sum + this.says(k, wish), 0); }

  /** Draw what the filters leave; the ways are fetched when they are first needed. */
  async draw() {
    const mine = ++this.asked, rows = this.wanted(), most = Number($("most").value) || Infinity;
    // Ids are digests: every n-th of them is a fair sample, and the same one each time.
    const stride = Math.max(1, rows.length / most);
    const shown = rows.length > most ? Array.from({ length: most }, (_, k) => rows[Math.floor(k * stride)]) : [...rows];
    const count = (n) => n.toLocaleString("en");
    $("n-routes").textContent = rows.length > shown.length ? `${count(shown.length)} of ${count(rows.length)}` : count(rows.length);
    this.shown = shown.length;
    this.changed(rows);
    if (!document.querySelector("[data-layer=routes]").checked) return;
    const busy = !this.ways || shown.length > MANY;
    if (busy) this.busy.show(`Drawing ${count(shown.length)} routes …`);
    try {
      this.ways ??= this.fetchWays();
      const ways = await this.ways;
      if (busy) await painted();
      if (mine === this.asked) this.put(shown, ways);
      if (busy) await painted();
    } finally {
      if (mine === this.asked) this.busy.hide();
    }
  }

  put(shown, ways) {
    const { routes } = this.index, byClearance = $("colour").value === "clearance";
    // What is drawn last lies on top: where routes overlap, the tightest gives the colour.
    if (byClearance) shown.sort((a, b) => routes.min_clearance_m[b] - routes.min_clearance_m[a]);
    const lines = shown.map((k) => ({
      id: routes.nav_id[k], points: ways(k),
      colour: byClearance ? clearanceColour(routes.min_clearance_m[k]) : SETTING[routes.setting[k]],
    }));
    if (lines.length > MOST_BROAD) this.view.addCrowd("routes", lines);
    else this.view.addRoutes("routes", lines, { width: 2.2 });
    this.fade(this.faded);
    this.legend(byClearance);
  }

  async fetchWays() {
    const response = await fetch("api/routes/points");
    if (!response.ok) throw new Error(`the routes did not load (${response.status})`);
    const buffer = await response.arrayBuffer(), n = new DataView(buffer).getUint32(0, true);
    const offsets = new Uint32Array(buffer, 4, n + 1), points = new Float32Array(buffer, 8 + 4 * n);
    return (k) => points.subarray(3 * offsets[k], 3 * offsets[k + 1]);
  }

  /** The crowd steps back where one route is picked. */
  fade(faded) {
    this.faded = faded;
    const byClearance = $("colour").value === "clearance";
    this.view.setOpacity("routes", faded ? 0.2 : byClearance ? 1 : this.shown > MANY ? 0.5 : 0.85);
  }

  legend(byClearance) {
    const swatch = (colour, text) => make("span", {}, make("svg", { width: 18, height: 8 },
      make("rect", { width: 18, height: 8, rx: 2, fill: colour })), text);
    $("legend").replaceChildren(...(byClearance
      ? [make("span", { class: "whole" }, "Least clearance along the route"),
        ...clearanceStops.map(([metres, colour]) => swatch(colour, `${metres} m`)),
        make("span", { class: "whole soft" }, "Where routes overlap, the tightest is on top.")]
      : this.index.settings.map((setting) => swatch(SETTING[setting], words(setting)))));
  }
}
