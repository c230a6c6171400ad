// Names, colours and marks of methods, and the legend whose buttons show and hide them in every chart.
const METHODS = D.methods.map((one) => one.name);
const INSTANCES = D.instances.map((one) => one.name);
const DASHES = ["", "7 3", "2 3", "8 3 2 3"];
const FIRST_CURVES = 4; // methods in the charts at first
const hidden = new Set();
const colour = (m) => `var(--c${m % D.colours})`;
const dash = (m) => DASHES[Math.floor(m / D.colours) % DASHES.length];
// A method's score with its unit, in a sentence or a figure.
const scored = (value) => `${number(value, D.score.digits)}${D.score.unit}`;

const numbered = (names) => names.map((name, k) => [String(k), name]);
const button = (text, click, about) => make("button", { type: "button", on: { click }, ...about }, ...[text].flat());
const percents = (value) => `${whole(100 * value)} %`;

// Corners of marks around 0, 0 with the area of a disc: seven colours and eight marks make 56 pairs.
const polygon = (count, radii, turn = 0) =>
  range(count).map((k) => {
    const angle = 2 * Math.PI * (k / count + turn) - Math.PI / 2;
    return [radii[k % radii.length] * Math.cos(angle), radii[k % radii.length] * Math.sin(angle)];
  });
const SHAPES = [
  polygon(24, [1]),
  polygon(4, [1.25], 0.125),
  polygon(3, [1.5]),
  polygon(4, [1.35]),
  polygon(3, [1.5], 0.5),
  polygon(8, [1.7, 0.6], 0.125),
  polygon(10, [1.6, 0.7]),
  polygon(6, [1.15]),
];

// A method's mark at a place, with the text that it shows where it is pointed at.
const mark = (m, x, y, radius, title) =>
  draw(
    "polygon",
    {
      class: "mark",
      points: corners(SHAPES[m % SHAPES.length].map(([a, b]) => [x + radius * a, y + radius * b])).join(" "),
      style: `fill: ${colour(m)}`,
    },
    title ? draw("title", {}, title) : null,
  );

const stroke = (m, width) => ({
  fill: "none",
  style: `stroke: ${colour(m)}`,
  "stroke-width": width,
  "stroke-dasharray": dash(m),
});

const swatch = (m) =>
  draw(
    "svg",
    { width: 20, height: 12, "aria-hidden": "true" },
    drawLine(0, 6, 20, 6, stroke(m, 2.5)),
    mark(m, 10, 6, 4),
  );

// The methods of the charts, with their places among those that take part.
const visible = () => D.taking_part.map((m, place) => [m, place]).filter(([m]) => !hidden.has(m));

function legend() {
  const order = D.leaderboard.map((row) => row.method).filter((m) => D.taking_part.includes(m));
  order.slice(FIRST_CURVES).forEach((m) => hidden.add(m));
  const set = (methods, on) => {
    methods.forEach((m) => (on ? hidden.delete(m) : hidden.add(m)));
    buttons.forEach((one) => one.setAttribute("aria-pressed", String(!hidden.has(+one.dataset.method))));
    redraw();
  };
  const buttons = order.map((m) => {
    const one = button([swatch(m), METHODS[m]], () => set([m], hidden.has(m)), { "data-method": m });
    for (const [event, on] of Object.entries({ pointerenter: true, pointerleave: false, focus: true, blur: false }))
      one.addEventListener(event, () =>
        document
          .querySelectorAll(`.series[data-method="${m}"]`)
          .forEach((series) => series.classList.toggle("lit", on)),
      );
    return one;
  });
  $("toggles").replaceChildren(...buttons);
  $("all").onclick = () => set(order, true);
  $("none").onclick = () => set(order, false);
  $("bands").onchange = () => document.querySelector("main").classList.toggle("banded", $("bands").checked);
  set([], true);
}
