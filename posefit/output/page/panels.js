// The two views of a frame: a camera's picture with the body on it, and the body in 3D.
const SURE = 0.05; // metres: up to this radius of a joint's 80 % interval a limb is drawn solid,
const UNSURE = 0.3; // and from this radius on it is faintest
const FAINTEST = 0.2; // how much of a faintest limb's colour is left
const SOLID = 0.65; // opacity of the body over the picture
const CLOSE = 1.4; // height of a close-up, in heights of the body
const CALM = 6; // frames to either side whose mean position a close-up is centred on
const show = { frame: 0, camera: 0 };
const shown = Math.ceil(D.count / D.step); // frames of this page
const estimateAt = decoded(D.estimate);
const truthAt = D.truth ? decoded(D.truth) : null;
const otherAt = decoded(D.others.joints);
const radiusAt = D.intervals ? unpacked(D.intervals.joints) : () => null;

// The radius in metres of a joint's interval at a level; null where unknown.
function radius(frame, level, joint) {
  const value = radiusAt((frame * D.intervals.levels.length + level) * D.joints.length + joint);
  return given(value) ? value / 1000 : null;
}

// How solid each bone is drawn, 0 to 1: as certain as the less certain of its ends.
function solids(frame) {
  if (!D.intervals) return BONES.map(() => 1);
  const level = D.intervals.levels.indexOf(80);
  const each = D.joints.map((_, joint) => {
    const off = radius(frame, level, joint) ?? 0;
    return between(FAINTEST, 1, (UNSURE - off) / (UNSURE - SURE));
  });
  return BONES.map(([parent, joint]) => Math.min(each[parent], each[joint]));
}

// The other likely pose of a frame, its weight and joints; null if there is none.
function otherOf(frame) {
  const place = D.others.at.indexOf(frame);
  return place < 0 ? null : { weight: D.others.weights[place], joints: otherAt(place) };
}

// A picture by its data, null until it is decoded: then everything is painted again.
const pictures = new Map();
function pictureOf(uri) {
  if (!pictures.has(uri)) {
    const image = new Image();
    image.onload = paint;
    image.src = uri;
    pictures.set(uri, image);
  }
  const image = pictures.get(uri);
  return image.complete && image.naturalWidth ? image : null;
}

// Draws a picture of data into a box, once it is decoded.
function drawPicture(pen, uri, ...box) {
  const image = pictureOf(uri);
  if (image) pen.drawImage(image, ...box);
}

// The body's middle and height in pixels of each camera and frame.
const framed = D.cameras.map((camera) =>
  range(shown).map((frame) => {
    const pixels = projected(camera, estimateAt(frame)).filter(([, , depth]) => depth > NEAR);
    const [xs, ys] = [0, 1].map((k) => pixels.map((pixel) => pixel[k]));
    const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    return pixels.length ? { x: (left + right) / 2, y: (top + bottom) / 2, tall: bottom - top } : null;
  }),
);
const middle = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];

// The zoom of a camera's close-up: the body fills most of its height.
function closeness(camera) {
  const tall = framed[camera].filter(given).map((one) => one.tall);
  return tall.length ? between(1, 6, D.cameras[camera].size[1] / (CLOSE * Math.max(middle(tall), 1))) : 1;
}

// The part of a camera's picture that is shown: its left and top, and its zoom.
function part(which, frame) {
  const [wide, high] = D.cameras[which].size;
  const zoom = $("close-up").checked ? closeness(which) : 1;
  const about = framed[which].slice(Math.max(0, frame - CALM), frame + CALM + 1).filter(given);
  if (zoom === 1 || !about.length) return { left: 0, top: 0, zoom: 1 };
  const mean = (name) => about.reduce((sum, one) => sum + one[name], 0) / about.length;
  const within = (centre, side) => between(0, side - side / zoom, centre - side / zoom / 2);
  return { left: within(mean("x"), wide), top: within(mean("y"), high), zoom };
}

// A body of tapered cones, far ones first. Cones are transparent unless they are solid.
function cones(pen, camera, pixels, solid, width) {
  const colours = limbs();
  const edge = ink("--back");
  const far = BONES.map(([parent, joint]) => pixels[parent][2] + pixels[joint][2]);
  const order = range(BONES.length).sort((a, b) => far[b] - far[a]);
  for (const bone of order) {
    const cone = new Path2D();
    if (!addCone(cone, camera, pixels, D.radii, bone)) continue;
    pen.globalAlpha = solid[bone];
    pen.strokeStyle = edge;
    pen.lineWidth = width;
    pen.stroke(cone);
    pen.fillStyle = colours[D.sides[BONES[bone][1]]];
    pen.fill(cone);
  }
  pen.globalAlpha = 1;
}

// A mask that is clear where its picture is black.
const cut = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
function cutOut(image) {
  Object.assign(cut.canvas, { width: image.naturalWidth, height: image.naturalHeight });
  cut.drawImage(image, 0, 0);
  const held = cut.getImageData(0, 0, cut.canvas.width, cut.canvas.height);
  for (let k = 0; k < held.data.length; k += 4) held.data[k + 3] = held.data[k];
  cut.putImageData(held, 0, 0);
  return cut.canvas;
}

// Pixels of both mask and body, of the mask alone and of the body alone, each in its colour.
function agreement(pen, size, [box, uri], body) {
  const mask = pictureOf(uri);
  if (mask) {
    pen.drawImage(cutOut(mask), ...box);
    pen.globalCompositeOperation = "source-in";
    pen.fillStyle = ink("--missed");
    pen.fillRect(0, 0, size[0], size[1]);
  }
  if (body) {
    pen.globalCompositeOperation = "source-atop";
    pen.fillStyle = ink("--both");
    pen.fill(body);
    pen.globalCompositeOperation = "destination-over";
    pen.fillStyle = ink("--spilled");
    pen.fill(body);
  }
  pen.globalCompositeOperation = "source-over";
}

// Paints a camera's film, all of it coarse and the part around the person fine, and on it mask and body, put together
// first. Returns the frame that the picture is of.
function paintPicture(canvas, which) {
  const camera = D.cameras[which];
  const { pen, width } = sheet(canvas, camera.size[1] / camera.size[0]);
  const scale = width / camera.size[0];
  const film = which === 0 && $("with-film").checked ? D.film : null;
  const masks = D.masks[which];
  const body = $("with-body").checked;
  const masked = $("with-mask").checked;
  const every = Math.max(film ? film.every : 1, masked || !film ? masks.every : 1);
  const frame = Math.floor((show.frame * D.step) / every) * (every / D.step); // of the body, as in the picture
  const { left, top, zoom } = part(which, frame);
  const factor = zoom * scale;
  pen.scale(factor, factor);
  pen.translate(-left, -top);
  const of = (strip) => strip.pictures[Math.min((frame * D.step) / strip.every, strip.pictures.length - 1)];
  if (film) {
    const [box, near, coarse] = of(film);
    drawPicture(pen, coarse, 0, 0, ...camera.size);
    drawPicture(pen, near, ...box);
  }
  const pixels = projected(camera, estimateAt(frame));
  const over = canvas.cloneNode().getContext("2d");
  over.lineCap = over.lineJoin = "round";
  over.setTransform(pen.getTransform());
  const solid = solids(frame);
  if (masked) {
    agreement(over, camera.size, of(masks), body ? outline(camera, pixels, D.radii) : null);
  } else if (body) cones(over, camera, pixels, solid, 1.5 / factor);
  pen.globalAlpha = film ? SOLID : 1;
  pen.drawImage(over.canvas, left, top, camera.size[0] / zoom, camera.size[1] / zoom);
  pen.globalAlpha = 1;
  if (!body) return frame;
  if (masked) sticks(pen, pixels, limbs(), 2.5 / factor);
  const other = otherOf(frame);
  if (other) sticks(pen, projected(camera, other.joints), ink("--other"), 2.5 / factor);
  return frame;
}

const lowest = (at) => Math.min(...range(shown).map((k) => Math.min(...at(k).map((point) => point[1]))));
const floor = lowest(truthAt ?? estimateAt);

// A line of points on the floor, round at its ends.
function onFloor(pen, camera, points, width) {
  const pixels = projected(
    camera,
    points.map(([x, , z]) => [x, floor, z]),
  ).filter(([, , depth]) => depth > NEAR);
  pen.lineWidth = width;
  pen.beginPath();
  for (const [x, y] of pixels) pen.lineTo(x, y);
  pen.stroke();
}

// The path over the ground up to a frame, and the body's shadow.
function ground(pen, camera, joints) {
  pen.strokeStyle = ink("--line");
  pen.lineCap = pen.lineJoin = "round";
  onFloor(
    pen,
    camera,
    range(show.frame + 1).map((frame) => estimateAt(frame)[0]),
    3,
  );
  const [, , depth] = projected(camera, [joints[0]])[0];
  BONES.forEach(([parent, joint], bone) => {
    const wide = ((D.radii[bone][0] + D.radii[bone][1]) * camera.focal[0]) / depth;
    onFloor(pen, camera, [joints[parent], joints[joint]], wide);
  });
}

// Two eyes, where the head faces the camera: the way that the line across the hips faces.
function face(pen, camera, joints) {
  const at = (name) => joints[D.joints.indexOf(name)];
  const [left, right, head, neck] = ["lfemur", "rfemur", "head", "upperneck"].map(at);
  const across = [left[0] - right[0], left[2] - right[2]];
  const long = Math.hypot(...across) || 1;
  const [x, z] = [across[0] / long, across[1] / long];
  const size = D.radii[BONES.findIndex(([, joint]) => D.joints[joint] === "head")][1];
  const centre = head.map((value, k) => (value + neck[k]) / 2);
  const points = [-1, 1].map((side) => [
    centre[0] - size * (0.85 * z - 0.4 * side * x),
    centre[1] + 0.1 * size,
    centre[2] + size * (0.85 * x + 0.4 * side * z),
  ]);
  const [[, , depth], ...eyes] = projected(camera, [centre, ...points]);
  pen.fillStyle = ink("--back");
  for (const [a, b, near] of eyes) {
    if (near <= NEAR || near > depth) continue;
    pen.beginPath();
    pen.arc(a, b, (0.16 * size * camera.focal[0]) / near, 0, 2 * Math.PI);
    pen.fill();
  }
}

function paintBody() {
  const joints = estimateAt(show.frame);
  const canvas = $("turning");
  const { pen, camera } = stage(canvas, joints[0], floor, canvas.clientWidth < 420 ? 0.9 : 0.75);
  ground(pen, camera, joints);
  cones(pen, camera, projected(camera, joints), solids(show.frame), 1.5);
  face(pen, camera, joints);
  if (truthAt && $("with-truth").checked) sticks(pen, projected(camera, truthAt(show.frame)), ink("--ink"), 1.5);
  const other = otherOf(show.frame);
  if (other) sticks(pen, projected(camera, other.joints), ink("--other"), 2.5);
}

// Looks from the first camera's direction, turned right and up by some radians.
function look(right, up) {
  const [x, , z] = D.cameras[0].rotation[2];
  gaze.yaw = Math.atan2(-x, -z) + right;
  gaze.pitch = up;
  paint();
}

// An entry of a legend: a patch of a colour, or a line, and its meaning.
function entry(colour, words, thin) {
  const patch = draw(
    "svg",
    { width: 16, height: 12, "aria-hidden": "true" },
    draw("rect", { y: thin ? 5 : 0, width: 16, height: thin ? 2.5 : 12, style: `fill: var(${colour})` }),
  );
  return make("li", {}, patch, words);
}

function legends() {
  const masked = $("with-mask").checked;
  const body = $("with-body").checked;
  const fit = [
    body ? entry("--both", "mask and body") : null,
    entry("--missed", body ? "mask only" : "mask"),
    body ? entry("--spilled", "body only") : null,
  ];
  const sides = () => [entry("--left", "left limbs"), entry("--right", "right limbs")];
  const may = () => (D.others.at.length ? entry("--other", "may also be this", true) : null);
  const truth = truthAt && $("with-truth").checked ? entry("--ink", "truth", true) : null;
  const faint = D.intervals ? make("li", {}, "faint: uncertain") : null;
  const below = (id, entries) => $(id).replaceChildren(...entries.filter(given));
  below("picture-legend", [...(masked ? fit : []), ...(body ? [...sides(), may()] : [])]);
  below("turning-legend", [...sides(), truth, may(), faint]);
}
