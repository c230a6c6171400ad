// What every part of a page uses. Text reaches the page as text alone, never as markup.
const D = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
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
const whole = (value) => value.toLocaleString("en-GB", { maximumFractionDigits: 0 });
const counted = (count, word) => `${whole(count)} ${word}${count === 1 ? "" : "s"}`;
const range = (count) => Array.from({ length: count }, (_, k) => k);

// A figure with its digits and without its unit, as D.columns says.
function shownAs(name, value) {
  const { factor, digits } = D.columns[name];
  if (!given(value)) return "–";
  return digits ? number(factor * value, digits) : whole(factor * value);
}

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

// Round values from low to high, about so many.
function steps(low, high, count) {
  const rough = (high - low) / count || 1;
  const size = 10 ** Math.floor(Math.log10(rough));
  const step = size * [1, 2, 5, 10].find((one) => one * size >= rough);
  return range(Math.floor(high / step) - Math.ceil(low / step) + 1).map((k) => (Math.ceil(low / step) + k) * step);
}
