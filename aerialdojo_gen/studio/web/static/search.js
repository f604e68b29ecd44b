// The search box: landmarks and objects by words, routes by their id; the arrows lead into what is found.
import { hasWords, make, words } from "./dom.js";

const MOST = 12, LETTERS_OF_AN_ID = 4;

export function addSearch(page, input, list) {
  let at = 0;
  const items = () => [...list.querySelectorAll("[role=option]")];
  const point = (to) => {
    const all = items();
    at = all.length ? (to + all.length) % all.length : 0;
    all.forEach((item, k) => item.setAttribute("aria-selected", String(k === at)));
    if (all.length) {
      input.setAttribute("aria-activedescendant", all[at].id);
      all[at].scrollIntoView({ block: "nearest" });
    } else input.removeAttribute("aria-activedescendant");
    input.setAttribute("aria-expanded", String(all.length > 0));
  };
  const show = () => {
    const wish = input.value.toLowerCase().split(/\s+/).filter(Boolean), hits = wish.length ? found(page, wish) : [];
    list.replaceChildren(...hits.slice(0, MOST).map(({ name, note, act }, k) => make("li",
      { role: "option", id: `found-${k}`, "aria-selected": "false", onclick: act, onpointerdown: (event) => event.preventDefault() },
      name, make("small", {}, ` ${note}`))));
    const count = !wish.length ? "" : !hits.length ? "nothing with these words" : hits.length > MOST ? `the first ${MOST} of ${hits.length.toLocaleString("en")}` : "";
    document.getElementById("search-count").textContent = count;
    point(0);
  };
  input.addEventListener("input", show);
  input.addEventListener("keydown", (event) => {
    const to = { ArrowDown: at + 1, ArrowUp: at - 1 }[event.key];
    if (to !== undefined) {
      event.preventDefault();
      point(to);
    } else if (event.key === "Enter") items()[at]?.click();
    else if (event.key === "Escape") {
      input.value = "";
      show();
      page.view.canvas.focus();
      event.stopPropagation();
    }
  });
}

/** Things of which every word begins one, those of whose name it does first. */
function found(page, wish) {
  const { landmarks, objects, routes } = page.index, hits = [];
  const add = (name, rest, note, act) => {
    if (!hasWords(`${name} ${rest}`, wish)) return;
    hits.push({ name, note, act, rank: wish.filter((word) => !hasWords(name, [word])).length });
  };
  for (const mark of landmarks) add(mark.name, mark.node, "landmark", () => page.pickLandmark(mark, true));
  for (const object of objects) {
    add(object.name, `${words(object.category)} ${object.mesh_node} ${object.direction} ${object.landmark} ${object.description}`,
      `${object.direction} of the ${object.landmark}`, () => page.pickObject(object.object_id, true));
  }
  hits.sort((a, b) => a.rank - b.rank || a.name.localeCompare(b.name));
  if (wish.length === 1 && wish[0].length >= LETTERS_OF_AN_ID) {
    // A task id is its route's id and a letter more.
    const id = wish[0].replace(/-[si]$/, "");
    for (const nav of routes.nav_id) if (nav.toLowerCase().includes(id)) hits.push({ name: nav, note: "route", act: () => page.pickRoute(nav, true) });
  }
  const through = page.routes.count(wish);
  if (through) {
    hits.splice(MOST - 1, 0, { name: `${through.toLocaleString("en")} routes`, note: "with these words, as a list", act: () => page.listRoutes(wish) });
  }
  return hits;
}
