// Small helpers to build pages. Text goes in as text, never as HTML: what people type cannot become markup.

/** Make an element: h("button", {class: "main", onclick}, "text", child, ...). */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (value === true) element.setAttribute(key, "");
    else if (value !== false && value != null) element.setAttribute(key, value);
  }
  element.append(...children.filter((child) => child != null && child !== false));
  return element;
}

const SVG = "http://www.w3.org/2000/svg";

/** A picture from a viewpoint with the object's box drawn over it. */
export function picture(viewpoint, [width, height], alt) {
  const [x, y, z] = viewpoint.position_m;
  const query = new URLSearchParams({ x, y, z, yaw_deg: viewpoint.yaw_deg });
  const frame = h("span", { class: "picture" }, h("img", { src: `/api/picture?${query}`, alt, width, height }));
  if (viewpoint.box_px) {
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const [u0, v0, u1, v1] = viewpoint.box_px;
    const rect = document.createElementNS(SVG, "rect");
    for (const [key, value] of Object.entries({ x: u0, y: v0, width: u1 - u0, height: v1 - v0 })) rect.setAttribute(key, value);
    svg.append(rect);
    frame.append(svg);
  }
  return frame;
}

/** Say something at the bottom of the page for a while. */
export function toast(text, wrong = false) {
  const box = h("div", { class: wrong ? "toast wrong" : "toast" }, text);
  const toasts = document.getElementById("toasts");
  toasts.append(box);
  while (toasts.children.length > 4) toasts.firstChild.remove();
  setTimeout(() => box.remove(), wrong ? 9000 : 5000);
}

export const byId = (id) => document.getElementById(id);
export const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

/** Ask the server; throws an Error that can be shown to a person. */
export async function ask(url, body = null, method = body ? "POST" : "GET") {
  let response, answer;
  try {
    response = await fetch(url, { method, ...(body && { headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) }) });
    answer = await response.json();
  } catch {
    throw new Error(response ? `the server answers ${response.status}` : "the server does not answer");
  }
  if (!response.ok) throw new Error(answer.error ?? `the server answers ${response.status}`);
  return answer;
}
