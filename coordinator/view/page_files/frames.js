// When the page is drawn: smoothly while somebody does something, seldom while a fleet is only watched.

let before = 0, followed = 0, touched = 0, sleeps = null;

function frame(time) {
  const passed = Math.min((time - before) / 1000, 0.25);
  before = time;
  if (live) word.look();
  if (following && time - followed > (many() ? 100 : 30)) {
    followed = time;
    followLive();
  } else if (running && !following) {
    seek(now + passed * Number(controls.speed.value));
    if (now >= play.scene.end) setRunning(false);
  }
  if (stale) {
    stale = false;
    draw();
  }
  if (following && time - touched > PATIENCE * 1000) sleeps = setTimeout(wake, many() ? 250 : 40);
  else requestAnimationFrame(frame);
}

const many = () => play.scene.robots.length > CROWD;

function wake() {
  sleeps = null;
  requestAnimationFrame(frame);
}

/** Somebody does something: draw at once, and smoothly for a while. */
function touch() {
  touched = performance.now();
  if (sleeps === null) return;
  clearTimeout(sleeps);
  wake();
}

for (const what of ["pointermove", "pointerdown", "wheel", "keydown", "input"]) {
  document.addEventListener(what, touch, { passive: true, capture: true });
}
requestAnimationFrame(frame);
