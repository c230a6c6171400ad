// One method compared with all others, by paired tests and instance by instance.
const probability = (p) => (!given(p) ? "–" : p < 0.001 ? "< 0.001" : p.toFixed(3));
const twoDigits = (value) => number(value, 2);
const verdict = (row) => (row.adjusted >= 0.05 ? "no difference shown" : row.difference < 0 ? "better" : "worse");

// Every paired test of a method, turned so that it comes first: a difference below 0 is in its favour.
function duelsOf(m) {
  const P = D.pairs;
  const place = P.methods.indexOf(m);
  const minus = (value) => (given(value) ? -value : null);
  const not = (share) => (given(share) ? 1 - share : null);
  return P.pairs
    .filter((pair) => pair.slice(0, 2).includes(place))
    .map(([first, second, difference, from, to, p, adjusted, better, low, high]) => {
      if (first === place) return { other: P.methods[second], difference, from, to, p, adjusted, better, low, high };
      const opposite = { difference: -difference, from: minus(to), to: minus(from), p, adjusted };
      return { other: P.methods[first], ...opposite, better: not(better), low: not(high), high: not(low) };
    });
}

function comparison() {
  const P = D.pairs;
  $("pairs-note").textContent = P
    ? `Wilcoxon's signed ranks over ${whole(P.blocks)} pairs of instance and seed. Seeds of one instance are not ` +
      "independent: all of it holds for these instances."
    : "Tests need two methods that share at least two runs.";
  const columns = [
    methodColumn("other"),
    column("median difference °", "difference", twoDigits, {
      about: "Below 0 the chosen method is better",
      down: true,
    }),
    intervalColumn("Of the median, from six runs on", "difference", 2, () => "–", ["from", "to"]),
    column("p", "p", probability),
    column("p after Holm", "adjusted", probability, { about: `Adjusted for all ${P?.pairs.length} comparisons` }),
    column("probability of improvement", "better", twoDigits, {
      about: "That a run of the chosen method has the lower error",
      down: true,
    }),
    intervalColumn("Of the probability, from three seeds on, if the runs are not too many", "low", 2, () => "–"),
    textColumn("verdict", verdict),
  ];
  const show = (m) => {
    const duels = P?.methods.includes(m) ? duelsOf(m) : [];
    if (duels.length) table($("pairs"), columns, duels, { name: "Paired tests", by: 1, down: true });
    else $("pairs").replaceChildren();
    against(m);
  };
  const first = D.leaderboard[0].method;
  choose($("against"), numbered(METHODS), String(first), () => show(+$("against").value));
  show(first);
}

// The mean error over seeds of each instance and method; null where there is none.
function meanErrors() {
  const errors = INSTANCES.map(() => METHODS.map(() => []));
  D.rows.error.forEach((error, k) => given(error) && errors[D.rows.instance[k]][D.rows.method[k]].push(error));
  const mean = (values) => (values.length ? values.reduce((sum, value) => sum + value, 0) / values.length : null);
  return errors.map((row) => row.map(mean));
}

function against(m) {
  const duels = meanErrors()
    .map((errors, instance) => {
      const others = errors.map((error, k) => [error, k]).filter(([error, k]) => given(error) && k !== m);
      const [least, best] = others.sort((a, b) => a[0] - b[0])[0] ?? [null, null];
      const rank = 1 + others.filter(([error]) => error < errors[m]).length;
      return { instance, errors, error: errors[m], least, best, rank, of: others.length + 1 };
    })
    .filter((row) => given(row.error));
  const most = usualMost(duels.flatMap((row) => row.errors));
  const skill = (name) => (row) => {
    const base = D.instances[row.instance][name];
    return given(base) && base > 0 ? 1 - row.error / base : null;
  };
  const best = (row) => [number(row.least, 2), make("small", {}, METHODS[row.best])];
  const columns = [
    namedColumn("instance", INSTANCES, (row) => row.instance),
    { title: "all methods", text: true, show: (row) => errorDots(row.errors, m, most) },
    figure("error"),
    { title: "rank", value: (row) => row.rank, show: (row) => `${row.rank} of ${row.of}` },
    { title: "best other °", value: (row) => row.least, show: (row) => (given(row.least) ? best(row) : "–") },
    column("behind it by °", (row) => (given(row.least) ? row.error - row.least : null), twoDigits, { down: true }),
    ...Object.keys(D.baseline_names).map((name) => figure(`skill_${name}`, skill(name))),
  ];
  table($("duels"), columns, duels, { name: "Instance by instance", by: 5, down: true });
}

// The errors of all methods on a line, that of one method larger.
function errorDots(errors, chosen, most) {
  const at = (value) => 6 + (248 * Math.min(value, most)) / most;
  const svg = draw("svg", { width: 260, height: 18, role: "img", "aria-label": "errors of all methods" });
  svg.append(drawLine(6, 9, 254, 9, { class: "rule" }));
  const others = range(METHODS.length).filter((m) => m !== chosen && given(errors[m]));
  for (const m of [...others, chosen])
    svg.append(mark(m, at(errors[m]), 9, m === chosen ? 6 : 3, `${METHODS[m]}: ${number(errors[m], 2)}°`));
  return svg;
}
