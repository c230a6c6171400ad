// Bodies on a canvas: joints in metres from the scene's origin, seen by a camera of the scene or by one that turns.
const BONES = D.parents.map((parent, joint) => [parent, joint]).slice(1);
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const limbs = () => ({ left: ink("--left"), right: ink("--right"), middle: ink("--ink") });

// Joints of all frames of a picture: a function of the frame that gives 27 points.
function decoded(text) {
  const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const count = D.joints.length;
  return (frame) =>
    range(count).map((j) => range(3).map((k) => view.getInt16(2 * (3 * (frame * count + j) + k), true) / 1000));
}

const sceneOf = (instance) => {
  const scene = D.gallery.scenes[instance];
  scene.joints = scene.joints || decoded(scene.truth);
  return scene;
};

// A canvas's context with sharp pixels, cleared; drawn in CSS pixels.
function sheet(canvas, ratio) {
  const width = canvas.clientWidth || 320;
  const height = Math.round(width * ratio);
  const scale = window.devicePixelRatio || 1;
  canvas.style.height = `${height}px`;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.lineCap = pen.lineJoin = "round";
  return { pen, width, height };
}

// Where a camera sees points: pixels x, y and depth.
const seen = (camera, points) =>
  points.map((point) => {
    const [x, y, z] = camera.rotation.map(
      (row, k) => row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + camera.translation[k],
    );
    return [(x / z) * camera.focal[0] + camera.centre[0], (y / z) * camera.focal[1] + camera.centre[1], z];
  });

function sticks(pen, pixels, colours, width) {
  for (const [parent, joint] of BONES) {
    if (pixels[parent][2] <= 0.05 || pixels[joint][2] <= 0.05) continue;
    pen.strokeStyle = typeof colours === "string" ? colours : colours[D.sides[joint]];
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(pixels[parent][0], pixels[parent][1]);
    pen.lineTo(pixels[joint][0], pixels[joint][1]);
    pen.stroke();
  }
}

// The outline of a body of tapered cones: on every bone the hull of two discs. All parts turn the same way, so that
// they fill as one.
function outline(camera, pixels, radii) {
  const path = new Path2D();
  BONES.forEach(([parent, joint], bone) => {
    const [ax, ay, az] = pixels[parent];
    const [bx, by, bz] = pixels[joint];
    if (az <= 0.05 || bz <= 0.05) return;
    const a = (radii[bone][0] * camera.focal[0]) / az;
    const b = (radii[bone][1] * camera.focal[0]) / bz;
    for (const [x, y, r] of [
      [ax, ay, a],
      [bx, by, b],
    ]) {
      path.moveTo(x + r, y);
      path.arc(x, y, r, 0, 2 * Math.PI);
    }
    const length = Math.hypot(bx - ax, by - ay);
    if (length <= Math.abs(a - b)) return;
    const along = Math.atan2(by - ay, bx - ax);
    const slope = Math.acos((a - b) / length);
    const on = (x, y, r, angle) => [x + r * Math.cos(angle), y + r * Math.sin(angle)];
    path.moveTo(...on(ax, ay, a, along - slope));
    for (const corner of [on(bx, by, b, along - slope), on(bx, by, b, along + slope), on(ax, ay, a, along + slope)])
      path.lineTo(...corner);
    path.closePath();
  });
  return path;
}

function paintOverlay(canvas, scene, camera, truth, estimate) {
  const { pen, width } = sheet(canvas, camera.size[1] / camera.size[0]);
  const scale = width / camera.size[0];
  pen.scale(scale, scale);
  const there = seen(camera, truth);
  const here = seen(camera, estimate);
  pen.globalAlpha = 0.38;
  pen.fillStyle = ink("--truth");
  pen.fill(outline(camera, there, scene.radii));
  pen.fillStyle = ink("--estimate");
  pen.fill(outline(camera, here, scene.radii));
  pen.globalAlpha = 1;
  sticks(pen, there, ink("--truth"), 3 / scale);
  sticks(pen, here, limbs(), 2 / scale);
}

const gaze = { yaw: 0.7, pitch: 0.15, zoom: 1 };

// A camera that looks at a point from where the gaze is.
function turned(target, width, height) {
  const [cy, sy, cp, sp] = [Math.cos(gaze.yaw), Math.sin(gaze.yaw), Math.cos(gaze.pitch), Math.sin(gaze.pitch)];
  const rotation = [
    [cy, 0, -sy],
    [sp * sy, -cp, sp * cy],
    [-cp * sy, -sp, -cp * cy],
  ];
  const away = 4 / gaze.zoom;
  const back = rotation.map((row, k) => (k === 2 ? away : 0) - row.reduce((sum, one, j) => sum + one * target[j], 0));
  return { rotation, translation: back, focal: [1.75 * height, 1.75 * height], centre: [width / 2, height / 2] };
}

function paintTurned(canvas, truth, estimate, floor) {
  const { pen, width, height } = sheet(canvas, canvas.clientWidth < 420 ? 1 : 0.75);
  const target = [truth[0][0], floor + 0.9, truth[0][2]];
  const camera = turned(target, width, height);
  pen.strokeStyle = ink("--line");
  pen.lineWidth = 1;
  const tile = 0.5;
  const [x0, z0] = [0, 2].map((k) => Math.round(truth[0][k] / tile) * tile);
  for (const k of range(9).map((one) => (one - 4) * tile)) {
    for (const ends of [
      [
        [x0 + k, floor, z0 - 2],
        [x0 + k, floor, z0 + 2],
      ],
      [
        [x0 - 2, floor, z0 + k],
        [x0 + 2, floor, z0 + k],
      ],
    ]) {
      const [a, b] = seen(camera, ends);
      if (a[2] < 0.1 || b[2] < 0.1) continue;
      pen.beginPath();
      pen.moveTo(a[0], a[1]);
      pen.lineTo(b[0], b[1]);
      pen.stroke();
    }
  }
  sticks(pen, seen(camera, truth), ink("--truth"), 6);
  sticks(pen, seen(camera, estimate), limbs(), 3);
}

// A small still of a pose, for a card.
function still(scene) {
  const points = scene.joints(Math.floor(scene.frames / 2));
  const size = 72;
  const flat = scene.cameras.length ? seen(scene.cameras[0], points) : points.map(([x, y, z]) => [x + 0.3 * z, -y]);
  const [xs, ys] = [0, 1].map((k) => flat.map((one) => one[k]));
  const [left, top] = [Math.min(...xs), Math.min(...ys)];
  const scale = (size - 8) / Math.max(Math.max(...ys) - top, Math.max(...xs) - left, 1e-6);
  const at = ([x, y]) => [
    4 + (x - left) * scale + (size - 8 - (Math.max(...xs) - left) * scale) / 2,
    4 + (y - top) * scale,
  ];
  const svg = draw("svg", { width: size, height: size, "aria-hidden": "true" });
  const tints = { left: "var(--left)", right: "var(--right)", middle: "var(--ink)" };
  for (const [parent, joint] of BONES) {
    const [a, b] = [at(flat[parent]), at(flat[joint])].map((one) => one.map((value) => value.toFixed(1)));
    svg.append(
      draw("line", {
        x1: a[0],
        y1: a[1],
        x2: b[0],
        y2: b[1],
        style: `stroke: ${tints[D.sides[joint]]}`,
        "stroke-width": 2.5,
        "stroke-linecap": "round",
      }),
    );
  }
  return svg;
}
