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
  if (isWatched()) sleeps = setTimeout(wake, many() ? 1000 : 40);
  else requestAnimationFrame(frame);
}

const many = () => play.scene.robots.length > CROWD;

/** Whether somebody only looks at a running fleet. */
const isWatched = () => following && performance.now() - touched > PATIENCE * 1000;

function wake() {
  sleeps = null;
  requestAnimationFrame(frame);
}

/** For how long [ms] texts stay: nobody reads faster, and they cost more than drawing. */
const textsStay = () => (!many() ? 100 : isWatched() ? 900 : 250);

/** Somebody does something: draw at once, and smoothly for a while. */
function touch() {
  touched = performance.now();
  hurry();
}

/** Something has happened: draw at once. */
function hurry() {
  if (sleeps === null) return;
  clearTimeout(sleeps);
  wake();
}

/** The fleet does something else: draw and tell it at once. */
function turn() {
  followed = 0;
  listed = -Infinity;
  stale = true;
  hurry();
}

for (const what of ["pointermove", "pointerdown", "wheel", "keydown", "input"]) {
  document.addEventListener(what, touch, { passive: true, capture: true });
}
requestAnimationFrame(frame);
