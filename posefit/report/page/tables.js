// Tables that any column sorts; leaderboard, all runs, running times, failures; the command that runs a cell again.
const PAGE = 50; // rows

// A column: its title, or one for screen readers alone, value(row) to sort by, and what is shown of it.
const column = (title, value, show, more) => ({
  title,
  value,
  show: (row) => (given(value(row)) ? show(value(row)) : "–"),
  ...more,
});
const textColumn = (title, value, show = value) => ({ title, text: true, value, show });
const methodColumn = (of) =>
  textColumn(
    "method",
    (row) => METHODS[of(row)],
    (row) => [swatch(of(row)), METHODS[of(row)]],
  );
const buttonColumn = (unseen, show) => ({ unseen, text: true, show });
const badColumn = (title, of, about) => ({
  title,
  about,
  value: of,
  show: (row) => (row.base ? "" : make("span", { class: of(row) ? "bad" : null }, String(of(row)))),
});
// A figure of D.columns; `of` gives it of a row.
const figure = (name, of) => ({ ...D.columns[name], value: of, show: (row) => shownAs(name, of(row)) });

function table(box, columns, rows, { name, by = null, down = false, kind = () => null }) {
  let [sorted, falling, start] = [by, down, 0];
  const body = make("tbody");
  const heads = columns.map(({ title, unseen, text, value, about }, k) =>
    make(
      "th",
      { scope: "col", class: text ? "text" : null },
      value ? button(title, () => sort(k), { title: about }) : (title ?? make("span", { class: "unseen" }, unseen)),
    ),
  );
  const pager = make("div", { class: "row pager" });
  const leaf = (count) => {
    start += count;
    show();
  };

  function sort(k) {
    falling = sorted === k ? !falling : Boolean(columns[k].down);
    [sorted, start] = [k, 0];
    show();
  }

  function ordered() {
    if (!given(sorted)) return rows;
    const sign = falling ? -1 : 1;
    const compare = (a, b) => sign * (typeof a === "string" ? a.localeCompare(b) : a - b);
    return rows
      .map((row) => [columns[sorted].value(row), row])
      .sort(([a], [b]) => (given(a) && given(b) ? compare(a, b) : given(b) - given(a)))
      .map((pair) => pair[1]);
  }

  function cell({ text, show: shown }, row) {
    const content = shown(row);
    const title = text && typeof content === "string" ? content : null;
    return make("td", { class: text ? "text" : null, title }, ...[content].flat());
  }

  function show() {
    heads.forEach((head, k) => {
      if (columns[k].value)
        head.setAttribute("aria-sort", k === sorted ? (falling ? "descending" : "ascending") : "none");
    });
    const shown = ordered().slice(start, start + PAGE);
    body.replaceChildren(
      ...shown.map((row) => make("tr", { class: kind(row) }, ...columns.map((one) => cell(one, row)))),
    );
    const end = Math.min(start + PAGE, rows.length);
    pager.replaceChildren(
      button("earlier", () => leaf(-PAGE), { disabled: start === 0 }),
      make("span", {}, rows.length ? `${whole(start + 1)} to ${whole(end)} of ${whole(rows.length)}` : "none"),
      button("later", () => leaf(PAGE), { disabled: end >= rows.length }),
    );
  }

  const grid = make("table", {}, make("thead", {}, make("tr", {}, ...heads)), body);
  box.replaceChildren(make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": name }, grid));
  if (rows.length > PAGE) box.append(pager);
  show();
}

function leaderboard() {
  $("leaderboard-note").textContent = `${D.score.leaderboard}A column's title sorts by it.`;
  const [score, ...figures] = Object.keys(D.columns);
  const { digits, alone, paired } = D.score;
  const warned = METHODS.map(() => 0);
  for (const row of Object.keys(D.warned)) warned[D.rows.method[row]] += 1;
  const bases = score === "error" ? D.baselines.map((row) => ({ ...row, base: true })) : [];
  const name = (row) => (row.base ? `baseline: ${D.baseline_names[row.baseline]}` : row.name);
  const settings = (row) => make("small", {}, D.methods[row.method].settings || "default settings");
  const method = (row) => (row.base ? name(row) : [swatch(row.method), row.name, settings(row)]);
  const interval = (row) => (given(row.low) ? `${number(row.low, digits)} – ${number(row.high, digits)}` : alone);
  const pairs = counted((D.taking_part.length * (D.taking_part.length - 1)) / 2, "pair");
  const tested = `Wilcoxon's signed ranks over ${paired}, Holm over ${pairs}, 5 %`;
  table(
    $("leaders"),
    [
      textColumn("method", name, method),
      figure(score, (row) => row[score]),
      {
        title: "95 % interval",
        about: "Sorts by its width",
        value: (row) => (given(row.low) ? row.high - row.low : null),
        show: (row) => (row.base ? "" : interval(row)),
      },
      {
        ...textColumn("group", (row) => row.letters ?? ""),
        about: `Methods that share a letter do not differ significantly: ${tested}`,
      },
      ...figures.map((one) => figure(one, (row) => row[one])),
      { title: "runs", down: true, value: (row) => row.runs, show: (row) => (row.base ? "" : whole(row.runs)) },
      badColumn("failed", (row) => row.failed),
      ...(D.warnings.length ? [badColumn("warned", (row) => warned[row.method], "Runs with a warning")] : []),
    ],
    [...D.leaderboard, ...bases],
    { name: "Leaderboard", by: 1, down: D.score.better === "more", kind: (row) => (row.base ? "base" : null) },
  );
}

// Buttons to watch a run, if it has an animation, and for the command that runs it again.
function runButtons(k) {
  const R = D.rows;
  const name = `${METHODS[R.method[k]]} on ${INSTANCES[R.instance[k]]}, seed ${D.seeds[R.seed[k]]}`;
  const place = `instance = ${D.instances[R.instance[k]].number}\nseed = ${D.seeds[R.seed[k]]}\nEND`;
  const repeat = button("command", () => showCommand(name, `${D.heads[R.head[k]]}${place}`), {
    title: "The command that runs it again",
  });
  if (!D.animations.tracks[k]) return [repeat];
  return [button("watch", () => openTrack(k), { title: "Watch this track" }), repeat];
}

function warningSign(k) {
  const title = D.warned[k].map((one) => D.warnings[one]).join("; ");
  return make("span", { class: "bad", role: "img", title, "aria-label": `warning: ${title}` }, " ⚠");
}

function allRows() {
  const R = D.rows;
  const settings = (k) => D.methods[R.method[k]].settings;
  const fill = () => {
    const [method, instance] = [$("of-method").value, $("of-instance").value];
    const chosen = (k) =>
      (method === "" || R.method[k] === +method) && (instance === "" || R.instance[k] === +instance);
    table(
      $("all-rows"),
      [
        buttonColumn("watch, or run again", runButtons),
        textColumn(
          "method",
          (k) => R.method[k],
          (k) => [METHODS[R.method[k]], D.warned[k] ? warningSign(k) : null],
        ),
        textColumn("settings", settings, (k) => settings(k) || "default"),
        textColumn(
          "instance",
          (k) => R.instance[k],
          (k) => INSTANCES[R.instance[k]],
        ),
        column(
          "seed",
          (k) => R.seed[k],
          (seed) => String(D.seeds[seed]),
        ),
        ...Object.keys(D.columns).map((name) => figure(name, (k) => R[name][k])),
        textColumn("key", (k) => R.key[k]),
      ],
      range(R.key.length).filter(chosen),
      { name: "All runs", by: 5 },
    );
  };
  choose($("of-method"), [["", "all"], ...numbered(METHODS)], "", fill);
  choose($("of-instance"), [["", "all"], ...numbered(INSTANCES)], "", fill);
  fill();
}

// Expected running times of single searches, by function and dimension; the least is bold.
function runningTimes() {
  const least = new Map();
  const place = (row, k) => `${row.dimension} ${row.function} ${k}`;
  for (const row of D.times)
    row.times.forEach((time, k) =>
      least.set(place(row, k), Math.min(least.get(place(row, k)) ?? Infinity, time ?? Infinity)),
    );
  const functions = new Map(D.times.map((row) => [row.function, `${row.function || ""} ${row.name}`.trim()]));
  const dimensions = [...new Set(D.times.map((row) => row.dimension))].sort((a, b) => a - b);
  const time = (above, k) => ({
    title: `ERT +${above}`,
    about: `Expected evaluations to ${above} above the best known cost`,
    value: (row) => row.times[k],
    show: (row) => {
      if (!given(row.times[k])) return "–";
      return make(row.times[k] === least.get(place(row, k)) ? "strong" : "span", {}, whole(row.times[k]));
    },
  });
  const fill = () => {
    const [chosen, dimension] = [$("of-function").value, $("of-dimension").value];
    const rows = D.times.filter(
      (row) => (chosen === "" || row.function === +chosen) && (dimension === "" || row.dimension === +dimension),
    );
    table(
      $("ert"),
      [
        methodColumn((row) => row.method),
        textColumn(
          "function",
          (row) => row.function,
          (row) => functions.get(row.function),
        ),
        column("dimension", (row) => row.dimension, String),
        ...D.above.map(time),
        ...["reached", "above"].map((name) => figure(name, (row) => row[name])),
        column("runs", (row) => row.runs, whole, { down: true }),
      ],
      rows.sort((a, b) => a.dimension - b.dimension || a.function - b.function || b.reached - a.reached),
      { name: "Running times" },
    );
  };
  const names = [...functions].sort(([a], [b]) => a - b).map(([one, name]) => [String(one), name]);
  choose($("of-function"), [["", "each"], ...names], "", fill);
  choose($("of-dimension"), [["", "each"], ...dimensions.map((one) => [String(one), String(one)])], "", fill);
  fill();
}

function failures() {
  const reasons = (row) => row.reasons.join("; ");
  const command = (row) => button("command", () => showCommand(row.name, row.command));
  const columns = [textColumn("cell", (row) => row.name), textColumn("why its attempts failed", reasons)];
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
