// The first screen: all methods with their intervals, three tracks of the leader, failures.
const MAX_METHODS = 12; // of the figure
const MAX_MISSING = 20; // instances that a note names
const MAX_WARNINGS = 5; // that it names

function firstScreen() {
  const { caption, alone, baseless } = D.score;
  const rows = D.leaderboard.filter((row) => row.taking_part && given(row[D.score.name]));
  const bases = D.baselines.filter((row) => given(row[D.score.name]));
  const notes = [caption];
  if (rows.some((row) => given(row.p)))
    notes.push(
      "Beside a name: how far it is behind the leader, the median of paired runs, with its 95 % interval and p.",
    );
  if (!rows.some((row) => given(row.low))) notes.push(alone);
  if (!bases.length) notes.push(baseless);
  if (rows.length > MAX_METHODS) notes.push(`The table has ${counted(rows.length - MAX_METHODS, "more method")}.`);
  $("standing-note").textContent = notes.join(" ");
  const lines = bases.map((row) => ({ ...row, name: D.baseline_names[row.baseline] }));
  lines.sort((a, b) => a[D.score.name] - b[D.score.name]);
  drawn($("standing"), (width) => forest(width, rows.slice(0, MAX_METHODS), lines));
  examples();
}

// How far a method is behind the leader, how certain that is, and in how many tracks it loses frames.
function behind(row) {
  const { digits, points, name } = D.score;
  const signed = (value) => `${value > 0 ? "+" : ""}${number(value, digits)}`;
  const ends = given(row.behind_low) ? ` (${signed(row.behind_low)} to ${signed(row.behind_high)})` : "";
  const lost = row.lost_tracks ? `lost in ${row.lost_tracks} of ${counted(row.runs, "track")}` : null;
  const effect = given(row.p) ? `${signed(row.behind)}${points}${ends}, p ${probability(row.p)}` : null;
  return name in row ? [effect, lost].filter(Boolean).join("; ") : "";
}

// A row a method with its interval, the first one in bold, and a line a baseline; `end` is the scale's where it is not
// of these rows.
function forest(width, rows, bases, end) {
  const { name: of, digits, unit, better } = D.score;
  const [left, right, line] = [14, 12, 15];
  // a logarithmic scale where less is better and the worst is far from the best
  const values = [...rows, ...bases].flatMap((row) => [row[of], row.low, row.high].filter((value) => value > 0));
  const [least, most] = [Math.min(...values), Math.max(...values)];
  const log = better === "less" && most > 15 * least;
  const [from, to] = log ? [0.8 * least, 1.15 * most] : [0, end ?? (1.05 * most || 1)];
  const marks = log ? logSteps(from, to) : steps(0, to, Math.max(3, (width - left - right) / 90));
  const x = { from, to, log, marks, rules: true, show: (value) => `${rounded(value)}${unit}` };
  x.label = `${D.score.axis}${log ? ", on a logarithmic scale" : ""}; ${better} is better`;
  const titles = [...rows, ...bases].map((row) => {
    const ends = given(row.low) ? ` from ${number(row.low, digits)} to ${number(row.high, digits)}` : "";
    return `${row.name} ${number(row[of], digits)}${ends}`;
  });
  const top = 16 * bases.length + 10;
  const room = width - left - 4;
  let bottom = top;
  const places = rows.map((row, k) => {
    const names = wrapped(`${row.name} ${scored(row[of])}`, room, 700);
    const more = behind(row) ? wrapped(behind(row), room) : [];
    const beside = more.length === 1 && textWidth(names.at(-1), 700) + textWidth(more[0]) + 24 < room;
    const texts = names.map((text, at) => [left, line * (at + 1), text, k ? "over" : "over best"]);
    const shift = names.length - (beside ? 1 : 0);
    for (const [at, text] of more.entries())
      texts.push([
        beside ? left + textWidth(names.at(-1), 700) + 14 : left,
        line * (shift + at + 1),
        text,
        "over soft",
      ]);
    const start = bottom;
    bottom += line * (shift + more.length || names.length) + 19;
    return { start, texts, y: bottom - 10 };
  });
  const name = `${D.score.label} with 95 % intervals: ${titles.join("; ")}`;
  const { svg, at } = axes({ width, height: bottom + 40, left, right, top, bottom: 40, name }, x);
  // a baseline's name stands to the right of its line, in a row of its own
  bases.forEach((row, k) => {
    const [text, y] = [`${row.name} ${scored(row[of])}`, 16 * (bases.length - 1 - k)];
    const place = Math.min(at(row[of]) + 5, width - textWidth(text) - 4);
    svg.prepend(drawLine(at(row[of]), y + 2, at(row[of]), bottom, { class: "baseline" }));
    svg.append(drawText(place, y + 12, text, { class: "soft over" }));
  });
  rows.forEach((row, k) => {
    const { start, texts, y } = places[k];
    svg.append(...texts.map(([across, down, text, kind]) => drawText(across, start + down, text, { class: kind })));
    if (given(row.low))
      svg.append(drawLine(at(row.low), y, at(row.high), y, { ...stroke(row.method, 3), "stroke-dasharray": null }));
    svg.append(mark(row.method, at(row[of]), y, 5.5, titles[k]));
  });
  return svg;
}

// The shares of a suite's targets on each of its functions.
function functionShares() {
  const most = Math.max(...D.by_function.flatMap(({ rows }) => rows.map((row) => row.high ?? row.reached)));
  for (const { name, rows } of D.by_function) {
    const box = make("div", { class: "chart" });
    $("functions").append(make("figure", {}, make("figcaption", {}, name), box));
    const named = rows.slice(0, MAX_METHODS).map((row) => ({ ...row, name: METHODS[row.method] }));
    drawn(box, (width) => forest(width, named, [], 1.05 * most));
  }
}

// Three tracks of the leader, which move.
function examples() {
  const rows = (D.examples ?? []).filter(([, row]) => D.animations.tracks[row]);
  if (!rows.length) return $("examples").remove();
  const stills = rows.map(([name, row]) => {
    const canvas = make("canvas", { "aria-hidden": "true" });
    const words = [
      make("strong", {}, `${name} track: ${number(D.rows.error[row], 2)}°`),
      make("small", {}, `${INSTANCES[D.rows.instance[row]]}, seed ${D.seeds[D.rows.seed[row]]}`),
    ];
    $("three").append(button([canvas, ...words], () => openTrack(row), { class: "example" }));
    return { canvas, still: stillOf(row) };
  });
  $("examples-of").textContent = `Three tracks of ${METHODS[D.leaderboard[0].method]}: `;
  let frame = 0;
  let inView = true;
  const repaint = () => inView && stills.forEach(({ canvas, still }) => paintStill(canvas, still, frame));
  const run = clock(
    $("moving"),
    () => pace(stills[0].still.scene),
    (over) => {
      frame += over;
      repaint();
    },
  );
  new IntersectionObserver((entries) => {
    inView = entries.at(-1).isIntersecting;
    repaint();
  }).observe($("three"));
  new ResizeObserver(repaint).observe($("three"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  run(!matchMedia("(prefers-reduced-motion: reduce)").matches);
}

// What failed and what is left out, with the reasons.
function trouble() {
  const H = D.header;
  const list = (items) => make("ul", {}, ...items.map((item) => make("li", {}, item)));
  const note = (kind, text, items, ...more) =>
    $("trouble").append(make("div", { class: `note ${kind}` }, ...text, list(items), ...more));
  if (H.failed) {
    const by = Object.entries(H.failed_by).map(([method, count]) => `${method} ${whole(count)}`);
    const text = `${counted(H.failed, "cell")} failed, left out of all figures: ${by.join("; ")}. `;
    const reasons = H.reasons.map(([reason, count]) => `${whole(count)} × ${reason}`);
    note("warn", [text, make("a", { href: "#failures" }, "Which ones")], reasons, H.unpaired ? `${H.unpaired}.` : "");
  }
  if (H.dropped.length) {
    const why = (gap) => (gap.missing.length ? `no run of ${gap.missing.join("; ")}` : "no seed in common");
    const missing = H.dropped.map((gap) => `${gap.instance}: ${why(gap)}`);
    const more = missing.length > MAX_MISSING ? [`and ${whole(missing.length - MAX_MISSING)} more`] : [];
    const text = `${counted(missing.length, "instance")} left out of the comparison, for every method:`;
    note("warn", [text], [...missing.slice(0, MAX_MISSING), ...more]);
  }
  if (H.unfinished.length)
    note("warn", [`No cell finished, so not on the leaderboard: ${H.unfinished.join("; ")}.`], []);
  const warned = Object.keys(D.warned).length;
  if (warned)
    note("", [`${counted(warned, "run")} with a warning, marked ⚠ below:`], D.warnings.slice(0, MAX_WARNINGS));
}
