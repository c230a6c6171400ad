// What moves a page's bodies: a clock, and turning by mouse, touch and keys.
// A clock with the button that starts and stops it; returns the function that does, too. `pace` gives the milliseconds
// of a frame, and `advance` gets the number of frames that are over.
function clock(control, pace, advance) {
  let handle = null;
  const play = (on) => {
    if (handle) cancelAnimationFrame(handle);
    handle = null;
    control.textContent = on ? "Pause" : "Play";
    if (!on) return;
    let last = performance.now();
    const tick = (now) => {
      const over = Math.floor((now - last) / pace());
      if (over >= 1) {
        last += over * pace();
        advance(over);
      }
      handle = requestAnimationFrame(tick);
    };
    handle = requestAnimationFrame(tick);
  };
  control.onclick = () => play(!handle);
  return play;
}

// Lets mouse, touch and keys turn the gaze, and paints again whenever a canvas may look different.
function turnable(canvas, repaint) {
  const turn = (yaw, pitch, zoom) => {
    gaze.yaw += yaw;
    gaze.pitch = between(-1.5, 1.5, gaze.pitch + pitch);
    gaze.zoom = between(0.4, 4, gaze.zoom * zoom);
    repaint();
  };
  const held = new Map();
  const apart = () => {
    const [a, b] = [...held.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const wide = held.size === 2 ? apart() : 0;
    held.set(event.pointerId, [event.clientX, event.clientY]);
    if (held.size === 2) return turn(0, 0, apart() / Math.max(wide, 1));
    turn((before[0] - event.clientX) / 120, (event.clientY - before[1]) / 120, 1);
  });
  for (const name of ["pointerup", "pointercancel"])
    canvas.addEventListener(name, (event) => held.delete(event.pointerId));
  const wheel = (event) => {
    event.preventDefault();
    turn(0, 0, event.deltaY < 0 ? 1.1 : 1 / 1.1);
  };
  canvas.addEventListener("wheel", wheel, { passive: false });
  const keys = { ArrowLeft: [0.12, 0, 1], ArrowRight: [-0.12, 0, 1], ArrowUp: [0, 0.12, 1], ArrowDown: [0, -0.12, 1] };
  Object.assign(keys, { "+": [0, 0, 1.1], "=": [0, 0, 1.1], "-": [0, 0, 1 / 1.1] });
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    turn(...keys[event.key]);
  });
  new ResizeObserver(repaint).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
}
