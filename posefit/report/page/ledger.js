// What every part of the report uses: names and colours of methods, and the command that runs a row again.
const METHODS = D.methods.map((one) => one.name);
const INSTANCES = D.instances.map((one) => one.name);
const DASHES = ["", "7 3", "2 3", "8 3 2 3"];
const colour = (m) => `var(--c${m % D.colours})`;
const dash = (m) => DASHES[Math.floor(m / D.colours) % DASHES.length];

const probability = (p) => (!given(p) ? "–" : p < 0.001 ? "< 0.001" : p.toFixed(3));
// A probability in a sentence.
const stated = (p) => `p ${p < 0.001 ? "" : "= "}${probability(p)}`;

function swatch(m) {
  return draw(
    "svg",
    { width: 24, height: 10, "aria-hidden": "true" },
    draw("line", {
      x1: 0,
      x2: 24,
      y1: 5,
      y2: 5,
      style: `stroke: ${colour(m)}`,
      "stroke-width": 3,
      "stroke-dasharray": dash(m),
    }),
  );
}

// The command that runs a row again: the beginning that it shares with others, then its instance and seed.
function commandOf(row) {
  const R = D.rows;
  const place = D.instances[R.instance[row]];
  return `${D.heads[R.head[row]]}instance = ${place.number}\nseed = ${D.seeds[R.seed[row]]}\nEND`;
}

const called = (row) =>
  `${METHODS[D.rows.method[row]]} on ${INSTANCES[D.rows.instance[row]]}, seed ${D.seeds[D.rows.seed[row]]}`;

function showCommand(title, text) {
  $("again-what").textContent = title;
  $("command").textContent = text;
  $("copied").textContent = "";
  $("again").showModal();
}

async function copy() {
  const text = $("command").textContent;
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = make("textarea", {});
    area.value = text;
    $("again").append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  $("copied").textContent = "copied";
}

const again = (row) =>
  make(
    "button",
    {
      type: "button",
      title: "The command that runs it again",
      on: { click: () => showCommand(called(row), commandOf(row)) },
    },
    "command",
  );
