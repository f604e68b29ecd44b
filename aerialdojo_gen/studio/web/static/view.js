// The page of a scene of `aerialdojo-gen view`: its landmarks, objects, anchors and routes.
import { ANCHOR, clearanceColour, GOAL, LANDMARK, OBJECT, START } from "./colours.js";
import { addCompass } from "./compass.js";
import { Busy, make, number, words } from "./dom.js";
import { Flight } from "./flight.js";
import { frameNode } from "./frame.js";
import { failure, showLandmark, showNode, showObject, showRoute, welcome } from "./panel.js";
import { RouteList } from "./routelist.js";
import { Routes } from "./routes.js";
import { SceneView } from "./scene.js";
import { addSearch } from "./search.js";
import { Tabs } from "./tabs.js";

const $ = (id) => document.getElementById(id);
const panel = $("panel");

async function json(url) {
  const response = await fetch(url);
  const body = await response.json();
  if (!response.ok) throw new Error(body.error ?? `${url}: ${response.status}`);
  return body;
}

class Page {
  constructor(view, index, busy) {
    this.view = view;
    this.index = index;
    this.objects = new Map(index.objects.map((object) => [object.object_id, object]));
    this.byNode = new Map(index.objects.map((object) => [object.mesh_node, object]));
    this.landmarkByNode = new Map(index.landmarks.map((landmark) => [landmark.node, landmark]));
    this.routes = new Routes(view, index, busy, (rows) => this.list.show(rows));
    this.list = new RouteList(this.routes, $("list"), {
      pick: (nav) => this.settle(this.pickRoute(nav, true)),
      filter: (wish) => { this.routes.words = wish; this.settle(this.routes.draw()); },
    });
    this.tabs = new Tabs(["panel", "list"], () => this.list.render());
    this.selection = 0;
  }

  /** What goes wrong in the background is told in the panel. */
  settle(promise) { return Promise.resolve(promise).catch((error) => { this.tabs.show("panel"); failure(panel, error); }); }

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
    if (name === "routes") this.settle(this.routes.draw());
  }

  // ---- picking ----

  picked(hit) {
    if (!hit) return this.letGo();
    this.tabs.show("panel");
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

  clear(node, nav = null) {
    this.selection++;
    this.flight?.pause();
    for (const layer of ["selected", "ends", "drone"]) this.view.remove(layer);
    if (this.riding) this.ride(false);
    this.picture = this.flight = null;
    frameNode(this.view, node);
    this.routes.fade(false);
    this.list.mark(nav);
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
    this.tabs.show("panel");
    if (focus) this.view.focusOn(object.mesh_node);
    showObject(panel, object, this.routes.byTarget.get(id).map((k) => this.routes.at(k)), this.actions);
    history.replaceState(null, "", `#object=${id}`);
  }

  pickLandmark(landmark, focus = false) {
    this.clear(landmark.node);
    this.tabs.show("panel");
    if (focus) this.view.focusOn(landmark.node);
    showLandmark(panel, landmark, this.index.objects.filter((object) => object.landmark_id === landmark.id), this.actions);
  }

  async pickRoute(nav, focus = false) {
    const k = this.routes.row.get(nav), route = this.routes.at(k);
    this.clear(this.objects.get(route.target_object_id)?.mesh_node, nav);
    this.tabs.show("panel");
    const mine = this.selection, detail = await json(`api/routes/${nav}`);
    if (mine !== this.selection) return;
    this.picture = { route, detail };
    this.flight = new Flight(detail.poses, { show: (pose, at) => this.flown(pose, at), state: (playing) => this.playing(playing) });
    this.routes.fade(true);
    const colours = detail.way.slice(1).map((_, i) => clearanceColour(Math.min(detail.clearance_m[i], detail.clearance_m[i + 1])));
    this.view.addRoutes("selected", [{ id: nav, points: detail.way.flat(), colour: colours }],
      { width: 6, opacity: 1, onTop: true, pickable: false });
    const ends = { start: detail.poses[0], goal: detail.poses.at(-1) };
    this.view.addMarkers("ends", [["start", START], ["goal", GOAL]].map(([label, colour]) => (
      { id: label, position: ends[label].slice(0, 3), colour, label })), { size: 15, pickable: false });
    showRoute(panel, route, detail, this.actions);
    if (focus) this.view.focusOn(detail.way);
    this.flight.now();
    history.replaceState(null, "", `#route=${nav}`);
  }

  get actions() {
    return {
      object: (id) => this.pickObject(id, true),
      route: (nav) => this.settle(this.pickRoute(nav, true)),
      only: (id) => this.showRoutes(id),
      list: (id) => { this.showRoutes(id); this.tabs.show("list"); },
      ride: () => this.ride(!this.riding),
      whole: () => { this.ride(false); this.view.focusOn(this.picture.detail.way); },
      step: (k) => { this.flight.pause(); this.flight.seek(k); },
      play: () => this.flight.toggle(),
      speed: (speed) => { this.flight.speed = speed; },
    };
  }

  showRoutes(target) {
    $("target").value = String(target);
    document.querySelector("[data-layer=routes]").checked = true;
    this.setLayer("routes", true);
  }

  /** All routes with these words, as a list. */
  listRoutes(wish) {
    $("target").value = "";
    this.list.find.value = wish.join(" ");
    this.routes.words = wish;
    this.tabs.show("list");
    this.settle(this.routes.draw());
  }

  // ---- flying along ----

  flown([x, y, z, yaw], k) {
    $("pose").textContent = k;
    $("step").value = k;
    $("doing").textContent = `${this.picture.detail.actions[k]} at ${number(x, 2)}, ${number(y, 2)}, ${number(z, 2)} m`;
    const ahead = [x + 1.5 * Math.cos(yaw), y + 1.5 * Math.sin(yaw), z];
    this.view.addRoutes("drone", [{ points: [x, y, z, ...ahead], colour: "#ffffff" }], { width: 4, onTop: true, pickable: false });
    this.view.setVisible("drone", !this.riding);
    if (this.riding) this.view.controls.lookFrom([x, y, z], ahead);
  }

  playing(on) {
    $("play").textContent = on ? "Pause" : "Play";
    // What changes several times a second is not to be read out.
    panel.setAttribute("aria-live", on ? "off" : "polite");
  }

  ride(on) {
    this.riding = on;
    $("ride").setAttribute("aria-pressed", on);
    // The drone's own cameras have a field of view of 90 degrees.
    this.view.setFieldOfView(on ? 90 : undefined);
    for (const layer of ["selected", "ends", "frame"]) this.view.setVisible(layer, !on);
    for (const box of document.querySelectorAll("[data-layer]")) {
      if (box.checked) this.view.setVisible(box.dataset.layer, !on);
      if (box.checked && box.dataset.layer === "anchors") this.view.setVisible("looks", !on);
    }
    this.flight.now();
  }

  // ---- the cursor ----

  tooltip(hit, event) {
    const element = $("tooltip");
    element.hidden = !hit;
    if (!hit) return;
    const node = hit.kind === "node" ? hit.node : null;
    element.textContent = hit.kind === "route" ? this.routes.line(this.routes.row.get(hit.id))
      : hit.layer === "objects" ? this.objects.get(hit.id).name
        : hit.layer === "landmarks" ? hit.item.label
          : hit.layer === "anchors" ? `anchor ${hit.item.anchor.anchor_id} of ${this.objects.get(hit.item.anchor.object_id)?.name ?? "?"}`
            : this.byNode.get(node)?.name ?? this.landmarkByNode.get(node)?.name ?? node;
    element.style.left = `${Math.min(event.clientX + 14, innerWidth - 310)}px`;
    element.style.top = `${event.clientY + 14}px`;
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
    const act = { orbit: () => this.mode("orbit"), fly: () => this.mode("fly"), home: () => view.home(), top: () => view.top() };
    for (const [id, press] of Object.entries(act)) $(id).addEventListener("click", press);
    const keys = { o: act.orbit, f: act.fly, h: act.home, t: act.top, Escape: () => this.letGo() };
    document.addEventListener("keydown", (event) => {
      if (event.target.matches("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "/") { event.preventDefault(); $("search").focus(); }
      else if (event.key === " " && this.flight && !event.target.matches("button")) { event.preventDefault(); this.flight.toggle(); }
      else keys[event.key]?.();
    });
    addSearch(this, $("search"), $("results"));
    view.onPick((hit) => this.settle(this.picked(hit)));
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
    if (what === "route" && this.routes.row.has(id)) return this.pickRoute(id, true);
    if (what === "object" && this.objects.has(Number(id))) return this.pickObject(Number(id), true);
    return welcome(panel);
  }
}

const busy = new Busy($("busy"));
try {
  const [view, index] = await Promise.all([SceneView.load($("scene"), "api/scene"), json("api/index")]);
  const page = new Page(view, index, busy);
  addCompass(view, view.overlay);
  page.fillIn();
  page.addPlaces();
  page.listen();
  await page.routes.draw();
  await page.fromAddress();
  window.page = page;
  document.body.dataset.ready = "yes";
} catch (error) {
  failure(panel, error);
  document.body.dataset.ready = "failed";
  throw error;
} finally {
  busy.hide();
}
