// The floor seen from above.  What changes only with the epoch is drawn once, on a sheet of its own.

const CROWD = 40;

class FloorView {
  constructor(canvas, play, shown) {
    this.sheet = new Sheet(canvas);
    this.play = play;
    this.shown = shown;
    this.crowd = play.scene.robots.length > CROWD;
    this.bounds = this.extent();
    this.background = null;
    this.key = "";
    this.spots = [];
  }

  /** [x0, y0, x1, y1] of the floor, or of all paths when there is none. */
  extent() {
    const { boundary, robots } = this.play.scene;
    let points = boundary, room = 0;
    if (!points.length) {
      points = this.play.epochs.flatMap((epoch) =>
        [...epoch.motions.values()].flatMap((motion) => motion.xs.map((x, i) => [x, motion.ys[i]])));
      room = 2 * Math.max(...robots.map((robot) => robot.radius), 0.1);
    }
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    for (const [x, y] of points) {
      box[0] = Math.min(box[0], x - room);
      box[1] = Math.min(box[1], y - room);
      box[2] = Math.max(box[2], x + room);
      box[3] = Math.max(box[3], y + room);
    }
    return box[0] < box[2] ? box : [0, 0, 1, 1];
  }

  get aspect() {
    const [x0, y0, x1, y1] = this.bounds;
    return (x1 - x0) / (y1 - y0);
  }

  fit() {
    const [x0, y0, x1, y1] = this.bounds, { width, height } = this.sheet, edge = 10;
    this.zoom = Math.max(Math.min((width - 2 * edge) / (x1 - x0), (height - 2 * edge) / (y1 - y0)), 1e-6);
    this.left = 0.5 * (width - this.zoom * (x1 - x0)) - this.zoom * x0;
    this.base = 0.5 * (height + this.zoom * (y1 - y0)) + this.zoom * y0;
  }

  X(x) { return this.left + this.zoom * x; }
  Y(y) { return this.base - this.zoom * y; }

  trace(pen, points, closed) {
    pen.beginPath();
    points.forEach((point, i) => {
      const x = this.X(point.x ?? point[0]), y = this.Y(point.y ?? point[1]);
      if (i) pen.lineTo(x, y); else pen.moveTo(x, y);
    });
    if (closed) pen.closePath();
  }

  /** Draw the floor at a time; `found` are the robots' states, `focus` and `hover` robots or -1. */
  draw(t, found, focus, hover, look) {
    const epoch = this.play.epochAt(t);
    const key = [epoch.epoch, focus, this.shown.paths, this.shown.zones, look.dark].join();
    if (this.sheet.resize() || key !== this.key) {
      this.key = key;
      this.fit();
      this.background = this.ground(epoch, focus, look);
    }
    const pen = this.sheet.begin(this.background.canvas);
    if (this.shown.zones) this.light(pen, epoch, found, focus, look);
    if (this.shown.waits) this.drawWaits(pen, found, focus, look);
    this.spots = [];
    found.forEach((robot, index) => {
      if (robot && index !== focus && index !== hover) this.drawRobot(pen, robot, index, focus, look);
    });
    for (const index of new Set([focus, hover])) {
      if (found[index]) this.drawRobot(pen, found[index], index, focus, look);
    }
    if (this.shown.ghosts) this.drawGhosts(pen, t, found, focus, look);
    if (this.shown.waits) this.sayWaits(pen, found, focus, look);
  }

  ground(epoch, focus, look) {
    const sheet = this.sheet.twin(), { pen } = sheet, { boundary, obstacles } = this.play.scene;
    pen.lineJoin = pen.lineCap = "round";
    if (boundary.length) {
      this.trace(pen, boundary, true);
      pen.fillStyle = look.ground;
      pen.fill();
    }
    for (const corners of obstacles) {
      this.trace(pen, corners, true);
      pen.fillStyle = look.solid;
      pen.fill();
    }
    if (boundary.length) {
      this.trace(pen, boundary, true);
      pen.strokeStyle = look.muted;
      pen.lineWidth = 1;
      pen.stroke();
    }
    for (const corners of epoch.keep_out) {
      this.trace(pen, corners, true);
      pen.fillStyle = pen.strokeStyle = look.red;
      pen.globalAlpha = 0.1;
      pen.fill();
      pen.globalAlpha = 0.6;
      pen.setLineDash([3, 3]);
      pen.stroke();
      pen.setLineDash([]);
      pen.globalAlpha = 1;
    }
    if (this.shown.paths) this.drawPaths(pen, epoch, focus, look);
    if (this.shown.zones) this.drawZones(pen, epoch, focus, look);
    return sheet;
  }

  drawPaths(pen, epoch, focus, look) {
    for (const [index, motion] of epoch.motions) {
      const faint = focus >= 0 && focus !== index, goal = motion.place(motion.length);
      const radius = this.zoom * this.play.scene.robots[index].radius;
      pen.strokeStyle = look.robot(index);
      pen.globalAlpha = faint ? 0.15 : this.crowd && focus !== index ? 0.4 : 0.85;
      pen.lineWidth = focus === index ? 2.5 : this.crowd ? 1 : 1.75;
      this.trace(pen, motion.xs.map((x, i) => [x, motion.ys[i]]));
      pen.stroke();
      pen.lineWidth = 1.25;
      pen.setLineDash([3, 3]);
      pen.beginPath();
      pen.arc(this.X(goal.x), this.Y(goal.y), Math.max(radius, 3), 0, 7);
      pen.stroke();
      pen.setLineDash([]);
      pen.fillStyle = look.robot(index);
      pen.beginPath();
      pen.arc(this.X(goal.x), this.Y(goal.y), 2, 0, 7);
      pen.fill();
    }
    pen.globalAlpha = 1;
  }

  /** Zones of interest: all of a small fleet; of a large one those that force waits. */
  zones(epoch, focus) {
    return epoch.zones.filter((zone) =>
      focus >= 0 ? zone.a === focus || zone.b === focus : zone.forces || !this.crowd);
  }

  drawZones(pen, epoch, focus, look) {
    this.lightable = this.zones(epoch, focus);
    pen.strokeStyle = look.muted;
    pen.globalAlpha = 0.16;
    for (const zone of this.lightable) {
      if (zone.forces) {
        this.band(pen, epoch, zone.a, zone.on_a);
        this.band(pen, epoch, zone.b, zone.on_b);
      }
    }
    pen.globalAlpha = 1;
  }

  band(pen, epoch, index, [from, to]) {
    const motion = epoch.motions.get(index);
    if (!motion) return;
    pen.lineCap = "round";
    pen.lineWidth = Math.max(2 * this.zoom * this.play.scene.robots[index].radius, 6);
    this.trace(pen, motion.stretch(from, to));
    pen.stroke();
  }

  light(pen, epoch, found, focus, look) {
    const within = (index, [from, to]) => {
      const robot = found[index];
      return robot && robot.motion && robot.state !== "arrived" && robot.s >= from && robot.s <= to;
    };
    pen.strokeStyle = look.amber;
    for (const zone of this.lightable || []) {
      const a = within(zone.a, zone.on_a), b = within(zone.b, zone.on_b);
      if (!a && !b) continue;
      pen.globalAlpha = 0.5;
      if (a) this.band(pen, epoch, zone.a, zone.on_a); else this.band(pen, epoch, zone.b, zone.on_b);
      pen.globalAlpha = 0.25;
      if (a) this.band(pen, epoch, zone.b, zone.on_b); else this.band(pen, epoch, zone.a, zone.on_a);
    }
    pen.globalAlpha = 1;
  }

  drawRobot(pen, robot, index, focus, look) {
    const body = this.play.scene.robots[index], radius = Math.max(this.zoom * body.radius, 3.5);
    const x = this.X(robot.x), y = this.Y(robot.y), colour = look.robot(index);
    const gone = !robot.motion && robot.state !== "arrived" || robot.state === "stopped";
    this.spots.push({ index, x, y, radius });
    pen.globalAlpha = focus >= 0 && focus !== index ? 0.35 : 1;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    pen.fillStyle = gone ? look.panel : colour;
    pen.fill();
    pen.lineWidth = gone ? 2 : 1.25;
    pen.strokeStyle = gone ? colour : look.panel;
    pen.stroke();
    this.drawHeading(pen, x, y, radius, robot.heading, colour);
    const inside = radius >= 8.5;
    if (inside || !this.crowd || focus === index) {
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.font = look.font(inside ? Math.min(radius * 0.95, 13) * Math.min(1, 2.6 / body.id.length) : 11, 600);
      pen.fillStyle = inside && !gone ? look.onRobot : look.ink;
      if (inside) {
        pen.fillText(body.id, x, y + 0.5);
      } else {
        pen.lineWidth = 3;
        pen.strokeStyle = look.ground;
        pen.strokeText(body.id, x, y - radius - 8);
        pen.fillText(body.id, x, y - radius - 8);
      }
    }
    pen.globalAlpha = 1;
  }

  /** A small wedge on the rim, where the robot faces. */
  drawHeading(pen, x, y, radius, heading, colour) {
    const reach = radius + Math.max(3.5, 0.28 * radius), wide = 0.42;
    pen.beginPath();
    pen.moveTo(x + reach * Math.cos(heading), y - reach * Math.sin(heading));
    pen.arc(x, y, radius + 0.5, -(heading - wide), -(heading + wide), true);
    pen.closePath();
    pen.fillStyle = colour;
    pen.fill();
  }

  drawGhosts(pen, t, found, focus, look) {
    pen.setLineDash([4, 3]);
    pen.lineWidth = 1.5;
    pen.strokeStyle = look.ink;
    this.play.scene.robots.forEach((body, index) => {
      const truth = this.play.truth(index, t);
      if (!truth) return;
      pen.globalAlpha = focus >= 0 && focus !== index ? 0.2 : 0.75;
      pen.beginPath();
      pen.arc(this.X(truth.x), this.Y(truth.y), Math.max(this.zoom * body.radius, 3.5) + 3, 0, 7);
      pen.stroke();
    });
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }

  waiting(found, focus) {
    return found.flatMap((robot, index) => {
      const other = robot && robot.state === "waits" ? found[robot.lets] : null;
      const wanted = focus < 0 || focus === index || (robot && focus === robot.lets);
      return other && wanted ? [{ robot, other, index }] : [];
    });
  }

  drawWaits(pen, found, focus, look) {
    pen.lineWidth = 1.5;
    pen.strokeStyle = look.ink;
    pen.setLineDash([2, 4]);
    for (const { robot, other } of this.waiting(found, focus)) {
      pen.beginPath();
      pen.moveTo(this.X(robot.x), this.Y(robot.y));
      pen.lineTo(this.X(other.x), this.Y(other.y));
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  sayWaits(pen, found, focus, look) {
    if (this.crowd && focus < 0) return;
    pen.font = look.font(12, 500);
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    for (const { robot, index } of this.waiting(found, focus)) {
      const bodies = this.play.scene.robots, text = `waits for ${bodies[robot.lets].id}`;
      const wide = pen.measureText(text).width + 14, radius = Math.max(this.zoom * bodies[index].radius, 4);
      const right = this.X(robot.x) + radius + 8;
      const x = right + wide < this.sheet.width ? right : this.X(robot.x) - radius - 8 - wide;
      const y = Math.max(this.Y(robot.y), 14);
      pen.fillStyle = look.ink;
      pen.beginPath();
      pen.roundRect(x, y - 11, wide, 22, 11);
      pen.fill();
      pen.fillStyle = look.panel;
      pen.fillText(text, x + 7, y + 0.5);
    }
  }

  /** The robot at a place on the canvas, or -1. */
  pick(x, y) {
    let best = -1, least = Infinity;
    for (const spot of this.spots) {
      const away = Math.hypot(spot.x - x, spot.y - y);
      if (away < Math.max(spot.radius + 4, 14) && away < least) [best, least] = [spot.index, away];
    }
    return best;
  }
}
