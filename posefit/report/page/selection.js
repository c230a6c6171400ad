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
  const closed = (part) =>
    part < 0 ? "worse than the single best" : `${number(100 * part, 0)} % of the gap between them`;
  const gap = S.single - S.oracle;
  const listed = (words) => [words.slice(0, -1).join(", "), words.at(-1)].filter(Boolean).join(" and ");
  const pays =
    given(S.closed) && S.closed >= 0.05
      ? "pays here"
      : given(S.oracle_apart) && S.oracle_apart >= S.single
        ? "does not pay here"
        : "might pay, but nothing here knows how";
  const apart = given(S.oracle_apart) ? `, or ${degrees(S.oracle_apart)} where it is picked on other seeds` : "";
  const leader = D.leaderboard[0].method;
  const other =
    S.best === leader ? "" : `, the lowest plain mean (${METHODS[leader]} has the lowest interquartile mean),`;
  const learnt = given(S.selector)
    ? `, and a selector that knows ${listed(S.features)} ${degrees(S.selector)}` +
      (given(S.closed) ? `, ${closed(S.closed)}` : "")
    : "";
  $("selection-said").textContent =
    `Choosing a method by its instance ${pays}: ${best} alone has a mean error of ${degrees(S.single)}${other} over ` +
    `${counted(S.instances, "instance")}, the best method of each ${degrees(S.oracle)} in hindsight${apart}${learnt}.` +
    (S.why ? ` There is no selector: ${S.why}.` : "");
  const ways = [
    { name: `single best, by the plain mean: ${best}`, error: S.single },
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
        show: (row) => {
          if (!given(share(row))) return "–";
          return share(row) < 0 ? "worse than the single best" : `${number(100 * share(row), 0)} %`;
        },
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
