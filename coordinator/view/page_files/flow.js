// How work flows: orders done and time lost over the last minutes, and where on the floor it is lost.

/** What counts as the last minutes [s], and how long [s] the heat of a wait is seen. */
const LATELY = 600;
/** The side [m] of the squares in which waits are added up, and the waiting [s] that is hottest. */
const SQUARE = 0.5;
const HOTTEST = 30;
const KEPT_FOR = 1;

/** Planned waits and times held of the last minutes: {index, x, y, from, to} in seconds of the scene. */
function lostTimes(play, t) {
  const found = [], since = t - LATELY;
  for (const { index, motion, epoch, from, to } of play.spans()) {
    for (const wait of motion.ride.waits) {
      const begin = Math.max(epoch.start + wait.since, from, since);
      const end = Math.min(epoch.start + wait.until, to, t);
      if (end - begin > KEPT_FOR) found.push({ index, ...motion.place(wait.s), from: begin, to: end });
    }
  }
  play.holds.forEach((holds, index) => {
    for (const { since: held, until } of holds) {
      const begin = Math.max(held, since), end = Math.min(until ?? t, t);
      const robot = end - begin > KEPT_FOR ? play.robot(index, end - 0.01) : null;
      if (robot) found.push({ index, x: robot.x, y: robot.y, from: begin, to: end });
    }
  });
  return found;
}

class Flow {
  constructor(text) {
    Object.assign(this, { text, at: null, looked: -Infinity, squares: new Map() });
  }

  /** Look at a time, at most once a second: it is slow, and nobody sees more. */
  look(play, t) {
    const time = performance.now();
    if (t === this.at || time - this.looked < 1000) return;
    Object.assign(this, { at: t, looked: time });
    const lost = lostTimes(play, t), span = Math.min(LATELY, t - play.scene.begin);
    this.squares = new Map();
    for (const { x, y, from, to } of lost) {
      const key = `${Math.floor(x / SQUARE)},${Math.floor(y / SQUARE)}`;
      this.squares.set(key, (this.squares.get(key) || 0) + to - from);
    }
    this.tell(play, t, span, lost.reduce((sum, { from, to }) => sum + to - from, 0));
  }

  tell(play, t, span, lost) {
    const done = play.scene.orders.filter(({ steps }) =>
      steps.some(([at, state]) => state === 2 && at <= t && at > t - span)).length;
    const minutes = span / 60, robots = play.scene.robots.length;
    const share = robots && span > 0 ? 100 * lost / (span * robots) : 0;
    const lately = minutes >= 1 ? `the last ${minutes.toFixed(0)} min` : `${span.toFixed(0)} s`;
    const rate = minutes >= 1 ? ` (${(done / minutes).toFixed(1)} a minute)` : "";
    const orders = play.scene.orders.length ? `${done} orders done${rate}; ` : "";
    const text = span < 1 ? "" : `In ${lately}: ${orders}robots waited ${share.toFixed(0)} % of the time`;
    write(this.text, text);
  }

  /** Draw where time was lost lately: the darker, the more. */
  draw(view, pen, look) {
    pen.fillStyle = look.red;
    const side = SQUARE * view.zoom;
    for (const [key, seconds] of this.squares) {
      const [i, j] = key.split(",").map(Number);
      pen.globalAlpha = 0.15 + 0.5 * Math.min(seconds / HOTTEST, 1);
      pen.fillRect(view.X(i * SQUARE), view.Y((j + 1) * SQUARE), side, side);
    }
    pen.globalAlpha = 1;
  }
}
