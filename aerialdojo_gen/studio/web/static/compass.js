// A compass and a scale bar over a SceneView; both follow the camera.
import * as THREE from "three";

const NS = "http://www.w3.org/2000/svg";
const draw = (name, attributes, parent, text) => {
  const element = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text) element.textContent = text;
  parent.append(element);
  return element;
};

/** Add them to an element over the view. */
export function addCompass(view, element) {
  const svg = draw("svg", { viewBox: "-50 -50 100 100", class: "scene-compass", role: "img" }, element);
  const title = draw("title", {}, svg, "Compass");
  draw("circle", { r: 46, class: "compass-disc" }, svg);
  const rose = draw("g", {}, svg);
  draw("path", { d: "M0 -26 L7 0 L-7 0 Z", class: "compass-north" }, rose);
  draw("path", { d: "M0 26 L7 0 L-7 0 Z", class: "compass-south" }, rose);
  const letters = [["N", 0], ["E", 90], ["S", 180], ["W", 270]].map(([letter, degrees]) =>
    [draw("text", { "text-anchor": "middle", "dominant-baseline": "central" }, svg, letter), degrees]);
  const scale = document.createElement("div");
  scale.className = "scene-scale";
  const bar = document.createElement("span"), text = document.createElement("span");
  scale.append(bar, text);
  element.append(scale);

  const ahead = new THREE.Vector3();
  view.onFrame(() => {
    view.camera.getWorldDirection(ahead);
    // Straight down, the picture's top tells the heading.
    if (Math.hypot(ahead.x, ahead.y) < 0.02) ahead.set(0, 1, 0).applyQuaternion(view.camera.quaternion);
    const heading = Math.atan2(ahead.x, ahead.y) * 180 / Math.PI;
    rose.setAttribute("transform", `rotate(${-heading})`);
    for (const [letter, degrees] of letters) {
      const angle = (degrees - heading) * Math.PI / 180;
      letter.setAttribute("x", 37 * Math.sin(angle));
      letter.setAttribute("y", -37 * Math.cos(angle));
    }
    title.textContent = `Looking ${Math.round((heading + 360) % 360)} degrees from north, clockwise`;
    const distance = view.camera.position.distanceTo(view.controls.orbit.target);
    const metre = view.height / (2 * distance * Math.tan(view.camera.fov * Math.PI / 360));
    const wish = 120 / metre, power = 10 ** Math.floor(Math.log10(wish));
    const length = power * [5, 2, 1].find((step) => step * power <= wish);
    bar.style.width = `${(length * metre).toFixed(1)}px`;
    text.textContent = `${length >= 1 ? length : length.toFixed(1)} m at the centre`;
  });
}
