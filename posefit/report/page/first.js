// The first screen: all methods with their intervals, and failures.
const MAX_METHODS = 12; // most methods of the figure

// The lines of a text, broken at spaces to a width in pixels.
function wrapped(text, room, weight) {
  const lines = [""];
  for (const word of text.match(/\S{1,36}\s*/g)) {
    if (lines.at(-1) && textWidth((lines.at(-1) + word).trimEnd(), weight) > room) lines.push("");
    lines.push(lines.pop() + word);
  }
  return lines;
}

function firstScreen() {
  const of = D.score.name;
  const rows = D.leaderboard.filter((row) => row.taking_part && given(row[of]));
  const bases = D.baselines.filter((row) => given(row[of])).sort((a, b) => a[of] - b[of]);
  const notes = [D.score.caption];
  if (rows.some((row) => given(row.p)))
    notes.push(
      "Below a name: its mean difference from the first method in paired runs, with the 95 % interval and p of a " +
        "paired t test, both after Holm's correction; below 0.05 a difference is shown.",
    );
  if (rows.length > MAX_METHODS) notes.push(`The table has ${counted(rows.length - MAX_METHODS, "more method")}.`);
  $("standing-note").textContent = notes.join(" ");
  drawn($("standing"), (width) => forest(width, rows.slice(0, MAX_METHODS), bases));
}

// The name of a method, or of a baseline.
const nameOf = (row) => row.title ?? row.name;

// How far a method is behind the first, how certain that is, and in how many tracks it loses frames.
function behind(row) {
  const { digits, points } = D.score;
  const signed = (value) => `${value > 0 ? "+" : ""}${number(value, digits)}`;
  const p = (value) => (value < D.constants.least_p ? `p ${probability(value)}` : `p = ${probability(value)}`);
  const ends = given(row.behind_low) ? ` (${signed(row.behind_low)} to ${signed(row.behind_high)})` : "";
  const lost = row.lost_tracks ? `lost in ${row.lost_tracks} of ${counted(row.runs, "track")}` : null;
  const effect = given(row.p) ? `${signed(row.behind)}${points}${ends}, ${p(row.p)}` : null;
  return [effect, lost].filter(Boolean).join("; ");
}

// A row a method with its interval, the first one in bold, and a line a baseline.
function forest(width, rows, bases) {
  const { name: of, digits, unit, down } = D.score;
  const [left, right, line] = [14, 12, 16];
  // a logarithmic scale where less is better and the worst is far from the best
  const values = [...rows, ...bases].flatMap((row) =>
    [row[of], row.low, row.high].filter((value) => given(value) && value > 0),
  );
  const [least, most] = [Math.min(...values), Math.max(...values)];
  const log = !down && most > 15 * least;
  const [from, to] = log ? [0.8 * least, 1.15 * most] : [0, 1.05 * most || 1];
  const marks = log ? logSteps(from, to) : steps(0, to, Math.max(3, (width - left - right) / 90));
  const x = { from, to, log, marks, rules: true, show: (value) => `${rounded(value)}${unit}` };
  x.label = `${D.score.axis}${log ? ", on a logarithmic scale" : ""}; ${down ? "more" : "less"} is better`;
  const titles = [...rows, ...bases].map((row) => {
    const ends = given(row.low) ? ` from ${number(row.low, digits)} to ${number(row.high, digits)}` : "";
    return `${nameOf(row)} ${number(row[of], digits)}${ends}`;
  });
  const top = 16 * bases.length + 10;
  const room = width - left - 4;
  let bottom = top;
  const places = rows.map((row, k) => {
    const texts = wrapped(`${row.name} ${scored(row[of])}`, room, 700).map((text) => [text, k ? "over" : "over best"]);
    if (behind(row)) texts.push(...wrapped(behind(row), room).map((text) => [text, "over soft"]));
    const start = bottom;
    bottom += line * texts.length + 19;
    return { start, texts, y: bottom - 10 };
  });
  const name = `${D.score.axis}, with 95 % intervals: ${titles.join("; ")}`;
  const { svg, at } = axes({ width, height: bottom + 40, left, right, top, bottom: 40, name }, x);
  // not clamped, so that an interval may go beyond the axis
  const free = (value) => (value < from ? left - 9 : at(value));
  // a baseline's name is to the right of its line, in a separate row
  bases.forEach((row, k) => {
    const [text, y] = [`${nameOf(row)} ${scored(row[of])}`, 16 * (bases.length - 1 - k)];
    const place = Math.min(at(row[of]) + 5, width - textWidth(text) - 4);
    svg.prepend(drawLine(at(row[of]), y + 2, at(row[of]), bottom, { class: "baseline" }));
    svg.append(drawText(place, y + 12, text, { class: "soft over" }));
  });
  rows.forEach((row, place) => {
    const { start, texts, y } = places[place];
    svg.append(...texts.map(([text, kind], k) => drawText(left, start + line * (k + 1), text, { class: kind })));
    const about = { ...stroke(row.method, 3), "stroke-dasharray": null };
    if (given(row.low)) svg.append(...interval({ at: free, left, right: width - right }, y, row.low, row.high, about));
    svg.append(mark(row.method, at(row[of]), y, 5.5, titles[place]));
  });
  return svg;
}

// Failures and left-out runs, with the reasons.
function trouble() {
  for (const [text, items] of D.header.problems) {
    const list = make("ul", {}, ...items.map((item) => make("li", {}, item)));
    $("problems").append(make("div", { class: "note warn" }, text, list));
  }
}
