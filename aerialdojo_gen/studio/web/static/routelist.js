// All routes that the filters leave, as a list of which only the rows in sight are made.
import { SETTING } from "./colours.js";
import { make, words } from "./dom.js";

const ROW_PX = 46, SPARE_ROWS = 6, TYPING_MS = 200;
const ORDERS = [["length_m", "length"], ["detour_ratio", "detour κ"], ["min_clearance_m", "clearance"], ["n_actions", "actions"],
  ["target", "target"], ["start", "start"]];

export class RouteList {
  /** pick(nav) shows a route; filter(words) is told what is typed. */
  constructor(routes, element, { pick, filter }) {
    Object.assign(this, { routes, element, pick, rows: [], sorted: [], at: 0, current: null, up: true });
    this.find = make("input", { id: "route-words", type: "search", placeholder: "words of start or target, id", "aria-label": "Routes with these words",
      autocomplete: "off" });
    this.order = make("select", { id: "route-order", "aria-label": "Sort routes by" },
      ...ORDERS.map(([key, text]) => make("option", { value: key }, text)));
    this.turn = make("button", { id: "route-turn", title: "The other way round", "aria-label": "Ascending; the other way round" }, "↑");
    this.count = make("p", { class: "soft", id: "route-count", role: "status" });
    this.space = make("div", { class: "rows", role: "presentation" });
    this.box = make("div", { class: "scroller", id: "route-rows", role: "listbox", tabindex: 0, "aria-label": "Routes" }, this.space);
    element.append(make("div", { class: "list-tools" }, this.find, this.order, this.turn), this.count, this.box);
    let waiting = 0;
    this.find.addEventListener("input", () => {
      clearTimeout(waiting);
      waiting = setTimeout(() => filter(this.find.value.toLowerCase().split(/\s+/).filter(Boolean)), TYPING_MS);
    });
    this.order.addEventListener("change", () => this.sort());
    this.turn.addEventListener("click", () => {
      this.up = !this.up;
      this.turn.textContent = this.up ? "↑" : "↓";
      this.turn.setAttribute("aria-label", `${this.up ? "Ascending" : "Descending"}; the other way round`);
      this.sort();
    });
    this.box.addEventListener("scroll", () => this.render());
    this.box.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.render()).observe(this.box);
  }

  /** Show these rows of the index. */
  show(rows) {
    this.rows = rows;
    this.sort();
  }

  sort() {
    const key = this.order.value, { routes } = this.routes.index, sign = this.up ? 1 : -1;
    const column = key === "target" || key === "start" ? this.routes[key] : routes[key];
    const compare = typeof column[0] === "string" ? (a, b) => column[a].localeCompare(column[b]) : (a, b) => column[a] - column[b];
    this.sorted = [...this.rows].sort((a, b) => sign * compare(a, b) || a - b);
    this.space.style.height = `${ROW_PX * this.sorted.length}px`;
    this.count.textContent = `${this.sorted.length.toLocaleString("en")} ${this.sorted.length === 1 ? "route" : "routes"}`;
    this.box.scrollTop = 0;
    this.at = Math.max(0, this.sorted.findIndex((k) => routes.nav_id[k] === this.current));
    this.render();
    if (this.at) this.reveal();
  }

  /** Mark the route that is picked; null for none. */
  mark(nav) {
    this.current = nav;
    const at = nav === null ? -1 : this.sorted.findIndex((k) => this.routes.index.routes.nav_id[k] === nav);
    if (at >= 0) this.at = at;
    this.render();
  }

  render() {
    const height = this.box.clientHeight;
    if (!height) return;
    const first = Math.max(0, Math.floor(this.box.scrollTop / ROW_PX) - SPARE_ROWS);
    const last = Math.min(this.sorted.length, Math.ceil((this.box.scrollTop + height) / ROW_PX) + SPARE_ROWS);
    const rows = [];
    for (let i = first; i < last; i++) rows.push(this.item(i));
    this.space.replaceChildren(...rows);
    if (this.at >= first && this.at < last) this.box.setAttribute("aria-activedescendant", `route-row-${this.at}`);
    else this.box.removeAttribute("aria-activedescendant");
  }

  item(i) {
    const k = this.sorted[i], { routes } = this.routes.index, nav = routes.nav_id[k];
    const row = make("div", { class: i === this.at ? "route at" : "route", role: "option", id: `route-row-${i}`, "data-nav": nav,
      "aria-selected": String(nav === this.current), "aria-setsize": this.sorted.length, "aria-posinset": i + 1,
      title: this.routes.line(k), onclick: () => { this.at = i; this.pick(nav); } },
    make("span", { class: "way" }, make("svg", { width: 9, height: 9, "aria-hidden": "true" },
      make("rect", { width: 9, height: 9, rx: 2, fill: SETTING[routes.setting[k]] })), ` ${this.routes.start[k]} → ${this.routes.target[k]}`),
    make("span", { class: "figures" }, `${words(routes.setting[k])} · ${routes.length_m[k].toFixed(1)} m · κ ${routes.detour_ratio[k].toFixed(2)} · `
      + `${routes.min_clearance_m[k].toFixed(2)} m free · ${routes.n_actions[k]} actions`));
    row.style.top = `${ROW_PX * i}px`;
    return row;
  }

  key(event) {
    const page = Math.max(1, Math.floor(this.box.clientHeight / ROW_PX) - 1), last = this.sorted.length - 1;
    const to = { ArrowDown: this.at + 1, ArrowUp: this.at - 1, PageDown: this.at + page, PageUp: this.at - page, Home: 0, End: last }[event.key];
    if (to !== undefined) {
      this.at = Math.max(0, Math.min(last, to));
      this.reveal();
      this.render();
    } else if (event.key === "Enter" && this.sorted.length) this.pick(this.routes.index.routes.nav_id[this.sorted[this.at]]);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  reveal() {
    const top = ROW_PX * this.at, height = this.box.clientHeight;
    if (top < this.box.scrollTop) this.box.scrollTop = top;
    else if (top + ROW_PX > this.box.scrollTop + height) this.box.scrollTop = top + ROW_PX - height;
  }
}
