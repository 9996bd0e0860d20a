// Pointing at a source line marks the line's instructions; pointing at an instruction marks its source line.
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
  // Keeps a line marked when the mouse pointer leaves. In the pane of `row`, the next arrow key starts at `row`; in the
  // other pane, the next arrow key starts at the line's first row.
  const keep = (line, row) => {
    pinned = line;
    mark(line);
    for (const pane of all(".pane", view)) {
      const inPane = (one) => one?.closest(".pane") === pane;
      const now = inPane(row) ? row : rows.get(line)?.find(inPane);
      if (!now) continue;
      all(".now", pane).forEach((one) => one.classList.remove("now"));
      now.classList.add("now");
      if (now !== row) reveal(now);
    }
  };
  for (const pane of all(".pane", view)) {
    const row = (event) => event.target.closest("[data-line]");
    pane.addEventListener("pointerover", (event) => mark(row(event)?.dataset.line ?? pinned));
    pane.addEventListener("pointerleave", () => mark(pinned));
    pane.addEventListener("click", (event) => {
      const at = row(event), line = at?.dataset.line ?? null;
      keep(line === pinned ? null : line, at);
    });
    // Arrow keys go to the next row that belongs to another source line.
    pane.addEventListener("keydown", (event) => {
      const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
      if (!step) return;
      const own = all("[data-line]", pane), now = own.findIndex((row) => row.classList.contains("now"));
      let next = now + (now < 0 ? Math.max(step, 0) : step);
      while (own[next] && own[now] && own[next].dataset.line === own[now].dataset.line) next += step;
      if (!own[next]) return;
      event.preventDefault();
      keep(own[next].dataset.line, own[next]);
      reveal(own[next]);
    });
  }
}
