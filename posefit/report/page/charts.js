// Charts of the methods that are shown: lines with bands, and errors of joints.
const LABELLED = 8; // lines that have their names at their ends

// Round values of a logarithmic scale.
const logSteps = (low, high) =>
  range(36)
    .map((k) => [1, 2, 5][k % 3] * 10 ** (Math.floor(k / 3) - 4))
    .filter((value) => value >= low && value <= high);

// The rising values that lie at least a gap apart, from the first on.
function spaced(values, of, gap, first = -Infinity) {
  let free = first;
  return values.filter((value) => {
    const enough = of(value) >= free;
    if (enough) free = of(value) + gap;
    return enough;
  });
}

const measuring = document.createElement("canvas").getContext("2d");

// The width in pixels of a text of a figure, as base.css has it.
function textWidth(text, weight = 400) {
  measuring.font = `${weight} 12px system-ui, sans-serif`;
  return measuring.measureText(text).width;
}

// The charts, each with a line of the methods that are shown.
function drawCharts() {
  for (const about of D.charts) {
    const [box, note] = [make("div", { class: "chart", id: about.name }), make("p", { class: "small" })];
    $("curves-charts").append(make("figure", {}, make("figcaption", {}, about.title), box, note));
    drawn(box, (width) => {
      const [lines, without] = [[], []];
      for (const [m, place] of visible())
        if (about.lines[place]) lines.push({ m, ...about.lines[place] });
        else without.push(METHODS[m]);
      note.textContent = without.length ? `Without a line: ${without.join("; ")}.` : "";
      return chart(width, lines, about);
    });
  }
}

// The end of an axis: where the last of some rising or falling lines has come to its end.
function lastChange(lines) {
  const ends = lines.map(
    ({ x, y }) =>
      x[
        Math.max(
          0,
          y.findLastIndex((value) => value !== y.at(-1)),
        ) + 1
      ] ?? x.at(-1),
  );
  return Math.max(...ends);
}

// The end of an axis that has all values, and their intervals if these are not much larger.
function topOf(values, highs) {
  const most = Math.max(...values.filter(given), 1e-9);
  return 1.05 * Math.max(most, ...highs.filter((value) => given(value) && value <= 1.5 * most));
}

// A chart of lines {m, x, y, low, high}.
function chart(width, lines, { x_label, y_label, most, log }) {
  const height = between(240, 380, 0.62 * width);
  const longest = Math.max(0, ...lines.map(({ m }) => textWidth(METHODS[m])));
  const named = lines.length > 0 && lines.length <= LABELLED && longest < 0.3 * width;
  const edges = { left: 46, right: named ? longest + 16 : 22, top: 24, bottom: 40 };
  const places = lines.flatMap(({ x }) => x);
  const last = !lines.length ? 1 : log ? Math.max(...places) : 1.04 * lastChange(lines);
  const x = { from: log ? Math.min(...places) : 0, to: last, log, label: x_label, show: log ? whole : rounded };
  const inner = width - edges.left - edges.right;
  const across = (value) => (inner * Math.log(value / x.from)) / Math.max(Math.log(x.to / x.from), 1e-9);
  x.marks = log ? spaced(logSteps(x.from, x.to), across, 44) : steps(0, x.to, inner / 90);
  const values = lines.flatMap(({ y }) => y);
  const highs = lines.flatMap(({ high }) => high ?? []);
  const to = most ?? (lines.length ? topOf(values, highs) : 1);
  const y = { to, marks: steps(0, to, 5), show: rounded, label: y_label };
  const frame = axes({ ...edges, width, height, name: `${y_label} over ${x_label}` }, x, y);
  const { svg, up } = frame;
  svg.append(...lines.map((line, order) => drawnLine(frame, line, order, last)));
  if (named)
    spread(
      lines.map((line) => up(line.y.at(-1))),
      14,
      30,
      height - 42,
    ).forEach((place, k) => {
      const style = `fill: ${colour(lines[k].m)}`;
      svg.append(drawText(width - longest - 8, place + 4, METHODS[lines[k].m], { style }));
    });
  return svg;
}

// The corners of steps through points [x, ...], which hold each value up to the next place.
const stepped = (points) =>
  points.flatMap((point, k) => (k ? [[point[0], ...points[k - 1].slice(1)], point] : [point]));

// A line with its band, both in steps, and marks of its method now and then.
function drawnLine({ at, up }, { m, x, y, low, high }, order, last) {
  const shown = range(x.length).filter((k) => x[k] <= last);
  const points = shown.map((k) => [at(x[k]), up(y[k])]);
  const line = path(stepped(points));
  const bounded = low ? shown.filter((k) => given(low[k]) && given(high[k])) : [];
  const ends = bounded.map((k) => [at(x[k]), up(Math.max(low[k], 0)), up(high[k])]);
  const marked = spaced(
    points.filter((_, k) => y[k]),
    ([place]) => place,
    85,
    70 + 17 * (order % 5),
  );
  const title = draw("title", {}, `${METHODS[m]}: ${number(y.at(-1), 3)} at the end`);
  return draw(
    "g",
    { class: "series", "data-method": m },
    ends.length ? band(stepped(ends), { class: "band", style: `fill: ${colour(m)}` }) : null,
    draw("path", { class: "near", d: line }, title),
    draw("path", { class: "curve", d: line, ...stroke(m, 2) }),
    ...marked.map(([left, top]) => mark(m, left, top, 3.6)),
  );
}

// A horizontal interval; an arrow means that it continues beyond an end of the axis.
function interval({ at, left, right }, y, low, high, about) {
  const [from, to] = [at(low), at(high)];
  const ends = [between(left, right, from), between(left, right, to)];
  const arrows = [
    from < left - 0.5 ? `M${left + 5},${y - 4}L${left},${y}L${left + 5},${y + 4}` : "",
    to > right + 0.5 ? `M${right - 5},${y - 4}L${right},${y}L${right - 5},${y + 4}` : "",
  ];
  const parts = [drawLine(ends[0], y, ends[1], y, about)];
  if (arrows.some(Boolean))
    parts.push(draw("path", { d: arrows.join(""), ...about, class: `${about.class ?? ""} beyond` }));
  return parts;
}

// Places as near to the wanted ones as possible, in the same order, at least a gap apart.
function spread(wanted, gap, low, high) {
  const order = range(wanted.length).sort((a, b) => wanted[a] - wanted[b]);
  const places = [];
  order.forEach((k, rank) => (places[k] = Math.max(wanted[k], rank ? places[order[rank - 1]] + gap : low)));
  let most = high;
  for (const k of order.reverse()) {
    places[k] = Math.min(places[k], most);
    most = places[k] - gap;
  }
  return places;
}

function curves() {
  legend();
  if (D.charts.length) drawCharts();
  else $("curves-charts").append("No run has a trace.");
}

function joints() {
  drawn($("joint-errors"), (width) => {
    const shown = visible();
    const row = 20;
    const errors = shown.map(([, place]) => D.joint_errors[place]);
    const to = shown.length
      ? topOf(
          errors.flatMap(({ values }) => values),
          errors.flatMap(({ high }) => high),
        )
      : 1;
    const box = { width, height: row * D.joints.length + 44, left: 112, right: 14, top: 4, bottom: 40 };
    const x = { to, marks: steps(0, to, Math.max(3, width / 110)), show: whole, label: "mm", rules: true };
    const { svg, at } = axes({ ...box, name: "error of each joint" }, x);
    const [left, right] = [at(0), at(to)];
    // not clamped, so that an interval may go beyond the axis
    const free = (value) => left + ((right - left) * value) / to;
    D.joints.forEach((joint, j) => {
      svg.append(drawText(104, row * j + 18, joint, { "text-anchor": "end" }));
      shown.forEach(([m, place], k) => {
        const { values, low, high } = D.joint_errors[place];
        const y = row * j + 7 + (shown.length > 1 ? (13 * k) / (shown.length - 1) : 6);
        const about = { class: "band", ...stroke(m, 2) };
        const ends = given(low[j]) ? interval({ at: free, left, right }, y, low[j], high[j], about) : [];
        const dot = mark(m, at(values[j]), y, 3.6, `${METHODS[m]}, ${joint}: ${number(values[j], 1)} mm`);
        svg.append(draw("g", { class: "series", "data-method": m }, ...ends, dot));
      });
    });
    return svg;
  });
}

function certainty() {
  const { levels, methods } = D.certainty;
  const share = (value) => `${number(100 * value, 1)} %`;
  const percents = (value) => `${whole(100 * value)} %`;
  const within = (level) => `Share of true joints inside the balls that should contain ${percents(level)} of them`;
  const columns = levels.flatMap((level, k) => [
    column(`within ${percents(level)}`, ({ coverage }) => coverage[k], share, { about: within(level) }),
    column("mm", ({ width }) => width[k], whole, { about: "Mean radius of these balls" }),
  ]);
  const about =
    "Expected calibration error: how far the likeliest mode's probability is from its share of right frames";
  const error = column("calibration error", "ece", (value) => number(value, 3), { about });
  const rows = D.taking_part.flatMap((m, place) => (methods[place] ? [{ m, ...methods[place] }] : []));
  table($("sure"), [methodColumn("m"), ...columns, error], rows, { name: "Uncertainty" });
}
