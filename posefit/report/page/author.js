// How one named method does against all others.
const byInstance = (() => {
  const sums = new Map();
  const R = D.rows;
  R.key.forEach((_, k) => {
    if (!given(R.error[k])) return;
    const name = R.instance[k] * METHODS.length + R.method[k];
    const sum = sums.get(name) || [0, 0];
    sums.set(name, [sum[0] + R.error[k], sum[1] + 1]);
  });
  return (instance, method) => {
    const sum = sums.get(instance * METHODS.length + method);
    return sum ? sum[0] / sum[1] : null;
  };
})();

function dots(errors, mine, most) {
  const width = 260;
  const x = (value) => 6 + ((width - 12) * Math.min(value, most)) / most;
  const svg = draw(
    "svg",
    { width, height: 18, role: "img", "aria-label": "errors of all methods" },
    draw("line", { class: "rule", x1: 6, x2: width - 6, y1: 9, y2: 9 }),
  );
  errors.forEach((error, m) => {
    if (given(error) && m !== mine)
      svg.append(mark(m, x(error), 9, 3, {}, draw("title", {}, `${METHODS[m]}: ${number(error, 2)}°`)));
  });
  if (given(errors[mine]))
    svg.append(
      mark(mine, x(errors[mine]), 9, 6, {}, draw("title", {}, `${METHODS[mine]}: ${number(errors[mine], 2)}°`)),
    );
  return svg;
}

// The three parts of the sentence that says how a method does.
const summary = (m) => {
  const { settings, evaluations, version } = D.methods[m];
  const about = `${settings || "default settings"}; ${whole(evaluations)} evaluations; posefit ${version}`;
  return `${METHODS[m]} (${about}) has the lowest error of all`;
};

const middle = (board) => {
  if (!board) return "";
  const skill = number(board.skill_mean_pose, 2);
  return `, ${number(board.error, 2)}° in the middle, a skill of ${skill} against the ${D.trivial.mean_pose}`;
};

const tally = (tests) => {
  if (!tests.length) return "";
  const [better, worse, alike] = ["better", "worse", "not told apart"].map(
    (word) => tests.filter((row) => verdict(row) === word).length,
  );
  const than = `it is better than ${better}, worse than ${worse}, and not told apart from ${alike}`;
  return `; of ${tests.length} others ${than}`;
};

function author(m) {
  const R = D.rows;
  const duels = INSTANCES.map((name, instance) => {
    const errors = METHODS.map((_, one) => byInstance(instance, one));
    const mine = errors[m];
    const others = errors.filter((error, one) => given(error) && one !== m).sort((a, b) => a - b);
    const best = others.length ? errors.findIndex((error, one) => error === others[0] && one !== m) : null;
    return {
      instance,
      name,
      errors,
      mine,
      best,
      least: others[0],
      rank: 1 + others.filter((error) => error < mine).length,
      of: others.length + 1,
      gap: given(mine) && others.length ? mine - others[0] : null,
    };
  }).filter((row) => given(row.mine));
  const won = duels.filter((row) => row.of > 1 && row.rank === 1).length;
  const board = D.leaderboard ? D.leaderboard.find((row) => row.method === m) : null;
  const tests = D.pairs && D.pairs.methods.includes(m) ? duelsOf(m) : [];
  $("verdict").textContent = duels.length
    ? `${summary(m)} on ${won} of ${duels.length} instances${middle(board)}${tally(tests)}.`
    : "No run of it has an error.";
  const all = duels.flatMap((row) => row.errors.filter(given)).sort((a, b) => a - b);
  const most = all[Math.floor(0.98 * (all.length - 1))] || 1;
  table(
    $("duels"),
    [
      { title: "instance", text: true, value: (row) => row.instance, show: (row) => row.name },
      { title: "all methods", text: true, show: (row) => dots(row.errors, m, most) },
      figure("error", (row) => row.mine),
      { title: "rank", value: (row) => row.rank, show: (row) => `${row.rank} of ${row.of}` },
      {
        title: "best other °",
        value: (row) => row.least,
        show: (row) => (given(row.least) ? [number(row.least, 2), make("small", {}, METHODS[row.best])] : "–"),
      },
      { title: "behind it by °", value: (row) => row.gap, show: (row) => number(row.gap, 2), down: true },
      ...Object.keys(D.trivial).map((name) => figure(`skill_${name}`, (row) => skillOf(row, name))),
    ],
    duels,
    { by: 5, down: true, name: "Instance by instance" },
  );
  const { lost: gone, swapped } = D.columns;
  $("lost-note").textContent = `${gone.label}: ${gone.about}; ${swapped.label}: ${swapped.about}.`;
  const lost = range(R.key.length).filter((k) => R.method[k] === m && (R.lost[k] > 0 || R.swapped[k] > 0));
  table(
    $("tracks"),
    [
      { title: "instance", text: true, value: (k) => R.instance[k], show: (k) => INSTANCES[R.instance[k]] },
      { title: "seed", value: (k) => R.seed[k], show: (k) => String(D.seeds[R.seed[k]]) },
      ...["lost", "swapped"].map((name) => ({ ...figure(name, (k) => R[name][k]), down: true })),
      { ...figure("error", (k) => R.error[k]), down: true },
      { unseen: "watch, or run again", text: true, show: (k) => [...watch(k), again(k)] },
    ],
    lost,
    { by: 2, down: true, name: "Lost and swapped tracks" },
  );
  if (!lost.length)
    $("tracks").replaceChildren(make("p", {}, "None of its runs lost a frame or swapped left and right."));
}

const skillOf = (row, name) => {
  const base = D.instances[row.instance][name];
  return given(base) && base > 0 ? 1 - row.mine / base : null;
};
