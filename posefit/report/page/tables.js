// Tables that any column sorts; leaderboard, all runs, running times, failures; the command that runs a cell again.
const PAGE = 25; // rows
const FEW = ["error", "lost", "ms"]; // figures of a run that need no button

// A column: its title, or one for screen readers alone, `of` to sort by, and what is shown of it. `of` is a name in a
// row, or a function of the row.
const pick = (of) => (typeof of === "string" ? (row) => row[of] : of);
const column = (title, of, show, more) => {
  const value = pick(of);
  return { title, value, show: (row) => (given(value(row)) ? show(value(row)) : "–"), ...more };
};
const textColumn = (title, of, show = pick(of), more = {}) => ({ title, text: true, value: pick(of), show, ...more });
const namedColumn = (title, names, of) => textColumn(title, of, (row) => names[pick(of)(row)]);
const methodColumn = (of) => {
  const name = (row) => METHODS[pick(of)(row)];
  return textColumn("method", name, (row) => [swatch(pick(of)(row)), name(row)]);
};
const seedColumn = (of) => column("seed", of, (seed) => String(D.seeds[seed]));
const buttonColumn = (unseen, show) => ({ unseen, text: true, show });
const intervalColumn = (about, of, digits, [low, high] = ["low", "high"]) => {
  const ends = (row) => `${number(row[low], digits)} – ${number(row[high], digits)}`;
  return { title: "95 % interval", about, value: pick(of), show: (row) => (given(row[low]) ? ends(row) : "–") };
};
const badColumn = (title, value, about) => {
  const show = (row) => (row.base ? "" : make("span", { class: value(row) ? "bad" : null }, String(value(row))));
  return { title, about, value, show };
};
// A figure of D.columns; `of` gives it of a row.
const figure = (name, of = name) => ({
  ...D.columns[name],
  value: pick(of),
  show: (row) => shownAs(name, pick(of)(row)),
});

function table(box, columns, rows, { name, by = null, down = false, kind = () => null }) {
  let [sorted, falling, start] = [by, down, 0];
  const body = make("tbody");
  const sort = (k) => {
    falling = sorted === k ? !falling : Boolean(columns[k].down);
    [sorted, start] = [k, 0];
    show();
  };
  const kinds = ({ text, more }) => [text && "text", more && "more"].filter(Boolean).join(" ") || null;
  const heads = columns.map((one, k) => {
    const { title, unseen, value, about } = one;
    const content = title ?? make("span", { class: "unseen" }, unseen);
    const head = value ? button(title, () => sort(k), { title: about }) : content;
    return make("th", { scope: "col", class: kinds(one) }, head);
  });
  const pager = make("div", { class: "row pager" });
  const leaf = (text, count, disabled) =>
    button(
      text,
      () => {
        start += count;
        show();
      },
      { disabled },
    );

  function ordered() {
    if (!given(sorted)) return rows;
    const sign = falling ? -1 : 1;
    const compare = (a, b) => sign * (typeof a === "string" ? a.localeCompare(b) : a - b);
    return rows
      .map((row) => [columns[sorted].value(row), row])
      .sort(([a], [b]) => (given(a) && given(b) ? compare(a, b) : given(b) - given(a)))
      .map((pair) => pair[1]);
  }

  function cell(one, row) {
    const content = one.show(row);
    return make("td", { class: kinds(one), "data-title": one.title }, ...[content].flat());
  }

  function show() {
    heads.forEach((head, k) => {
      const order = k !== sorted ? "none" : falling ? "descending" : "ascending";
      if (columns[k].value) head.setAttribute("aria-sort", order);
    });
    const end = Math.min(start + PAGE, rows.length);
    const line = (row) => make("tr", { class: kind(row) }, ...columns.map((one) => cell(one, row)));
    body.replaceChildren(...ordered().slice(start, end).map(line));
    const places = rows.length ? `${whole(start + 1)} to ${whole(end)} of ${whole(rows.length)}` : "none";
    pager.replaceChildren(
      leaf("earlier", -PAGE, start === 0),
      make("span", {}, places),
      leaf("later", PAGE, end >= rows.length),
    );
  }

  const grid = make("table", {}, make("thead", {}, make("tr", {}, ...heads)), body);
  box.replaceChildren(make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": name }, grid));
  if (rows.length > PAGE) box.append(pager);
  if (columns.some((one) => one.more)) {
    const toggle = button("more columns", () => {
      toggle.textContent = box.classList.toggle("few") ? "more columns" : "fewer columns";
    });
    box.classList.add("few");
    box.prepend(toggle);
  }
  show();
}

function leaderboard() {
  $("leaderboard-note").textContent = `${D.score.leaderboard}A column's title sorts by it.`;
  const [score, ...figures] = Object.keys(D.columns);
  const { digits, points, paired } = D.score;
  const warned = METHODS.map(() => 0);
  for (const row of Object.keys(D.warned)) warned[D.rows.method[row]] += 1;
  const bases = score === "error" ? D.baselines.map((row) => ({ ...row, base: true })) : [];
  const name = (row) => (row.base ? `baseline: ${D.baseline_names[row.baseline]}` : row.name);
  const settings = (row) => make("small", {}, D.methods[row.method].settings || "default settings");
  const method = (row) => (row.base ? name(row) : [swatch(row.method), row.name, settings(row)]);
  const width = (row) => (given(row.low) ? row.high - row.low : null);
  const about = "Methods that share a letter do not differ significantly";
  const letters = (row) => row.letters ?? "";
  const more = (one) => ({ ...one, more: true });
  const lost = (row) => (row.base ? "" : `${row.lost_tracks} of ${row.runs}`);
  const columns = [
    textColumn("method", name, method),
    figure(score),
    intervalColumn("Sorts by its width", width, digits),
    column(`behind ${points.trim()}`, "behind", (value) => number(value, digits), {
      about: `The median of the differences from the leader in paired ${paired}`,
    }),
    column("p", "p", probability, { about: "Of that difference: Wilcoxon's signed ranks, after Holm over all pairs" }),
    ...(D.columns.lost
      ? [{ title: "lost in", about: "Tracks that lost frames", value: (row) => row.lost_tracks, show: lost }]
      : []),
    badColumn("failed", (row) => row.failed),
    ...(D.warnings.length ? [badColumn("warned", (row) => warned[row.method], "Runs with a warning")] : []),
    ...(D.columns.above ? [figure("above")] : []),
    more(textColumn("group", letters, letters, { about })),
    ...figures.filter((one) => one !== "above").map((one) => more(figure(one))),
    more({ title: "runs", down: true, value: (row) => row.runs, show: (row) => (row.base ? "" : whole(row.runs)) }),
  ];
  const order = { by: 1, down: D.score.down };
  const kind = (row) => (row.base ? "base" : null);
  table($("leaders"), columns, [...D.leaderboard, ...bases], { name: "Leaderboard", ...order, kind });
}

// Buttons to watch a run, if it has an animation, and for the command that runs it again.
function runButtons(k) {
  const R = D.rows;
  const seed = D.seeds[R.seed[k]];
  const name = `${METHODS[R.method[k]]} on ${INSTANCES[R.instance[k]]}, seed ${seed}`;
  const text = `${D.heads[R.head[k]]}instance = ${D.instances[R.instance[k]].number}\nseed = ${seed}\nEND`;
  const repeat = button("command", () => showCommand(name, text), { title: "The command that runs it again" });
  if (!D.animations.tracks[k]) return [repeat];
  return [button("watch", () => openTrack(k), { title: "Watch this track" }), repeat];
}

function warningSign(k) {
  const title = D.warned[k].map((one) => D.warnings[one]).join("; ");
  return make("span", { class: "bad", role: "img", title, "aria-label": `warning: ${title}` }, " ⚠");
}

// Fills selects of [value, name] pairs by their ids, and shows the rows that have the chosen values of `of`.
function filtered(selects, rows, show) {
  const fill = () => {
    const fits = (row) => selects.every(([id, , , of]) => ["", String(of(row))].includes($(id).value));
    show(rows.filter(fits));
  };
  for (const [id, all, names] of selects) choose($(id), [["", all], ...names], "", fill);
  fill();
}

function allRows() {
  const R = D.rows;
  const of = (name) => (k) => R[name][k];
  const settings = (k) => D.methods[R.method[k]].settings;
  const columns = [
    buttonColumn("watch, or run again", runButtons),
    textColumn("method", of("method"), (k) => [METHODS[R.method[k]], D.warned[k] ? warningSign(k) : null]),
    { ...textColumn("settings", settings, (k) => settings(k) || "default"), more: true },
    namedColumn("instance", INSTANCES, of("instance")),
    seedColumn(of("seed")),
    ...Object.keys(D.columns).map((name) => ({ ...figure(name, of(name)), more: !FEW.includes(name) })),
    { ...textColumn("key", of("key")), more: true },
  ];
  const selects = [
    ["of-method", "all", numbered(METHODS), of("method")],
    ["of-instance", "all", numbered(INSTANCES), of("instance")],
  ];
  const show = (rows) => table($("all-rows"), columns, rows, { name: "All runs", by: 5 });
  filtered(selects, range(R.key.length), show);
}

// Expected running times of single searches, by function and dimension; the least is bold.
function runningTimes() {
  const least = new Map();
  const place = (row, k) => `${row.dimension} ${row.function} ${k}`;
  for (const row of D.times)
    row.times.forEach((time, k) =>
      least.set(place(row, k), Math.min(least.get(place(row, k)) ?? Infinity, time ?? Infinity)),
    );
  const functions = new Map(D.times.map((row) => [row.function, `${row.function} ${row.name}`]));
  const dimensions = [...new Set(D.times.map((row) => row.dimension))].sort((a, b) => a - b);
  const time = (above, k) => ({
    title: `ERT +${above}`,
    about: `Expected evaluations to ${above} above the best known cost`,
    value: (row) => row.times[k],
    show: (row) => {
      if (!given(row.times[k])) return "–";
      const shown = make(row.times[k] === least.get(place(row, k)) ? "strong" : "span", {}, whole(row.times[k]));
      const [low, high] = row.ends[k].map((end) => (given(end) ? whole(end) : "∞"));
      return given(row.ends[k][0]) ? [shown, make("small", {}, `${low} – ${high}`)] : shown;
    },
  });
  const columns = [
    methodColumn("method"),
    textColumn("function", "function", (row) => functions.get(row.function)),
    column("dimension", "dimension", String),
    ...D.above.map(time),
    figure("reached"),
    figure("above"),
    column("runs", "runs", whole, { down: true }),
  ];
  const names = [...functions].sort(([a], [b]) => a - b).map(([one, name]) => [String(one), name]);
  const selects = [
    ["of-function", "each", names, (row) => row.function],
    ["of-dimension", "each", dimensions.map((one) => [String(one), String(one)]), (row) => row.dimension],
  ];
  const rows = D.times.sort((a, b) => a.dimension - b.dimension || a.function - b.function || b.reached - a.reached);
  filtered(selects, rows, (shown) => table($("ert"), columns, shown, { name: "Running times" }));
}

function failures() {
  const reasons = (row) => row.reasons.join("; ");
  const command = (row) => button("command", () => showCommand(row.name, row.command));
  const columns = [textColumn("cell", "name"), textColumn("why its attempts failed", reasons)];
  table($("lost"), [...columns, buttonColumn("run again", command)], D.failures, { name: "Failures" });
}

function showCommand(title, text) {
  $("again-what").textContent = title;
  $("command").textContent = text;
  $("copied").textContent = "";
  $("again").showModal();
}

async function copyCommand() {
  try {
    await navigator.clipboard.writeText($("command").textContent);
  } catch {
    getSelection().selectAllChildren($("command"));
    document.execCommand("copy");
  }
  $("copied").textContent = "copied";
}
