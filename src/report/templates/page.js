// Makes the page interactive: tooltips, switches, sorting, enlarged pictures. All data are in the page's HTML elements.
"use strict";
const all = (selector, root = document) => [...root.querySelectorAll(selector)];
const tip = document.getElementById("tip");

function showTip(mark) {
  all(".mark.lit").forEach((other) => other.classList.remove("lit"));
  if (!mark) { tip.hidden = true; return; }
  mark.classList.add("lit");
  tip.textContent = mark.dataset.tip;
  tip.hidden = false;
  const at = mark.getBoundingClientRect(), own = tip.getBoundingClientRect();
  const left = Math.min(Math.max(8, at.left + Math.min(at.width, 400) / 2 - own.width / 2), innerWidth - own.width - 8);
  const above = at.top - own.height - 8;
  tip.style.left = left + "px";
  tip.style.top = (above > 4 ? above : at.bottom + 8) + "px";
}
const pointed = (event) => event.target.closest?.("[data-tip]");
document.addEventListener("pointerover", (event) => showTip(pointed(event)));
document.addEventListener("click", (event) => showTip(pointed(event)));
document.addEventListener("scroll", () => showTip(null), { passive: true, capture: true });
document.addEventListener("keydown", (event) => { if (event.key === "Escape") showTip(null); });

// In a focused plot, an arrow key goes to the nearest mark in the key's direction on the screen.
function step(chart, key) {
  const marks = all(".mark", chart).filter((mark) => mark.getClientRects().length);
  if (!marks.length) return;
  const centre = (mark) => { const r = mark.getBoundingClientRect(); return [r.left + r.width / 2, r.top + r.height / 2]; };
  const lit = marks.find((mark) => mark.classList.contains("lit"));
  if (!lit) return showTip(marks[0]);
  const [x, y] = centre(lit), across = key === "ArrowLeft" || key === "ArrowRight", sign = key === "ArrowLeft" || key === "ArrowUp" ? -1 : 1;
  const cost = (mark) => {
    const [a, b] = centre(mark), along = sign * (across ? a - x : b - y), aside = Math.abs(across ? b - y : a - x);
    return mark !== lit && along > 0.5 ? along + 2 * aside : Infinity;
  };
  const best = marks.reduce((one, other) => (cost(other) < cost(one) ? other : one));
  if (cost(best) < Infinity) showTip(best);
}
for (const chart of all("svg.chart")) {
  chart.setAttribute("role", "group");
  chart.addEventListener("keydown", (event) => {
    if (event.target === chart && event.key.startsWith("Arrow")) { event.preventDefault(); step(chart, event.key); }
  });
  chart.addEventListener("blur", () => showTip(null));
}

// Legends: pointing at an entry highlights the entry's series; a click on the entry hides or shows the series.
for (const entry of all(".entry")) {
  const chart = entry.closest("svg"), series = all(`.series[data-series="${entry.dataset.for}"]`, chart);
  if (!series.length) continue;
  const set = (name, value) => entry.setAttribute(name, value);
  set("role", "button"); set("tabindex", "0"); set("aria-pressed", "true"); set("aria-label", entry.dataset.tip);
  const light = (on) => { chart.classList.toggle("focus", on); series.forEach((one) => one.classList.toggle("lit", on)); };
  const flip = () => {
    const off = entry.getAttribute("aria-pressed") === "true";
    series.forEach((one) => one.classList.toggle("off", off));
    set("aria-pressed", String(!off));
  };
  entry.addEventListener("pointerenter", () => light(true));
  entry.addEventListener("pointerleave", () => light(false));
  entry.addEventListener("focus", () => light(true));
  entry.addEventListener("blur", () => light(false));
  entry.addEventListener("click", flip);
  entry.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); flip(); } });
}

// Shows the plots and the table of one group at a time.
const pick = document.getElementById("pick");
const show = (id) => all(".view").forEach((view) => { view.hidden = view.id !== id; });
if (pick) { pick.addEventListener("change", () => show(pick.value)); show(pick.value); }
for (const button of all("[data-scale]")) button.addEventListener("click", () => {
  document.body.classList.toggle("linear-scale", button.dataset.scale === "linear");
  all("[data-scale]").forEach((other) => other.setAttribute("aria-pressed", String(other === button)));
});

// Tables: a click on a heading sorts the rows; empty cells come last and, in a column of numbers, so do cells without a
// number. A filter shows only the rows that contain all of the filter's words.
const value = (cell) => { const text = cell.dataset.v ?? cell.textContent.trim(), number = parseFloat(text); return cell.classList.contains("num") ? (Number.isNaN(number) ? null : number) : text || null; };
function sort(head, table) {
  const up = head.getAttribute("aria-sort") !== "ascending", index = [...head.parentElement.children].indexOf(head), body = table.tBodies[0];
  const keyed = [...body.rows].map((row) => [value(row.cells[index]), row]);
  keyed.sort(([a], [b]) => {
    if (a === null || b === null) return (a === null) - (b === null);
    const order = typeof a === "number" ? a - b : a.localeCompare(b, "en", { numeric: true });
    return up ? order : -order;
  });
  body.append(...keyed.map(([, row]) => row));
  all("th", table).forEach((other) => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", up ? "ascending" : "descending");
}
for (const table of all(".data table, table.sorted")) for (const head of all("thead th", table)) {
  const button = document.createElement("button");
  button.type = "button";
  button.append(...head.childNodes);
  head.append(button);
  button.addEventListener("click", () => sort(head, table));
}
for (const input of all(".filter input")) input.addEventListener("input", () => {
  const words = input.value.toLowerCase().split(/[\s,]+/).filter(Boolean);
  for (const row of all("tbody tr", input.closest(".data"))) {
    const text = row.textContent.toLowerCase();
    row.hidden = !words.every((word) => text.includes(word));
  }
});

// Pictures: a click enlarges a picture; then, arrow keys show the previous or the next picture.
const box = document.getElementById("lightbox"), pictures = all(".enlarge");
let current = 0;
function enlarge(index) {
  current = (index + pictures.length) % pictures.length;
  const from = pictures[current].querySelector("img"), to = box.querySelector("img");
  to.src = from.src; to.alt = from.alt;
  box.querySelector("figcaption").textContent = from.alt;
  if (!box.open) box.showModal();
}
pictures.forEach((button, index) => button.addEventListener("click", () => enlarge(index)));
all("[data-step]", box).forEach((button) => button.addEventListener("click", () => enlarge(current + Number(button.dataset.step))));
box.addEventListener("keydown", (event) => { if (event.key === "ArrowLeft") enlarge(current - 1); if (event.key === "ArrowRight") enlarge(current + 1); });
box.addEventListener("click", (event) => { if (event.target === box) box.close(); });

for (const button of all(".copy")) button.addEventListener("click", async () => {
  const code = button.previousElementSibling;
  try { await navigator.clipboard.writeText(code.textContent); button.textContent = "Copied"; }
  catch { getSelection().selectAllChildren(code); button.textContent = "Selected"; }
});

const theme = document.getElementById("theme");
theme.addEventListener("click", () => {
  const dark = document.documentElement.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  document.documentElement.dataset.theme = dark === "dark" ? "light" : "dark";
});
