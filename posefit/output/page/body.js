// Bodies on a canvas: joints in metres from the scene's origin, by a camera of the scene or by a turning one.
const BONES = D.parents.map((parent, joint) => [parent, joint]).slice(1);
const NEAR = 0.05; // metres before a camera: nearer parts are not drawn
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const limbs = () => ({ left: ink("--left"), right: ink("--right"), middle: ink("--middle") });

// Numbers of 16 bits in base 64: a function from the place to the number, or null if it is missing.
function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return (place) => {
    const value = view.getInt16(2 * place, true);
    return value === -32768 ? null : value;
  };
}

// Joints of all frames of a track: a function from the frame to 27 points.
function decoded(text) {
  const at = unpacked(text);
  const count = D.joints.length;
  return (frame) => range(count).map((j) => range(3).map((k) => at(3 * (frame * count + j) + k) / 1000));
}

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

// The points that a camera projects: pixels x, y and depth.
const projected = (camera, points) =>
  points.map((point) => {
    const [x, y, z] = camera.rotation.map(
      (row, k) => row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + camera.translation[k],
    );
    return [(x / z) * camera.focal[0] + camera.centre[0], (y / z) * camera.focal[1] + camera.centre[1], z];
  });

// Bones as lines, in one colour or in a colour for each side.
function sticks(pen, pixels, colours, width) {
  for (const [parent, joint] of BONES) {
    if (pixels[parent][2] <= NEAR || pixels[joint][2] <= NEAR) continue;
    pen.strokeStyle = typeof colours === "string" ? colours : colours[D.sides[joint]];
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(pixels[parent][0], pixels[parent][1]);
    pen.lineTo(pixels[joint][0], pixels[joint][1]);
    pen.stroke();
  }
}

// Adds a bone's tapered cone to a path: the hull of two discs. All its parts turn the same way, so that they fill as
// one. Returns whether any of it is visible.
function addCone(shape, camera, pixels, radii, bone) {
  const [parent, joint] = BONES[bone];
  const [ax, ay, az] = pixels[parent];
  const [bx, by, bz] = pixels[joint];
  if (az <= NEAR || bz <= NEAR) return false;
  const a = (radii[bone][0] * camera.focal[0]) / az;
  const b = (radii[bone][1] * camera.focal[0]) / bz;
  const disc = (x, y, r) => {
    shape.moveTo(x + r, y);
    shape.arc(x, y, r, 0, 2 * Math.PI);
  };
  disc(ax, ay, a);
  disc(bx, by, b);
  const length = Math.hypot(bx - ax, by - ay);
  if (length <= Math.abs(a - b)) return true;
  const along = Math.atan2(by - ay, bx - ax);
  const slope = Math.acos((a - b) / length);
  const on = (x, y, r, angle) => [x + r * Math.cos(angle), y + r * Math.sin(angle)];
  shape.moveTo(...on(ax, ay, a, along - slope));
  for (const corner of [on(bx, by, b, along - slope), on(bx, by, b, along + slope), on(ax, ay, a, along + slope)])
    shape.lineTo(...corner);
  shape.closePath();
  return true;
}

// The outline of a body of tapered cones.
function outline(camera, pixels, radii) {
  const shape = new Path2D();
  BONES.forEach((_, bone) => addCone(shape, camera, pixels, radii, bone));
  return shape;
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

// Clears a canvas, draws the floor around a person in it, and gives the pen with the camera of the gaze.
function stage(canvas, person, floor, ratio) {
  const { pen, width, height } = sheet(canvas, ratio);
  const camera = turned([person[0], floor + 0.9, person[2]], width, height);
  pen.strokeStyle = ink("--line");
  pen.lineWidth = 1;
  const tile = 0.5;
  const [x, z] = [0, 2].map((k) => Math.round(person[k] / tile) * tile);
  const tileLine = (...ends) => {
    const [a, b] = projected(
      camera,
      ends.map(([right, back]) => [x + right, floor, z + back]),
    );
    if (a[2] < 0.1 || b[2] < 0.1) return;
    pen.beginPath();
    pen.moveTo(a[0], a[1]);
    pen.lineTo(b[0], b[1]);
    pen.stroke();
  };
  for (const k of range(9).map((one) => (one - 4) * tile)) {
    tileLine([k, -2], [k, 2]);
    tileLine([-2, k], [2, k]);
  }
  return { pen, camera };
}
