// Who is better than whom: mean ranks with the critical difference, and paired tests of one method with all others.
const probability = (p) => (!given(p) ? "–" : p < 0.001 ? "< 0.001" : p.toFixed(3));
// A probability in a sentence.
const stated = (p) => `p ${p < 0.001 ? "" : "= "}${probability(p)}`;

function differenceDiagram(P, room) {
  const order = P.ranks.map((rank, k) => [rank, k]).sort((a, b) => a[0] - b[0]);
  const count = order.length;
  const half = Math.ceil(count / 2);
  const width = Math.max(290, Math.min(760, room));
  const side = Math.min(250, 0.4 * width);
  const [left, right] = [side, width - side];
  const step = 20;
  const x = (rank) => left + ((right - left) * (rank - 1)) / Math.max(count - 1, 1);
  const axis = 62;
  const names = axis + 22 + 8 * P.cliques.length;
  const height = names + step * half + 4;
  const ranks = order.map(([rank, k]) => `${METHODS[P.methods[k]]} ${rank.toFixed(2)}`);
  const svg = draw("svg", {
    width,
    height,
    viewBox: `0 0 ${width} ${height}`,
    role: "img",
    "aria-label": `Mean ranks, best first: ${ranks.join(", ")}`,
  });
  const long = Math.min(P.critical_difference, count - 1);
  const said =
    `critical difference ${P.critical_difference.toFixed(2)}` +
    (P.critical_difference > long ? ", longer than the line" : "");
  svg.append(
    draw("line", { class: "ink", x1: x(1), x2: x(1 + long), y1: 26, y2: 26, "stroke-width": 2 }),
    draw("text", { x: Math.max(0, Math.min(x(1), width - textWidth(said) - 4)), y: 17 }, said),
    draw("line", { class: "ink", x1: x(1), x2: x(count), y1: axis, y2: axis }),
  );
  const every = Math.ceil((textWidth(String(count)) + 4) / ((right - left) / Math.max(count - 1, 1)));
  for (let rank = 1; rank <= count; rank += every) {
    svg.append(
      draw("line", { class: "ink", x1: x(rank), x2: x(rank), y1: axis - 6, y2: axis }),
      draw("text", { x: x(rank), y: axis - 10, "text-anchor": "middle" }, String(rank)),
    );
  }
  P.cliques.forEach((clique, k) =>
    svg.append(
      draw("line", {
        class: "ink",
        "stroke-width": 4,
        x1: x(P.ranks[clique[0]]) - 4,
        x2: x(P.ranks[clique.at(-1)]) + 4,
        y1: axis + 10 + 8 * k,
        y2: axis + 10 + 8 * k,
      }),
    ),
  );
  order.forEach(([rank, k], place) => {
    const m = P.methods[k];
    const best = place < half;
    const at = names + step * (best ? place : count - 1 - place) + 6;
    const edge = best ? left - 14 : right + 14;
    const name = fitted(METHODS[m], side - 22 - textWidth(` ${rank.toFixed(2)}`));
    svg.append(
      draw("polyline", {
        points: `${x(rank)},${axis} ${x(rank)},${at} ${edge},${at}`,
        fill: "none",
        style: `stroke: ${colour(m)}`,
        "stroke-dasharray": dash(m),
      }),
      mark(m, x(rank), axis, 4),
      draw(
        "text",
        { x: best ? edge - 5 : edge + 5, y: at + 4, "text-anchor": best ? "end" : "start" },
        best ? `${name}  ${rank.toFixed(2)}` : `${rank.toFixed(2)}  ${name}`,
      ),
    );
  });
  return svg;
}

// Every comparison of a method, turned so that it comes first; a difference below 0 is in its favour.
function duelsOf(m) {
  const P = D.pairs;
  const mine = P.methods.indexOf(m);
  return P.pairs
    .filter((pair) => pair[0] === mine || pair[1] === mine)
    .map(([first, second, difference, p, adjusted, better, low, high]) =>
      first === mine
        ? { other: P.methods[second], difference, p, adjusted, better, low, high }
        : {
            other: P.methods[first],
            difference: -difference,
            p,
            adjusted,
            better: 1 - better,
            low: given(high) ? 1 - high : null,
            high: given(low) ? 1 - low : null,
          },
    );
}

function comparison() {
  const P = D.pairs;
  if (!P) {
    $("friedman").textContent = "A comparison needs two methods that share at least two runs.";
    $("against").closest(".row").remove();
    return;
  }
  $("friedman").textContent =
    `Friedman's test over ${whole(P.blocks)} pairs of instance and seed: ` +
    `${stated(P.friedman)} that all methods are alike` +
    `${P.friedman >= 0.05 ? "; what follows means little then" : ""}. Below are mean ranks, 1 is best; ` +
    "bars join methods whose ranks differ by less than Nemenyi's critical difference at 5 %. " +
    "Seeds of one instance are not independent: all of it holds for these instances.";
  drawn($("difference"), (width) => differenceDiagram(P, width));
  const first = D.leaderboard[0].method;
  choose(
    $("against"),
    P.methods.map((m) => [String(m), METHODS[m]]),
    String(first),
    () => show(+$("against").value),
  );
  const show = (m) =>
    table(
      $("pairs"),
      [
        { title: "other method", text: true, value: (row) => METHODS[row.other], show: (row) => METHODS[row.other] },
        {
          title: "median difference °",
          about: "Below 0 the chosen method is better",
          value: (row) => row.difference,
          show: (row) => number(row.difference, 2),
        },
        { title: "Wilcoxon p", value: (row) => row.p, show: (row) => probability(row.p) },
        {
          title: "p after Holm",
          about: `Adjusted for all ${P.pairs.length} comparisons`,
          value: (row) => row.adjusted,
          show: (row) => probability(row.adjusted),
        },
        {
          title: "probability of improvement",
          about: "That a run of the chosen method has the lower error",
          down: true,
          value: (row) => row.better,
          show: (row) => number(row.better, 2),
        },
        {
          title: "95 % interval",
          about: "From three seeds on, where the runs are not too many",
          value: (row) => row.low,
          show: (row) => (given(row.low) ? `${number(row.low, 2)} – ${number(row.high, 2)}` : "–"),
        },
        { title: "verdict", text: true, value: (row) => verdict(row), show: (row) => verdict(row) },
      ],
      duelsOf(m),
      { by: 1, name: "Paired tests" },
    );
  show(first);
}

const verdict = (row) => (row.adjusted >= 0.05 ? "not told apart" : row.difference < 0 ? "better" : "worse");

// How the orders came out that publications claim.
function claims() {
  const stepped = (C, names, { difference, adjusted, by_instance }, k) =>
    `${names[k + 1]} is ` +
    (difference < 0 ? "worse" : difference > 0 ? "better" : "the same") +
    ` by a median of ${number(Math.abs(difference), 2)}° than ${names[k]} (paired Wilcoxon, Holm over all steps, ` +
    `${C.blocks} pairs: ${stated(adjusted)}; over ${C.instances} instances alone: ${stated(by_instance)})`;
  D.claims.forEach((C) => {
    const names = C.methods.map((m) => METHODS[m]);
    const errors = C.errors.map((value) => `${number(value, 2)}°`);
    const between = (k) => `from ${names[k]} to ${names[k + 1]}`;
    const held = C.steps.flatMap((one, k) => (one.seen ? [between(k)] : []));
    const said =
      held.length === C.steps.length
        ? `${C.steps.length > 1 ? "Every step is" : "It is"} seen here`
        : held.length
          ? `Only the step ${held.join(" and ")} is seen here`
          : `${C.steps.length > 1 ? "No step is" : "It is not"} seen here`;
    $("claims").append(
      make(
        "div",
        { class: "note claim" },
        make("strong", {}, `What ${C.source} claims`),
        `: ${C.said}. Here ${names.map((name, k) => `${name} ${k ? "" : "has "}${errors[k]}`).join(", ")}. ` +
          `${C.steps.map((step, k) => stepped(C, names, step, k)).join("; ")}. ${said}, at 5 %.`,
      ),
    );
  });
}
