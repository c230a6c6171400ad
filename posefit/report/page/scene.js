// Bodies of a report: what a camera of a scene sees, a view that can be turned, and stills on cards.
const sceneOf = (instance) => {
  const scene = D.gallery.scenes[instance];
  scene.joints = scene.joints || decoded(scene.truth);
  return scene;
};

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

function paintTurned(canvas, truth, estimate, floor) {
  const { pen, camera } = stage(canvas, truth[0], floor, canvas.clientWidth < 420 ? 1 : 0.75);
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
