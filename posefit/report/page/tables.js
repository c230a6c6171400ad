// The leaderboard, and all runs with the command that runs one again.
const FIGURES = Object.keys(D.columns);
const pairsOf = (methods) => (methods * (methods - 1)) / 2;

function leaderboard() {
  const warned = METHODS.map(() => 0);
  for (const row of Object.keys(D.warned)) warned[D.rows.method[row]] += 1;
  const shown = D.leaderboard.map((row) => ({
    ...row,
    interval: given(row.low) ? row.high - row.low : null,
    warned: warned[row.method],
  }));
  const bases = D.baselines.map((row) => ({
    ...row,
    name: `baseline: ${D.trivial[row.baseline]}`,
    base: true,
  }));
  table(
    $("leaders"),
    [
      {
        title: "method",
        text: true,
        value: (row) => row.name,
        show: (row) =>
          row.base
            ? row.name
            : [swatch(row.method), row.name, make("small", {}, D.methods[row.method].settings || "default settings")],
      },
      figure("error", (row) => row.error),
      {
        title: "95 % interval",
        about: "Sorts by its width",
        value: (row) => row.interval,
        show: (row) => {
          if (row.base) return "";
          return given(row.low) ? `${number(row.low, 2)} – ${number(row.high, 2)}` : "one seed";
        },
      },
      {
        title: "alike",
        text: true,
        about:
          "Methods that share a letter are not told apart: Wilcoxon's signed ranks, " +
          `Holm over ${counted(pairsOf(D.taking_part.length), "pair")}, 5 %`,
        value: (row) => (row.base ? "" : row.letters),
        show: (row) => (row.base ? "" : row.letters),
      },
      ...FIGURES.slice(1).map((name) => figure(name, (row) => row[name])),
      {
        title: "runs",
        down: true,
        value: (row) => row.runs,
        show: (row) => (given(row.runs) ? whole(row.runs) : ""),
      },
      {
        title: "failed",
        value: (row) => row.failed,
        show: (row) => (row.base ? "" : make("span", { class: row.failed ? "bad" : null }, String(row.failed))),
      },
      ...(D.warnings.length
        ? [
            {
              title: "warned",
              about: "Runs with a warning",
              value: (row) => row.warned,
              show: (row) => (row.base ? "" : make("span", { class: row.warned ? "bad" : null }, String(row.warned))),
            },
          ]
        : []),
    ],
    [...shown, ...bases],
    { by: 1, name: "Leaderboard", kind: (row) => (row.base ? "base" : null) },
  );
}

// The command that runs a row again: the beginning that it shares with others, then its instance and seed.
function commandOf(row) {
  const R = D.rows;
  const place = D.instances[R.instance[row]];
  return `${D.heads[R.head[row]]}instance = ${place.number}\nseed = ${D.seeds[R.seed[row]]}\nEND`;
}

const called = (row) =>
  `${METHODS[D.rows.method[row]]} on ${INSTANCES[D.rows.instance[row]]}, seed ${D.seeds[D.rows.seed[row]]}`;

const again = (row) =>
  make(
    "button",
    {
      type: "button",
      title: "The command that runs it again",
      on: { click: () => showCommand(called(row), commandOf(row)) },
    },
    "command",
  );

// The mark of a row with warnings, which says them.
const warning = (row) => {
  const said = D.warned[row].map((k) => D.warnings[k]).join("; ");
  return make("span", { class: "bad", role: "img", title: said, "aria-label": `warning: ${said}` }, " ⚠");
};

function allRows() {
  const R = D.rows;
  const method = $("of-method").value;
  const instance = $("of-instance").value;
  const rows = range(R.key.length).filter(
    (k) => (method === "" || R.method[k] === +method) && (instance === "" || R.instance[k] === +instance),
  );
  table(
    $("all-rows"),
    [
      { unseen: "watch, or run again", text: true, show: (k) => [...watch(k), again(k)] },
      {
        title: "method",
        text: true,
        value: (k) => R.method[k],
        show: (k) => [METHODS[R.method[k]], ...(D.warned[k] ? [warning(k)] : [])],
      },
      {
        title: "settings",
        text: true,
        value: (k) => D.methods[R.method[k]].settings,
        show: (k) => D.methods[R.method[k]].settings || "default",
      },
      { title: "instance", text: true, value: (k) => R.instance[k], show: (k) => INSTANCES[R.instance[k]] },
      { title: "seed", value: (k) => R.seed[k], show: (k) => String(D.seeds[R.seed[k]]) },
      ...FIGURES.map((name) => figure(name, (k) => R[name][k])),
      { title: "key", text: true, value: (k) => R.key[k], show: (k) => R.key[k] },
    ],
    rows,
    { by: 5, name: "All runs" },
  );
}
