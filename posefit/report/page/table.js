// A table that any column sorts. A column: title, or one for readers of screens alone, value(row), and what is shown of
// it; text to the left.
const PAGE = 50;

function table(box, columns, rows, how) {
  let by = how.by;
  let down = how.down || false;
  let first = 0;
  const body = make("tbody");
  const heads = columns.map((column, k) =>
    make(
      "th",
      { scope: "col", class: column.text ? "text" : null },
      column.value
        ? make("button", { type: "button", title: column.about, on: { click: () => sort(k) } }, column.title)
        : (column.title ?? make("span", { class: "unseen" }, column.unseen)),
    ),
  );
  const pager = make("div", { class: "row pager" });

  function sort(k) {
    down = by === k ? !down : Boolean(columns[k].down);
    by = k;
    first = 0;
    show();
  }

  function ordered() {
    if (!given(by)) return rows;
    const value = columns[by].value;
    const sign = down ? -1 : 1;
    return rows
      .map((row) => [value(row), row])
      .sort(([a], [b]) =>
        !given(a) ? (given(b) ? 1 : 0) : !given(b) ? -1 : sign * (typeof a === "string" ? a.localeCompare(b) : a - b),
      )
      .map((pair) => pair[1]);
  }

  function show() {
    heads.forEach((head, k) => {
      if (columns[k].value) head.setAttribute("aria-sort", k === by ? (down ? "descending" : "ascending") : "none");
    });
    body.replaceChildren(
      ...ordered()
        .slice(first, first + PAGE)
        .map((row) =>
          make(
            "tr",
            { class: how.kind ? how.kind(row) : null },
            ...columns.map((column) => {
              const shown = column.show(row);
              return make(
                "td",
                { class: column.text ? "text" : null, title: column.text && typeof shown === "string" ? shown : null },
                ...[shown].flat(),
              );
            }),
          ),
        ),
    );
    const leaf = (count) => {
      first += count;
      show();
    };
    pager.replaceChildren(
      make("button", { type: "button", disabled: first === 0, on: { click: () => leaf(-PAGE) } }, "earlier"),
      make(
        "span",
        {},
        rows.length
          ? `${whole(first + 1)} to ${whole(Math.min(first + PAGE, rows.length))} of ${whole(rows.length)}`
          : "none",
      ),
      make(
        "button",
        { type: "button", disabled: first + PAGE >= rows.length, on: { click: () => leaf(PAGE) } },
        "later",
      ),
    );
  }

  box.replaceChildren(
    make(
      "div",
      { class: "scroll", tabindex: 0, role: "region", "aria-label": how.name },
      make("table", {}, make("thead", {}, make("tr", {}, ...heads)), body),
    ),
  );
  if (rows.length > PAGE) box.append(pager);
  show();
}

// A column of a figure: its title and, where it is pointed at, its meaning; `of` gives the figure of a row.
const figure = (name, of) => ({
  ...D.columns[name],
  value: of,
  show: (row) => shownAs(name, of(row)),
});
