// What every part of the page uses. Text reaches the page as text alone, never as markup.
const D = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const METHODS = D.methods.map((one) => one.name);
const INSTANCES = D.instances.map((one) => one.name);
const DASHES = ["", "7 3", "2 3", "8 3 2 3"];
const colour = (m) => `var(--c${m % D.colours})`;
const dash = (m) => DASHES[Math.floor(m / D.colours) % DASHES.length];
const given = (value) => value !== null && value !== undefined;

function make(tag, about, ...children) {
  const node = document.createElement(tag);
  fill(node, about);
  node.append(...children.filter(given));
  return node;
}

function draw(tag, about, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  fill(node, about);
  node.append(...children.filter(given));
  return node;
}

function fill(node, about) {
  for (const [name, value] of Object.entries(about || {})) {
    if (name === "on") for (const [event, act] of Object.entries(value)) node.addEventListener(event, act);
    else if (given(value) && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
}

const number = (value, digits) => (given(value) ? value.toFixed(digits).replace("-", "−") : "–");
// A figure of a run with its digits and without its unit, as D.columns says.
function shownAs(name, value) {
  const { factor, digits } = D.columns[name];
  if (!given(value)) return "–";
  return digits ? number(factor * value, digits) : whole(factor * value);
}
const probability = (p) => (!given(p) ? "–" : p < 0.001 ? "< 0.001" : p.toFixed(3));
// A probability in a sentence.
const stated = (p) => `p ${p < 0.001 ? "" : "= "}${probability(p)}`;
const whole = (value) => value.toLocaleString("en-GB", { maximumFractionDigits: 0 });
const counted = (count, word) => `${whole(count)} ${word}${count === 1 ? "" : "s"}`;
const range = (count) => Array.from({ length: count }, (_, k) => k);

function choose(select, names, chosen, act) {
  select.replaceChildren(...names.map(([value, name]) => make("option", { value, selected: value === chosen }, name)));
  select.onchange = act;
}

// Draws into a box again whenever its width changes.
function drawn(box, picture) {
  let last = 0;
  const repaint = () => {
    last = box.clientWidth;
    if (last) box.replaceChildren(picture(last));
  };
  new ResizeObserver(() => {
    if (box.clientWidth !== last) repaint();
  }).observe(box);
  repaint();
  return repaint;
}

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
