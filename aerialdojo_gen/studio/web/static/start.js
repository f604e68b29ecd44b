// The start page of `aerialdojo-gen view`: scenes with their pictures, tasks with their goals.
import { Busy, make, number, words } from "./dom.js";
import { LazyPictures } from "./lazy.js";

const PAGE = 48, TYPING_MS = 250;
const $ = (id) => document.getElementById(id);
const count = (n) => n.toLocaleString("en");
const busy = new Busy($("busy"));

async function json(url) {
  const response = await fetch(url);
  const body = await response.json();
  if (!response.ok) throw new Error(body.error ?? `${url}: ${response.status}`);
  return body;
}

const rendered = new LazyPictures();

/** A picture, or in words that there is none. */
function picture(attributes) {
  const image = make("img", { class: "picture", ...attributes });
  image.addEventListener("error", () => image.replaceWith(make("div", { class: "picture none" }, "no picture")));
  return image;
}

function scenePicture(scene) {
  const image = picture({ "data-src": `/scenes/${scene}/picture`, alt: "", width: 480, height: 300 });
  rendered.add(image);
  return image;
}

function sceneCard(scene) {
  return make("li", { "data-scene": scene.scene },
    make("a", { href: `/scenes/${scene.scene}/` }, scenePicture(scene.scene),
      make("div", { class: "text" }, make("strong", {}, scene.scene),
        make("small", {}, `${scene.family} · ${scene.scene_type} · ${scene.partition}`),
        make("small", {}, `${scene.n_objects} objects · ${count(scene.n_routes)} routes`))),
    make("button", { onclick: () => choose(scene.scene), "aria-label": `Tasks here: ${scene.scene}` }, "Tasks here"));
}

function taskCard(task) {
  return make("li", { "data-nav": task.nav_id },
    make("a", { href: `/scenes/${task.scene}/#route=${task.nav_id}`, title: task.description },
      picture({ src: `/scenes/${task.scene}/api/objects/${task.object_id}/thumb`, alt: `Goal: ${task.name}`, loading: "lazy" }),
      make("div", { class: "text" }, make("strong", {}, task.name),
        make("small", {}, `${task.direction} of the ${task.landmark}`),
        make("small", {}, make("span", { class: `chip ${task.setting}` }), `${words(task.setting)} · ${number(task.length_m)} m`),
        make("small", {}, `${task.scene} · ${task.split}`))));
}

function choose(scene) {
  $("scene").value = scene;
  tasks();
  $("tasks-title").scrollIntoView({ block: "start" });
}

function family(name, release) {
  for (const button of $("families").children) button.setAttribute("aria-pressed", String(button.dataset.family === name));
  const shown = release.scenes.filter((scene) => !name || scene.family === name);
  $("scenes").replaceChildren(...shown.map(sceneCard));
  $("n-scenes").textContent = shown.length === release.scenes.length ? count(shown.length) : `${shown.length} of ${release.scenes.length}`;
}

let asked = 0;

/** Show the tasks that the filters leave, or the next of them. */
async function tasks(offset = 0) {
  const mine = ++asked, order = $("order").value;
  const query = new URLSearchParams({ setting: $("setting").value, split: $("split").value, words: $("words").value,
    order: order.replace("-", ""), descending: order.startsWith("-"), offset, most: PAGE });
  if ($("scene").value) query.append("scene", $("scene").value);
  busy.show("Reading tasks …");
  try {
    const { total, tasks: found } = await json(`/api/tasks?${query}`);
    if (mine !== asked) return;
    if (!offset) $("tasks").replaceChildren();
    $("wrong").textContent = "";
    $("tasks").append(...found.map(taskCard));
    $("n-tasks").textContent = count(total);
    $("more").hidden = offset + found.length >= total;
  } catch (error) {
    if (mine === asked) $("wrong").textContent = String(error.message);
  } finally {
    if (mine === asked) busy.hide();
  }
}

function listen() {
  let waiting = 0;
  $("words").addEventListener("input", () => { clearTimeout(waiting); waiting = setTimeout(() => tasks(), TYPING_MS); });
  for (const id of ["scene", "setting", "split", "order"]) $(id).addEventListener("change", () => tasks());
  $("filters").addEventListener("submit", (event) => { event.preventDefault(); tasks(); });
  $("more").addEventListener("click", () => tasks($("tasks").children.length));
}

try {
  const release = await json("/api/release");
  const routes = release.scenes.reduce((sum, scene) => sum + scene.n_routes, 0);
  $("about").textContent = `${release.data} · ${count(release.scenes.length)} scenes · ${count(routes)} routes, each to be found by its words and by its picture`;
  const families = ["", ...new Set(release.scenes.map((scene) => scene.family))];
  $("families").append(...families.map((name) => make("button", { "data-family": name, onclick: () => family(name, release) }, name || "All families")));
  $("setting").append(...release.settings.map((setting) => make("option", { value: setting }, words(setting))));
  $("scene").append(...release.scenes.map(({ scene }) => make("option", { value: scene }, scene)));
  family("", release);
  listen();
  await tasks();
  document.body.dataset.ready = "yes";
} catch (error) {
  $("about").replaceChildren(make("span", { class: "error", role: "alert" }, String(error.message)));
  document.body.dataset.ready = "failed";
  throw error;
}
