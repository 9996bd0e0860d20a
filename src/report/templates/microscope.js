// Pointing at a line marks its instructions; pointing at an instruction marks its line.
for (const view of all(".microscope")) {
  const rows = new Map();
  for (const row of all("[data-line]", view)) {
    const line = row.dataset.line;
    if (!rows.has(line)) rows.set(line, []);
    rows.get(line).push(row);
  }
  let pinned = null;
  const mark = (line) => {
    all(".same", view).forEach((row) => row.classList.remove("same"));
    (rows.get(line) ?? []).forEach((row) => row.classList.add("same"));
  };
  const reveal = (row) => {
    const pane = row.closest(".pane"), top = row.offsetTop - pane.scrollTop;
    if (top < 0 || top > pane.clientHeight - row.offsetHeight) pane.scrollTop = row.offsetTop - pane.clientHeight / 3;
  };
  const keep = (line, from) => {
    pinned = line;
    mark(line);
    for (const pane of all(".pane", view)) {
      const first = pane !== from && rows.get(line)?.find((row) => row.closest(".pane") === pane);
      if (first) reveal(first);
    }
  };
  for (const pane of all(".pane", view)) {
    const line = (event) => event.target.closest("[data-line]")?.dataset.line ?? null;
    pane.addEventListener("pointerover", (event) => mark(line(event) ?? pinned));
    pane.addEventListener("pointerleave", () => mark(pinned));
    pane.addEventListener("click", (event) => { const at = line(event); keep(at === pinned ? null : at, pane); });
    // Arrow keys go to the next row that belongs to another line.
    pane.addEventListener("keydown", (event) => {
      const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
      if (!step) return;
      const own = all("[data-line]", pane), now = own.findIndex((row) => row.classList.contains("now"));
      let next = now + (now < 0 ? Math.max(step, 0) : step);
      while (own[next] && own[now] && own[next].dataset.line === own[now].dataset.line) next += step;
      if (!own[next]) return;
      event.preventDefault();
      own[now]?.classList.remove("now");
      own[next].classList.add("now");
      keep(own[next].dataset.line, null);
      reveal(own[next]);
    });
  }
}
