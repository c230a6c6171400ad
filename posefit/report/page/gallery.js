// The gallery: a card an instance, and the window that plays its tracks.
const show = { row: null, frame: 0, camera: 0 };
const pictured = Object.keys(D.gallery.tracks).map(Number);
const watch = (row) =>
  D.gallery.tracks[row]
    ? [make("button", { type: "button", title: "Watch this track", on: { click: () => openTrack(row) } }, "watch")]
    : [];

function gallery() {
  const all = D.rows.key.length;
  const R = D.rows;
  const some =
    `; ${whole(pictured.length)} of ${whole(all)} runs have one, so that this file stays small. ` +
    "A report of the ledger that a row's command makes shows that row";
  $("gallery-note").textContent =
    `Each instance opens an animation and a skeleton that can be turned${pictured.length === all ? "" : some}.`;
  const cards = new Map();
  for (const row of pictured) {
    const best = cards.get(R.instance[row]);
    if (best === undefined || (R.error[row] ?? Infinity) < (R.error[best] ?? Infinity)) cards.set(R.instance[row], row);
  }
  const shown = [...cards].sort((a, b) => a[0] - b[0]);
  const add = (from) =>
    shown
      .slice(from, from + 60)
      .forEach(([instance, row]) =>
        $("cards").append(
          make(
            "button",
            { type: "button", class: "card", on: { click: () => openTrack(row) } },
            still(sceneOf(instance)),
            make(
              "span",
              {},
              INSTANCES[instance],
              make("small", {}, `best: ${METHODS[R.method[row]]}, ${number(R.error[row], 2)}°`),
            ),
          ),
        ),
      );
  add(0);
  let next = 60;
  if (shown.length > next) {
    const more = make(
      "button",
      {
        type: "button",
        on: {
          click: () => {
            add(next);
            next += 60;
            if (next >= shown.length) more.remove();
          },
        },
      },
      "more instances",
    );
    $("cards").after(more);
  }
}

function openTrack(row) {
  choices(row);
  if (!$("viewer").open) $("viewer").showModal();
  paint();
}

function choices(row) {
  const R = D.rows;
  const instance = R.instance[row];
  const here = pictured.filter((one) => R.instance[one] === instance);
  const scene = sceneOf(instance);
  show.row = row;
  show.camera = Math.min(show.camera, Math.max(scene.cameras.length - 1, 0));
  show.frame = Math.min(show.frame, scene.frames - 1);
  $("viewer-title").textContent = INSTANCES[instance];
  const methods = [...new Set(here.map((one) => R.method[one]))].sort((a, b) => a - b);
  choose(
    $("viewer-method"),
    methods.map((m) => [String(m), METHODS[m]]),
    String(R.method[row]),
    () => {
      const same = here.filter((one) => R.method[one] === +$("viewer-method").value);
      openTrack(same.find((one) => R.seed[one] === R.seed[show.row]) ?? same[0]);
    },
  );
  choose(
    $("viewer-seed"),
    here.filter((one) => R.method[one] === R.method[row]).map((one) => [String(one), String(D.seeds[R.seed[one]])]),
    String(row),
    () => openTrack(+$("viewer-seed").value),
  );
  choose(
    $("viewer-camera"),
    scene.cameras.map((_, k) => [String(k), String(k + 1)]),
    String(show.camera),
    () => {
      show.camera = +$("viewer-camera").value;
      paint();
    },
  );
  $("camera-label").hidden = scene.cameras.length < 2;
  $("overlay").parentNode.hidden = !scene.cameras.length;
  $("frame").max = scene.frames - 1;
  strip();
}

function paint() {
  if (!$("viewer").open) return;
  const instance = D.rows.instance[show.row];
  const scene = sceneOf(instance);
  const track = D.gallery.tracks[show.row];
  track.joints = track.joints || decoded(track.estimate);
  const truth = scene.joints(show.frame);
  const estimate = track.joints(show.frame);
  if (scene.cameras.length) paintOverlay($("overlay"), scene, scene.cameras[show.camera], truth, estimate);
  scene.floor =
    scene.floor ?? Math.min(...range(scene.frames).flatMap((k) => scene.joints(k).map((point) => point[1])));
  paintTurned($("turning"), truth, estimate, scene.floor);
  $("frame").value = show.frame;
  const state = [
    track.lost.includes(show.frame) ? "lost" : "",
    track.swapped.includes(show.frame) ? "left and right swapped" : "",
  ].filter(Boolean);
  const said = [`frame ${show.frame * scene.step}: MPJPE ${track.mpjpe[show.frame]} mm`, ...state].join(", ");
  $("reading").textContent = said;
  $("overlay").setAttribute("aria-label", said);
  const now = $("strip").querySelector(".now");
  if (now) now.setAttribute("transform", `translate(${now.dataset.step * show.frame},0)`);
}

// Every frame's error as a bar: lost ones red, a line below those that are swapped.
function strip() {
  const track = D.gallery.tracks[show.row];
  const count = track.mpjpe.length;
  const height = 46;
  const step = 600 / count;
  const most = Math.max(160, ...track.mpjpe);
  const svg = draw("svg", {
    viewBox: `0 0 600 ${height}`,
    width: "100%",
    height,
    preserveAspectRatio: "none",
    "aria-hidden": "true",
  });
  track.mpjpe.forEach((value, k) =>
    svg.append(
      draw("rect", {
        x: k * step,
        width: Math.max(step - 0.6, 0.4),
        y: 38 * (1 - value / most),
        height: (38 * value) / most,
        style: `fill: var(${track.lost.includes(k) ? "--bad" : "--truth"})`,
      }),
    ),
  );
  track.swapped.forEach((k) =>
    svg.append(draw("rect", { x: k * step, width: step, y: 41, height: 4, style: "fill: var(--swapped)" })),
  );
  svg.append(
    draw("rect", {
      class: "now",
      "data-step": step,
      x: 0,
      width: step,
      y: 0,
      height,
      style: "fill: var(--accent)",
      opacity: 0.35,
    }),
  );
  $("strip").replaceChildren(
    make(
      "p",
      {},
      `MPJPE frame by frame, up to ${whole(most)} mm`,
      track.lost.length ? "; red: lost" : "",
      track.swapped.length ? "; underlined: left and right swapped" : "",
    ),
    svg,
  );
}

const play = clock(
  $("play"),
  () => {
    const scene = sceneOf(D.rows.instance[show.row]);
    return (1000 * scene.step) / scene.fps;
  },
  (over) => {
    show.frame = (show.frame + over) % sceneOf(D.rows.instance[show.row]).frames;
    paint();
  },
);

function viewer() {
  turnable($("turning"), paint);
  $("frame").oninput = () => {
    play(false);
    show.frame = +$("frame").value;
    paint();
  };
  $("viewer").addEventListener("close", () => play(false));
}
