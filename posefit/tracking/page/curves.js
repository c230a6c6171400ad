// Curves over the frames, with intervals as bands, and rows of marks below: lost frames, unknown sides, held poses.
const LEFT = 48;
const RIGHT = 12;
const TOP = 8;
const ROW = 7; // pixels of a row of marks
const MARKS = [
  ["lost", "--bad", "lost"],
  ["unknown", "--other", "left and right unknown"],
  ["held", "--held", "pose held: too little is seen"],
].filter(([name]) => D.marks[name].length);
const STRENGTHS = [0.85, 0.5, 0.25]; // of the bands, the narrowest first
const cursors = new Map(); // of each box, what moves its line to a frame
const redraws = [];
const seconds = (frame) => (frame * D.step) / D.fps;

// A chart of `lines` {values, colour, name, dashed} over bands {low, high}, the narrowest first; null where nothing is.
function chart(width, { lines, bands, label, unit, digits }) {
  const height = (width < 500 ? 120 : 150) + ROW * MARKS.length;
  const bottom = height - 20 - (ROW + 2) * MARKS.length;
  const all = [...lines.map((one) => one.values), ...bands.flatMap(({ low, high }) => [low, high])]
    .flat()
    .filter(given);
  let low = Math.min(...all, Infinity);
  let high = Math.max(...all, -Infinity);
  if (!all.length) [low, high] = [0, 1];
  if (low > 0 && low < 0.6 * high) low = 0;
  if (high - low < 1e-9) high = low + 1;
  const pad = 0.06 * (high - low);
  const [least, most] = [low === 0 ? 0 : low - pad, high + pad];
  const across = (width - LEFT - RIGHT) / Math.max(shown - 1, 1);
  const x = (frame) => LEFT + across * frame;
  const y = (value) => bottom - ((bottom - TOP) * (value - least)) / (most - least);
  const spoken = lines.map((one) => `${one.name}: ${summed(one.values, digits)} ${unit}`).join("; ");
  const svg = draw("svg", {
    width,
    height,
    viewBox: `0 0 ${width} ${height}`,
    role: "img",
    "aria-label": `${label} over time. ${spoken}`,
  });
  for (const value of steps(least, most, 4)) {
    svg.append(
      draw("line", { class: "rule", x1: LEFT, x2: width - RIGHT, y1: y(value), y2: y(value) }),
      draw(
        "text",
        { x: LEFT - 6, y: y(value) + 4, "text-anchor": "end", class: "soft" },
        String(+value.toPrecision(4)).replace("-", "−"),
      ),
    );
  }
  const last = seconds(shown - 1);
  for (const value of steps(0, last, Math.max(2, width / 110)))
    svg.append(
      draw(
        "text",
        { x: x(last ? (value / last) * (shown - 1) : 0), y: bottom + 14, "text-anchor": "middle", class: "soft" },
        `${+value.toPrecision(3)} s`,
      ),
    );
  [...bands].reverse().forEach(({ low: lows, high: highs }, k) => {
    for (const run of runsOf(lows)) {
      const [first, end] = [run[0], run.at(-1)].map(x);
      const at = (frame) => (run.length > 1 ? [x(frame)] : [first - across / 2, end + across / 2]);
      const there = run.flatMap((frame) =>
        at(frame).map((place) => `${place.toFixed(1)},${y(highs[frame]).toFixed(1)}`),
      );
      const back = [...run].reverse().flatMap((frame) =>
        at(frame)
          .reverse()
          .map((place) => `${place.toFixed(1)},${y(lows[frame]).toFixed(1)}`),
      );
      svg.append(
        draw("polygon", {
          points: [...there, ...back].join(" "),
          style: "fill: var(--unsure)",
          opacity: STRENGTHS[bands.length - 1 - k] * 0.6,
        }),
      );
    }
  });
  for (const one of lines) {
    const path = runsOf(one.values)
      .map((run) => `M${run.map((frame) => `${x(frame).toFixed(1)},${y(one.values[frame]).toFixed(1)}`).join("L")}`)
      .join("");
    svg.append(
      draw("path", {
        d: path,
        fill: "none",
        style: `stroke: var(${one.colour})`,
        "stroke-width": 2,
        "stroke-dasharray": one.dashed ? "5 4" : null,
        "stroke-linecap": "round",
      }),
    );
  }
  MARKS.forEach(([name, colour], k) => {
    const top = height - (ROW + 2) * (MARKS.length - k);
    const wide = Math.max(across, 1);
    svg.append(draw("rect", { class: "rule", x: LEFT, width: width - LEFT - RIGHT, y: top, height: ROW }));
    const there = range(shown).map((frame) => (D.marks[name].includes(frame) ? 1 : null));
    for (const run of runsOf(there)) {
      const [from, to] = [Math.max(LEFT, x(run[0]) - wide / 2), Math.min(width - RIGHT, x(run.at(-1)) + wide / 2)];
      svg.append(
        draw("rect", {
          class: `mark ${name}`,
          x: from,
          width: to - from,
          y: top,
          height: ROW,
          style: `fill: var(${colour})`,
        }),
      );
    }
  });
  const line = draw("line", {
    class: "now",
    y1: TOP - 4,
    y2: height,
    style: "stroke: var(--ink)",
    "stroke-width": 1.5,
  });
  svg.append(line);
  const follow = (event) => {
    const place = event.clientX - svg.getBoundingClientRect().left;
    seek(Math.max(0, Math.min(shown - 1, Math.round((place - LEFT) / across))));
  };
  svg.addEventListener("pointerdown", (event) => {
    svg.setPointerCapture(event.pointerId);
    follow(event);
  });
  svg.addEventListener("pointermove", (event) => {
    if (event.buttons) follow(event);
  });
  return { svg, move: (frame) => line.setAttribute("transform", `translate(${x(frame)},0)`) };
}

// Least, greatest and mean in words.
function summed(values, digits) {
  const known = values.filter(given);
  if (!known.length) return "nothing";
  const mean = known.reduce((sum, value) => sum + value, 0) / known.length;
  return `${number(Math.min(...known), digits)} to ${number(Math.max(...known), digits)}, mean ${number(mean, digits)}`;
}

// The numbers of frames that follow each other and have a value.
function runsOf(values) {
  const found = [];
  values.forEach((value, frame) => {
    if (!given(value)) return;
    if (frame && given(values[frame - 1])) found.at(-1).push(frame);
    else found.push([frame]);
  });
  return found;
}

// Draws what `about` returns into a box, again whenever its width changes, with a line at the frame that is shown.
function follows(box, about) {
  redraws.push(
    drawn(box, (width) => {
      const { svg, move } = chart(width, about());
      cursors.set(box, move);
      move(show.frame);
      return svg;
    }),
  );
}

function figureAbout() {
  const name = $("figure").value;
  const { label, unit, digits, factor } = D.columns[name];
  const values = D.rows[name].map((value) => (given(value) ? factor * value : null));
  return { lines: [{ values, colour: "--accent", name: label }], bands: [], label, unit, digits };
}

// How far joints may be off, the mean over all but the root, which every interval is relative to.
function sureAbout() {
  const inner = range(D.joints.length).slice(1);
  const bands = (D.intervals ? D.intervals.levels : []).map((_, level) => {
    const high = range(shown).map((frame) => {
      const each = inner.map((joint) => radius(frame, level, joint));
      return each.every(given) ? (1000 * each.reduce((sum, value) => sum + value, 0)) / each.length : null;
    });
    return { low: high.map((value) => (given(value) ? 0 : null)), high };
  });
  const off = D.rows.mpjpe_mm;
  const lines = off ? [{ values: off, colour: "--ink", name: "true error" }] : [];
  return { lines, bands, label: "How far joints may be off", unit: "mm", digits: 0 };
}

// The height of a joint above the floor in metres, or an angle in degrees, with the truth; heights and the pose's own
// angles have intervals.
function jointAbout() {
  const [kind, which] = $("joint").value.split(":");
  const at = +which;
  const frames = range(shown);
  const levels = D.intervals ? range(D.intervals.levels.length) : [];
  const lines = [];
  const add = (values, colour, name, dashed) => lines.push({ values, colour, name, dashed });
  const band = (values, halfOf) =>
    levels.map((level) => {
      const half = frames.map((frame) => halfOf(frame, level));
      const side = (sign) => values.map((value, k) => (given(half[k]) ? value + sign * half[k] : null));
      return { low: side(-1), high: side(1) };
    });
  if (kind === "height") {
    const heights = (of) => frames.map((frame) => of(frame)[at][1] - floor);
    const values = heights(estimateAt);
    add(values, "--accent", D.places[at]);
    if (truthAt) add(heights(truthAt), "--ink", "truth", true);
    const label = `Height of the ${D.places[at]}`;
    return { lines, bands: band(values, (frame, level) => radius(frame, level, at)), label, unit: "m", digits: 2 };
  }
  const { names, values: found, truth } = kind === "clinical" ? D.clinical : D.angles;
  const count = names.length;
  const degrees = (text) => {
    const value = unpacked(text);
    return frames.map((frame) => value(frame * count + at)).map((tenths) => (given(tenths) ? tenths / 10 : null));
  };
  const values = degrees(found);
  add(values, "--accent", names[at]);
  if (truth) add(degrees(truth), "--ink", "truth", true);
  const about = { lines, label: names[at], unit: "degrees", digits: 1 };
  if (kind === "clinical") return { ...about, bands: [] };
  const half = D.intervals ? unpacked(D.intervals.angles) : null;
  const halfOf = (frame, level) => {
    const value = half((frame * levels.length + level) * count + at);
    return given(value) ? value / 10 : null;
  };
  return { ...about, bands: band(values, halfOf) };
}

// A select of grouped names.
function grouped(select, groups, chosen) {
  select.replaceChildren(
    ...groups.map(([label, names]) =>
      make(
        "optgroup",
        { label },
        ...names.map(([value, name]) => make("option", { value, selected: value === chosen }, name)),
      ),
    ),
  );
}

function curves() {
  const between = D.intervals ? `, with intervals of ${D.intervals.levels.join(", ")} %` : "";
  const redraw = () => redraws.forEach((act) => act());
  choose(
    $("figure"),
    Object.entries(D.columns).map(([name, { label, unit }]) => [name, unit ? `${label}, ${unit}` : label]),
    Object.keys(D.columns)[0],
    redraw,
  );
  grouped(
    $("joint"),
    [
      ["heights above the floor", D.places.map((name, joint) => [`height:${joint}`, `${name}: height, m`])],
      ["clinical angles", D.clinical.names.map((name, angle) => [`clinical:${angle}`, `${name}, degrees`])],
      ["angles of the pose", D.angles.names.map((name, angle) => [`angle:${angle}`, `${name}: angle, degrees`])],
    ],
    `height:${D.places.indexOf("left ankle")}`,
  );
  $("joint").onchange = redraw;
  follows($("figure-chart"), figureAbout);
  if (D.intervals) {
    $("sure-caption").textContent =
      `How far joints may be off, mm, the mean over joints${between}` +
      `${D.rows.mpjpe_mm ? "; the line is how far they are" : ""}`;
    follows($("sure-chart"), sureAbout);
  } else $("sure").remove();
  follows($("joint-chart"), () => {
    const about = jointAbout();
    const said = [about.lines.length > 1 ? "dashed: the truth" : "", about.bands.length ? between.slice(2) : ""];
    $("joint-caption").textContent = said.filter(Boolean).join(", ");
    return about;
  });
  $("marks").append(
    ...MARKS.map(([name, colour, words]) => entry(colour, `${words}: ${counted(D.marks[name].length, "frame")}`)),
  );
}
