// Tables that any column sorts; leaderboard, all runs, running times, failures; the command that runs a cell again.
const PAGE = 25; // rows

// A column: its title, `of` to sort by, a name in a row or a function of the row, and how a value is shown.
const pick = (of) => (typeof of === "string" ? (row) => row[of] : of);
const column = (title, of, show = String, more = {}) => {
  const value = pick(of);
  return { title, value, show: (row) => (given(value(row)) ? show(value(row), row) : "–"), ...more };
};
const textColumn = (title, of, show, more) => column(title, of, show, { text: true, ...more });
const further = (one) => ({ ...one, more: true });
const methodColumn = (of) => {
  const name = (row) => METHODS[pick(of)(row)];
  return textColumn("method", name, (text, row) => [swatch(pick(of)(row)), text]);
};
const buttonColumn = (title, show) => ({ title, text: true, show });
const intervalColumn = (about, of, digits, [low, high] = ["low", "high"]) => {
  const ends = (row) => `${number(row[low], digits)} to ${number(row[high], digits)}`;
  return { title: "95 % interval", about, value: pick(of), show: (row) => (given(row[low]) ? ends(row) : "–") };
};
const bad = (count) => make("span", { class: count ? "bad" : null }, whole(count));
// A figure of D.columns; `of` gives it of a row.
const figure = (name, of = name) => {
  const { title, ...about } = D.columns[name];
  return column(title, of, (value) => shownAs(name, value), about);
};

function table(box, columns, rows, { name, by = null, down = false, kind = () => null }) {
  let [sorted, falling, start] = [by, down, 0];
  const body = make("tbody");
  const sort = (k) => {
    falling = sorted === k ? !falling : Boolean(columns[k].down);
    [sorted, start] = [k, 0];
    show();
  };
  const kinds = (one) => ["text", "more"].filter((word) => one[word]).join(" ") || null;
  const heads = columns.map((one, k) => {
    const head = one.value ? button(one.title, () => sort(k), { title: one.about }) : one.title;
    return make("th", { scope: "col", class: kinds(one) }, head);
  });
  const pager = make("div", { class: "row pager" });
  const turn = (count) => () => {
    start += count;
    show();
  };

  function ordered() {
    if (!given(sorted)) return rows;
    const sign = falling ? -1 : 1;
    const compare = (a, b) => sign * (typeof a === "string" ? a.localeCompare(b) : a - b);
    return rows
      .map((row) => [columns[sorted].value(row), row])
      .sort(([a], [b]) => (given(a) && given(b) ? compare(a, b) : given(b) - given(a)))
      .map((pair) => pair[1]);
  }

  function show() {
    heads.forEach((head, k) => {
      const order = k !== sorted ? "none" : falling ? "descending" : "ascending";
      if (columns[k].value) head.setAttribute("aria-sort", order);
    });
    const cell = (one, row) => make("td", { class: kinds(one), "data-title": one.title }, ...[one.show(row)].flat());
    const line = (row) => make("tr", { class: kind(row) }, ...columns.map((one) => cell(one, row)));
    const end = Math.min(start + PAGE, rows.length);
    body.replaceChildren(...ordered().slice(start, end).map(line));
    pager.replaceChildren(
      button("earlier", turn(-PAGE), { disabled: start === 0 }),
      make("span", {}, `${whole(start + 1)} to ${whole(end)} of ${whole(rows.length)}`),
      button("later", turn(PAGE), { disabled: end >= rows.length }),
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
  $("leaderboard-note").textContent = `${D.score.leaderboard}Click a column's title to sort by it.`;
  const { name: score, digits, points, paired } = D.score;
  const bases = D.leaderboard[0].lost_tracks >= 0 ? D.baselines : [];
  const name = (row) => (row.baseline ? `baseline: ${row.title}` : row.name);
  const settings = (row) => make("small", {}, D.methods[row.method].settings || "default settings");
  const method = (text, row) => (row.baseline ? text : [swatch(row.method), text, settings(row)]);
  const width = (row) => (given(row.low) ? row.high - row.low : null);
  const about = `The mean difference from the first method in paired ${paired}`;
  const first = [
    textColumn("method", name, method),
    figure(score),
    intervalColumn("Sorts by its width", width, digits),
    column(`behind ${points.trim()}`, "behind", (value) => number(value, digits), { about }),
    column("p", "p", probability, { about: "Of this difference: paired t test, corrected by Holm over all pairs" }),
    column("lost in", "lost_tracks", (count, row) => `${count} of ${row.runs}`, { about: "Tracks that lost frames" }),
    column("failed", "failed", bad),
    ...(D.warnings.length ? [column("warned", "warned", bad, { about: "Runs with a warning" })] : []),
  ];
  const columns = [
    ...first.filter(({ value }) => D.leaderboard.some((row) => given(value(row)))),
    ...Object.keys(D.columns).flatMap((one) => (one === score ? [] : [further(figure(one))])),
    further(column("runs", "runs", whole, { down: true })),
    further(
      column("runs needed", "blocks_needed", neededRuns, { about: `Paired ${paired} that would show that difference` }),
    ),
  ];
  const kind = (row) => (row.baseline ? "base" : null);
  table($("leaders"), columns, [...D.leaderboard, ...bases], { name: "Leaderboard", kind });
}

// The command that runs a row again, and a button for a command that needs no ledger.
const rerun = (key) => make("code", {}, `posefit rerun ${D.ledger} ${key}`);
function repeatButton(k) {
  const R = D.rows;
  const seed = D.seeds[R.seed[k]];
  const name = `${METHODS[R.method[k]]} on ${INSTANCES[R.instance[k]]}, seed ${seed}`;
  const { begin, methods, instances, end } = D.command;
  const text = `${begin}${methods[R.method[k]]}${instances[R.instance[k]]}seed = ${seed}\n${end}`;
  return [rerun(R.key[k]), button("plan", () => showCommand(name, text), { title: "A command that needs no ledger" })];
}

function warningSign(k) {
  const title = D.warned[k].map((one) => D.warnings[one]).join("; ");
  return make("span", { class: "bad", role: "img", title, "aria-label": `warning: ${title}` }, " ⚠");
}

// Fills selects of [value, name] pairs by their ids, and shows the rows that have the chosen values of `of`.
function filtered(selects, rows, show) {
  const fill = () => {
    const fits = (row) => selects.every(([id, , of]) => ["", String(of(row))].includes($(id).value));
    show(rows.filter(fits));
  };
  for (const [id, names] of selects) choose($(id), [["", "all"], ...names], "", fill);
  fill();
}

function allRows() {
  const R = D.rows;
  const of = (name) => (k) => R[name][k];
  const columns = [
    textColumn("method", of("method"), (m, k) => [METHODS[m], D.warned[k] ? warningSign(k) : null]),
    further(textColumn("settings", (k) => D.methods[R.method[k]].settings || "default")),
    textColumn("instance", of("instance"), (instance) => INSTANCES[instance]),
    column("seed", of("seed"), (seed) => String(D.seeds[seed])),
    ...Object.keys(D.columns).map((name) => ({ ...figure(name, of(name)), more: !D.columns[name].brief })),
    buttonColumn("run again", repeatButton),
  ];
  const selects = [
    ["of-method", numbered(METHODS), of("method")],
    ["of-instance", numbered(INSTANCES), of("instance")],
  ];
  const show = (rows) => table($("all-rows"), columns, rows, { name: "All runs", by: 4 });
  filtered(selects, range(R.key.length), show);
}

// Expected running times of single searches, by function and dimension.
function runningTimes() {
  const functions = new Map(D.times.map((row) => [row.function, `${row.function} ${row.name}`]));
  const dimensions = [...new Set(D.times.map((row) => row.dimension))].sort((a, b) => a - b);
  const time = (above, k) =>
    column(`ERT +${above}`, (row) => row.times[k], whole, {
      about: `Expected evaluations to ${above} above the best known cost`,
    });
  const columns = [
    methodColumn("method"),
    textColumn("function", "function", (one) => functions.get(one)),
    column("dimension", "dimension"),
    ...D.above.map(time),
    figure("reached"),
    figure("above"),
    column("runs", "runs", whole, { down: true }),
  ];
  const names = [...functions].sort(([a], [b]) => a - b).map(([one, name]) => [String(one), name]);
  const selects = [
    ["of-function", names, (row) => row.function],
    ["of-dimension", dimensions.map((one) => [String(one), String(one)]), (row) => row.dimension],
  ];
  const rows = D.times.sort((a, b) => a.dimension - b.dimension || a.function - b.function || b.reached - a.reached);
  filtered(selects, rows, (shown) => table($("ert"), columns, shown, { name: "Running times" }));
}

function failures() {
  const columns = [
    textColumn("cell", "name"),
    textColumn("why its attempts failed", (row) => row.reasons.join("; ")),
    buttonColumn("run again", (row) => [rerun(row.key), button("plan", () => showCommand(row.name, row.command))]),
  ];
  table($("lost"), columns, D.failures, { name: "Failures" });
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
