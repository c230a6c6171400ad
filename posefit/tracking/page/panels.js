// The two views of a frame: what a camera saw with the body on it, and the body in 3D.
const SURE = 0.05; // metres: a joint's 80 % interval, up to which a limb is drawn solid,
const UNSURE = 0.3; // and from which on it is faintest
const FAINTEST = 0.2; // how much of a faintest limb's colour is left
const SOLID = 0.65; // how much of what was filmed the body hides
const show = { frame: 0, camera: 0 };
const shown = Math.ceil(D.count / D.step); // frames of this page
const estimateAt = decoded(D.estimate);
const truthAt = D.truth ? decoded(D.truth) : null;
const otherAt = decoded(D.others.joints);
const radiusAt = D.intervals ? unpacked(D.intervals.joints) : () => null;

// Metres that a joint may be off at a level; null where nobody says.
function radius(frame, level, joint) {
  const value = radiusAt((frame * D.intervals.levels.length + level) * D.joints.length + joint);
  return given(value) ? value / 1000 : null;
}

// How solid each bone is drawn, 0 to 1: as sure as the less sure of its ends.
function solids(frame) {
  if (!D.intervals) return BONES.map(() => 1);
  const level = D.intervals.levels.indexOf(80);
  const each = D.joints.map((_, joint) => {
    const off = radius(frame, level, joint) ?? 0;
    return Math.max(FAINTEST, Math.min(1, (UNSURE - off) / (UNSURE - SURE)));
  });
  return BONES.map(([parent, joint]) => Math.min(each[parent], each[joint]));
}

// What else a frame may show: its weight and joints; null where nothing else is likely.
function otherOf(frame) {
  const place = D.others.at.indexOf(frame);
  return place < 0 ? null : { weight: D.others.weights[place], joints: otherAt(place) };
}

// A picture by its strip and place in it: it is there once it is decoded, and then everything is painted again.
const pictures = new Map();
function pictureOf(strip, place) {
  const uri = strip.pictures[place];
  if (!uri) return null;
  if (!pictures.has(uri)) {
    const image = new Image();
    image.onload = paint;
    image.src = uri;
    pictures.set(uri, image);
  }
  const image = pictures.get(uri);
  return image.complete && image.naturalWidth ? image : null;
}

// A sheet as large as another canvas, with the same scale.
function layer(canvas, scale) {
  const sheetOf = document.createElement("canvas");
  sheetOf.width = canvas.width;
  sheetOf.height = canvas.height;
  const pen = sheetOf.getContext("2d");
  pen.scale(scale, scale);
  pen.lineCap = pen.lineJoin = "round";
  return pen;
}

// A body of tapered cones, far ones first; what lies behind shows through where it is not solid.
function cones(pen, camera, pixels, solid, width) {
  const colours = limbs();
  const edge = ink("--back");
  const far = BONES.map(([parent, joint]) => pixels[parent][2] + pixels[joint][2]);
  const order = range(BONES.length).sort((a, b) => far[b] - far[a]);
  for (const bone of order) {
    const path = new Path2D();
    if (!addCone(path, camera, pixels, D.radii, bone)) continue;
    pen.globalAlpha = solid[bone];
    pen.strokeStyle = edge;
    pen.lineWidth = width;
    pen.stroke(path);
    pen.fillStyle = colours[D.sides[BONES[bone][1]]];
    pen.fill(path);
  }
  pen.globalAlpha = 1;
}

// Where mask and body agree, and where they do not, each in its colour.
function agreement(pen, size, mask, path) {
  if (mask) {
    pen.drawImage(mask, 0, 0, size[0], size[1]);
    pen.globalCompositeOperation = "source-in";
    pen.fillStyle = ink("--missed");
    pen.fillRect(0, 0, size[0], size[1]);
  }
  if (path) {
    pen.globalCompositeOperation = "source-atop";
    pen.fillStyle = ink("--both");
    pen.fill(path);
    pen.globalCompositeOperation = "destination-over";
    pen.fillStyle = ink("--spilled");
    pen.fill(path);
  }
  pen.globalCompositeOperation = "source-over";
}

// The strip of a camera's pictures that is shown: what was filmed, if that is wanted, or the masks.
const filmed = () => (show.camera === 0 && D.film && $("with-film").checked ? D.film : null);

function paintPicture() {
  const camera = D.cameras[show.camera];
  const canvas = $("picture");
  const { pen, width } = sheet(canvas, camera.size[1] / camera.size[0]);
  const scale = width / camera.size[0];
  pen.scale(scale, scale);
  const film = filmed();
  const masks = D.masks[show.camera];
  const every = (film ?? masks).every;
  const place = Math.floor((show.frame * D.step) / every);
  const frame = (place * every) / D.step; // the body is drawn as it was in the picture
  const behind = film ? pictureOf(film, place) : null;
  if (behind) pen.drawImage(behind, 0, 0, camera.size[0], camera.size[1]);
  const pixels = seen(camera, estimateAt(frame));
  const body = $("with-body").checked;
  const masked = $("with-mask").checked;
  const device = scale * (window.devicePixelRatio || 1);
  const over = layer(canvas, device);
  const solid = solids(frame);
  if (masked) {
    const mask = pictureOf(masks, Math.floor((place * every) / masks.every));
    agreement(over, camera.size, mask, body ? outline(camera, pixels, D.radii) : null);
  } else if (body) cones(over, camera, pixels, solid, 1.5 / scale);
  pen.globalAlpha = film ? SOLID : 1;
  pen.drawImage(over.canvas, 0, 0, camera.size[0], camera.size[1]);
  pen.globalAlpha = 1;
  if (!body) return frame;
  if (masked) sticks(pen, pixels, limbs(), 2.5 / scale);
  const other = otherOf(frame);
  if (other) sticks(pen, seen(camera, other.joints), ink("--other"), 2.5 / scale);
  return frame;
}

const lowest = (at) => Math.min(...range(shown).map((k) => Math.min(...at(k).map((point) => point[1]))));
const floor = lowest(truthAt ?? estimateAt);

function paintBody() {
  const joints = estimateAt(show.frame);
  const canvas = $("turning");
  const { pen, camera } = stage(canvas, joints[0], floor, canvas.clientWidth < 420 ? 0.9 : 0.75);
  cones(pen, camera, seen(camera, joints), solids(show.frame), 1.5);
  if (truthAt && $("with-truth").checked) sticks(pen, seen(camera, truthAt(show.frame)), ink("--ink"), 1.5);
  const other = otherOf(show.frame);
  if (other) sticks(pen, seen(camera, other.joints), ink("--other"), 2.5);
}

// Looks from where the first camera stands, turned by some radians to its right, and from so high up.
function look(right, up) {
  const [x, , z] = D.cameras[0].rotation[2];
  gaze.yaw = Math.atan2(-x, -z) + right;
  gaze.pitch = up;
  paint();
}

// An entry of a legend: a patch of a colour, or a line, and what it means.
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
  const may = D.others.at.length ? entry("--other", "may be this, too", true) : null;
  const sides = [entry("--left", "left limbs"), entry("--right", "right limbs")];
  $("picture-legend").replaceChildren(...[...(masked ? fit : []), ...(body ? [...sides, may] : [])].filter(given));
  const truth = truthAt && $("with-truth").checked ? entry("--ink", "truth", true) : null;
  const faint = D.intervals ? make("li", {}, "faint: unsure") : null;
  $("turning-legend").replaceChildren(...[...sides, truth, may, faint].filter(given));
}
