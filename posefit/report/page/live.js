// A page of a sweep that goes on: how far it is, what failed, and how the page makes itself anew.
const L = D.live;

const lasting = (seconds) => {
  if (!given(seconds)) return null;
  const [size, word] = seconds >= 5400 ? [3600, "hours"] : seconds >= 90 ? [60, "minutes"] : [1, "seconds"];
  return `about ${number(seconds / size, size === 1 ? 0 : 1)} ${word}`;
};

function live() {
  if (!L) return $("live").remove();
  const settled = L.done + L.quarantined;
  const state = L.left
    ? L.running
      ? `${whole(L.running)} running, ${lasting(L.seconds) ?? "some time"} left`
      : "nobody works on it now"
    : "finished";
  const again = L.failed ? `, ${counted(L.failed, "failed attempt")} to be repeated` : "";
  const sums = `${whole(L.done)} done, ${whole(L.quarantined)} quarantined${again}`;
  $("live-said").textContent = given(L.cells)
    ? `${whole(settled)} of ${whole(L.cells)} cells: ${sums}; ${state}.`
    : `Cells: ${sums}. No plan is known, so nobody knows how many are left.`;
  if (given(L.cells)) {
    $("live-bar").max = L.cells;
    $("live-bar").value = settled;
  } else $("live-bar").remove();
  if (!L.left && given(L.cells)) return $("live-again").remove();
  const kept = "posefit-stands-still";
  const box = $("live-stop");
  box.checked = sessionStorage.getItem(kept) === "1";
  box.onchange = () => sessionStorage.setItem(kept, box.checked ? "1" : "0");
  setInterval(() => {
    if (!box.checked && !document.querySelector("dialog[open]")) location.reload();
  }, 1000 * L.again);
}
