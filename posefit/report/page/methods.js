// Names, colours and marks of methods, and the legend whose buttons show and hide them in every chart.
const METHODS = D.methods.map((method) => method.name);
const INSTANCES = D.instances.map((instance) => instance.name);
const DASHES = ["", "7 3", "2 3", "8 3 2 3"];
const FIRST_CURVES = 4; // methods in the charts at first
const hidden = new Set();
const colour = (m) => `var(--c${m % D.constants.colours})`;
const dash = (m) => DASHES[Math.floor(m / D.constants.colours) % DASHES.length];
// A method's score with its unit, in a sentence or a figure.
const scored = (value) => `${number(value, D.score.digits)}${D.score.unit}`;

const numbered = (names) => names.map((name, k) => [String(k), name]);
const button = (text, click, about) => make("button", { type: "button", on: { click }, ...about }, ...[text].flat());

// Marks around 0, 0 with about the area of a disc: seven colours and eight marks make 56 pairs.
const SHAPES = [
  "M-1,0a1,1 0 1 0 2,0a1,1 0 1 0 -2,0",
  "M-.9,-.9H.9V.9H-.9Z",
  "M0,-1.5L1.3,.75H-1.3Z",
  "M0,-1.35L1.35,0L0,1.35L-1.35,0Z",
  "M0,1.5L1.3,-.75H-1.3Z",
  "M0,-.55L1.2,-1.2L.55,0L1.2,1.2L0,.55L-1.2,1.2L-.55,0L-1.2,-1.2Z",
  "M0,-1.6L.5,-.5H1.5L.7,.2L1,1.3L0,.7L-1,1.3L-.7,.2L-1.5,-.5H-.5Z",
  "M0,-1.15L1,-.6V.6L0,1.15L-1,.6V-.6Z",
];

// A method's mark at a place, with the text that it shows where it is pointed at.
const mark = (m, x, y, radius, title) =>
  draw(
    "path",
    {
      class: "mark",
      d: SHAPES[m % SHAPES.length],
      transform: `translate(${x} ${y}) scale(${radius})`,
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

// The methods of the charts, with their places among the methods that take part.
const visible = () => D.taking_part.map((m, place) => [m, place]).filter(([m]) => !hidden.has(m));

function legend() {
  const order = D.leaderboard.map((row) => row.method).filter((m) => D.taking_part.includes(m));
  order.slice(FIRST_CURVES).forEach((m) => hidden.add(m));
  const set = (methods, on) => {
    methods.forEach((m) => (on ? hidden.delete(m) : hidden.add(m)));
    buttons.forEach((one, k) => one.setAttribute("aria-pressed", String(!hidden.has(order[k]))));
    redraw();
  };
  const buttons = order.map((m) =>
    button([swatch(m), METHODS[m]], () => set([m], hidden.has(m)), { "data-method": m }),
  );
  $("toggles").replaceChildren(...buttons);
  $("all").onclick = () => set(order, true);
  $("none").onclick = () => set(order, false);
  set([], true);
}
