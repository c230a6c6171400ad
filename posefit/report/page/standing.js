// All methods by their scores with intervals, and the baselines: the figure of the first screen.
const MANY = 20; // methods of the figure
const BOLD = 700; // the weight of names that are not shown to be worse

// Places of labels over a figure, each to the right of its line, which ends below every label that it would cross.
function lanes(labels, high) {
  const found = [];
  for (const { x, text } of labels) {
    const wide = 6.4 * text.length + 8;
    const from = Math.min(x + 5, high - wide);
    const above = found.filter((one) => one.end > from - 6);
    found.push({ lane: 1 + Math.max(-1, ...above.map((one) => one.lane)), from, end: from + wide });
  }
  return found;
}

const measuring = document.createElement("canvas").getContext("2d");

// How many pixels a text of a figure is wide, as report.css has it.
function textWidth(text, weight = 400) {
  measuring.font = `${weight} 12px system-ui, sans-serif`;
  return measuring.measureText(text).width;
}

// A text that is shortened until it is at most so many pixels wide.
function fitted(text, room, weight = 400) {
  let length = text.length;
  while (length > 4 && textWidth(shortened(text, length), weight) > room) length -= 1;
  return shortened(text, length);
}

// A scale of scores from 0, or of their logarithms where less is better and the worst is far from the best.
function scoreScale(values, low, high) {
  const [least, most] = [Math.min(...values), Math.max(...values)];
  const wide = D.score.better === "less" && least > 0 && most > 15 * least;
  const [from, to] = wide ? [Math.log(0.8 * least), Math.log(1.15 * most)] : [0, 1.05 * most || 1];
  const at = (value) => low + ((high - low) * ((wide ? Math.log(value) : value) - from)) / (to - from);
  const marks = wide
    ? range(36)
        .map((k) => [1, 2, 5][k % 3] * 10 ** (Math.floor(k / 3) - 4))
        .filter((one) => Math.log(one) >= from && Math.log(one) <= to)
    : steps(0, to, Math.max(3, (high - low) / 90));
  return { at, marks, wide };
}

function standing(width) {
  const of = D.score.name;
  const rows = D.leaderboard.filter((row) => row.taking_part && given(row[of])).slice(0, MANY);
  const alike = new Set(D.alike);
  const narrow = width < 480;
  const step = narrow ? 38 : 26;
  const widest = Math.max(...rows.map((row) => textWidth(shortened(row.name, 27), BOLD)));
  const [left, right] = [narrow ? 14 : widest + 24, width - (narrow ? 12 : 66)];
  const bases = D.baselines.filter((row) => given(row[of])).sort((a, b) => a[of] - b[of]);
  const spans = rows.flatMap((row) => [row[of], row.low, row.high].filter((one) => given(one) && one > 0));
  const scale = scoreScale([...spans, ...bases.map((row) => row[of])], left, right);
  const labels = bases.map((row) => ({
    x: scale.at(row[of]),
    text: `${D.trivial[row.baseline]} ${scored(row[of])}`,
  }));
  const placed = lanes(labels, width);
  const top = 16 * (1 + Math.max(-1, ...placed.map((one) => one.lane))) + 10;
  const bottom = top + step * rows.length;
  const height = bottom + 40;
  const said = [...rows, ...bases].map((row) => {
    const name = row.name ?? `baseline, ${D.trivial[row.baseline]}`;
    const ends = given(row.low)
      ? ` from ${number(row.low, D.score.digits)} to ${number(row.high, D.score.digits)}`
      : "";
    return `${name} ${number(row[of], D.score.digits)}${ends}`;
  });
  const svg = draw("svg", {
    width,
    height,
    viewBox: `0 0 ${width} ${height}`,
    role: "img",
    "aria-label": `${D.score.said} with 95 % intervals: ${said.join("; ")}`,
  });
  for (const value of scale.marks)
    svg.append(
      draw("line", { class: "rule", x1: scale.at(value), x2: scale.at(value), y1: top, y2: bottom }),
      draw(
        "text",
        { x: scale.at(value), y: bottom + 16, "text-anchor": "middle", class: "soft" },
        `${+value.toPrecision(3)}${D.score.unit}`,
      ),
    );
  bases.forEach((row, k) =>
    svg.append(
      draw("line", {
        class: "baseline",
        x1: labels[k].x,
        x2: labels[k].x,
        y1: 16 * placed[k].lane + 2,
        y2: bottom,
      }),
    ),
  );
  bases.forEach((row, k) =>
    svg.append(draw("text", { x: placed[k].from, y: 16 * placed[k].lane + 12, class: "soft over" }, labels[k].text)),
  );
  rows.forEach((row, k) => {
    const y = top + step * (k + 0.5) + (narrow ? 8 : 0);
    const name = shortened(row.name, narrow ? 34 : 27);
    const best = k === 0 || alike.has(row.method);
    svg.append(
      draw(
        "text",
        narrow
          ? { x: left, y: y - 11, class: best ? "over best" : "over" }
          : { x: left - 12, y: y + 4, "text-anchor": "end", class: best ? "best" : null },
        narrow ? `${name}  ${scored(row[of])}` : name,
      ),
    );
    if (given(row.low))
      svg.append(
        draw("line", {
          x1: scale.at(row.low),
          x2: scale.at(row.high),
          y1: y,
          y2: y,
          style: `stroke: ${colour(row.method)}`,
          "stroke-width": 3,
        }),
      );
    svg.append(mark(row.method, scale.at(row[of]), y, 5.5, {}, draw("title", {}, said[k])));
    if (!narrow) svg.append(draw("text", { x: right + 12, y: y + 4, class: best ? "best" : null }, scored(row[of])));
  });
  svg.append(
    draw("line", { class: "axis", x1: left, x2: right, y1: bottom, y2: bottom }),
    draw(
      "text",
      { x: (left + right) / 2, y: height - 5, "text-anchor": "middle", class: "soft" },
      `${D.score.axis}${scale.wide ? ", on a logarithmic scale" : ""}; ${D.score.better} is better`,
    ),
  );
  return svg;
}

function firstFigure() {
  drawn($("standing"), standing);
  const left = D.leaderboard.filter((row) => row.taking_part).length - MANY;
  if (left > 0) $("standing-note").append(` The ${MANY} best; ${whole(left)} more are in the table.`);
}
