// Shared by all pages. Text is inserted only as text, never as markup.
const D = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const given = (value) => value !== null && value !== undefined;

const make = (tag, about, ...children) => filled(document.createElement(tag), about, children);
const draw = (tag, about, ...children) =>
  filled(document.createElementNS("http://www.w3.org/2000/svg", tag), about, children);

function filled(node, about, children) {
  for (const [name, value] of Object.entries(about || {})) {
    if (name === "on") for (const [event, act] of Object.entries(value)) node.addEventListener(event, act);
    else if (given(value) && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter(given));
  return node;
}

const number = (value, digits) => (given(value) ? value.toFixed(digits).replace("-", "−") : "–");
const whole = (value) => value.toLocaleString("en-GB", { maximumFractionDigits: 0 });
const counted = (count, noun) => `${whole(count)} ${noun}${count === 1 ? "" : "s"}`;
const between = (low, high, value) => Math.max(low, Math.min(high, value));
const range = (count) => Array.from({ length: count }, (_, k) => k);

// A figure with the digits of its column and without its unit.
function shownAs(name, value) {
  const { factor, digits } = D.columns[name];
  return given(value) && !digits ? whole(factor * value) : number(given(value) ? factor * value : null, digits);
}

// Fills a select with [value, name] pairs.
function choose(select, names, chosen, act) {
  select.replaceChildren(...names.map(([value, name]) => make("option", { value, selected: value === chosen }, name)));
  select.onchange = act;
}

// Fills the box of facts, the notes and the foot.
function details({ facts, notes, version }) {
  $("facts").append(...facts.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
  $("notes").append(...notes.map((text) => make("p", { class: "note" }, text)));
  $("foot").textContent = `posefit ${version}. This file holds everything it shows and makes no network request.`;
}
