// Distance along the path over time: every robot's line, the epochs, the events, the cursor.

/** Of more robots than this, only some have a line: the chosen one and those that it meets. */
const MANY = 20;

/** Lines that are drawn anew because of news alone are so at most once in this time [ms]. */
const SELDOM = 1000;
/** The cursor moves by no less than this [px]. */
const LEAST = 1;

class DiagramView {
  constructor(canvas) {
    this.sheet = new Sheet(canvas);
    this.background = null;
    this.key = "";
    this.box = { left: 36, top: 18, right: 12, bottom: 26 };
  }

  /** Show another scene. */
  show(play) {
    this.play = play;
    this.longest = this.farthest();
    this.meets = "";
  }

  /** The greatest distance that a robot drives on a course, without what a freeze left undriven. */
  farthest() {
    const { epochs } = this.play, last = epochs[epochs.length - 1];
    return this.play.spans().reduce((most, { motion, epoch, to }) => {
      const end = epoch === last && motion.ride.ends === null ? Infinity : epoch.planTime(to);
      return Math.max(most, motion.progress(motion.passed(end))[0]);
    }, 1);
  }

  X(t) {
    const { left, right } = this.box, { begin, end } = this.play.scene;
    return left + (this.sheet.width - left - right) * (t - begin) / (end - begin);
  }

  Y(s) {
    const { top, bottom } = this.box;
    return this.sheet.height - bottom - (this.sheet.height - top - bottom) * s / this.longest;
  }

  /** The time at a place on the canvas. */
  time(x) {
    const { left, right } = this.box, { begin, end } = this.play.scene;
    const t = begin + (x - left) / (this.sheet.width - left - right) * (end - begin);
    return Math.min(Math.max(t, begin), end);
  }

  draw(t, found, focus, hover, look) {
    this.gather(t, found, focus);
    const { end, marks } = this.play.scene, drawn = this.company && [...this.company].join(" ");
    const news = [this.play.version, this.play.learned, drawn].join(), seen = [focus, look.dark, end].join();
    const key = [seen, marks.length, news].join(), time = performance.now();
    const isSoon = time - this.drawn < SELDOM && key.startsWith(this.seen);
    const isNew = this.sheet.resize() || key !== this.key && !isSoon, x = this.X(t);
    if (isNew) {
      Object.assign(this, { key, seen, drawn: time });
      this.background = this.lines(focus, look);
    } else if (hover < 0 && this.hover < 0 && Math.abs(x - this.cursor) < LEAST) {
      return;
    }
    Object.assign(this, { hover, cursor: x });
    const pen = this.sheet.begin(this.background.canvas);
    pen.strokeStyle = look.ink;
    pen.lineWidth = 1.25;
    pen.beginPath();
    pen.moveTo(x, this.box.top);
    pen.lineTo(x, this.sheet.height - this.box.bottom);
    pen.stroke();
    found.forEach((robot, index) => {
      if (robot && robot.motion && this.shows(index)) this.dot(pen, x, this.Y(robot.s), index, focus, hover, look);
    });
    const over = found[hover];
    if (over && over.motion) this.dot(pen, x, this.Y(over.s), hover, focus, hover, look);
  }

  /** Find out whose lines are drawn: of a large fleet only those that have to do with each other. */
  gather(t, found, focus) {
    if (found.length <= MANY) return;
    const meets = [focus, found[focus]?.motion?.ride.revision, this.play.epochAt(t).epoch].join();
    if (focus >= 0 && meets !== this.meets) this.company = this.play.company(focus, t);
    this.meets = meets;
    if (focus >= 0) return;
    this.company = new Set();
    found.forEach((robot, index) => {
      if (robot && robot.lets >= 0) this.company.add(index).add(robot.lets);
    });
  }

  shows(index) {
    return !this.company || this.company.has(index);
  }

  /** The time under the pointer. */
  preview(t, look) {
    const { pen } = this.sheet;
    pen.strokeStyle = look.muted;
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(this.X(t), this.box.top);
    pen.lineTo(this.X(t), this.sheet.height - this.box.bottom);
    pen.stroke();
  }

  dot(pen, x, y, index, focus, hover, look) {
    const strong = index === focus || index === hover;
    pen.globalAlpha = focus >= 0 && !strong ? 0.25 : 1;
    pen.beginPath();
    pen.arc(x, y, strong ? 5.5 : 3.5, 0, 7);
    pen.fillStyle = look.robot(index);
    pen.fill();
    pen.strokeStyle = look.panel;
    pen.lineWidth = 1;
    pen.stroke();
    pen.globalAlpha = 1;
  }

  lines(focus, look) {
    const sheet = this.sheet.twin(), { pen } = sheet;
    this.axes(pen, look);
    this.events(pen, look);
    pen.lineJoin = "round";
    const crowd = this.shownCount() > MANY;
    if (this.company && focus < 0) this.hint(pen, look);
    for (const { index, motion, epoch, from, to } of this.play.spans()) {
      if (!this.shows(index)) continue;
      const faint = this.company ? 0.5 : 0.15;
      pen.globalAlpha = focus >= 0 && focus !== index ? faint : crowd && focus !== index ? 0.45 : 1;
      pen.strokeStyle = look.robot(index);
      pen.lineWidth = focus === index ? 2.75 : crowd ? 1 : 1.75;
      this.line(pen, motion, epoch, from, to);
      this.heldLines(pen, index, motion, epoch, from, to, look);
      if (focus === index || focus < 0 && this.shownCount() <= FEW) {
        this.yieldLines(pen, motion, epoch, from, to, focus === index, look);
      }
    }
    pen.globalAlpha = 1;
    return sheet;
  }

  shownCount() {
    return this.company ? this.company.size : this.play.scene.robots.length;
  }

  hint(pen, look) {
    pen.font = look.font(12);
    pen.fillStyle = look.muted;
    pen.textAlign = "right";
    pen.textBaseline = "top";
    const text = "those that wait, and for whom; choose a robot to see it and those that it meets";
    pen.fillText(text, this.sheet.width - this.box.right - 4, this.box.top + 4);
  }

  /** The line of a robot's motion in an epoch from one time to another. */
  line(pen, motion, epoch, from, to) {
    const times = [from, to], add = (passed) => times.push(epoch.start + motion.when(passed));
    for (const [t0, t1, , , v0, v1] of motion.ride.legs) {
      const parts = Math.abs(v1 - v0) > 1e-9 ? 6 : 1;
      for (let i = 0; i <= parts; i++) add(t0 + (t1 - t0) * i / parts);
    }
    if (motion.halt) motion.halt.slice(0, 2).forEach(add);
    for (const t of motion.known) times.push(epoch.start + t);
    pen.beginPath();
    for (const t of times.filter((one) => one >= from && one <= to).sort((a, b) => a - b)) {
      const x = this.X(t), y = this.Y(motion.progress(motion.passed(epoch.planTime(t)))[0]);
      if (t === from) pen.moveTo(x, y); else pen.lineTo(x, y);
    }
    pen.stroke();
  }

  /** Mark when a robot was held. */
  heldLines(pen, index, motion, epoch, begin, end, look) {
    pen.strokeStyle = look.amber;
    pen.lineWidth += 2;
    for (const { since, until } of this.play.holds[index]) {
      const from = Math.max(since, begin), to = Math.min(until ?? end, end);
      if (from < to) this.line(pen, motion, epoch, from, to);
    }
  }

  /** Widen the line where a robot slows down; say for whom it does so or goes aside. */
  yieldLines(pen, motion, epoch, begin, end, chosen, look) {
    const bodies = this.play.scene.robots, wide = pen.lineWidth, said = [];
    pen.font = look.font(11);
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    for (const { how, other, since, until, lost } of motion.ride.yields) {
      const [from, to] = [since, until].map((passed) => epoch.start + motion.when(passed));
      pen.strokeStyle = look.robot(motion.ride.robot);
      if (lost > 0) {
        pen.lineWidth = wide + 6;
        pen.globalAlpha = 0.3;
        this.line(pen, motion, epoch, Math.max(from, begin), Math.min(to, end));
        pen.lineWidth = wide;
        pen.globalAlpha = 1;
      }
      const t = lost > 0 ? 0.5 * (from + to) : to;
      if (!chosen || t < begin || t > end) continue;
      const s = motion.progress(motion.passed(epoch.planTime(t)))[0];
      const text = `${how} ${bodies[other].id}`, x = this.X(t) + 8;
      const covers = (one, y) => Math.abs(one.y - y) < 13 && x < one.end && x + pen.measureText(text).width > one.x;
      let y = this.Y(s) + 9;
      while (said.some((one) => covers(one, y))) y += 13;
      said.push({ x, y, end: x + pen.measureText(text).width });
      pen.strokeStyle = look.panel;
      pen.fillStyle = look.ink;
      pen.lineWidth = 3;
      pen.strokeText(text, x, y);
      pen.fillText(text, x, y);
      pen.lineWidth = wide;
    }
  }

  axes(pen, look) {
    const { left, right, top, bottom } = this.box, { width, height } = this.sheet;
    pen.font = look.font(11);
    pen.strokeStyle = look.line;
    pen.fillStyle = look.muted;
    pen.lineWidth = 1;
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    const rise = roundStep(this.longest, Math.max(height / 60, 2));
    for (let i = 0; i * rise <= this.longest; i++) {
      const y = Math.round(this.Y(i * rise)) + 0.5;
      pen.beginPath();
      pen.moveTo(left, y);
      pen.lineTo(width - right, y);
      pen.stroke();
      pen.fillText(`${+(i * rise).toFixed(3)}${i ? "" : " m"}`, left - 6, y);
    }
    pen.textAlign = "center";
    pen.textBaseline = "top";
    const { begin, end } = this.play.scene, stride = roundStep(end - begin, Math.max(width / 90, 2));
    for (let i = Math.ceil(begin / stride); i * stride <= end; i++) {
      const x = this.X(i * stride), last = (i + 1) * stride > end;
      pen.fillText(`${+(i * stride).toFixed(3)}${last ? " s" : ""}`, x, height - bottom + 7);
      pen.beginPath();
      pen.moveTo(Math.round(x) + 0.5, height - bottom);
      pen.lineTo(Math.round(x) + 0.5, height - bottom + 4);
      pen.stroke();
    }
    pen.beginPath();
    pen.moveTo(left, top);
    pen.lineTo(left, height - bottom);
    pen.stroke();
  }

  events(pen, look) {
    pen.lineWidth = 1;
    for (const mark of this.play.scene.marks) {
      if (mark.t < 0.01) continue;
      pen.strokeStyle = markColour(mark, look);
      pen.setLineDash([3, 3]);
      pen.beginPath();
      pen.moveTo(this.X(mark.t), this.box.top);
      pen.lineTo(this.X(mark.t), this.sheet.height - this.box.bottom);
      pen.stroke();
    }
    pen.setLineDash([]);
    if (this.play.epochs.length < 2) return;
    pen.textAlign = "left";
    pen.textBaseline = "bottom";
    pen.fillStyle = look.muted;
    this.play.epochs.forEach((epoch, number) => {
      const next = this.play.epochs[number + 1], x = this.X(Math.max(epoch.begin, this.play.scene.begin));
      const room = this.X(next ? next.begin : this.play.scene.end) - x;
      const text = [`epoch ${epoch.epoch}`, `${epoch.epoch}`].find((one) => pen.measureText(one).width + 4 < room);
      if (text) pen.fillText(text, x + 2, this.box.top - 1);
    });
  }

  /** The robot whose line is nearest to a place on the canvas, or -1. */
  pick(x, y) {
    const t = this.time(x);
    let best = -1, least = 12;
    this.play.scene.robots.forEach((_, index) => {
      const robot = this.play.robot(index, t);
      if (!robot || !robot.motion || !this.shows(index)) return;
      const away = Math.abs(this.Y(robot.s) - y);
      if (away < least) [best, least] = [index, away];
    });
    return best;
  }
}

function markColour(mark, look) {
  return { fault: look.red, silent: look.red, freeze: look.amber, late: look.amber }[mark.kind] || look.muted;
}
