// The first screen: who leads, all methods with their intervals and the baselines, and three tracks of the leader.
const MANY = 20; // methods of the figure

// Places of labels over a figure, each to the right of its line, which ends below every label that it would cross.
function lanes(labels, high) {
  const found = [];
  for (const { x, text } of labels) {
    const wide = 6.4 * text.length + 8;
    const from = Math.min(x + 5, high - wide);
    const above = found.filter((one) => one.end > from - 6);
    found.push({ lane: 1 + Math.max(-1, ...above.map((one) => one.lane)), from, end: from + wide });
  }
  return found;
}

// A scale of errors from 0, or of their logarithms where the worst is far from the best.
function errorScale(values, low, high) {
  const [least, most] = [Math.min(...values), Math.max(...values)];
  const wide = least > 0 && most > 15 * least;
  const [from, to] = wide ? [Math.log(0.8 * least), Math.log(1.15 * most)] : [0, 1.05 * most || 1];
  const at = (value) => low + ((high - low) * ((wide ? Math.log(value) : value) - from)) / (to - from);
  const marks = wide
    ? range(36)
        .map((k) => [1, 2, 5][k % 3] * 10 ** (Math.floor(k / 3) - 4))
        .filter((one) => Math.log(one) >= from && Math.log(one) <= to)
    : steps(0, to, Math.max(3, (high - low) / 90));
  return { at, marks, wide };
}

function standing(width) {
  const rows = D.leaderboard.filter((row) => row.taking_part && given(row.error)).slice(0, MANY);
  const alike = new Set(
    D.pairs ? duelsOf(rows[0].method).flatMap((row) => (row.adjusted >= 0.05 ? [row.other] : [])) : [],
  );
  const narrow = width < 480;
  const step = narrow ? 38 : 26;
  const longest = Math.min(27, Math.max(...rows.map((row) => row.name.length)));
  const [left, right] = [narrow ? 10 : 7.4 * longest + 24, width - (narrow ? 12 : 66)];
  const bases = D.baselines.filter((row) => given(row.error)).sort((a, b) => a.error - b.error);
  const spans = rows.flatMap((row) => [row.error, row.low, row.high].filter((one) => given(one) && one > 0));
  const scale = errorScale([...spans, ...bases.map((row) => row.error)], left, right);
  const labels = bases.map((row) => ({
    x: scale.at(row.error),
    text: `${D.trivial[row.baseline]} ${number(row.error, 2)}°`,
  }));
  const placed = lanes(labels, width);
  const top = 16 * (1 + Math.max(-1, ...placed.map((one) => one.lane))) + 10;
  const bottom = top + step * rows.length;
  const height = bottom + 40;
  const said = [...rows, ...bases].map((row) => {
    const name = row.name ?? `baseline, ${D.trivial[row.baseline]}`;
    const ends = given(row.low) ? ` from ${number(row.low, 2)} to ${number(row.high, 2)}` : "";
    return `${name} ${number(row.error, 2)}${ends}`;
  });
  const svg = draw("svg", {
    width,
    height,
    viewBox: `0 0 ${width} ${height}`,
    role: "img",
    "aria-label": `Errors in degrees with 95 % intervals: ${said.join("; ")}`,
  });
  for (const value of scale.marks)
    svg.append(
      draw("line", { class: "rule", x1: scale.at(value), x2: scale.at(value), y1: top, y2: bottom }),
      draw(
        "text",
        { x: scale.at(value), y: bottom + 16, "text-anchor": "middle", class: "soft" },
        `${+value.toPrecision(3)}°`,
      ),
    );
  bases.forEach((row, k) =>
    svg.append(
      draw("line", {
        class: "baseline",
        x1: labels[k].x,
        x2: labels[k].x,
        y1: 16 * placed[k].lane + 2,
        y2: bottom,
      }),
    ),
  );
  bases.forEach((row, k) =>
    svg.append(draw("text", { x: placed[k].from, y: 16 * placed[k].lane + 12, class: "soft over" }, labels[k].text)),
  );
  rows.forEach((row, k) => {
    const y = top + step * (k + 0.5) + (narrow ? 8 : 0);
    const name = shortened(row.name, narrow ? 34 : 27);
    const best = k === 0 || alike.has(row.method);
    svg.append(
      draw(
        "text",
        narrow
          ? { x: left, y: y - 11, class: best ? "over best" : "over" }
          : { x: left - 12, y: y + 4, "text-anchor": "end", class: best ? "best" : null },
        narrow ? `${name}  ${number(row.error, 2)}°` : name,
      ),
    );
    if (given(row.low))
      svg.append(
        draw("line", {
          x1: scale.at(row.low),
          x2: scale.at(row.high),
          y1: y,
          y2: y,
          style: `stroke: ${colour(row.method)}`,
          "stroke-width": 3,
        }),
      );
    svg.append(mark(row.method, scale.at(row.error), y, 5.5, {}, draw("title", {}, said[k])));
    if (!narrow)
      svg.append(draw("text", { x: right + 12, y: y + 4, class: best ? "best" : null }, `${number(row.error, 2)}°`));
  });
  svg.append(
    draw("line", { class: "axis", x1: left, x2: right, y1: bottom, y2: bottom }),
    draw(
      "text",
      { x: (left + right) / 2, y: height - 5, "text-anchor": "middle", class: "soft" },
      `error in degrees${scale.wide ? ", on a logarithmic scale" : ""}; less is better`,
    ),
  );
  return svg;
}

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
  drawn($("standing"), standing);
  const left = D.leaderboard.filter((row) => row.taking_part).length - MANY;
  if (left > 0) $("standing-note").append(` The ${MANY} best; ${whole(left)} more are in the table.`);
  examples();
}
