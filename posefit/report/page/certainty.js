// How sure methods say they are, and whether that is so. Whoever means what he says has his dots on the dashed lines.

// Axes from 0 on: both are {most, label, marks, show}.
function axes(width, x, y, name) {
  const height = Math.max(240, Math.min(380, 0.72 * width));
  const [left, bottom, top, right] = [46, 40, 14, 22];
  const at = (value) => left + ((width - left - right) * Math.min(value, x.most)) / x.most;
  const up = (value) => height - bottom - ((height - bottom - top) * Math.min(value, y.most)) / y.most;
  const svg = draw("svg", { width, height, viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": name });
  for (const value of y.marks)
    svg.append(
      draw("line", { class: "rule", x1: left, x2: width - right, y1: up(value), y2: up(value) }),
      draw("text", { x: left - 6, y: up(value) + 4, "text-anchor": "end", class: "soft" }, y.show(value)),
    );
  for (const value of x.marks)
    svg.append(
      draw("line", { class: "axis", x1: at(value), x2: at(value), y1: up(0), y2: up(0) + 4 }),
      draw("text", { x: at(value), y: up(0) + 17, "text-anchor": "middle", class: "soft" }, x.show(value)),
    );
  svg.append(
    draw("line", { class: "axis", x1: left, x2: width - right, y1: up(0), y2: up(0) }),
    draw("text", { x: (left + width) / 2, y: height - 5, "text-anchor": "middle", class: "soft" }, x.label),
  );
  return { svg, at, up };
}

// A method's dots, joined: each is {x, y, size, said}.
function joined({ svg, at, up }, m, points) {
  const corners = points.map((dot) => `${at(dot.x).toFixed(1)},${up(dot.y).toFixed(1)}`);
  svg.append(
    draw("polyline", {
      points: corners.join(" "),
      fill: "none",
      style: `stroke: ${colour(m)}`,
      "stroke-width": 2,
      "stroke-dasharray": dash(m),
      "data-method": m,
    }),
    ...points.map((dot) =>
      mark(m, at(dot.x), up(dot.y), dot.size, {}, draw("title", {}, `${METHODS[m]}: ${dot.said}`)),
    ),
  );
}

const TENTHS = range(6).map((k) => k / 5);
const percents = (value) => `${whole(100 * value)} %`;

function certainty() {
  const C = D.certainty;
  if (!C) {
    $("certainty").remove();
    $("to-certainty").remove();
    return;
  }
  const saying = () => visible().flatMap(([m, place]) => (C.methods[place] ? [[m, C.methods[place]]] : []));
  redraws.push(
    drawn($("reliability"), (width) => {
      const x = { most: 1, label: "probability of the likeliest mode", marks: TENTHS, show: percents };
      const frame = axes(width, x, { most: 1, marks: TENTHS, show: percents }, "how often the likeliest mode is right");
      const ends = { x1: frame.at(0), x2: frame.at(1), y1: frame.up(0), y2: frame.up(1) };
      frame.svg.append(draw("line", { class: "axis", "stroke-dasharray": "4 4", ...ends }));
      for (const [m, { reliability }] of saying()) {
        const all = reliability.reduce((sum, [count]) => sum + count, 0);
        const points = reliability.map(([count, told, right]) => ({
          x: told,
          y: right,
          size: 3 + 8 * Math.sqrt(count / all),
          said: `${percents(told)} said, ${percents(right)} right, of ${counted(count, "frame")}`,
        }));
        joined(frame, m, points);
      }
      return frame.svg;
    }),
  );
  redraws.push(
    drawn($("coverage"), (width) => {
      const said = saying().filter(([, one]) => one.coverage.every(given) && one.width.every(given));
      const most = 1.08 * Math.max(10, ...said.flatMap(([, one]) => one.width));
      const x = { most, label: "radius of intervals, mm", marks: steps(0, most, width / 90), show: whole };
      const y = { most: 1, marks: [0], show: percents };
      const frame = axes(width, x, y, "share of joints within their intervals, over how wide these are");
      for (const level of C.levels) {
        const ends = { x1: frame.at(0), x2: frame.at(most), y1: frame.up(level), y2: frame.up(level) };
        frame.svg.append(
          draw("line", { class: "axis", "stroke-dasharray": "4 4", ...ends }),
          draw(
            "text",
            { x: frame.at(0) - 6, y: frame.up(level) + 4, "text-anchor": "end", class: "soft" },
            percents(level),
          ),
        );
      }
      for (const [m, one] of said) {
        const points = C.levels.map((level, k) => ({
          x: one.width[k],
          y: one.coverage[k],
          size: 4,
          said: `${percents(level)} asked, ${percents(one.coverage[k])} within ${whole(one.width[k])} mm`,
        }));
        joined(frame, m, points);
      }
      return frame.svg;
    }),
  );
  table(
    $("sure"),
    [
      { title: "method", text: true, value: ([m]) => METHODS[m], show: ([m]) => [swatch(m), METHODS[m]] },
      ...C.levels.flatMap((level, k) => [
        {
          title: `within ${percents(level)}`,
          about: `Share of joints whose truth lies in the ball that is to hold ${percents(level)} of them`,
          value: ([, one]) => one.coverage[k],
          show: ([, one]) => (given(one.coverage[k]) ? `${number(100 * one.coverage[k], 1)} %` : "–"),
        },
        {
          title: "mm",
          about: "Mean radius of these balls",
          value: ([, one]) => one.width[k],
          show: ([, one]) => (given(one.width[k]) ? whole(one.width[k]) : "–"),
        },
      ]),
      {
        title: "calibration error",
        about: "Expected calibration error of the likeliest mode's probability: the mean distance from the diagonal",
        value: ([, one]) => one.ece,
        show: ([, one]) => number(one.ece, 3),
      },
    ],
    D.taking_part.flatMap((m, place) => (C.methods[place] ? [[m, C.methods[place]]] : [])),
    { name: "How sure" },
  );
}
