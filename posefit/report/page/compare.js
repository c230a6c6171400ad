// Methods compared: ranks and paired tests, one method against all others.
const probability = (p) => (!given(p) ? "–" : p < 0.001 ? "< 0.001" : p.toFixed(3));
const stated = (p) => `p ${p < 0.001 ? "" : "= "}${probability(p)}`; // in a sentence
const degrees = (value) => `${number(value, 2)}°`;
const twoDigits = (value) => number(value, 2);
const verdict = (row) => (row.adjusted >= 0.05 ? "no difference shown" : row.difference < 0 ? "better" : "worse");

// Mean ranks on a line; bars join methods that do not differ. Demšar, 2006.
function ranksDiagram(P, room) {
  const order = P.ranks.map((rank, k) => [rank, k]).sort((a, b) => a[0] - b[0]);
  const count = order.length;
  const half = Math.ceil(count / 2);
  const width = between(290, 760, room);
  const side = Math.min(250, 0.4 * width);
  const [left, right, line] = [side, width - side, 62];
  const at = (rank) => left + ((right - left) * (rank - 1)) / Math.max(count - 1, 1);
  const names = line + 22 + 8 * P.cliques.length;
  const ranks = order.map(([rank, k]) => `${METHODS[P.methods[k]]} ${rank.toFixed(2)}`);
  const svg = drawing(width, names + 20 * half + 4, `Mean ranks, best first: ${ranks.join(", ")}`);
  const long = Math.min(P.critical_difference, count - 1);
  const longer = P.critical_difference > long ? ", longer than the line" : "";
  const difference = `critical difference ${P.critical_difference.toFixed(2)}${longer}`;
  svg.append(
    drawLine(at(1), 26, at(1 + long), 26, { class: "ink", "stroke-width": 2 }),
    drawText(between(0, width - textWidth(difference) - 4, at(1)), 17, difference),
    drawLine(at(1), line, at(count), line, { class: "ink" }),
  );
  const every = Math.ceil((textWidth(String(count)) + 4) / ((right - left) / Math.max(count - 1, 1)));
  for (let rank = 1; rank <= count; rank += every)
    svg.append(
      drawLine(at(rank), line - 6, at(rank), line, { class: "ink" }),
      drawText(at(rank), line - 10, String(rank), { "text-anchor": "middle" }),
    );
  P.cliques.forEach((clique, k) => {
    const [low, high, y] = [P.ranks[clique[0]], P.ranks[clique.at(-1)], line + 10 + 8 * k];
    svg.append(drawLine(at(low) - 4, y, at(high) + 4, y, { class: "ink", "stroke-width": 4 }));
  });
  order.forEach(([rank, k], place) => {
    const m = P.methods[k];
    const best = place < half;
    const y = names + 20 * (best ? place : count - 1 - place) + 6;
    const edge = best ? left - 14 : right + 14;
    const value = rank.toFixed(2);
    const name = fitted(METHODS[m], side - 22 - textWidth(` ${value}`));
    const text = best ? `${name}  ${value}` : `${value}  ${name}`;
    svg.append(
      draw("path", { d: `M${at(rank)},${line}V${y}H${edge}`, ...stroke(m, 1) }),
      mark(m, at(rank), line, 4),
      drawText(best ? edge - 5 : edge + 5, y + 4, text, { "text-anchor": best ? "end" : "start" }),
    );
  });
  return svg;
}

// Every paired test of a method, turned so that it comes first: a difference below 0 is in its favour.
function duelsOf(m) {
  const P = D.pairs;
  const mine = P.methods.indexOf(m);
  const not = (share) => (given(share) ? 1 - share : null);
  return P.pairs
    .filter((pair) => pair.slice(0, 2).includes(mine))
    .map(([first, second, difference, p, adjusted, better, low, high]) => {
      if (first === mine) return { other: P.methods[second], difference, p, adjusted, better, low, high };
      const other = { better: not(better), low: not(high), high: not(low) };
      return { other: P.methods[first], difference: -difference, p, adjusted, ...other };
    });
}

function comparison() {
  const P = D.pairs;
  if (!P) {
    $("friedman").textContent = "A comparison needs two methods that share at least two runs.";
    return $("against").closest(".row").remove();
  }
  $("friedman").textContent =
    `Friedman's test over ${whole(P.blocks)} pairs of instance and seed: ${stated(P.friedman)} that all methods are ` +
    `equal${P.friedman >= 0.05 ? "; the rest of this section means little then" : ""}. Below are mean ranks, 1 is best; ` +
    "bars join methods whose ranks differ by less than Nemenyi's critical difference at 5 %. " +
    "Seeds of one instance are not independent: all of it holds for these instances.";
  drawn($("difference"), (width) => ranksDiagram(P, width));
  const columns = [
    textColumn("other method", (row) => METHODS[row.other]),
    column("median difference °", "difference", twoDigits, { about: "Below 0 the chosen method is better" }),
    column("Wilcoxon p", "p", probability),
    column("p after Holm", "adjusted", probability, { about: `Adjusted for all ${P.pairs.length} comparisons` }),
    column("probability of improvement", "better", twoDigits, {
      about: "That a run of the chosen method has the lower error",
      down: true,
    }),
    intervalColumn("From three seeds on, if the runs are not too many", "low", 2, () => "–"),
    textColumn("verdict", verdict),
  ];
  const show = (m) => table($("pairs"), columns, duelsOf(m), { name: "Paired tests", by: 1 });
  const names = P.methods.map((m) => [String(m), METHODS[m]]);
  chooseMethod($("against"), names, D.leaderboard[0].method, show);
}

// A select of methods, which shows the chosen one.
function chooseMethod(select, names, first, show) {
  choose(select, names, String(first), () => show(+select.value));
  show(first);
}

// One method against all others, instance by instance.
function author() {
  const first = D.leaderboard ? D.leaderboard[0].method : 0;
  chooseMethod($("mine"), numbered(METHODS), first, against);
}

// The mean error over seeds of each instance and method; null where there is none.
function meanErrors() {
  const errors = INSTANCES.map(() => METHODS.map(() => []));
  D.rows.error.forEach((error, k) => given(error) && errors[D.rows.instance[k]][D.rows.method[k]].push(error));
  const mean = (values) => (values.length ? values.reduce((sum, value) => sum + value, 0) / values.length : null);
  return errors.map((row) => row.map(mean));
}

function against(m) {
  const R = D.rows;
  const duels = meanErrors()
    .map((errors, instance) => {
      const others = errors.map((error, one) => [error, one]).filter(([error, one]) => given(error) && one !== m);
      const [least, best] = others.sort((a, b) => a[0] - b[0])[0] ?? [null, null];
      const rank = 1 + others.filter(([error]) => error < errors[m]).length;
      return { instance, errors, mine: errors[m], least, best, rank, of: others.length + 1 };
    })
    .filter((row) => given(row.mine));
  $("verdict").textContent = duels.length ? verdictText(m, duels) : "No run of it has an error.";
  const most = usualMost(duels.flatMap((row) => row.errors));
  const skill = (name) => (row) => {
    const base = D.instances[row.instance][name];
    return given(base) && base > 0 ? 1 - row.mine / base : null;
  };
  const best = (row) => [number(row.least, 2), make("small", {}, METHODS[row.best])];
  const columns = [
    namedColumn("instance", INSTANCES, (row) => row.instance),
    { title: "all methods", text: true, show: (row) => errorDots(row.errors, m, most) },
    figure("error", "mine"),
    { title: "rank", value: (row) => row.rank, show: (row) => `${row.rank} of ${row.of}` },
    { title: "best other °", value: (row) => row.least, show: (row) => (given(row.least) ? best(row) : "–") },
    column("behind it by °", (row) => (given(row.least) ? row.mine - row.least : null), twoDigits, { down: true }),
    ...Object.keys(D.baseline_names).map((name) => figure(`skill_${name}`, skill(name))),
  ];
  table($("duels"), columns, duels, { name: "Instance by instance", by: 5, down: true });
  const { lost, swapped } = D.columns;
  $("lost-note").textContent = `${lost.label}: ${lost.about}; ${swapped.label}: ${swapped.about}.`;
  const gone = range(R.key.length).filter((k) => R.method[k] === m && (R.lost[k] > 0 || R.swapped[k] > 0));
  if (!gone.length)
    return $("tracks").replaceChildren(make("p", {}, "None of its runs lost a frame or swapped left and right."));
  const tracks = [
    namedColumn("instance", INSTANCES, (k) => R.instance[k]),
    seedColumn((k) => R.seed[k]),
    ...["lost", "swapped", "error"].map((name) => ({ ...figure(name, (k) => R[name][k]), down: true })),
    buttonColumn("watch, or run again", runButtons),
  ];
  table($("tracks"), tracks, gone, { name: "Lost and swapped tracks", by: 2, down: true });
}

function verdictText(m, duels) {
  const { settings, evaluations, version } = D.methods[m];
  const about = `${settings || "default settings"}; ${whole(evaluations)} evaluations; posefit ${version}`;
  const won = duels.filter((row) => row.of > 1 && row.rank === 1).length;
  const board = (D.leaderboard ?? []).find((row) => row.method === m);
  const skill = board ? `a skill of ${number(board.skill_mean_pose, 2)} against the ${D.baseline_names.mean_pose}` : "";
  const mean = board ? `, an interquartile mean of ${degrees(board.error)}, ${skill}` : "";
  const tests = D.pairs && D.pairs.methods.includes(m) ? duelsOf(m) : [];
  const [better, worse] = ["better", "worse"].map((word) => tests.filter((row) => verdict(row) === word).length);
  const than = `${better}, worse than ${worse}, and not shown to differ from ${tests.length - better - worse}`;
  const tally = tests.length ? `; of ${tests.length} others it is better than ${than}` : "";
  return `${METHODS[m]} (${about}) has the lowest error of all on ${won} of ${duels.length} instances${mean}${tally}.`;
}

// The errors of all methods on a line, that of one method larger.
function errorDots(errors, mine, most) {
  const at = (value) => 6 + (248 * Math.min(value, most)) / most;
  const svg = draw("svg", { width: 260, height: 18, role: "img", "aria-label": "errors of all methods" });
  svg.append(drawLine(6, 9, 254, 9, { class: "rule" }));
  const others = range(METHODS.length).filter((m) => m !== mine && given(errors[m]));
  for (const m of [...others, mine])
    svg.append(mark(m, at(errors[m]), 9, m === mine ? 6 : 3, `${METHODS[m]}: ${degrees(errors[m])}`));
  return svg;
}
