// The page of `aerialdojo-gen view`: a scene with its landmarks, objects, anchors and routes.
import { addCompass } from "./compass.js";
import { ANCHOR, clearanceColour, clearanceStops, GOAL, LANDMARK, OBJECT, SETTING, START } from "./colours.js";
import { make, number, words } from "./dom.js";
import { frameNode } from "./frame.js";
import { failure, showLandmark, showNode, showObject, showRoute, welcome } from "./panel.js";
import { SceneView } from "./scene.js";
import { addSearch } from "./search.js";

const $ = (id) => document.getElementById(id);
const panel = $("panel");

async function json(url) {
  const response = await fetch(url);
  const body = await response.json();
  if (!response.ok) throw new Error(body.error ?? `${url}: ${response.status}`);
  return body;
}

class Page {
  constructor(view, index) {
    this.view = view;
    this.index = index;
    this.objects = new Map(index.objects.map((object) => [object.object_id, object]));
    this.byNode = new Map(index.objects.map((object) => [object.mesh_node, object]));
    this.landmarkByNode = new Map(index.landmarks.map((landmark) => [landmark.node, landmark]));
    const { routes } = index;
    this.rows = new Map(routes.nav_id.map((nav, k) => [nav, k]));
    this.byTarget = new Map(index.objects.map((object) => [object.object_id, []]));
    routes.target_object_id.forEach((target, k) => this.byTarget.get(target)?.push(k));
    this.selection = 0;
  }

  /** One route of the index as a row. */
  route(k) {
    const row = Object.fromEntries(Object.entries(this.index.routes).map(([key, column]) => [key, column[k]]));
    return { ...row, start: this.objects.get(row.start_object_id)?.name ?? "?", target: this.objects.get(row.target_object_id)?.name ?? "?" };
  }

  // ---- layers ----

  addPlaces() {
    const { view, index } = this;
    view.addMarkers("objects", index.objects.map((object) => (
      { id: object.object_id, position: object.position, colour: OBJECT })), { size: 10 });
    view.addMarkers("landmarks", index.landmarks.map((landmark) => (
      { id: landmark.id, position: landmark.position, colour: LANDMARK, label: landmark.name })), { size: 15 });
    view.addMarkers("anchors", index.anchors.map((anchor) => (
      { id: `${anchor.object_id}/${anchor.anchor_id}`, position: anchor.position, colour: anchor.selected ? GOAL : ANCHOR,
        size: anchor.selected ? 9 : 7, anchor })), { onTop: false });
    view.addRoutes("looks", index.anchors.map(({ position: [x, y, z], yaw_rad: yaw, selected }) => (
      { points: [x, y, z, x + 0.9 * Math.cos(yaw), y + 0.9 * Math.sin(yaw), z], colour: selected ? GOAL : ANCHOR })),
    { width: 2, pickable: false });
    this.setLayer("anchors", false);
  }

  setLayer(name, on) {
    this.view.setVisible(name, on);
    if (name === "anchors") this.view.setVisible("looks", on);
    if (name === "routes") this.drawRoutes();
  }

  wanted() {
    const { routes } = this.index, rows = [];
    const setting = $("setting").value, split = $("split").value, modality = $("modality").value, target = $("target").value;
    for (const k of target === "" ? routes.nav_id.keys() : this.byTarget.get(Number(target))) {
      if ((!setting || routes.setting[k] === setting) && (!split || routes.split[k] === split)
        && (!modality || routes.modality[k].includes(modality))) rows.push(k);
    }
    return rows;
  }

  /** Draw what the filters leave; the ways are fetched when they are first needed. */
  async drawRoutes() {
    const rows = this.wanted(), most = Number($("most").value) || Infinity;
    // Ids are digests: every n-th of them is a fair sample, and the same one each time.
    const stride = Math.max(1, rows.length / most);
    const shown = rows.length > most ? Array.from({ length: most }, (_, k) => rows[Math.floor(k * stride)]) : rows;
    $("n-routes").textContent = rows.length > shown.length
      ? `${shown.length.toLocaleString("en")} of ${rows.length.toLocaleString("en")}` : rows.length.toLocaleString("en");
    this.shownRoutes = shown.length;
    const on = document.querySelector("[data-layer=routes]").checked;
    if (!on) return;
    this.ways ??= this.fetchWays();
    const ways = await this.ways, { routes } = this.index, byClearance = $("colour").value === "clearance";
    this.view.addRoutes("routes", shown.map((k) => ({
      id: routes.nav_id[k], points: ways(k),
      colour: byClearance ? clearanceColour(routes.min_clearance_m[k]) : SETTING[routes.setting[k]],
    })), { width: shown.length > 1500 ? 1.2 : 2.2 });
    this.fade();
    this.legend(byClearance);
  }

  async fetchWays() {
    const buffer = await (await fetch("/api/routes/points")).arrayBuffer();
    const n = new DataView(buffer).getUint32(0, true);
    const offsets = new Uint32Array(buffer, 4, n + 1), points = new Float32Array(buffer, 8 + 4 * n);
    return (k) => points.subarray(3 * offsets[k], 3 * offsets[k + 1]);
  }

  /** The crowd steps back: all the more where one route is picked. */
  fade() {
    this.view.setOpacity("routes", this.picture ? 0.2 : this.shownRoutes > 1500 ? 0.5 : 0.85);
  }

  legend(byClearance) {
    const swatch = (colour, text) => make("span", {}, make("svg", { width: 18, height: 8 },
      make("rect", { width: 18, height: 8, rx: 2, fill: colour })), text);
    $("legend").replaceChildren(...(byClearance
      ? [make("span", { class: "ramp" }, "Least clearance along the route"),
        ...clearanceStops.map(([metres, colour]) => swatch(colour, `${metres} m`))]
      : this.index.settings.map((setting) => swatch(SETTING[setting], words(setting)))));
  }

  // ---- picking ----

  picked(hit) {
    if (!hit) return this.letGo();
    if (hit.kind === "route" && hit.layer === "routes") return this.pickRoute(hit.id);
    if (hit.kind === "marker" && hit.layer === "objects") return this.pickObject(hit.id);
    if (hit.kind === "marker" && hit.layer === "anchors") return this.pickObject(hit.item.anchor.object_id);
    if (hit.kind === "marker" && hit.layer === "landmarks") {
      return this.pickLandmark(this.index.landmarks.find((landmark) => landmark.id === hit.id));
    }
    const node = hit.kind === "node" ? hit : hit.under;
    if (!node) return this.letGo();
    if (this.byNode.has(node.node)) return this.pickObject(this.byNode.get(node.node).object_id);
    if (this.landmarkByNode.has(node.node)) return this.pickLandmark(this.landmarkByNode.get(node.node));
    this.clear(node.node);
    showNode(panel, node);
  }

  clear(node) {
    this.selection++;
    for (const layer of ["selected", "ends", "drone"]) this.view.remove(layer);
    frameNode(this.view, node);
    if (this.riding) this.ride(false);
    this.picture = null;
    this.fade();
  }

  letGo() {
    this.clear(null);
    welcome(panel);
    history.replaceState(null, "", location.pathname);
  }

  pickObject(id, focus = false) {
    const object = this.objects.get(id);
    if (!object) return;
    this.clear(object.mesh_node);
    if (focus) this.view.focusOn(object.mesh_node);
    showObject(panel, object, this.byTarget.get(id).map((k) => this.route(k)), this.actions);
    history.replaceState(null, "", `#object=${id}`);
  }

  pickLandmark(landmark, focus = false) {
    this.clear(landmark.node);
    if (focus) this.view.focusOn(landmark.node);
    showLandmark(panel, landmark, this.index.objects.filter((object) => object.landmark_id === landmark.id), this.actions);
  }

  async pickRoute(nav, focus = false) {
    this.clear(this.objects.get(this.index.routes.target_object_id[this.rows.get(nav)])?.mesh_node);
    const mine = this.selection, route = this.route(this.rows.get(nav));
    const detail = await json(`/api/routes/${nav}`);
    if (mine !== this.selection) return;
    this.picture = { route, detail };
    this.fade();
    const colours = detail.way.slice(1).map((_, k) => clearanceColour(Math.min(detail.clearance_m[k], detail.clearance_m[k + 1])));
    this.view.addRoutes("selected", [{ id: nav, points: detail.way.flat(), colour: colours }],
      { width: 6, opacity: 1, onTop: true, pickable: false });
    const ends = { start: detail.poses[0], goal: detail.poses.at(-1) };
    this.view.addMarkers("ends", [["start", START], ["goal", GOAL]].map(([label, colour]) => (
      { id: label, position: ends[label].slice(0, 3), colour, label })), { size: 15, pickable: false });
    showRoute(panel, route, detail, this.actions);
    if (focus) this.view.focusOn(detail.way);
    this.step(0);
    history.replaceState(null, "", `#route=${nav}`);
  }

  get actions() {
    return {
      object: (id) => this.pickObject(id, true),
      route: (nav) => this.pickRoute(nav, true),
      only: (id) => { $("target").value = String(id); this.showRoutes(); },
      ride: () => this.ride(!this.riding),
      whole: () => { this.ride(false); this.view.focusOn(this.picture.detail.way); },
      step: (k) => this.step(k),
    };
  }

  showRoutes() {
    document.querySelector("[data-layer=routes]").checked = true;
    this.setLayer("routes", true);
  }

  step(k) {
    const [x, y, z, yaw] = this.picture.detail.poses[k];
    $("pose").textContent = k;
    $("doing").textContent = `${this.picture.detail.actions[k]} at ${number(x, 2)}, ${number(y, 2)}, ${number(z, 2)} m`;
    const ahead = [x + 1.5 * Math.cos(yaw), y + 1.5 * Math.sin(yaw), z];
    this.view.addRoutes("drone", [{ points: [x, y, z, ...ahead], colour: "#ffffff" }], { width: 4, onTop: true, pickable: false });
    this.view.setVisible("drone", !this.riding);
    if (this.riding) this.view.controls.lookFrom([x, y, z], ahead);
  }

  ride(on) {
    this.riding = on;
    $("ride").setAttribute("aria-pressed", on);
    // The drone's own cameras have a field of view of 90 degrees.
    this.view.setFieldOfView(on ? 90 : undefined);
    for (const layer of ["selected", "ends", "frame"]) this.view.setVisible(layer, !on);
    for (const box of document.querySelectorAll("[data-layer]")) {
      if (box.checked) this.view.setVisible(box.dataset.layer, !on);
    }
    this.step(Number($("step").value));
  }

  // ---- the cursor ----

  tooltip(hit, event) {
    const element = $("tooltip");
    element.hidden = !hit;
    if (!hit) return;
    const node = hit.kind === "node" ? hit.node : null;
    const text = hit.kind === "route" ? this.routeLine(hit.id)
      : hit.layer === "objects" ? this.objects.get(hit.id).name
        : hit.layer === "landmarks" ? hit.item.label
          : hit.layer === "anchors" ? `anchor ${hit.item.anchor.anchor_id} of ${this.objects.get(hit.item.anchor.object_id)?.name ?? "?"}`
            : this.byNode.get(node)?.name ?? this.landmarkByNode.get(node)?.name ?? node;
    element.textContent = text;
    element.style.left = `${Math.min(event.clientX + 14, innerWidth - 310)}px`;
    element.style.top = `${event.clientY + 14}px`;
  }

  routeLine(nav) {
    const route = this.route(this.rows.get(nav));
    return `${words(route.setting)}, ${number(route.length_m)} m: ${route.start} → ${route.target}`;
  }

  // ---- the page's controls ----

  mode(name) {
    this.view.controls.setMode(name);
    for (const mode of ["orbit", "fly"]) $(mode).setAttribute("aria-pressed", mode === name);
  }

  listen() {
    const { view } = this;
    for (const box of document.querySelectorAll("[data-layer]")) {
      box.addEventListener("change", () => this.setLayer(box.dataset.layer, box.checked));
    }
    for (const id of ["setting", "split", "modality", "target", "colour", "most"]) {
      $(id).addEventListener("change", () => this.drawRoutes());
    }
    const act = { orbit: () => this.mode("orbit"), fly: () => this.mode("fly"), home: () => view.home(), top: () => view.top() };
    for (const [id, press] of Object.entries(act)) $(id).addEventListener("click", press);
    const keys = { o: act.orbit, f: act.fly, h: act.home, t: act.top, Escape: () => this.letGo() };
    document.addEventListener("keydown", (event) => {
      if (event.target.matches("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "/") { event.preventDefault(); $("search").focus(); } else keys[event.key]?.();
    });
    addSearch(this, $("search"), $("results"));
    view.onPick((hit) => Promise.resolve(this.picked(hit)).catch((error) => failure(panel, error)));
    view.onHover((hit, event) => this.tooltip(hit, event));
  }

  fillIn() {
    const { scene, settings, splits, objects, landmarks, anchors, routes } = this.index;
    document.title = `${scene.scene} · aerialdojo-gen view`;
    $("title").textContent = scene.scene;
    $("subtitle").textContent = `${scene.family}, ${scene.scene_type}, ${scene.partition} · ${scene.n_triangles.toLocaleString("en")} triangles · `
      + `${routes.nav_id.length.toLocaleString("en")} routes`;
    $("n-landmarks").textContent = landmarks.length;
    $("n-objects").textContent = objects.length;
    $("n-anchors").textContent = anchors.length;
    $("setting").append(...settings.map((setting) => make("option", { value: setting }, words(setting))));
    $("split").append(...splits.map((split) => make("option", { value: split }, split)));
    $("target").append(...[...objects].sort((a, b) => a.name.localeCompare(b.name))
      .map((object) => make("option", { value: object.object_id }, object.name)));
  }

  fromAddress() {
    const [, what, id] = location.hash.match(/^#(route|object)=(.+)$/) ?? [];
    if (what === "route" && this.rows.has(id)) return this.pickRoute(id, true);
    if (what === "object" && this.objects.has(Number(id))) return this.pickObject(Number(id), true);
    return welcome(panel);
  }
}

try {
  const [view, index] = await Promise.all([SceneView.load($("scene"), "/api/scene"), json("/api/index")]);
  const page = new Page(view, index);
  addCompass(view, view.overlay);
  page.fillIn();
  page.addPlaces();
  page.listen();
  await page.drawRoutes();
  await page.fromAddress();
  window.page = page;
  document.body.dataset.ready = "yes";
} catch (error) {
  failure(panel, error);
  document.body.dataset.ready = "failed";
  throw error;
}
