// A table that any column sorts. A column: title, value(row), and what is shown of it; text to the left.
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
        : column.title,
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

const figure = (title, name, shown, about, down) => ({
  title,
  about,
  down,
  value: (row) => row[name],
  show: (row) => shown(row[name]),
});
const skills = [
  ["mean_pose", "mean pose"],
  ["persistence", "first pose held"],
  ["nearest", "nearest training pose"],
];
const skillColumns = skills.map(([name, title]) =>
  figure(`skill, ${title}`, `skill_${name}`, (value) => number(value, 2), `1 − error / error of the ${title}`, true),
);

function leaderboard() {
  const shown = D.leaderboard.map((row) => ({ ...row, interval: given(row.low) ? row.high - row.low : null }));
  const bases = D.baselines.map((row) => ({
    ...row,
    name: `baseline: ${skills.find((one) => one[0] === row.baseline)[1]}`,
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
          row.base ? row.name : [row.name, make("small", {}, D.methods[row.method].settings || "default settings")],
      },
      figure("error °", "error", (value) => number(value, 2), "Mean over a track's frames and 66 angles"),
      {
        title: "95 % interval",
        about: "Sorts by its width",
        value: (row) => row.interval,
        show: (row) => {
          if (row.base) return "";
          return given(row.low) ? `${number(row.low, 2)} – ${number(row.high, 2)}` : "one seed";
        },
      },
      ...skillColumns,
      figure("lost %", "lost", percent, "Frames with an MPJPE above 150 mm"),
      figure("swapped %", "swapped", percent, "Frames nearer to the truth when mirrored"),
      figure("MPJPE mm", "mpjpe", (value) => number(value, 0)),
      figure("IoU", "iou", (value) => number(value, 3), null, true),
      figure("ms a frame", "ms", (value) => number(value, 1)),
      figure("evaluations a frame", "evaluations", (value) => (given(value) ? whole(value) : "–")),
      figure("runs", "runs", (value) => (given(value) ? whole(value) : ""), null, true),
      {
        title: "failed",
        value: (row) => row.failed,
        show: (row) => (row.base ? "" : make("span", { class: row.failed ? "bad" : null }, String(row.failed))),
      },
    ],
    [...shown, ...bases],
    { by: 1, name: "Leaderboard", kind: (row) => (row.base ? "base" : null) },
  );
}

function allRows() {
  const R = D.rows;
  const method = $("of-method").value;
  const instance = $("of-instance").value;
  const rows = range(R.key.length).filter(
    (k) => (method === "" || R.method[k] === +method) && (instance === "" || R.instance[k] === +instance),
  );
  const column = (title, name, shown, down) => ({
    title,
    down,
    value: (k) => R[name][k],
    show: (k) => shown(R[name][k]),
  });
  table(
    $("all-rows"),
    [
      { title: "", text: true, show: (k) => [...watch(k), again(k)] },
      { title: "method", text: true, value: (k) => R.method[k], show: (k) => METHODS[R.method[k]] },
      {
        title: "settings",
        text: true,
        value: (k) => D.methods[R.method[k]].settings,
        show: (k) => D.methods[R.method[k]].settings || "default",
      },
      { title: "instance", text: true, value: (k) => R.instance[k], show: (k) => INSTANCES[R.instance[k]] },
      column("seed", "seed", (seed) => String(D.seeds[seed])),
      column("error °", "error", (value) => number(value, 2)),
      ...skills.map(([name, title]) => column(`skill, ${title}`, `skill_${name}`, (value) => number(value, 2), true)),
      column("lost %", "lost", percent),
      column("swapped %", "swapped", percent),
      column("MPJPE mm", "mpjpe", (value) => number(value, 0)),
      column("IoU", "iou", (value) => number(value, 3), true),
      column("ms a frame", "ms", (value) => number(value, 1)),
      column("evaluations a frame", "evaluations", (value) => (given(value) ? whole(value) : "–")),
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
        title: "",
        text: true,
        show: (row) =>
          make("button", { type: "button", on: { click: () => showCommand(row.name, row.command) } }, "command"),
      },
    ],
    D.failures,
    { name: "Failures" },
  );
}
