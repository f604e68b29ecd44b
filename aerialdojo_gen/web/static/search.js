// The search box: landmarks and objects by name, category or node, routes by their id.
import { make, words } from "./dom.js";

const MOST = 10, LETTERS_OF_AN_ID = 4;

export function addSearch(page, input, list) {
  input.addEventListener("input", () => list.replaceChildren(...found(page, input.value.trim().toLowerCase())));
  input.addEventListener("keydown", (event) => {
    if (event.key === "Enter") list.querySelector("button")?.click();
    if (event.key === "Escape") {
      input.value = "";
      list.replaceChildren();
      page.view.canvas.focus();
      event.stopPropagation();
    }
  });
}

function found(page, wish) {
  if (!wish) return [];
  const { landmarks, objects, routes } = page.index;
  const fits = (...texts) => texts.some((text) => text.toLowerCase().includes(wish));
  const item = (name, note, act) =>
    make("li", {}, make("button", { onclick: act }, name, make("small", {}, ` ${note}`)));
  const items = [
    ...landmarks.filter((landmark) => fits(landmark.name, landmark.node))
      .map((landmark) => item(landmark.name, "landmark", () => page.pickLandmark(landmark, true))),
    ...objects.filter((object) => fits(object.name, words(object.category), object.mesh_node))
      .map((object) => item(object.name, words(object.category), () => page.pickObject(object.object_id, true))),
    // A task id is its route's id and a letter more.
    ...(wish.length < LETTERS_OF_AN_ID ? [] : routes.nav_id.filter((nav) => fits(nav) || wish.startsWith(nav.toLowerCase())))
      .slice(0, MOST).map((nav) => item(nav, "route", () => page.pickRoute(nav, true))),
  ];
  return items.length ? items.slice(0, MOST) : [make("li", { class: "soft" }, "nothing of that name")];
}
