// Puts the page together.
// what there is not where nothing can be compared
const ABSENT = [
  "overview",
  "leaderboard",
  "comparison",
  "selection",
  "to-selection",
  "curves",
  "joints",
  "certainty",
  "to-certainty",
];

function header() {
  const H = D.header;
  const words = (list) => list.join("; ");
  $("lead").textContent =
    `${whole(H.done)} runs of ${counted(METHODS.length, "method")} on ${counted(INSTANCES.length, "instance")}` +
    ` of ${counted(H.motions.length, "motion")}` +
    `${H.failed ? `; ${counted(H.failed, "cell")} failed` : "; no cell failed"}.`;
  const facts = [
    ["methods", words(METHODS)],
    ["motions", words(H.motions)],
    ["views, degrees", words(H.views)],
    ["corruptions", words(H.corruptions)],
    ["frames", words(H.frames)],
    ["translation", words(H.translations)],
    ["seeds", H.seeds.join(", ") + (H.seed_count > H.seeds.length ? `, … (${whole(H.seed_count)})` : "")],
    ["evaluations a frame", H.budgets.map(whole).join("; ")],
    ["posefit", words(H.versions)],
    ["time in the loop", H.hours < 0.1 ? `${number(60 * H.hours, 1)} minutes` : `${number(H.hours, 1)} hours`],
  ];
  $("facts").append(...facts.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
  const notes = [];
  if (H.shared === null) notes.push("No run has an error: nothing can be compared.");
  else {
    if (H.shared < H.done)
      notes.push(
        `Means and intervals are of the ${whole(H.shared)} runs that all methods share, ` +
          `${counted(H.shared_instances, "instance")} with ${counted(H.shared_seeds, "seed")} each.` +
          (H.unpaired ? ` ${H.unpaired}.` : ""),
      );
    if (H.apart.length)
      notes.push(
        `Too few runs in common with the others, so not compared: ${words(H.apart.map((m) => METHODS[m]))}. ` +
          "Their rows of the leaderboard are of their own runs.",
      );
    if (H.shared_seeds === 1) notes.push("One seed says nothing about others: there are no intervals.");
    else if (H.shared / Math.max(D.taking_part.length, 1) < 20)
      notes.push("Fewer than 20 runs of each method: the intervals are wide.");
    if (H.resamples < 2000) notes.push(`So many runs have ${H.resamples} bootstrap resamples instead of 2,000.`);
    if (H.drawn[0] * H.drawn[1] < H.shared_instances * H.shared_seeds)
      notes.push(
        `Curves and joints are of ${whole(H.drawn[0])} instances with ${whole(H.drawn[1])} seeds each, not of all.`,
      );
  }
  if (H.budgets.length > 1) notes.push("Budgets differ: compare methods of one budget only.");
  if (H.versions.length > 1) notes.push("Commands run rows again where the same versions are installed.");
  $("notes").append(...notes.map((text) => make("p", { class: "note" }, text)));
  trouble();
  $("foot").textContent = `posefit ${H.version}. This file holds everything it shows and asks the network for nothing.`;
}

header();
live();
if (D.leaderboard) {
  lead();
  leaderboard();
  claims();
  legend();
  comparison();
  selection();
  curves();
  jointErrors();
  certainty();
} else {
  $("answer").textContent = D.header.failed
    ? "Every cell failed."
    : "No run has an error yet: there is nothing to compare.";
  ABSENT.forEach((id) => $(id).remove());
}
if (METHODS.length) runs();
else ["gallery", "author", "rows"].forEach((id) => $(id).remove());
failures();
closing();
for (const link of document.querySelectorAll("nav a")) if (!document.querySelector(link.hash)) link.remove();
addEventListener("beforeprint", () => $("what").setAttribute("open", ""));
function runs() {
  gallery();
  viewer();
  const first = D.leaderboard ? D.leaderboard[0].method : 0;
  choose(
    $("mine"),
    METHODS.map((name, m) => [String(m), name]),
    String(first),
    () => author(+$("mine").value),
  );
  author(first);
  choose($("of-method"), [["", "all"], ...METHODS.map((name, m) => [String(m), name])], "", allRows);
  choose($("of-instance"), [["", "all"], ...INSTANCES.map((name, i) => [String(i), name])], "", allRows);
  allRows();
}
