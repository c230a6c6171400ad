// The curves of a sweep of tracks, and the errors of joints.
const UNDER = "evaluations of a frame";

function curves() {
  $("bands").onchange = () => $("bands").closest("main").classList.toggle("banded", $("bands").checked);
  if (!D.evaluations.length) return ["convergence", "ecdf"].forEach((id) => $(id).append("no run has a trace"));
  redraws.push(
    drawn($("convergence"), (width) => {
      const all = visible().map(([m, place]) => ({ m, ...(D.convergence[place] ?? { values: [] }) }));
      // one point is no curve
      const series = all.filter((one) => one.values.filter(given).length > 1);
      const without = all.filter((one) => !series.includes(one)).map(({ m }) => METHODS[m]);
      $("no-curve").textContent = without.length ? `Without a curve: ${without.join(", ")}.` : "";
      const values = series
        .flatMap((one) => one.values)
        .filter(given)
        .sort((a, b) => a - b);
      return chart(width, series, 1.05 * (values[Math.floor(0.98 * (values.length - 1))] || 1), {
        label: "best cost",
        under: UNDER,
      });
    }),
  );
  redraws.push(
    drawn($("ecdf"), (width) =>
      chart(
        width,
        visible().map(([m, place]) => ({ m, values: D.reached[place] })),
        1,
        { label: "share of targets reached", under: UNDER, stepped: true },
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
      const most = 1.05 * Math.max(1, ...shown.flatMap(([, place]) => [...D.joint_errors[place].values]));
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
          const group = draw("g", { class: "series", "data-method": m });
          if (given(one.low[j])) {
            const ends = { x1: x(one.low[j]), x2: x(one.high[j]), y1: at, y2: at };
            group.append(draw("line", { class: "band", ...ends, style: `stroke: ${colour(m)}`, "stroke-width": 2 }));
          }
          const said = `${METHODS[m]}, ${joint}: ${number(one.values[j], 1)} mm`;
          group.append(mark(m, x(one.values[j]), at, 3.6, {}, draw("title", {}, said)));
          svg.append(group);
        });
      });
      return svg;
    }),
  );
}
