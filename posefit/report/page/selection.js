// Who wins where, and what choosing a method by its instance would be worth.
function selection() {
  const S = D.selection;
  if (!S) {
    $("selection").remove();
    $("to-selection").remove();
    return;
  }
  const best = METHODS[S.best];
  const degrees = (value) => `${number(value, 2)}°`;
  const gap = S.single - S.oracle;
  const said = [
    `${best} is the best single method, with a mean error of ${degrees(S.single)} over ${counted(S.instances, "instance")}; ` +
      `taking the best method of each instance would have given ${degrees(S.oracle)}, ${number(Math.max(gap, 0), 2)}° less`,
  ];
  if (given(S.oracle_apart))
    said.push(
      S.oracle_apart < S.single
        ? `, of which ${number(S.single - S.oracle_apart, 2)}° remain where the choice is made on other seeds than it is scored on`
        : `, of which nothing remains where the choice is made on other seeds than it is scored on (${degrees(S.oracle_apart)}): ` +
            "most of it is chance",
    );
  if (given(S.selector)) {
    const closed = given(S.closed) ? `${number(100 * S.closed, 0)} % of the gap` : "nothing: there is no gap";
    said.push(
      `; a selector that knows ${S.features.join(", ")} and has never seen the instance has ${degrees(S.selector)} and closes ${closed}.`,
    );
  } else said.push(`. There is no selector: ${S.why}.`);
  $("selection-said").textContent = said.join("");
  const ways = [
    { name: `single best: ${best}`, error: S.single },
    ...(given(S.selector) ? [{ name: "selector, on instances it has not seen", error: S.selector }] : []),
    ...(given(S.oracle_apart) ? [{ name: "oracle, scored on seeds it has not seen", error: S.oracle_apart }] : []),
    { name: "oracle", error: S.oracle },
  ];
  const share = (row) => (gap > 0 ? (S.single - row.error) / gap : null);
  table(
    $("choosing"),
    [
      { title: "choice of a method", text: true, show: (row) => row.name },
      { title: "mean error °", show: (row) => number(row.error, 2) },
      {
        title: "gap closed",
        show: (row) => (given(share(row)) ? `${number(100 * share(row), 0)} %` : "–"),
      },
    ],
    ways,
    { name: "Ways of choosing" },
  );
  table(
    $("wins"),
    [
      { title: "method", text: true, value: ([m]) => METHODS[m], show: ([m]) => [swatch(m), METHODS[m]] },
      { title: "instances won", down: true, value: ([, won]) => won, show: ([, won]) => whole(won) },
      ...(given(S.selector)
        ? [
            {
              title: "chosen by the selector",
              down: true,
              value: ([, , taken]) => taken,
              show: ([, , taken]) => whole(taken),
            },
          ]
        : []),
    ],
    S.wins,
    { name: "Instances won" },
  );
  if (!S.where.length) return $("where").remove();
  table(
    $("where"),
    [
      { title: "where", text: true, show: (row) => row.part },
      { title: "instances", show: (row) => whole(row.instances) },
      { title: "best there", text: true, show: (row) => [swatch(row.method), METHODS[row.method]] },
      { title: "mean error °", show: (row) => number(row.error, 2) },
      { title: `${shortened(best, 20)} behind by °`, show: (row) => number(row.behind, 2) },
    ],
    S.where,
    { name: "Who wins where" },
  );
}
