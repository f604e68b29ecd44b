"use strict";
// Moves the drones along their paths; without it the page shows all paths whole.
for (const article of document.querySelectorAll(".replay")) {
  const { flights } = JSON.parse(article.querySelector('script[type="application/json"]').textContent);
  const slider = article.querySelector("input");
  const drones = article.querySelectorAll(".drone");
  const readouts = article.querySelectorAll(".readout");
  const panels = article.querySelectorAll(".flight");
  const most = Number(slider.max);
  const show = () => {
    const step = Number(slider.value);
    article.querySelector("output").value = step;
    const x = most ? (400 * step) / most : 0;
    article.querySelector(".now").setAttribute("d", `M ${x} 0 V 90`);
    flights.forEach((flight, i) => {
      const k = Math.min(step, flight.said.length - 1);
      const turn = (-180 / Math.PI) * flight.yaw[k];
      drones[i].setAttribute("transform", `translate(${flight.x[k]} ${-flight.y[k]}) rotate(${turn})`);
      const ended = step > k ? "ended: " : "";
      const words = flight.answers[k] ? ` — ${flight.answers[k]}` : "";
      readouts[i].textContent =
        `${ended}${flight.said[k]}; ${flight.d[k].toFixed(1)} m to the goal, ${flight.z[k].toFixed(1)} m high${words}`;
      const frame = panels[i].querySelector(".frame");
      if (frame) {
        const nearest = Math.max(...Object.keys(flight.frames).map(Number).filter((n) => n <= k));
        frame.src = flight.frames[nearest];
      }
    });
  };
  slider.addEventListener("input", show);
  show();
}
