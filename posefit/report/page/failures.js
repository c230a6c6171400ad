// What failed and is left out: on top with the reasons, in a table, and the command that runs a cell again.
const NAMED = 20; // instances that a note names
const REASONS = 5; // warnings that it names

// What failed and what is left out, with the reasons.
function trouble() {
  const H = D.header;
  const words = (list) => list.join("; ");
  if (H.failed) {
    const by = Object.entries(H.failed_by).map(([method, count]) => `${method} ${whole(count)}`);
    $("trouble").append(
      make(
        "div",
        { class: "note warn" },
        `${counted(H.failed, "cell")} failed, left out of all figures: ${by.join(", ")}. `,
        make("a", { href: "#failures" }, "Which ones"),
        make("ul", {}, ...H.reasons.map(([reason, count]) => make("li", {}, `${whole(count)} × ${reason}`))),
        H.unpaired ? `${H.unpaired}.` : "",
      ),
    );
  }
  if (H.dropped.length) {
    const named = H.dropped.slice(0, NAMED).map(({ instance, missing }) => {
      const why = missing.length ? `no run of ${words(missing.map((m) => METHODS[m]))}` : "no seed in common";
      return make("li", {}, `${INSTANCES[instance]}: ${why}`);
    });
    if (H.dropped.length > NAMED) named.push(make("li", {}, `and ${whole(H.dropped.length - NAMED)} more`));
    $("trouble").append(
      make(
        "div",
        { class: "note warn" },
        `${counted(H.dropped.length, "instance")} left out of the comparison, for every method:`,
        make("ul", {}, ...named),
      ),
    );
  }
  if (H.unfinished.length)
    $("trouble").append(
      make("p", { class: "note warn" }, `No cell finished, so not on the leaderboard: ${words(H.unfinished)}.`),
    );
  const warned = Object.keys(D.warned).length;
  if (warned)
    $("trouble").append(
      make(
        "div",
        { class: "note" },
        `${counted(warned, "run")} with a warning, marked ⚠ below:`,
        make("ul", {}, ...D.warnings.slice(0, REASONS).map((text) => make("li", {}, text))),
      ),
    );
}

function failures() {
  if (!D.failures.length) {
    $("failures").remove();
    $("to-failures").remove();
    return;
  }
  table(
    $("lost"),
    [
      { title: "cell", text: true, value: (row) => row.name, show: (row) => row.name },
      {
        title: "why its attempts failed",
        text: true,
        value: (row) => row.reasons.join("; "),
        show: (row) => row.reasons.join("; "),
      },
      {
        unseen: "run again",
        text: true,
        show: (row) =>
          make("button", { type: "button", on: { click: () => showCommand(row.name, row.command) } }, "command"),
      },
    ],
    D.failures,
    { name: "Failures" },
  );
}

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

function closing() {
  $("copy").onclick = copy;
  document.querySelectorAll("dialog .close").forEach((button) => {
    button.onclick = () => button.closest("dialog").close();
  });
}
