// The first screen: who leads, and three tracks of the leader.
// A camera for a scene that has none: from the front, far away.
const FRONT = {
  focal: [1000, 1000],
  centre: [0, 0],
  rotation: [
    [1, 0, 0],
    [0, -1, 0],
    [0, 0, -1],
  ],
  translation: [0, 0, 10],
};

// What moves in a small picture: the frames of a track as its camera sees them, and how many pixels about the root.
function cutOut(row) {
  const scene = sceneOf(D.rows.instance[row]);
  const track = D.gallery.tracks[row];
  track.joints = track.joints || decoded(track.estimate);
  const camera = scene.cameras[0] ?? FRONT;
  const far = range(scene.frames).flatMap((k) => {
    const [there, here] = [scene.joints(k), track.joints(k)].map((points) => seen(camera, points));
    return [...there, ...here]
      .filter((one) => one[2] > NEAR)
      .flatMap((one) => [0, 1].map((axis) => Math.abs(one[axis] - there[0][axis])));
  });
  return { scene, track, camera, size: 2.08 * Math.max(...far, 1) };
}

function paintCutOut(canvas, { scene, track, camera, size }, time) {
  const frame = time % scene.frames;
  const { pen, width, height } = sheet(canvas, 1);
  const scale = width / size;
  const [there, here] = [scene.joints(frame), track.joints(frame)].map((points) => seen(camera, points));
  pen.translate(width / 2 - scale * there[0][0], height / 2 - scale * there[0][1]);
  pen.scale(scale, scale);
  if (scene.radii.length) {
    pen.globalAlpha = 0.35;
    pen.fillStyle = ink("--truth");
    pen.fill(outline(camera, there, scene.radii));
    pen.globalAlpha = 1;
  } else sticks(pen, there, ink("--truth"), 5 / scale);
  sticks(pen, here, limbs(), 2.2 / scale);
}

function examples() {
  const shown = D.tracks.filter(([, row]) => D.gallery.tracks[row]);
  if (!shown.length) return $("examples").remove();
  const leader = METHODS[D.leaderboard[0].method];
  const parts = shown.map(([name, row]) => {
    const canvas = make("canvas", { "aria-hidden": "true" });
    const place = `${INSTANCES[D.rows.instance[row]]}, seed ${D.seeds[D.rows.seed[row]]}`;
    return {
      canvas,
      cut: cutOut(row),
      node: make(
        "button",
        { type: "button", class: "example", on: { click: () => openTrack(row) } },
        canvas,
        make("strong", {}, `${name} track: ${number(D.rows.error[row], 2)}°`),
        make("small", {}, place),
      ),
    };
  });
  $("examples-of").textContent = `Three tracks of ${leader}: `;
  $("three").append(...parts.map((one) => one.node));
  let time = 0;
  let there = true;
  const repaint = () => there && parts.forEach(({ canvas, cut }) => paintCutOut(canvas, cut, time));
  const { step, fps } = parts[0].cut.scene;
  const run = clock(
    $("moving"),
    () => (1000 * step) / fps,
    (over) => {
      time += over;
      repaint();
    },
  );
  new IntersectionObserver((seenNow) => {
    there = seenNow.at(-1).isIntersecting;
    repaint();
  }).observe($("three"));
  new ResizeObserver(repaint).observe($("three"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  repaint();
  run(!matchMedia("(prefers-reduced-motion: reduce)").matches);
}

function lead() {
  $("answer").textContent = D.answer;
  firstFigure();
  examples();
}
