// Small pictures of tracks that move, and the window that plays one.
const show = { row: null, frame: 0, camera: 0 };
const pace = ({ step, fps }) => (1000 * step) / fps; // milliseconds of a frame
const animated = D.animations ? Object.keys(D.animations.tracks).map(Number) : [];

// The scene of a row's instance, and its track; joints are decoded once.
function sceneOf(row) {
  const scene = D.animations.scenes[D.rows.instance[row]];
  scene.joints ??= decoded(scene.truth);
  return scene;
}

function trackOf(row) {
  const track = D.animations.tracks[row];
  track.joints ??= decoded(track.estimate);
  return track;
}

// A small picture of a track that can move: the camera, and the side of the square around the root in its pixels.
function stillOf(row) {
  const [scene, track] = [sceneOf(row), trackOf(row)];
  const camera = scene.cameras[0] ?? turned(scene.joints(0)[0], 400, 400);
  const far = range(scene.frames).flatMap((k) => {
    const [truth, estimate] = [scene.joints(k), track.joints(k)].map((points) => projected(camera, points));
    return [...truth, ...estimate]
      .filter((point) => point[2] > NEAR)
      .map((point) => Math.max(...[0, 1].map((axis) => Math.abs(point[axis] - truth[0][axis]))));
  });
  return { scene, track, camera, size: 2.08 * Math.max(...far, 1) };
}

// Adds a button with a small picture that opens a track; returns what paints its picture at a time.
function addStill(box, row, ...words) {
  const canvas = make("canvas", { "aria-hidden": "true" });
  box.append(button([canvas, make("span", {}, ...words)], () => openTrack(row), { class: "example" }));
  const { scene, track, camera, size } = stillOf(row);
  return (time) => {
    const frame = time % scene.frames;
    const { pen, width, height } = sheet(canvas, 1);
    const scale = width / size;
    const [truth, estimate] = [scene.joints(frame), track.joints(frame)].map((points) => projected(camera, points));
    pen.translate(width / 2 - scale * truth[0][0], height / 2 - scale * truth[0][1]);
    pen.scale(scale, scale);
    if (scene.radii.length) silhouette(pen, camera, truth, scene.radii, "--truth", 0.35);
    else sticks(pen, truth, ink("--truth"), 5 / scale);
    sticks(pen, estimate, limbs(), 2.2 / scale);
  };
}

function silhouette(pen, camera, pixels, radii, name, opacity) {
  pen.globalAlpha = opacity;
  pen.fillStyle = ink(name);
  pen.fill(outline(camera, pixels, radii));
  pen.globalAlpha = 1;
}

function viewer() {
  turnable($("turning"), paint);
  $("frame").oninput = () => {
    play(false);
    show.frame = +$("frame").value;
    paint();
  };
  $("viewer").addEventListener("close", () => play(false));
}

function openTrack(row) {
  const R = D.rows;
  const here = animated.filter((one) => R.instance[one] === R.instance[row]);
  const scene = sceneOf(row);
  show.row = row;
  show.frame = Math.min(show.frame, scene.frames - 1);
  show.camera = Math.min(show.camera, Math.max(scene.cameras.length - 1, 0));
  $("viewer-title").textContent = INSTANCES[R.instance[row]];
  const runs = here.map((one) => [String(one), `${METHODS[R.method[one]]}, seed ${D.seeds[R.seed[one]]}`]);
  choose($("viewer-run"), runs, String(row), () => openTrack(+$("viewer-run").value));
  const cameras = scene.cameras.map((_, k) => [String(k), String(k + 1)]);
  choose($("viewer-camera"), cameras, String(show.camera), () => {
    show.camera = +$("viewer-camera").value;
    paint();
  });
  $("camera-label").hidden = scene.cameras.length < 2;
  $("overlay").parentNode.hidden = !scene.cameras.length;
  $("frame").max = scene.frames - 1;
  strip();
  if (!$("viewer").open) $("viewer").showModal();
  paint();
}

function paint() {
  if (!$("viewer").open) return;
  const [scene, track] = [sceneOf(show.row), trackOf(show.row)];
  const [truth, estimate] = [scene.joints(show.frame), track.joints(show.frame)];
  const camera = scene.cameras[show.camera];
  if (camera) paintOverlay(camera, scene.radii, truth, estimate);
  scene.floor ??= Math.min(...range(scene.frames).flatMap((k) => scene.joints(k).map((point) => point[1])));
  const turning = stage($("turning"), truth[0], scene.floor, $("turning").clientWidth < 420 ? 1 : 0.75);
  sticks(turning.pen, projected(turning.camera, truth), ink("--truth"), 6);
  sticks(turning.pen, projected(turning.camera, estimate), limbs(), 3);
  $("frame").value = show.frame;
  const lost = track.lost.includes(show.frame) ? ", lost" : "";
  const swapped = track.swapped.includes(show.frame) ? ", left and right swapped" : "";
  const error = `frame ${show.frame * scene.step}: MPJPE ${track.mpjpe[show.frame]} mm`;
  $("reading").textContent = `${error}${lost}${swapped}`;
  $("overlay").setAttribute("aria-label", $("reading").textContent);
  $("strip").querySelector(".now").setAttribute("x", show.frame);
}

function paintOverlay(camera, radii, truth, estimate) {
  const { pen, width } = sheet($("overlay"), camera.size[1] / camera.size[0]);
  const scale = width / camera.size[0];
  pen.scale(scale, scale);
  const [there, here] = [truth, estimate].map((points) => projected(camera, points));
  silhouette(pen, camera, there, radii, "--truth", 0.38);
  silhouette(pen, camera, here, radii, "--estimate", 0.38);
  sticks(pen, there, ink("--truth"), 3 / scale);
  sticks(pen, here, limbs(), 2 / scale);
}

// Every frame's error as a bar: lost ones red, a line below the swapped ones.
function strip() {
  const { mpjpe, lost, swapped } = trackOf(show.row);
  const most = Math.max(160, ...mpjpe);
  const about = { width: "100%", height: 46, viewBox: `0 0 ${mpjpe.length} 46`, preserveAspectRatio: "none" };
  const bar = (x, y, height, name, more) =>
    draw("rect", { x, y, width: 0.9, height, style: `fill: var(${name})`, ...more });
  const svg = draw("svg", { ...about, "aria-hidden": "true" });
  svg.append(
    ...mpjpe.map((value, k) =>
      bar(k, 38 * (1 - value / most), (38 * value) / most, lost.includes(k) ? "--bad" : "--truth"),
    ),
    ...swapped.map((k) => bar(k, 41, 4, "--swapped")),
    bar(0, 0, 46, "--accent", { class: "now", opacity: 0.35 }),
  );
  const red = lost.length ? "; red: lost" : "";
  const below = swapped.length ? "; underlined: left and right swapped" : "";
  $("strip").replaceChildren(make("p", {}, `MPJPE of each frame, up to ${whole(most)} mm${red}${below}`), svg);
}

const play = clock(
  $("play"),
  () => pace(sceneOf(show.row)),
  (over) => {
    show.frame = (show.frame + over) % sceneOf(show.row).frames;
    paint();
  },
);
