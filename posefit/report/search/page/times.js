// The leaderboard, and the expected running times by function and dimension.
const share = (value) => number(value, D.score.digits);

const named = {
  title: "method",
  text: true,
  value: (row) => METHODS[row.method],
  show: (row) => [swatch(row.method), METHODS[row.method]],
};
const targetsReached = figure("reached", (row) => row.reached);
const aboveBest = figure("above", (row) => row.above);
const runsOf = { title: "runs", down: true, value: (row) => row.runs, show: (row) => whole(row.runs) };

function leaderboard() {
  table(
    $("leaders"),
    [
      named,
      targetsReached,
      {
        title: "95 % interval",
        about: "What other instances would give. Sorts by its width",
        value: (row) => (given(row.low) ? row.high - row.low : null),
        show: (row) => (given(row.low) ? `${share(row.low)} – ${share(row.high)}` : "one instance"),
      },
      {
        title: "alike",
        text: true,
        about:
          "Methods that share a letter are not told apart: Wilcoxon's signed ranks over instances, " +
          `Holm over ${counted((D.taking_part.length * (D.taking_part.length - 1)) / 2, "pair")}, 5 %`,
        value: (row) => row.letters,
        show: (row) => row.letters,
      },
      aboveBest,
      runsOf,
      {
        title: "failed",
        value: (row) => row.failed,
        show: (row) => make("span", { class: row.failed ? "bad" : null }, String(row.failed)),
      },
    ],
    D.leaderboard,
    { by: 1, down: true, name: "Leaderboard" },
  );
}

// The least running time to each target, by dimension and function.
const placeOf = (row) => `${row.dimension} ${row.function}`;
const leastTimes = () => {
  const found = new Map();
  for (const row of D.times) {
    const least = found.get(placeOf(row)) ?? row.times.map(() => Infinity);
    found.set(
      placeOf(row),
      least.map((one, k) => Math.min(one, row.times[k] ?? Infinity)),
    );
  }
  return found;
};

function runningTimes() {
  const least = leastTimes();
  const functions = new Map(
    D.times.map((row) => [row.function, row.function ? `${row.function} ${row.name}` : row.name]),
  );
  const dimensions = [...new Set(D.times.map((row) => row.dimension))].sort((a, b) => a - b);
  const timed = (above, k) => ({
    title: `ERT +${above}`,
    about: `Expected evaluations to ${above} above the best known cost`,
    value: (row) => row.times[k],
    show: (row) => {
      const best = given(row.times[k]) && row.times[k] === least.get(placeOf(row))[k];
      return given(row.times[k]) ? make(best ? "strong" : "span", {}, whole(row.times[k])) : "–";
    },
  });
  const show = () => {
    const [chosen, dimension] = [$("of-function").value, $("of-dimension").value];
    table(
      $("ert"),
      [
        named,
        {
          title: "function",
          text: true,
          value: (row) => row.function,
          show: (row) => functions.get(row.function),
        },
        { title: "dimension", value: (row) => row.dimension, show: (row) => String(row.dimension) },
        ...D.above.map(timed),
        targetsReached,
        aboveBest,
        runsOf,
      ],
      ordered.filter(
        (row) => (chosen === "" || row.function === +chosen) && (dimension === "" || row.dimension === +dimension),
      ),
      { name: "Running times" },
    );
  };
  const ordered = [...D.times].sort(
    (a, b) => a.dimension - b.dimension || a.function - b.function || b.reached - a.reached,
  );
  const numbers = [...functions].sort(([a], [b]) => a - b).map(([one, name]) => [String(one), name]);
  choose($("of-function"), [["", "each"], ...numbers], "", show);
  choose($("of-dimension"), [["", "each"], ...dimensions.map((one) => [String(one), String(one)])], "", show);
  show();
}
