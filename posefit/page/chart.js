// The parts of charts: lines, texts, axes, curves with bands.
const redraws = [];
const redraw = () => redraws.forEach((act) => act());

// Draws into a box, and again whenever its width changes.
function drawn(box, picture) {
  let last = 0;
  const repaint = () => {
    last = box.clientWidth;
    if (last) box.replaceChildren(picture(last));
  };
  new ResizeObserver(() => {
    if (box.clientWidth !== last) repaint();
  }).observe(box);
  redraws.push(repaint);
  repaint();
}

const drawLine = (x1, y1, x2, y2, about) => draw("line", { x1, y1, x2, y2, ...about });
const drawText = (x, y, text, about) => draw("text", { x, y, ...about }, text);
const MIDDLE = { "text-anchor": "middle", class: "soft" };
const END = { "text-anchor": "end", class: "soft" };
const drawing = (width, height, name) =>
  draw("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": name });

// Round values from low to high, about `count` of them.
function steps(low, high, count) {
  const rough = (high - low) / count || 1;
  const size = 10 ** Math.floor(Math.log10(rough));
  const step = size * [1, 2, 5, 10].find((one) => one * size >= rough);
  return range(Math.floor(high / step) - Math.ceil(low / step) + 1).map((k) => (Math.ceil(low / step) + k) * step);
}

// Draws a chart with its axes, {from, to, marks, show, label}. Either axis may be
// logarithmic; the horizontal one may have rules instead of ticks. Returns the drawing,
// and the functions from values to its pixels.
function axes({ width, height, left, right, top, bottom, name }, x, y) {
  const svg = drawing(width, height, name);
  const [last, base] = [width - right, height - bottom];
  const scale = ({ from = 0, to, log }, low, high) => {
    const of = log ? Math.log : (value) => value;
    return (value) => low + ((high - low) * (of(Math.min(value, to)) - of(from))) / Math.max(of(to) - of(from), 1e-9);
  };
  const [at, up] = [scale(x, left, last), y ? scale(y, base, top) : null];
  for (const value of y ? y.marks : [])
    svg.append(
      drawLine(left, up(value), last, up(value), { class: "rule" }),
      drawText(left - 6, up(value) + 4, y.show(value), END),
    );
  for (const value of x.marks)
    svg.append(
      x.rules
        ? drawLine(at(value), top, at(value), base, { class: "rule" })
        : drawLine(at(value), base, at(value), base + 4, { class: "axis" }),
      drawText(at(value), base + 17, x.show(value), MIDDLE),
    );
  svg.append(drawLine(left, base, last, base, { class: "axis" }));
  if (x.label) svg.append(drawText((left + last) / 2, height - 5, x.label, MIDDLE));
  if (y && y.label) svg.append(drawText(2, 12, y.label, { class: "soft" }));
  return { svg, at, up };
}

const corners = (points) => points.map((point) => point.map((value) => value.toFixed(1)).join(","));
const path = (points) => `M${corners(points).join("L")}`;

// The area between points [x, low, high].
const band = (points, about) =>
  draw("polygon", {
    points: corners([
      ...points.map(([x, , high]) => [x, high]),
      ...points.toReversed().map(([x, low]) => [x, low]),
    ]).join(" "),
    ...about,
  });

const rounded = (value) => String(+value.toPrecision(3)).replace("-", "−");
