// A table that any column sorts. A column: title, or one for readers of screens alone, value(row), and what is shown of
// it; text to the left.
const PAGE = 50;

function table(box, columns, rows, how) {
  let by = how.by;
  let down = how.down || false;
  let first = 0;
  const body = make("tbody");
  const heads = columns.map((column, k) =>
    make(
      "th",
      { scope: "col", class: column.text ? "text" : null },
      column.value
        ? make("button", { type: "button", title: column.about, on: { click: () => sort(k) } }, column.title)
        : (column.title ?? make("span", { class: "unseen" }, column.unseen)),
    ),
  );
  const pager = make("div", { class: "row pager" });

  function sort(k) {
    down = by === k ? !down : Boolean(columns[k].down);
    by = k;
    first = 0;
    show();
  }

  function ordered() {
    if (!given(by)) return rows;
    const value = columns[by].value;
    const sign = down ? -1 : 1;
    return rows
      .map((row) => [value(row), row])
      .sort(([a], [b]) =>
        !given(a) ? (given(b) ? 1 : 0) : !given(b) ? -1 : sign * (typeof a === "string" ? a.localeCompare(b) : a - b),
      )
      .map((pair) => pair[1]);
  }

  function show() {
    heads.forEach((head, k) => {
      if (columns[k].value) head.setAttribute("aria-sort", k === by ? (down ? "descending" : "ascending") : "none");
    });
    body.replaceChildren(
      ...ordered()
        .slice(first, first + PAGE)
        .map((row) =>
          make(
            "tr",
            { class: how.kind ? how.kind(row) : null },
            ...columns.map((column) => {
              const shown = column.show(row);
              return make(
                "td",
                { class: column.text ? "text" : null, title: column.text && typeof shown === "string" ? shown : null },
                ...[shown].flat(),
              );
            }),
          ),
        ),
    );
    const leaf = (count) => {
      first += count;
      show();
    };
    pager.replaceChildren(
      make("button", { type: "button", disabled: first === 0, on: { click: () => leaf(-PAGE) } }, "earlier"),
      make(
        "span",
        {},
        rows.length
          ? `${whole(first + 1)} to ${whole(Math.min(first + PAGE, rows.length))} of ${whole(rows.length)}`
          : "none",
      ),
      make(
        "button",
        { type: "button", disabled: first + PAGE >= rows.length, on: { click: () => leaf(PAGE) } },
        "later",
      ),
    );
  }

  box.replaceChildren(
    make(
      "div",
      { class: "scroll", tabindex: 0, role: "region", "aria-label": how.name },
      make("table", {}, make("thead", {}, make("tr", {}, ...heads)), body),
    ),
  );
  if (rows.length > PAGE) box.append(pager);
  show();
}

// A column of a figure: its title and, where it is pointed at, its meaning; `of` gives the figure of a row.
const figure = (name, of) => ({
  ...D.columns[name],
  value: of,
  show: (row) => shownAs(name, of(row)),
});
const FIGURES = Object.keys(D.columns);

function leaderboard() {
  const warned = METHODS.map(() => 0);
  for (const row of Object.keys(D.warned)) warned[D.rows.method[row]] += 1;
  const shown = D.leaderboard.map((row) => ({
    ...row,
    interval: given(row.low) ? row.high - row.low : null,
    warned: warned[row.method],
  }));
  const bases = D.baselines.map((row) => ({
    ...row,
    name: `baseline: ${D.trivial[row.baseline]}`,
    base: true,
  }));
  table(
    $("leaders"),
    [
      {
        title: "method",
        text: true,
        value: (row) => row.name,
        show: (row) =>
          row.base
            ? row.name
            : [swatch(row.method), row.name, make("small", {}, D.methods[row.method].settings || "default settings")],
      },
      figure("error", (row) => row.error),
      {
        title: "95 % interval",
        about: "Sorts by its width",
        value: (row) => row.interval,
        show: (row) => {
          if (row.base) return "";
          return given(row.low) ? `${number(row.low, 2)} – ${number(row.high, 2)}` : "one seed";
        },
      },
      {
        title: "alike",
        text: true,
        about: "Methods that share a letter are not told apart: Wilcoxon's signed ranks, Holm, 5 %",
        value: (row) => (row.base ? "" : row.letters),
        show: (row) => (row.base ? "" : row.letters),
      },
      ...FIGURES.slice(1).map((name) => figure(name, (row) => row[name])),
      {
        title: "runs",
        down: true,
        value: (row) => row.runs,
        show: (row) => (given(row.runs) ? whole(row.runs) : ""),
      },
      {
        title: "failed",
        value: (row) => row.failed,
        show: (row) => (row.base ? "" : make("span", { class: row.failed ? "bad" : null }, String(row.failed))),
      },
      ...(D.warnings.length
        ? [
            {
              title: "warned",
              about: "Runs with a warning",
              value: (row) => row.warned,
              show: (row) => (row.base ? "" : make("span", { class: row.warned ? "bad" : null }, String(row.warned))),
            },
          ]
        : []),
    ],
    [...shown, ...bases],
    { by: 1, name: "Leaderboard", kind: (row) => (row.base ? "base" : null) },
  );
}

// The mark of a row with warnings, which says them.
const warning = (row) => {
  const said = D.warned[row].map((k) => D.warnings[k]).join("; ");
  return make("span", { class: "bad", role: "img", title: said, "aria-label": `warning: ${said}` }, " ⚠");
};

function allRows() {
  const R = D.rows;
  const method = $("of-method").value;
  const instance = $("of-instance").value;
  const rows = range(R.key.length).filter(
    (k) => (method === "" || R.method[k] === +method) && (instance === "" || R.instance[k] === +instance),
  );
  table(
    $("all-rows"),
    [
      { unseen: "watch, or run again", text: true, show: (k) => [...watch(k), again(k)] },
      {
        title: "method",
        text: true,
        value: (k) => R.method[k],
        show: (k) => [METHODS[R.method[k]], ...(D.warned[k] ? [warning(k)] : [])],
      },
      {
        title: "settings",
        text: true,
        value: (k) => D.methods[R.method[k]].settings,
        show: (k) => D.methods[R.method[k]].settings || "default",
      },
      { title: "instance", text: true, value: (k) => R.instance[k], show: (k) => INSTANCES[R.instance[k]] },
      { title: "seed", value: (k) => R.seed[k], show: (k) => String(D.seeds[R.seed[k]]) },
      ...FIGURES.map((name) => figure(name, (k) => R[name][k])),
      { title: "key", text: true, value: (k) => R.key[k], show: (k) => R.key[k] },
    ],
    rows,
    { by: 5, name: "All runs" },
  );
}

function failures() {
  if (!D.failures.length) {
    $("failures").remove();
    $("to-failures").remove();
    return;
  }
  table(
    $("lost"),
    [
      { title: "cell", text: true, value: (row) => row.name, show: (row) => row.name },
      {
        title: "why its attempts failed",
        text: true,
        value: (row) => row.reasons.join("; "),
        show: (row) => row.reasons.join("; "),
      },
      {
        unseen: "run again",
        text: true,
        show: (row) =>
          make("button", { type: "button", on: { click: () => showCommand(row.name, row.command) } }, "command"),
      },
    ],
    D.failures,
    { name: "Failures" },
  );
}
