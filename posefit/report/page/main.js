// Puts the page together.
const SECTIONS = {
  leaderboard,
  comparison,
  curves,
  joints,
  certainty,
  times: runningTimes,
  rows: allRows,
  failures,
};

document.title = `posefit: ${D.title}`;
$("title").textContent = D.title;
$("made").textContent = D.made;
const [first, ...because] = D.answer;
$("headline").textContent = first;
$("because").append(...because.map((sentence) => make("p", {}, sentence)));
$("summary").textContent = D.header.summary;
details(D.header);
trouble();
if (D.leaderboard) firstScreen();
else $("overview").remove();
for (const [id, fill] of Object.entries(SECTIONS))
  if (D.sections.includes(id)) {
    $("sections").append(make("a", { href: `#${id}` }, $(id).querySelector("h2").textContent));
    fill();
  } else $(id).remove();
$("copy").onclick = copyCommand;
for (const close of document.querySelectorAll("dialog .close")) close.onclick = () => close.closest("dialog").close();
addEventListener("beforeprint", () => $("what").setAttribute("open", ""));
