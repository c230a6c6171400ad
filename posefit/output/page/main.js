// Puts the page together: words, player, keys.
const marked = [...new Set(MARKS.flatMap(([name]) => D.marks[name]))].sort((a, b) => a - b);

function header() {
  document.title = `${D.title}: a track of posefit`;
  $("title").textContent = D.title;
  $("verdict").textContent = D.verdict;
  details({ facts: D.facts, notes: D.notes, version: D.version });
  for (const note of $("notes").children) note.classList.add("warn");
  const every = (count) => (count === 1 ? "every frame" : `one frame in ${whole(count)}`);
  const pictured = (D.film ?? D.masks[0]).every;
  const thinned = D.step > 1 ? `This track is long, so this page shows ${every(D.step)}. ` : "";
  const fewer = pictured > D.step ? `To keep this file small, it has a picture of ${every(pictured)}. ` : "";
  $("thinned").textContent =
    `${thinned}${fewer}poses.npz and frames.csv in the same folder have every frame, overlay.mp4 the pictures.`;
  const time = `${number(D.count / D.fps, 1)} s at ${+D.fps.toPrecision(4)} frames a second`;
  const length = shown > 1 ? `${counted(D.count, "frame")}, ${time}.` : "A single frame.";
  $("lead").textContent = `${length} ${D.made} ${thinned}${fewer}`.trimEnd();
}

// A frame's time, figures and marks in words.
function frameText(frame) {
  const figureText = (name) => {
    const { label, unit } = D.columns[name];
    return `${label} ${shownAs(name, D.rows[name][frame])} ${unit}`.trim();
  };
  const figures = ["mpjpe_mm", "iou", "cost"].filter((name) => D.columns[name]).map(figureText);
  const other = otherOf(frame);
  const states = MARKS.filter(([name]) => D.marks[name].includes(frame)).map(([, , words]) => words);
  if (other) states.push(`the thin bones are possible, too: ${whole(100 * other.weight)} %`);
  return [
    `frame ${D.first + frame * D.step} of ${D.first + D.count}, ${number(seconds(frame), 2)} s`,
    ...figures,
    ...states,
  ].join("; ");
}

const others = D.cameras.length > 1 ? D.cameras.map(() => make("canvas", { "aria-hidden": "true" })) : [];
let last = "";
function paint() {
  const pictured = paintPicture($("picture"), show.camera);
  others.forEach((canvas, which) => paintPicture(canvas, which));
  paintBody();
  cursors.forEach((move) => move(show.frame));
  const text = frameText(show.frame);
  if (last === `${show.camera} ${text}`) return;
  last = `${show.camera} ${text}`;
  $("frame").value = show.frame;
  $("frame").setAttribute("aria-valuetext", text);
  $("reading").textContent =
    pictured === show.frame ? text : `${text}; the picture is of frame ${D.first + pictured * D.step}`;
  $("picture").setAttribute("aria-label", `Camera ${show.camera + 1} with the body on it, ${text}`);
  $("turning").setAttribute("aria-label", `The body in 3D, which arrow keys turn, ${text}`);
}

const pace = () => (1000 * D.step) / D.fps / +$("speed").value;
const play = clock($("play"), pace, (over) => {
  show.frame = (show.frame + over) % shown;
  paint();
});

function seek(frame) {
  play(false);
  show.frame = between(0, shown - 1, frame);
  paint();
}

// The next marked frame, or the previous one; the first comes after the last.
function seekMark(way) {
  if (!marked.length) return;
  const next = way > 0 ? marked.find((k) => k > show.frame) : marked.findLast((k) => k < show.frame);
  seek(next ?? marked.at(way > 0 ? 0 : -1));
}

const KEYS = {
  " ": () => $("play").click(),
  ArrowLeft: ({ shiftKey }) => seek(show.frame - (shiftKey ? 10 : 1)),
  ArrowRight: ({ shiftKey }) => seek(show.frame + (shiftKey ? 10 : 1)),
  Home: () => seek(0),
  End: () => seek(shown - 1),
  n: () => seekMark(1),
  p: () => seekMark(-1),
};

document.addEventListener("keydown", (event) => {
  const act = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  const on = event.target;
  if (!act || event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
  if (on.closest("select") || (event.key === " " && on.closest("button, summary, input[type=checkbox]"))) return;
  event.preventDefault();
  act(event);
});

function player() {
  $("controls").hidden = shown === 1;
  $("frame").max = shown - 1;
  $("frame").oninput = () => seek(+$("frame").value);
  const speeds = [1, 0.5, 0.25, 0.1].map((speed) => [String(speed), `${speed}×`]);
  choose($("speed"), speeds, "1", () => {});
  others.forEach((canvas, which) => {
    const act = () => {
      show.camera = which;
      upright();
      paint();
    };
    $("cameras").append(make("button", { type: "button", on: { click: act } }, canvas, `camera ${which + 1}`));
  });
  $("with-film").parentNode.hidden = !D.film;
  $("with-mask").checked = !D.film;
  $("close-up").checked = closeness(0) > 1.4;
  $("truth-label").hidden = !truthAt;
  const repaint = () => {
    legends();
    paint();
  };
  for (const id of ["with-film", "with-mask", "with-body", "with-truth", "close-up"]) $(id).onchange = repaint;
  const looks = { "from-camera": [0, 0], "from-side": [Math.PI / 2, 0], "from-above": [0, 1.4] };
  for (const [id, place] of Object.entries(looks)) $(id).onclick = () => look(...place);
  $("doubtful").hidden = !marked.length;
  $("before").onclick = () => seekMark(-1);
  $("after").onclick = () => seekMark(1);
}

// A picture of an upright camera is no higher than most of the window.
function upright() {
  const [wide, high] = D.cameras[show.camera].size;
  $("picture").style.maxWidth = `calc(62vh * ${wide / high})`;
}

header();
player();
legends();
upright();
if (shown > 1) curves();
else $("curves").remove();
if (D.gait) gait();
else $("gait").remove();
look(0.7, 0.15);
turnable($("turning"), paint);
for (const masks of D.masks) for (const [, uri] of masks.pictures) pictureOf(uri);
for (const [, ...uris] of D.film?.pictures ?? []) uris.forEach(pictureOf);
play(shown > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches);
new ResizeObserver(paint).observe($("picture"));
