// Puts the page of single searches together.
function header() {
  const H = D.header;
  const words = (list) => list.join("; ");
  $("lead").textContent =
    `${whole(H.done)} runs of ${counted(METHODS.length, "method")} on ${counted(H.functions.length, "function")}` +
    ` in ${counted(H.dimensions.length, "dimension")}, ${counted(H.instances, "instance")}` +
    `${H.failed ? `; ${counted(H.failed, "cell")} failed` : "; no cell failed"}.`;
  const facts = [
    ["suite", words(H.suites)],
    ["methods", words(METHODS)],
    ["functions", words(H.functions.map((one) => `${one.number} ${one.name}`))],
    ["dimensions", words(H.dimensions)],
    ["seeds", whole(H.seed_count)],
    ["evaluations for each dimension", words(H.budgets.map((one) => `${+one.toFixed(2)}`))],
    ["what is not feasible", words(H.infeasible)],
    ["targets of a problem", `${H.targets} costs, from ${H.easiest} to ${H.hardest} above the best known`],
    ["posefit", words(H.versions)],
  ];
  $("facts").append(...facts.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
  const notes = [];
  if (H.shared !== null && H.shared < H.done)
    notes.push(
      `Methods are compared on the ${whole(H.shared)} runs that all of them share; ` +
        `${counted(H.done - H.shared, "other")} of ${whole(H.done)} count nowhere.`,
    );
  if (H.apart.length)
    notes.push(
      `Too few runs in common with the others, so not compared: ${words(H.apart.map((m) => METHODS[m]))}. ` +
        "Their rows of the leaderboard are of their own runs.",
    );
  if (H.budgets.length > 1) notes.push("Budgets differ: whoever searches longer reaches more targets.");
  if (H.infeasible.length > 1)
    notes.push("Proposals that are not feasible are not treated alike: compare methods that treat them the same.");
  $("notes").append(...notes.map((text) => make("p", { class: "note" }, text)));
  trouble();
  $("foot").textContent = `posefit ${H.version}. This file holds everything it shows and asks the network for nothing.`;
}

function note() {
  const sure = D.leaderboard.some((row) => given(row.low))
    ? " with the 95 % interval that other instances would give"
    : "; one instance of a function says nothing about others, so there are no intervals";
  const base = D.baselines.length
    ? " The dashed line is random search."
    : " There is no baseline, for the plan has no random search.";
  $("standing-note").textContent =
    `Share of all runs and targets that a method reached${sure}.${base} ` +
    "Methods in bold are not shown to be worse than the best one.";
}

header();
live();
if (D.leaderboard) {
  $("answer").textContent = D.answer;
  note();
  firstFigure();
  leaderboard();
  legend();
  curves();
  runningTimes();
} else {
  $("answer").textContent = "Every cell failed.";
  ["overview", "leaderboard", "curves", "times"].forEach((id) => $(id).remove());
}
failures();
closing();
for (const link of document.querySelectorAll("nav a")) if (!document.querySelector(link.hash)) link.remove();
addEventListener("beforeprint", () => $("what").setAttribute("open", ""));
