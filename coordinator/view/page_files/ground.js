// The parts of the floor that change only with the courses: drawn once, on a separate sheet.

const CROWD = 40;

class Ground {
  constructor(canvas, shown, lens) {
    this.lens = lens;
    this.sheet = new Sheet(canvas);
    this.shown = shown;
    this.bounds = [];
    this.lightable = [];
  }

  /** Show another scene. */
  show(play) {
    this.play = play;
    this.crowd = play.scene.robots.length > CROWD;
    const bounds = this.extent();
    if (bounds.join() === this.bounds.join()) return;
    Object.assign(this, { bounds, key: "" });
    const [x0, y0, x1, y1] = bounds, aspect = Math.min(Math.max((x1 - x0) / (y1 - y0), 0.6), 2.4);
    this.sheet.canvas.style.setProperty("--aspect", aspect);
  }

  /** [x0, y0, x1, y1] of the floor, or of all paths when there is none. */
  extent() {
    const { boundary, robots } = this.play.scene;
    let points = boundary, room = 0;
    if (!points.length) {
      points = this.play.epochs.flatMap((epoch) =>
        [...epoch.courses.values()].flat().flatMap((motion) => motion.xs.map((x, i) => [x, motion.ys[i]])));
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

  fit() {
    const [x0, y0, x1, y1] = this.bounds, { width, height } = this.sheet, edge = 10;
    const fits = Math.min((width - 2 * edge) / (x1 - x0), (height - 2 * edge) / (y1 - y0));
    this.zoom = Math.max(fits, 1e-6) * this.lens.factor;
    this.lens.hold(this.bounds, (0.5 * width - edge) / this.zoom, (0.5 * height - edge) / this.zoom);
    this.left = 0.5 * width - this.zoom * this.lens.x;
    this.base = 0.5 * height + this.zoom * this.lens.y;
  }

  /** The place on the floor at a spot on the canvas; by default at the canvas's middle. */
  placeAt(spot) {
    const { x, y } = spot || { x: 0.5 * this.sheet.width, y: 0.5 * this.sheet.height };
    return { x: (x - this.left) / this.zoom, y: (this.base - y) / this.zoom };
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

  ground(epoch, found, focus, look) {
    const sheet = this.sheet.twin(), { pen } = sheet, { boundary, obstacles } = this.play.scene;
    pen.lineJoin = pen.lineCap = "round";
    if (boundary.length) {
      this.trace(pen, boundary, true);
      pen.fillStyle = look.ground;
      pen.fill();
    }
    this.fillObstacles(pen, obstacles, look);
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
    if (this.shown.paths) this.drawPaths(pen, found, focus, look);
    if (this.shown.zones) this.drawZones(pen, epoch, found, focus, look);
    return sheet;
  }

  /** Draw all obstacles in one path and in one orientation: no seams between neighbours, no holes. */
  fillObstacles(pen, obstacles, look) {
    pen.beginPath();
    for (const corners of obstacles) {
      const area = corners.reduce((sum, [x, y], i) => {
        const [u, v] = corners[(i + 1) % corners.length];
        return sum + x * v - u * y;
      }, 0);
      const turned = area < 0 ? [...corners].reverse() : corners;
      turned.forEach(([x, y], i) => (i ? pen.lineTo(this.X(x), this.Y(y)) : pen.moveTo(this.X(x), this.Y(y))));
      pen.closePath();
    }
    pen.fillStyle = look.solid;
    pen.fill();
  }

  /** Draw the course that each robot drives, and dashed the newer one that it has been sent. */
  drawPaths(pen, found, focus, look) {
    found.forEach((robot, index) => {
      if (!robot || !robot.motion || robot.state === "unheard") return;
      if (this.isIdle(robot) && focus !== index) return;
      const { motion, next } = robot, goal = (next || motion).place((next || motion).length);
      const faint = focus >= 0 && focus !== index;
      const radius = this.zoom * this.play.scene.robots[index].radius;
      pen.strokeStyle = look.robot(index);
      pen.lineWidth = this.crowd && focus !== index ? 1 : 1.5;
      for (const course of next ? [motion, next] : [motion]) {
        pen.globalAlpha = faint ? 0.12 : course === next ? 0.8 : 0.35;
        pen.setLineDash(course === next ? [7, 5] : []);
        this.trace(pen, course.xs.map((x, i) => [x, course.ys[i]]));
        pen.stroke();
      }
      pen.globalAlpha = faint ? 0.12 : this.crowd && focus !== index ? 0.5 : 0.9;
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
    });
    pen.globalAlpha = 1;
  }

  /** Dot the way that a robot would take alone. */
  drawShortest(pen, [, xs, ys]) {
    pen.lineWidth = 1.5;
    pen.setLineDash([1, 5]);
    this.trace(pen, xs.map((x, i) => [x, ys[i]]));
    pen.stroke();
    pen.setLineDash([]);
  }

  /** Whether a robot has nothing to do, in a fleet with orders. */
  isIdle(robot) {
    return robot.state === "arrived" && !robot.next && this.play.scene.orders.length > 0;
  }

  /**
   * The zones to draw: all of a small fleet; of a large one those that force waits.
   *
   * They are those of the robots' first courses.
   */
  zones(epoch, found, focus) {
    const drives = (index) => found[index]?.motion?.since === -Infinity;
    return epoch.zones.filter((zone) => drives(zone.a) && drives(zone.b) &&
      (focus >= 0 ? zone.a === focus || zone.b === focus : zone.forces || !this.crowd));
  }

  drawZones(pen, epoch, found, focus, look) {
    this.lightable = this.zones(epoch, found, focus);
    pen.strokeStyle = look.muted;
    pen.globalAlpha = this.crowd && focus < 0 ? 0.06 : 0.16;
    for (const zone of this.lightable) {
      if (zone.forces) {
        this.band(pen, found, zone.a, zone.on_a);
        this.band(pen, found, zone.b, zone.on_b);
      }
    }
    pen.globalAlpha = 1;
  }

  band(pen, found, index, [from, to]) {
    pen.lineCap = "round";
    pen.lineWidth = Math.max(2 * this.zoom * this.play.scene.robots[index].radius, 6);
    this.trace(pen, found[index].motion.stretch(from, to));
    pen.stroke();
  }
}
