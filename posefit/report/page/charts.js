// Curves over evaluations with their intervals, and the legend whose buttons show and hide methods everywhere.
const hidden = new Set();
const redraws = [];
let banded = true;

function legend() {
  const order = D.leaderboard.map((row) => row.method).filter((m) => D.taking_part.includes(m));
  const shown = new Set([...order.slice(0, 6), ...(D.claim ? D.claim.methods : [])]);
  order.filter((m) => !shown.has(m)).forEach((m) => hidden.add(m));
  const buttons = order.map((m) =>
    make(
      "button",
      { type: "button", "data-method": m, on: { click: () => set([m], hidden.has(m)) } },
      swatch(m),
      METHODS[m],
    ),
  );
  const set = (methods, visible) => {
    methods.forEach((m) => (visible ? hidden.delete(m) : hidden.add(m)));
    mark();
    redraws.forEach((redraw) => redraw());
  };
  const mark = () =>
    buttons.forEach((button) => button.setAttribute("aria-pressed", String(!hidden.has(+button.dataset.method))));
  $("toggles").replaceChildren(...buttons);
  $("all").onclick = () => set(order, true);
  $("none").onclick = () => set(order, false);
  $("bands").onchange = () => {
    banded = $("bands").checked;
    redraws.forEach((redraw) => redraw());
  };
  mark();
}

const visible = () => D.taking_part.map((m, place) => [m, place]).filter(([m]) => !hidden.has(m));

// A chart of series {m, values, low, high} over D.evaluations, on a log scale.
function chart(width, series, most, label, stepped) {
  const height = Math.max(240, Math.min(380, 0.62 * width));
  const left = 46;
  const bottom = 40;
  const top = 8;
  const right = 10;
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
    "aria-label": `${label} over evaluations`,
  });
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
    if (x(value) - free < 44 || x(value) > width - 12) continue;
    free = x(value);
    svg.append(
      draw("line", { class: "axis", x1: free, x2: free, y1: y(0), y2: y(0) + 4 }),
      draw("text", { x: free, y: y(0) + 17, "text-anchor": "middle", class: "soft" }, whole(value)),
    );
  }
  svg.append(
    draw("line", { class: "axis", x1: left, x2: width - right, y1: y(0), y2: y(0) }),
    draw(
      "text",
      { x: (left + width) / 2, y: height - 5, "text-anchor": "middle", class: "soft" },
      "evaluations of a frame",
    ),
  );
  for (const { m, low, high } of banded ? series : []) {
    const known = range(used.length).filter((k) => low && given(low[k]) && given(high[k]));
    if (!known.length) continue;
    const there = known.map((k) => `${x(used[k]).toFixed(1)},${y(Math.min(high[k], most)).toFixed(1)}`);
    const back = known.reverse().map((k) => `${x(used[k]).toFixed(1)},${y(Math.min(low[k], most)).toFixed(1)}`);
    svg.append(draw("polygon", { points: [...there, ...back].join(" "), style: `fill: ${colour(m)}`, opacity: 0.13 }));
  }
  for (const { m, values } of series) {
    if (values.filter(given).length === 1) {
      const k = values.findIndex(given);
      svg.append(
        draw(
          "circle",
          { cx: x(used[k]) - 3, cy: y(Math.min(values[k], most)), r: 4, style: `fill: ${colour(m)}` },
          draw("title", {}, `${METHODS[m]}: ${number(values[k], 3)}`),
        ),
      );
    }
    let path = "";
    values.forEach((value, k) => {
      if (!given(value)) return;
      const [px, py] = [x(used[k]).toFixed(1), y(Math.min(value, most)).toFixed(1)];
      path += path ? (stepped ? `H${px}V${py}` : `L${px},${py}`) : `M${px},${py}`;
    });
    svg.append(
      draw(
        "path",
        {
          d: path,
          fill: "none",
          style: `stroke: ${colour(m)}`,
          "stroke-width": 2,
          "stroke-dasharray": dash(m),
          "data-method": m,
        },
        draw("title", {}, `${METHODS[m]}: ${number(values.filter(given).at(-1), 3)} at the end`),
      ),
    );
  }
  return svg;
}

function curves() {
  if (!D.evaluations.length) return ["convergence", "ecdf"].forEach((id) => $(id).append("no run has a trace"));
  redraws.push(
    drawn($("convergence"), (width) => {
      const series = visible()
        .map(([m, place]) => D.convergence[place] && { m, ...D.convergence[place] })
        .filter(Boolean);
      const values = series
        .flatMap((one) => [...one.values, ...(banded ? one.high : [])])
        .filter(given)
        .sort((a, b) => a - b);
      return chart(width, series, 1.05 * (values[Math.floor(0.98 * (values.length - 1))] || 1), "best cost");
    }),
  );
  redraws.push(
    drawn($("ecdf"), (width) =>
      chart(
        width,
        visible().map(([m, place]) => ({ m, values: D.reached[place] })),
        1,
        "share of targets reached",
        true,
      ),
    ),
  );
}

function jointErrors() {
  if (!D.joint_errors.length) return $("joint-errors").append("runs do not say the errors of joints");
  redraws.push(
    drawn($("joint-errors"), (width) => {
      const left = 84;
      const right = 14;
      const row = 20;
      const height = row * D.joints.length + 40;
      const shown = visible();
      const most =
        1.05 *
        Math.max(
          1,
          ...shown.flatMap(([, place]) => [
            ...D.joint_errors[place].values,
            ...(banded ? D.joint_errors[place].high.filter(given) : []),
          ]),
        );
      const x = (value) => left + ((width - left - right) * Math.min(value, most)) / most;
      const svg = draw("svg", {
        width,
        height,
        viewBox: `0 0 ${width} ${height}`,
        role: "img",
        "aria-label": "error of each joint",
      });
      for (const value of steps(0, most, Math.max(3, width / 110))) {
        svg.append(
          draw("line", { class: "rule", x1: x(value), x2: x(value), y1: 4, y2: height - 34 }),
          draw("text", { x: x(value), y: height - 18, "text-anchor": "middle", class: "soft" }, whole(value)),
        );
      }
      svg.append(draw("text", { x: (left + width) / 2, y: height - 3, "text-anchor": "middle", class: "soft" }, "mm"));
      D.joints.forEach((joint, j) => {
        svg.append(draw("text", { x: left - 8, y: row * j + 18, "text-anchor": "end" }, joint));
        shown.forEach(([m, place], k) => {
          const one = D.joint_errors[place];
          const at = row * j + 7 + (shown.length > 1 ? (13 * k) / (shown.length - 1) : 6);
          if (banded && given(one.low[j]))
            svg.append(
              draw("line", {
                x1: x(one.low[j]),
                x2: x(one.high[j]),
                y1: at,
                y2: at,
                style: `stroke: ${colour(m)}`,
                opacity: 0.35,
              }),
            );
          svg.append(
            draw(
              "circle",
              { cx: x(one.values[j]), cy: at, r: 3.2, style: `fill: ${colour(m)}`, "data-method": m },
              draw("title", {}, `${METHODS[m]}, ${joint}: ${number(one.values[j], 1)} mm`),
            ),
          );
        });
      });
      return svg;
    }),
  );
}
