// Small helpers to build pages. Text goes in as text, never as HTML: what people type cannot become markup.

import { make as h } from "/static/dom.js";

export { h };

/** A picture from a viewpoint with the object's box drawn over it. */
export function picture(viewpoint, [width, height], alt) {
  const [x, y, z] = viewpoint.position_m;
  const query = new URLSearchParams({ x, y, z, yaw_deg: viewpoint.yaw_deg });
  const frame = h("span", { class: "picture" }, h("img", { src: `/api/picture?${query}`, alt, width, height }));
  if (viewpoint.box_px) {
    const [u0, v0, u1, v1] = viewpoint.box_px;
    const box = h("rect", { x: u0, y: v0, width: u1 - u0, height: v1 - v0 });
    frame.append(h("svg", { viewBox: `0 0 ${width} ${height}` }, box));
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
