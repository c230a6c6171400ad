// A chart of curves over evaluations with intervals, and the legend whose buttons show and hide methods everywhere.
const CURVES = 4; // that are shown at first
const LABELLED = 8; // curves that have their names at their ends
const hidden = new Set();
const redraws = [];

function legend() {
  const order = D.leaderboard.map((row) => row.method).filter((m) => D.taking_part.includes(m));
  order.slice(CURVES).forEach((m) => hidden.add(m));
  const lit = (m, on) =>
    document.querySelectorAll(`.series[data-method="${m}"]`).forEach((one) => one.classList.toggle("lit", on));
  const buttons = order.map((m) =>
    make(
      "button",
      {
        type: "button",
        "data-method": m,
        on: {
          click: () => set([m], hidden.has(m)),
          pointerenter: () => lit(m, true),
          pointerleave: () => lit(m, false),
          focus: () => lit(m, true),
          blur: () => lit(m, false),
        },
      },
      swatch(m),
      METHODS[m],
    ),
  );
  const set = (methods, seenNow) => {
    methods.forEach((m) => (seenNow ? hidden.delete(m) : hidden.add(m)));
    pressed();
    redraws.forEach((redraw) => redraw());
  };
  const pressed = () =>
    buttons.forEach((button) => button.setAttribute("aria-pressed", String(!hidden.has(+button.dataset.method))));
  $("toggles").replaceChildren(...buttons);
  $("all").onclick = () => set(order, true);
  $("none").onclick = () => set(order, false);
  pressed();
}

const visible = () => D.taking_part.map((m, place) => [m, place]).filter(([m]) => !hidden.has(m));

// A chart of series {m, values, low, high} over D.evaluations, on a log scale; of what they are is `under`.
function chart(width, series, most, { label, under, stepped }) {
  const height = Math.max(240, Math.min(380, 0.62 * width));
  const left = 46;
  const bottom = 40;
  const top = 24;
  const named = width >= 420 && series.length > 0 && series.length <= LABELLED;
  const right = named ? 124 : 12;
  const used = D.evaluations;
  const from = Math.log(used[0]);
  const to = Math.log(used.at(-1)) || from + 1;
  const x = (value) => left + ((width - left - right) * (Math.log(value) - from)) / Math.max(to - from, 1e-9);
  const y = (value) => height - bottom - ((height - bottom - top) * value) / most;
  const svg = draw("svg", {
    width,
    height,
    viewBox: `0 0 ${width} ${height}`,
    role: "img",
    "aria-label": `${label} over ${under}`,
  });
  svg.append(draw("text", { x: 2, y: 12, class: "soft" }, label));
  for (const value of steps(0, most, 5)) {
    svg.append(
      draw("line", { class: "rule", x1: left, x2: width - right, y1: y(value), y2: y(value) }),
      draw(
        "text",
        { x: left - 6, y: y(value) + 4, "text-anchor": "end", class: "soft" },
        String(+value.toPrecision(3)),
      ),
    );
  }
  let free = -1e9;
  for (const value of range(24)
    .map((k) => [1, 2, 5][k % 3] * 10 ** Math.floor(k / 3))
    .filter((one) => one >= used[0] && one <= used.at(-1))) {
    if (x(value) - free < 44 || x(value) > width - right + 4) continue;
    free = x(value);
    svg.append(
      draw("line", { class: "axis", x1: free, x2: free, y1: y(0), y2: y(0) + 4 }),
      draw("text", { x: free, y: y(0) + 17, "text-anchor": "middle", class: "soft" }, whole(value)),
    );
  }
  svg.append(
    draw("line", { class: "axis", x1: left, x2: width - right, y1: y(0), y2: y(0) }),
    draw("text", { x: (left + width - right) / 2, y: height - 5, "text-anchor": "middle", class: "soft" }, under),
  );
  series.forEach((one, k) => svg.append(line(one, k, { x, y, most, used, stepped, from: left })));
  if (named)
    spread(
      series.map(({ values }) => y(Math.min(values.findLast(given), most))),
      14,
      top + 6,
      height - bottom - 2,
    ).forEach((at, k) => {
      const { m } = series[k];
      svg.append(draw("text", { x: width - right + 8, y: at + 4, class: "name" }, fitted(METHODS[m], right - 12)));
    });
  return svg;
}

// A curve with its band, which shows where it is pointed at, and some of its method's marks.
function line({ m, values, low, high }, order, { x, y, most, used, stepped, from }) {
  const group = draw("g", { class: "series", "data-method": m });
  const known = range(used.length).filter((k) => low && given(low[k]) && given(high[k]));
  if (known.length) {
    const there = known.map((k) => `${x(used[k]).toFixed(1)},${y(Math.min(high[k], most)).toFixed(1)}`);
    const back = known.reverse().map((k) => `${x(used[k]).toFixed(1)},${y(Math.min(low[k], most)).toFixed(1)}`);
    group.append(
      draw("polygon", { class: "band", points: [...there, ...back].join(" "), style: `fill: ${colour(m)}` }),
    );
  }
  let path = "";
  let free = from + 24 + 17 * (order % 5);
  const marks = [];
  values.forEach((value, k) => {
    if (!given(value)) return;
    const [px, py] = [x(used[k]), y(Math.min(value, most))];
    const to = [px.toFixed(1), py.toFixed(1)];
    path += path ? (stepped ? `H${to[0]}V${to[1]}` : `L${to.join(",")}`) : `M${to.join(",")}`;
    if (px < free || value === 0) return;
    marks.push(mark(m, px, py, 3.6));
    free = px + 85;
  });
  const title = draw("title", {}, `${METHODS[m]}: ${number(values.findLast(given), 3)} at the end`);
  const style = `stroke: ${colour(m)}`;
  group.append(
    draw("path", { class: "near", d: path }, title),
    draw("path", { class: "curve", d: path, style, "stroke-dasharray": dash(m) }),
    ...marks,
  );
  return group;
}
