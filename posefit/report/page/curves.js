// Charts of the methods that are shown: curves over evaluations, errors of joints, calibration.
const LABELLED = 8; // curves that have their names at their ends

// Round values of a logarithmic scale.
const logSteps = (low, high) =>
  range(36)
    .map((k) => [1, 2, 5][k % 3] * 10 ** (Math.floor(k / 3) - 4))
    .filter((value) => value >= low && value <= high);

// Those of rising values that lie at least a gap apart, from the first place on.
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

// The lines of a text, each at most so many pixels wide where it can be broken.
function wrapped(text, room, weight) {
  const lines = [""];
  for (const word of text.match(/\S{1,36}\s*/g)) {
    if (lines.at(-1) && textWidth((lines.at(-1) + word).trimEnd(), weight) > room) lines.push("");
    lines.push(lines.pop() + word);
  }
  return lines;
}

function curves() {
  legend();
  $("curves-note").textContent = D.score.curves;
  if (!D.charts.length) $("charts").append("No run has a trace.");
  for (const about of D.charts) {
    const [box, note] = [make("div", { class: "chart", id: about.id }), make("p", { class: "small" })];
    $("charts").append(make("figure", {}, make("figcaption", {}, about.title), box, note));
    drawn(box, (width) => {
      const all = visible().map(([m, place]) => ({ m, values: [], ...about.series[place] }));
      const series = all.filter((one) => one.values.filter(given).length > 1); // one point is no curve
      const without = all.filter((one) => !series.includes(one)).map(({ m }) => METHODS[m]);
      note.textContent = without.length ? `Without a curve: ${without.join("; ")}.` : "";
      return chart(width, series, about);
    });
  }
}

// The value that 98 % of some values do not exceed.
function usualMost(values) {
  const known = values.filter(given).sort((a, b) => a - b);
  return known[Math.floor(0.98 * (known.length - 1))] || 1;
}

// A chart of series {m, values, low, high} over D.evaluations, on a logarithmic scale.
function chart(width, series, { label, under, most, stepped }) {
  const height = between(240, 380, 0.62 * width);
  const longest = Math.max(0, ...series.map((one) => textWidth(METHODS[one.m])));
  const named = series.length > 0 && series.length <= LABELLED && longest < 0.3 * width;
  const to = most ?? 1.05 * usualMost(series.flatMap((one) => one.values));
  const used = D.evaluations;
  const x = { from: used[0], to: used.at(-1), log: true, label: under, show: whole };
  const across = (value) =>
    ((width - 58 - longest * named) * Math.log(value / x.from)) / Math.max(Math.log(x.to / x.from), 1e-9);
  x.marks = spaced(logSteps(x.from, x.to), across, 44);
  const box = {
    width,
    height,
    left: 46,
    right: named ? longest + 16 : 12,
    top: 24,
    bottom: 40,
    name: `${label} over ${under}`,
  };
  const frame = axes(box, x, { to, marks: steps(0, to, 5), show: rounded, label });
  frame.svg.append(...series.map((one, order) => curve(frame, one, order, stepped)));
  if (named) {
    const ends = series.map((one) => frame.up(one.values.findLast(given)));
    spread(ends, 14, 30, height - 42).forEach((y, k) =>
      frame.svg.append(drawText(width - longest - 8, y + 4, METHODS[series[k].m], { class: "name" })),
    );
  }
  return frame.svg;
}

// A curve with some marks of its method, and its band, which shows where the curve is pointed at.
function curve({ at, up }, { m, values, low, high }, order, stepped) {
  const known = range(values.length).filter((k) => given(values[k]));
  const points = known.map((k) => [at(D.evaluations[k]), up(values[k])]);
  const line = path(
    stepped ? points.flatMap((point, k) => (k ? [[point[0], points[k - 1][1]], point] : [point])) : points,
  );
  const bounded = known.filter((k) => low && given(low[k]) && given(high[k]));
  const ends = bounded.map((k) => [at(D.evaluations[k]), up(low[k]), up(high[k])]);
  const positive = points.filter((_, k) => values[known[k]] !== 0);
  const marked = spaced(positive, ([x]) => x, 85, 70 + 17 * (order % 5));
  const title = draw("title", {}, `${METHODS[m]}: ${number(values.findLast(given), 3)} at the end`);
  return draw(
    "g",
    { class: "series", "data-method": m },
    ends.length ? band(ends, { class: "band", style: `fill: ${colour(m)}` }) : null,
    draw("path", { class: "near", d: line }, title),
    draw("path", { class: "curve", d: line, ...stroke(m, 2) }),
    ...marked.map(([x, y]) => mark(m, x, y, 3.6)),
  );
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

function joints() {
  drawn($("joint-errors"), (width) => {
    const shown = visible();
    const row = 20;
    const to = 1.05 * Math.max(1, ...shown.flatMap(([, place]) => [...D.joint_errors[place].values]));
    const box = { width, height: row * D.joints.length + 44, left: 112, right: 14, top: 4, bottom: 40 };
    const x = { to, marks: steps(0, to, Math.max(3, width / 110)), show: whole, label: "mm", rules: true };
    const { svg, at } = axes({ ...box, name: "error of each joint" }, x);
    D.joints.forEach((joint, j) => {
      svg.append(drawText(104, row * j + 18, joint, { "text-anchor": "end" }));
      shown.forEach(([m, place], k) => {
        const { values, low, high } = D.joint_errors[place];
        const y = row * j + 7 + (shown.length > 1 ? (13 * k) / (shown.length - 1) : 6);
        const ends = given(low[j]) ? drawLine(at(low[j]), y, at(high[j]), y, { class: "band", ...stroke(m, 2) }) : null;
        const dot = mark(m, at(values[j]), y, 3.6, `${METHODS[m]}, ${joint}: ${number(values[j], 1)} mm`);
        svg.append(draw("g", { class: "series", "data-method": m }, ends, dot));
      });
    });
    return svg;
  });
}

// The dots {x, y, size, title} of each method, joined, over dashed lines between pairs of points.
function calibration(width, name, x, y, dashed, series) {
  const height = between(240, 380, 0.72 * width);
  const { svg, at, up } = axes({ width, height, left: 46, right: 22, top: 14, bottom: 40, name }, x, y);
  for (const [x1, y1, x2, y2] of dashed)
    svg.append(drawLine(at(x1), up(y1), at(x2), up(y2), { class: "axis", "stroke-dasharray": "4 4" }));
  for (const [m, dots] of series)
    svg.append(
      draw("path", { d: path(dots.map((dot) => [at(dot.x), up(dot.y)])), ...stroke(m, 2), "data-method": m }),
      ...dots.map((dot) => mark(m, at(dot.x), up(dot.y), dot.size, `${METHODS[m]}: ${dot.title}`)),
    );
  return svg;
}

function certainty() {
  const C = D.certainty;
  const uncertain = (methods) => methods.flatMap(([m, place]) => (C.methods[place] ? [[m, C.methods[place]]] : []));
  const shares = { to: 1, marks: range(6).map((k) => k / 5), show: percents };
  drawn($("reliability"), (width) => {
    const series = uncertain(visible()).map(([m, { reliability }]) => {
      const all = reliability.reduce((sum, [count]) => sum + count, 0);
      const dots = reliability.map(([count, probability, right]) => {
        const title = `${percents(probability)} predicted, ${percents(right)} right, of ${counted(count, "frame")}`;
        return { x: probability, y: right, size: 3 + 8 * Math.sqrt(count / all), title };
      });
      return [m, dots];
    });
    const x = { ...shares, label: "probability of the likeliest mode" };
    return calibration(width, "how often the likeliest mode is right", x, shares, [[0, 0, 1, 1]], series);
  });
  drawn($("coverage"), (width) => {
    const known = uncertain(visible()).filter(([, one]) => [...one.coverage, ...one.width].every(given));
    const to = 1.08 * Math.max(10, ...known.flatMap(([, one]) => one.width));
    const series = known.map(([m, one]) => {
      const dots = C.levels.map((level, k) => {
        const [x, y] = [one.width[k], one.coverage[k]];
        return { x, y, size: 4, title: `${percents(level)} nominal, ${percents(y)} within ${whole(x)} mm` };
      });
      return [m, dots];
    });
    const x = { to, marks: steps(0, to, width / 90), show: whole, label: "radius of intervals, mm" };
    const y = { to: 1, marks: [0, ...C.levels], show: percents };
    const dashed = C.levels.map((level) => [0, level, to, level]);
    return calibration(width, "share of joints within their intervals, over their width", x, y, dashed, series);
  });
  const within = (level) => `Share of joints whose truth lies in the ball that should hold ${percents(level)} of them`;
  const share = (value) => `${number(100 * value, 1)} %`;
  const columns = C.levels.flatMap((level, k) => [
    column(`within ${percents(level)}`, ([, one]) => one.coverage[k], share, { about: within(level) }),
    column("mm", ([, one]) => one.width[k], whole, { about: "Mean radius of these balls" }),
  ]);
  const about = "Expected calibration error of the likeliest mode's probability: the mean distance from the diagonal";
  const threeDigits = (value) => number(value, 3);
  const error = column("calibration error", ([, one]) => one.ece, threeDigits, { about });
  const rows = uncertain(D.taking_part.map((m, place) => [m, place]));
  table($("sure"), [methodColumn("0"), ...columns, error], rows, { name: "Uncertainty" });
}
