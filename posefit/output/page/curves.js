// Curves over the frames, with intervals as bands, and rows of marks below.
const BOX = { left: 48, right: 12, top: 8 };
const ROW = 7; // pixels of a row of marks
const MARKS = [
  ["lost", "--bad", "lost"],
  ["unknown", "--other", "left and right unknown"],
  ["held", "--held", "pose held: too little is visible"],
].filter(([name]) => D.marks[name].length);
const STRENGTHS = [0.85, 0.5, 0.25]; // opacities of the bands, the narrowest first
const cursors = new Map(); // from each box to the function that moves its line to a frame
const seconds = (frame) => (D.first + frame * D.step) / D.fps;

// A chart of `lines` {values, colour, name, dashed} over `bands` {low, high}, the narrowest first.
function chart(width, { lines, bands, label, unit, digits }) {
  const bottom = 20 + (ROW + 2) * MARKS.length;
  const height = (width < 500 ? 120 : 150) + ROW * MARKS.length;
  const all = [...lines.map((one) => one.values), ...bands.flatMap(({ low, high }) => [low, high])]
    .flat()
    .filter(given);
  let [low, high] = all.length ? [Math.min(...all), Math.max(...all)] : [0, 1];
  if (low > 0 && low < 0.6 * high) low = 0;
  if (high - low < 1e-9) high = low + 1;
  const pad = 0.06 * (high - low);
  const [from, to] = [low === 0 ? 0 : low - pad, high + pad];
  const ticks = steps(0, seconds(shown - 1), Math.max(2, width / 110)).map((time) => (time * D.fps) / D.step);
  const texts = lines.map((one) => `${one.name}: ${summed(one.values, digits)} ${unit}`);
  const { svg, at, up } = axes(
    { ...BOX, width, height, bottom, name: `${label} over time. ${texts.join("; ")}` },
    { to: shown - 1, marks: ticks, show: (frame) => `${rounded(seconds(frame))} s` },
    { from, to, marks: steps(from, to, 4), show: rounded },
  );
  const across = at(1) - at(0);
  bands.toReversed().forEach((one, k) => {
    const about = { style: "fill: var(--unsure)", opacity: 0.6 * STRENGTHS[bands.length - 1 - k] };
    for (const run of runsOf(one.low)) {
      const place = (frame, aside) => [at(frame) + aside, up(one.low[frame]), up(one.high[frame])];
      const [first] = run;
      const points =
        run.length > 1 ? run.map((frame) => place(frame, 0)) : [-1, 1].map((side) => place(first, (side * across) / 2));
      svg.append(band(points, about));
    }
  });
  for (const { values, colour, dashed } of lines) {
    const runs = runsOf(values).map((run) => path(run.map((frame) => [at(frame), up(values[frame])])));
    const dashes = { "stroke-dasharray": dashed ? "5 4" : null, "stroke-linecap": "round" };
    const about = { fill: "none", style: `stroke: var(${colour})`, "stroke-width": 2, ...dashes };
    svg.append(draw("path", { d: runs.join(""), ...about }));
  }
  const last = width - BOX.right;
  MARKS.forEach(([name, colour], k) => {
    const y = height - (ROW + 2) * (MARKS.length - k);
    svg.append(draw("rect", { class: "rule", x: BOX.left, width: last - BOX.left, y, height: ROW }));
    for (const run of runsOf(range(shown).map((frame) => (D.marks[name].includes(frame) ? 1 : null)))) {
      const half = Math.max(across, 1) / 2;
      const [x, end] = [Math.max(BOX.left, at(run[0]) - half), Math.min(last, at(run.at(-1)) + half)];
      const about = { class: `mark ${name}`, style: `fill: var(${colour})` };
      svg.append(draw("rect", { ...about, x, width: end - x, y, height: ROW }));
    }
  });
  const cursor = drawLine(0, BOX.top - 4, 0, height, {
    class: "now",
    style: "stroke: var(--ink)",
    "stroke-width": 1.5,
  });
  svg.append(cursor);
  const follow = (event) => {
    const place = event.clientX - svg.getBoundingClientRect().left;
    seek(between(0, shown - 1, Math.round((place - BOX.left) / across)));
  };
  svg.addEventListener("pointerdown", (event) => {
    svg.setPointerCapture(event.pointerId);
    follow(event);
  });
  svg.addEventListener("pointermove", (event) => event.buttons && follow(event));
  return { svg, move: (frame) => cursor.setAttribute("transform", `translate(${at(frame)},0)`) };
}

// Least, greatest and mean in words.
function summed(values, digits) {
  const known = values.filter(given);
  if (!known.length) return "nothing";
  const mean = known.reduce((sum, value) => sum + value, 0) / known.length;
  return `${number(Math.min(...known), digits)} to ${number(Math.max(...known), digits)}, mean ${number(mean, digits)}`;
}

// The runs of consecutive frames that have a value.
function runsOf(values) {
  const runs = [];
  values.forEach((value, frame) => {
    if (!given(value)) return;
    if (frame && given(values[frame - 1])) runs.at(-1).push(frame);
    else runs.push([frame]);
  });
  return runs;
}

// Draws the chart of what `about` returns into a box, with a line at the frame that is shown.
function follows(box, about) {
  drawn(box, (width) => {
    const { svg, move } = chart(width, about());
    cursors.set(box, move);
    move(show.frame);
    return svg;
  });
}

function frameFigure() {
  const name = $("figure").value;
  const { label, unit, digits, factor } = D.columns[name];
  const values = D.rows[name].map((value) => (given(value) ? factor * value : null));
  return { lines: [{ values, colour: "--accent", name: label }], bands: [], label, unit, digits };
}

// The intervals of joints, the mean over all but the root, which every interval is relative to.
function jointIntervals() {
  const inner = range(D.joints.length).slice(1);
  const bands = D.intervals.levels.map((_, level) => {
    const high = range(shown).map((frame) => {
      const each = inner.map((joint) => radius(frame, level, joint));
      return each.every(given) ? (1000 * each.reduce((sum, value) => sum + value, 0)) / each.length : null;
    });
    return { low: high.map((value) => (given(value) ? 0 : null)), high };
  });
  const lines = D.rows.mpjpe_mm ? [{ values: D.rows.mpjpe_mm, colour: "--ink", name: "true error" }] : [];
  return { lines, bands, label: "Uncertainty of joints", unit: "mm", digits: 0 };
}

// The height of a joint above the floor in metres, or an angle in degrees, with the truth and intervals if known.
function jointOrAngle() {
  const [kind, which] = $("joint").value.split(":");
  const at = +which;
  const frames = range(shown);
  const curve = (values, truth, name, label, unit, digits, halfOf) => {
    const lines = [{ values, colour: "--accent", name }];
    if (truth) lines.push({ values: truth, colour: "--ink", name: "truth", dashed: true });
    const bands = range(halfOf && D.intervals ? D.intervals.levels.length : 0).map((level) => {
      const half = frames.map((frame) => halfOf(frame, level));
      const side = (sign) => values.map((value, k) => (given(half[k]) ? value + sign * half[k] : null));
      return { low: side(-1), high: side(1) };
    });
    return { lines, bands, label, unit, digits };
  };
  if (kind === "height") {
    const heights = (of) => frames.map((frame) => of(frame)[at][1] - floor);
    const name = D.places[at];
    const truth = truthAt ? heights(truthAt) : null;
    const half = (frame, level) => radius(frame, level, at);
    return curve(heights(estimateAt), truth, name, `Height of the ${name}`, "m", 2, half);
  }
  const { names, values, truth } = D[kind];
  const tenths = (text) => {
    const value = unpacked(text);
    return (place) => (given(value(place)) ? value(place) / 10 : null);
  };
  const ofFrames = (text) => frames.map((frame) => tenths(text)(frame * names.length + at));
  const half = D.intervals && kind === "angles" ? tenths(D.intervals.angles) : null;
  const halfOf = (frame, level) => half((frame * D.intervals.levels.length + level) * names.length + at);
  const trueValues = truth ? ofFrames(truth) : null;
  return curve(ofFrames(values), trueValues, names[at], names[at], "degrees", 1, half && halfOf);
}

function curves() {
  const intervals = D.intervals ? `with intervals of ${D.intervals.levels.join(", ")} %` : "";
  const figures = Object.entries(D.columns).map(([name, { label, unit }]) => [
    name,
    unit ? `${label}, ${unit}` : label,
  ]);
  choose($("figure"), figures, figures[0][0], redraw);
  const group = (label, kind, names, unit) => {
    const options = names.map((name, k) => make("option", { value: `${kind}:${k}` }, `${name}${unit}`));
    return make("optgroup", { label }, ...options);
  };
  $("joint").append(
    group("heights above the floor", "height", D.places, ": height, m"),
    group("clinical angles", "clinical", D.clinical.names, ", degrees"),
    group("angles of the pose", "angles", D.angles.names, ": angle, degrees"),
  );
  $("joint").value = `height:${D.places.indexOf("left ankle")}`;
  $("joint").onchange = redraw;
  follows($("figure-chart"), frameFigure);
  if (D.intervals) {
    const errors = D.rows.mpjpe_mm ? "; the line is the true error" : "";
    $("sure-caption").textContent = `Uncertainty of joints, mm, the mean over joints, ${intervals}${errors}`;
    follows($("sure-chart"), jointIntervals);
  } else $("sure").remove();
  follows($("joint-chart"), () => {
    const about = jointOrAngle();
    const captions = [about.lines.length > 1 ? "dashed: the truth" : "", about.bands.length ? intervals : ""];
    $("joint-caption").textContent = captions.filter(Boolean).join(", ");
    return about;
  });
  const counts = MARKS.map(([name, colour, words]) =>
    entry(colour, `${words}: ${counted(D.marks[name].length, "frame")}`),
  );
  $("marks").append(...counts);
}

// The gait by side, and how the knees bend over a stride.
function gait() {
  const { text, rows, knees } = D.gait;
  $("gait-text").textContent = `${text[0].toUpperCase()}${text.slice(1)}.`;
  const row = (tag, cells) => make("tr", {}, ...cells.map((cell) => make(tag, {}, cell)));
  if (rows.length) $("gait-table").append(row("th", ["", "left", "right"]));
  $("gait-table").append(...rows.map(([label, unit, ...sides]) => row("td", [`${label}, ${unit}`, ...sides])));
  const sides = Object.entries(knees).filter(([, { strides }]) => strides);
  $("knees").hidden = !sides.length;
  if (!sides.length) return;
  const all = sides.flatMap(([, { low, high }]) => [...low, ...high]);
  const [from, to] = [Math.min(0, ...all), 1.06 * Math.max(...all)];
  const words = sides.map(([side, { mean, strides }]) => `${side}, ${counted(strides, "stride")}: ${summed(mean, 0)}`);
  $("knee-legend").append(...sides.map(([side], k) => entry(`--${side}`, words[k])));
  drawn($("knee-chart"), (width) => {
    const { svg, at, up } = axes(
      { ...BOX, width, height: width < 500 ? 160 : 200, bottom: 38, name: `Knee flexion. ${words.join("; ")}` },
      { to: 100, marks: steps(0, 100, 5), show: rounded, label: "% of the stride" },
      { from, to, marks: steps(from, to, 4), show: rounded },
    );
    for (const [side, { low, high }] of sides) {
      const points = low.map((value, k) => [at(k), up(value), up(high[k])]);
      svg.append(band(points, { style: `fill: var(--${side})`, opacity: 0.25 }));
    }
    for (const [side, { mean }] of sides) {
      const about = { fill: "none", style: `stroke: var(--${side})`, "stroke-width": 2 };
      svg.append(draw("path", { d: path(mean.map((value, k) => [at(k), up(value)])), ...about }));
    }
    return svg;
  });
}
