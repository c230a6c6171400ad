// What every part of a report uses: names, colours and marks of methods, and what they are judged by.
const METHODS = D.methods.map((one) => one.name);
const INSTANCES = D.instances.map((one) => one.name);
// A method's score with its unit, in a sentence or a figure.
const scored = (value) => `${number(value, D.score.digits)}${D.score.unit}`;
const DASHES = ["", "7 3", "2 3", "8 3 2 3"];
const colour = (m) => `var(--c${m % D.colours})`;
const dash = (m) => DASHES[Math.floor(m / D.colours) % DASHES.length];

// Corners of marks about 0, 0, of which a disc has the area: seven colours and eight marks make 56 pairs.
const polygon = (count, radius, turn = 0) =>
  range(count).map((k) => {
    const [angle, size] = [
      2 * Math.PI * (k / count + turn) - Math.PI / 2,
      Array.isArray(radius) ? radius[k % 2] : radius,
    ];
    return [size * Math.cos(angle), size * Math.sin(angle)];
  });
const CROSS = [
  [-0.45, -1.3],
  [0.45, -1.3],
  [0.45, -0.45],
  [1.3, -0.45],
  [1.3, 0.45],
  [0.45, 0.45],
  [0.45, 1.3],
  [-0.45, 1.3],
  [-0.45, 0.45],
  [-1.3, 0.45],
  [-1.3, -0.45],
  [-0.45, -0.45],
];
const MARKS = [
  polygon(24, 1),
  polygon(4, 1.25, 0.125),
  polygon(3, 1.5),
  polygon(4, 1.35),
  polygon(3, 1.5, 0.5),
  CROSS,
  polygon(10, [1.6, 0.7]),
  polygon(6, 1.15),
];

// A method's mark at a place; what else is said of it stands in `about`, and in its children.
function mark(m, x, y, radius, about, ...children) {
  const corners = MARKS[m % MARKS.length].map(
    ([a, b]) => `${(x + radius * a).toFixed(1)},${(y + radius * b).toFixed(1)}`,
  );
  return draw(
    "polygon",
    { class: "mark", points: corners.join(" "), style: `fill: ${colour(m)}`, ...about },
    ...children,
  );
}

function swatch(m) {
  return draw(
    "svg",
    { width: 20, height: 12, "aria-hidden": "true" },
    draw("line", {
      x1: 0,
      x2: 20,
      y1: 6,
      y2: 6,
      style: `stroke: ${colour(m)}`,
      "stroke-width": 2.5,
      "stroke-dasharray": dash(m),
    }),
    mark(m, 10, 6, 4),
  );
}

// Places as near to what is wanted as they can be, at least a gap apart, in the same order.
function spread(wanted, gap, low, high) {
  const order = range(wanted.length).sort((a, b) => wanted[a] - wanted[b]);
  const found = [];
  order.forEach((k, rank) => {
    found[k] = Math.max(wanted[k], rank ? found[order[rank - 1]] + gap : low);
  });
  let most = high;
  for (const k of order.reverse()) {
    found[k] = Math.min(found[k], most);
    most = found[k] - gap;
  }
  return found;
}

const shortened = (name, most) => (name.length > most ? `${name.slice(0, most - 1)}…` : name);
