// Drawing a box around a thing for which a foreign mesh has no node: two corners by clicks or numbers, and a category.
import { edges } from "/static/frame.js";
import { byId, h } from "./dom.js";

const AXES = ["x", "y", "z"];

export class BoxDrawer {
  constructor(page) {
    this.page = page;
    this.corners = null;
    this.clicks = 0;
  }

  get active() { return this.corners !== null; }

  /** Start at a point of the surface, or in front of the camera. */
  start(point) {
    const centre = point ?? this.page.view.controls.orbit.target.toArray();
    this.corners = [centre.map((v, k) => v - (k < 2 ? 1 : 0.05)), centre.map((v, k) => v + (k < 2 ? 1 : 2))];
    this.clicks = 0;
    this.form();
    this.draw();
  }

  stop() {
    this.corners = null;
    this.page.view.remove("box");
  }

  /** A click on the surface sets one corner, the next one the opposite corner; the height stays. */
  click(point) {
    const [low, high] = this.corners, height = high[2] - low[2];
    if (this.clicks++ % 2 === 0) {
      this.first = point;
      this.corners = [point.map((v) => v - 0.05), [point[0] + 0.05, point[1] + 0.05, point[2] + height]];
    } else {
      const floor = Math.min(this.first[2], point[2]) - 0.05;
      this.corners = [[0, 1].map((k) => Math.min(this.first[k], point[k])).concat(floor),
        [0, 1].map((k) => Math.max(this.first[k], point[k])).concat(Math.max(this.first[2], point[2], floor + height))];
    }
    this.form();
    this.draw();
  }

  draw() {
    this.page.view.addRoutes("box", edges(this.corners).map((points, id) => ({ id, points, colour: "#fde047" })),
      { width: 2.5, opacity: 1, onTop: true, pickable: false });
  }

  form() {
    const category = byId("box-category")?.value ?? "";
    const number = (side, k) => h("label", { class: "field" }, h("span", {}, `${AXES[k]} ${side ? "to" : "from"}, m`),
      h("input", { type: "number", step: 0.1, value: this.corners[side][k].toFixed(2), onchange: (event) => {
        if (Number.isFinite(event.target.valueAsNumber)) this.corners[side][k] = event.target.valueAsNumber;
        this.draw();
      } }));
    byId("panel").replaceChildren(
      h("div", { class: "head" }, h("h2", {}, "Box out a thing")),
      h("p", { class: "hint" }, "Click two opposite corners on the surface, or type them. What lies in the box, by the middle of its triangles, becomes "
        + "a thing of its own that can be annotated."),
      h("div", { class: "placing" }, h("div", { class: "numbers three" }, ...[0, 1, 2].flatMap((k) => [number(0, k), number(1, k)]))),
      h("label", { class: "field" }, h("span", {}, "Category"), h("input", { id: "box-category", list: "categories", value: category })),
      h("div", { class: "row" }, h("button", { id: "cut", class: "main", onclick: () => this.cut() }, "Make it a thing"),
        h("button", { onclick: () => this.page.select(null) }, "Cancel")));
  }

  async cut() {
    const [low_m, high_m] = this.corners, category = byId("box-category").value;
    byId("cut").disabled = true;
    const made = await this.page.ask("/api/boxes", { low_m, high_m, category });
    if (made) {
      // The scene is another one now: load it anew, and go on with the new thing.
      location.hash = encodeURIComponent(made.node);
      location.reload();
      return;
    }
    // Somebody may have turned to something else meanwhile.
    if (byId("cut")) byId("cut").disabled = false;
  }

  /** Undo a box: what it held goes back to where it was. */
  async uncut(node) {
    if (await this.page.ask(`/api/boxes/${encodeURIComponent(node)}`, null, "DELETE")) {
      location.hash = "";
      location.reload();
    }
  }
}
