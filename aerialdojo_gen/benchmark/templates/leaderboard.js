"use strict";
// Sorts a table by the column whose head is clicked; without it the rows stand by success rate.
for (const table of document.querySelectorAll(".board")) {
  const heads = [...table.querySelectorAll("thead tr:last-child th")];
  const body = table.tBodies[0];
  heads.forEach((head, k) => head.querySelector("button").addEventListener("click", () => {
    const words = k === 0;
    const before = head.getAttribute("aria-sort");
    // Arrows in the head point to the better, which comes first.
    const first = words || head.textContent.includes("↓") ? "ascending" : "descending";
    const order = before === null ? first : before === "ascending" ? "descending" : "ascending";
    const sign = order === "ascending" ? 1 : -1;
    const valueOf = (row) => (words ? row.cells[k].textContent : row.cells[k].dataset.value);
    const compare = (a, b) => {
      const [x, y] = [valueOf(a), valueOf(b)];
      if (x === "" || y === "") return (x === "") - (y === "");  // unknown goes last
      return sign * (words ? x.localeCompare(y) : Number(x) - Number(y));
    };
    body.append(...[...body.rows].sort(compare));
    for (const other of heads) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", order);
  }));
}
const paper = document.getElementById("paper");
paper.addEventListener("change", () => {
  for (const table of document.querySelectorAll(".board")) table.classList.toggle("no-paper", !paper.checked);
});
