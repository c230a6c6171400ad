// The share of targets reached over evaluations, of all functions together and of each.
function curves() {
  const most = Math.min(1, 1.1 * Math.max(0.05, ...D.curves.flatMap(({ shares }) => shares.map((one) => one.at(-1)))));
  const panel = ({ title, shares }) => {
    const box = make("div", { class: "chart" });
    const drawing = (width) =>
      chart(
        width,
        visible().map(([m, place]) => ({ m, values: shares[place] })),
        most,
        { label: `${title}: share of targets reached`, under: "evaluations for each dimension", stepped: true },
      );
    return { box, drawing, node: make("figure", {}, make("figcaption", {}, title), box) };
  };
  const [all, ...each] = D.curves.map(panel);
  $("together").append(all.node);
  $("each").append(...each.map((one) => one.node));
  if (!each.length) ["each", "each-title"].forEach((id) => $(id).remove());
  // where the box is in the page it has a width
  for (const { box, drawing } of [all, ...each]) redraws.push(drawn(box, drawing));
}
