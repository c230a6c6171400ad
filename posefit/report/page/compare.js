// One method compared with all others, by paired tests and instance by instance.
const probability = (p) => (!given(p) ? "–" : p < D.constants.least_p ? `< ${D.constants.least_p}` : p.toFixed(3));
const neededRuns = (count) =>
  count > D.constants.max_blocks ? `more than ${whole(D.constants.max_blocks)}` : whole(count);
const twoDigits = (value) => number(value, 2);
const verdict = (row) =>
  row.adjusted >= D.constants.significance ? "no difference shown" : row.difference < 0 ? "better" : "worse";

// Every paired test of a method, turned so that it comes first: a difference below 0 is in its favour.
function duelsOf(m) {
  const P = D.pairs;
  const place = P.methods.indexOf(m);
  const minus = (value) => (given(value) ? -value : null);
  return P.pairs
    .filter((pair) => pair.slice(0, 2).includes(place))
    .map(([first, second, difference, from, to, p, adjusted, needed]) =>
      first === place
        ? { other: P.methods[second], difference, from, to, p, adjusted, needed }
        : { other: P.methods[first], difference: -difference, from: minus(to), to: minus(from), p, adjusted, needed },
    );
}

function comparison() {
  const P = D.pairs;
  $("pairs-note").textContent = P
    ? `Paired t tests of the errors with losses, over ${whole(P.blocks)} pairs of instance and seed. Seeds of one ` +
      "instance are not independent, so the results hold for these instances only."
    : "Tests need two methods that share at least two runs.";
  const columns = [
    methodColumn("other"),
    column("mean difference °", "difference", twoDigits, {
      about: "Below 0 the chosen method is better",
      down: true,
    }),
    intervalColumn("Of the mean difference, adjusted like p by Holm's correction", "difference", 2, ["from", "to"]),
    column("p", "p", probability),
    column("p after Holm", "adjusted", probability, { about: `Adjusted for all ${P?.pairs.length} comparisons` }),
    textColumn("verdict", verdict),
    column("runs needed", "needed", neededRuns, {
      about: `Paired runs that would show such a difference with a probability of ${whole(100 * D.constants.power)} %`,
    }),
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

// Each instance's mean errors with losses over seeds: of a method, and of the best other one.
function against(m) {
  const sums = INSTANCES.map(() => METHODS.map(() => [0, 0]));
  D.rows[D.score.name].forEach((error, k) => {
    const sum = sums[D.rows.instance[k]][D.rows.method[k]];
    if (given(error)) [sum[0], sum[1]] = [sum[0] + error, sum[1] + 1];
  });
  const duels = sums.flatMap((methods, instance) => {
    const ranked = methods.flatMap(([sum, count], k) => (count ? [[sum / count, k]] : [])).sort((a, b) => a[0] - b[0]);
    const place = ranked.findIndex(([, k]) => k === m);
    if (place < 0) return [];
    const [least, best] = ranked[place ? 0 : 1] ?? [null, null];
    return [{ instance, error: ranked[place][0], least, best, rank: place + 1, of: ranked.length }];
  });
  const best = (least, row) => [number(least, 2), make("small", {}, METHODS[row.best])];
  const columns = [
    textColumn("instance", "instance", (k) => INSTANCES[k]),
    figure(D.score.name, "error"),
    column("rank", "rank", (rank, row) => `${rank} of ${row.of}`),
    column("best other °", "least", best),
    column("behind it by °", (row) => (given(row.least) ? row.error - row.least : null), twoDigits, { down: true }),
  ];
  table($("duels"), columns, duels, { name: "Instance by instance", by: 4, down: true });
}
