// The floor at one moment: robots, the rest of their paths, highlighted zones, waits, ghosts.

/** The states of robots that have left their plan for good. */
const RESTS = new Set(["stopped", "unheard", "no course"]);

/** The states of robots that stand or slow down because of another one. */
const WAITS = new Set(["waits", "held"]);

/** A robot's name is in its disc where it can be as large as this [px], else beside it. */
const LEGIBLE = 7.5;

class FloorView extends Ground {
  constructor(canvas, shown, lens) {
    super(canvas, shown, lens);
    this.background = null;
    this.key = "";
    this.spots = [];
  }

  /** Draw the floor at a time; `found` are the robots' states, `focus` and `hover` robots or -1, `troubled` a set. */
  draw(t, found, focus, hover, look, troubled = new Set()) {
    this.troubled = troubled;
    this.fades = troubled.size === 0 && this.play.phaseAt(t) !== "stop";
    const epoch = this.play.epochAt(t);
    const courses = found.map((robot) =>
      robot && [robot.motion?.ride.revision, robot.next?.ride.revision, this.isIdle(robot), robot.state === "unheard"]);
    const shown = [this.shown.paths, this.shown.zones, look.dark, this.lens.key];
    const key = [epoch.epoch, focus, ...shown, ...courses].join();
    if (this.sheet.resize() || key !== this.key) {
      this.fit();
      this.key = key;
      this.background = this.ground(epoch, found, focus, look);
    }
    const pen = this.sheet.begin(this.background.canvas);
    if (this.shown.paths) this.drawAhead(pen, found, focus, look);
    if (this.shown.zones) this.light(pen, found, look);
    if (this.shown.waits) this.drawWaits(pen, found, focus, look);
    this.spots = [];
    found.forEach((robot, index) => {
      if (robot && index !== focus && index !== hover) this.drawRobot(pen, robot, index, focus, look);
    });
    for (const index of new Set([focus, hover])) {
      if (found[index]) this.drawRobot(pen, found[index], index, focus, look);
    }
    if (found[hover]) this.ring(pen, found[hover], hover, look.ink);
    if (this.shown.ghosts) this.drawGhosts(pen, t, found, focus, look);
    this.taken = [];
    this.sayNames(pen, focus, hover, look);
    if (this.shown.waits) this.sayWaits(pen, found, focus, look);
    this.tellScale();
  }

  /** Tell the place on the floor at a spot on the canvas. */
  tellWhere(spot) {
    const place = spot && this.placeAt(spot);
    byId("where").textContent = place ? `${place.x.toFixed(2)}, ${place.y.toFixed(2)} m` : "";
  }

  /** Tell the scale by a bar of a round length [m]. */
  tellScale() {
    const wanted = 90 / this.zoom, tens = 10 ** Math.floor(Math.log10(wanted));
    const length = tens * [5, 2, 1].find((one) => one * tens <= wanted), bar = byId("scale");
    write(bar, `${Number(length.toPrecision(1))} m`);
    const width = `${(this.zoom * length).toFixed(1)}px`;
    if (bar.style.width !== width) bar.style.width = width;
  }

  /** Draw every path, the part ahead stronger than the part behind. */
  drawAhead(pen, found, focus, look) {
    pen.lineJoin = pen.lineCap = "round";
    found.forEach((robot, index) => {
      const wanted = focus < 0 ? !this.crowd : focus === index;
      if (!wanted || !robot || !robot.motion || robot.s >= robot.length || RESTS.has(robot.state)) return;
      pen.strokeStyle = look.robot(index);
      pen.lineWidth = 2;
      this.trace(pen, robot.motion.stretch(robot.s, robot.length));
      pen.stroke();
      const { shortest } = robot.motion.ride;
      if (shortest && (focus === index || found.length <= FEW)) this.drawShortest(pen, shortest);
    });
  }

  light(pen, found, look) {
    const within = (index, [from, to]) => {
      const robot = found[index];
      return robot && robot.motion && robot.state !== "arrived" && robot.s >= from && robot.s <= to;
    };
    pen.strokeStyle = look.amber;
    for (const zone of this.lightable) {
      const a = within(zone.a, zone.on_a), b = within(zone.b, zone.on_b);
      if (!a && !b) continue;
      pen.globalAlpha = this.crowd ? 0.35 : 0.5;
      if (a) this.band(pen, found, zone.a, zone.on_a); else this.band(pen, found, zone.b, zone.on_b);
      pen.globalAlpha = this.crowd ? 0.12 : 0.25;
      if (a) this.band(pen, found, zone.b, zone.on_b); else this.band(pen, found, zone.a, zone.on_a);
    }
    pen.globalAlpha = 1;
  }

  drawRobot(pen, robot, index, focus, look) {
    const body = this.play.scene.robots[index], radius = Math.max(this.zoom * body.radius, 3.5);
    const x = this.X(robot.x), y = this.Y(robot.y), colour = look.robot(index);
    const gone = !robot.motion && robot.state !== "arrived" || RESTS.has(robot.state);
    this.spots.push({ index, x, y, radius });
    pen.globalAlpha = this.fades && focus >= 0 && focus !== index ? 0.35 : 1;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    pen.fillStyle = gone ? look.panel : colour;
    pen.fill();
    pen.lineWidth = gone ? 2 : 1.25;
    pen.strokeStyle = gone ? colour : look.panel;
    pen.stroke();
    this.drawHeading(pen, x, y, radius, robot.heading, colour);
    const size = this.sizeOf(body.id, radius);
    if (size > 0) {
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.font = look.font(size, 600);
      pen.fillStyle = gone ? (this.troubled.has(index) ? look.red : look.ink) : look.onRobot;
      pen.fillText(body.id, x, y + 0.5);
    }
    pen.globalAlpha = 1;
  }

  /** The size [px] of a robot's name inside its disc; 0 if it is to be beside it. */
  sizeOf(name, radius) {
    const size = Math.min(radius * 0.95, 13) * Math.min(1, 2.6 / name.length);
    return size < LEGIBLE ? 0 : size;
  }

  /** Choose how words on the floor look; they have a rim in its colour. */
  inscribe(pen, look, font, colour) {
    pen.font = font;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.lineWidth = 3;
    pen.strokeStyle = look.ground;
    pen.fillStyle = colour;
  }

  inscription(pen, words, x, y) {
    pen.strokeText(words, x, y);
    pen.fillText(words, x, y);
  }

  /**
   * Write names beside robots that are too small for them, clear of robots and other names: of those
   * in trouble first, then of the chosen one; others have none where there is no room.
   */
  sayNames(pen, focus, hover, look) {
    const ranked = (index) => (this.troubled.has(index) ? 0 : index === focus ? 1 : index === hover ? 2 : 3);
    for (const { index, x, y, radius } of this.spots.toSorted((a, b) => ranked(a.index) - ranked(b.index))) {
      const name = this.play.scene.robots[index].id, rank = ranked(index), isTroubled = rank === 0;
      if (this.sizeOf(name, radius) > 0 || this.crowd && rank === 3) continue;
      this.inscribe(pen, look, look.font(isTroubled ? 12 : 11, 600), isTroubled ? look.red : look.ink);
      const wide = pen.measureText(name).width + 2, away = radius + (isTroubled ? 5 : 0);
      const left = x - away - 4 - wide, right = x + away + 4;
      const spot = this.room(wide, 14, [
        [x - wide / 2, y - away - 15], [x - wide / 2, y + away + 2], [right, y - 7], [left, y - 7],
        [right, y - away - 12], [left, y - away - 12], [right, y + away], [left, y + away],
      ], rank < 2);
      if (!spot) continue;
      pen.globalAlpha = this.fades && rank === 3 && focus >= 0 ? 0.35 : 1;
      this.inscription(pen, name, spot.x + wide / 2, spot.y + 7);
    }
    pen.globalAlpha = 1;
  }

  ring(pen, place, index, colour, away = 1.5) {
    const radius = Math.max(this.zoom * this.play.scene.robots[index].radius, 3.5);
    pen.lineWidth = 2;
    pen.strokeStyle = colour;
    pen.beginPath();
    pen.arc(this.X(place.x), this.Y(place.y), radius + away, 0, 7);
    pen.stroke();
  }

  /** Draw where a robot is at the time under the pointer in the diagram. */
  preview(robot, index, t, look) {
    if (!robot) return;
    const { pen } = this.sheet, x = this.X(robot.x), y = this.Y(robot.y);
    this.ring(pen, robot, index, look.robot(index));
    this.inscribe(pen, look, look.font(11, 600), look.ink);
    const below = y + Math.max(this.zoom * this.play.scene.robots[index].radius, 4) + 11;
    this.inscription(pen, `${t.toFixed(1)} s`, x, below);
  }

  /** Draw a small wedge on the rim that shows where the robot faces. */
  drawHeading(pen, x, y, radius, heading, colour) {
    const reach = radius + Math.max(4, 0.45 * radius), wide = 0.5;
    pen.beginPath();
    pen.moveTo(x + reach * Math.cos(heading), y - reach * Math.sin(heading));
    pen.arc(x, y, radius + 0.5, -(heading - wide), -(heading + wide), true);
    pen.closePath();
    pen.fillStyle = colour;
    pen.fill();
  }

  drawGhosts(pen, t, found, focus, look) {
    pen.setLineDash([3, 3]);
    pen.lineWidth = 1;
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

  /** Who stands, slows down or goes aside for whom; of a crowd, only the chosen robot goes aside. */
  waiting(found, focus) {
    const { robots } = this.play.scene;
    const told = (robot, index, verb, other) =>
      ({ robot, index, other: found[other], verb: `${verb} ${robots[other].id}` });
    return found.flatMap((robot, index) => {
      if (!robot) return [];
      const all = WAITS.has(robot.state) && robot.lets >= 0 ?
        [[robot.state === "held" ? "held by" : "waits for", robot.lets]] :
        this.crowd && focus !== index ? [] : robot.yields.map((one) => [one.how, one.other]);
      return all.filter(([, other]) => found[other] && (focus < 0 || focus === index || focus === other))
        .map(([verb, other]) => told(robot, index, verb, other));
    });
  }

  drawWaits(pen, found, focus, look) {
    const quiet = this.crowd && focus < 0;
    pen.lineWidth = quiet ? 1 : 1.5;
    pen.setLineDash(quiet ? [1, 3] : [2, 4]);
    pen.globalAlpha = quiet ? 0.5 : 1;
    for (const { robot, other, index } of this.waiting(found, focus)) {
      pen.strokeStyle = robot.state === "held" ? look.amber : quiet ? look.robot(index) : look.ink;
      pen.beginPath();
      pen.moveTo(this.X(robot.x), this.Y(robot.y));
      pen.lineTo(this.X(other.x), this.Y(other.y));
      pen.stroke();
    }
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }

  sayWaits(pen, found, focus, look) {
    if (this.crowd && focus < 0) return;
    pen.font = look.font(12, 500);
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    for (const { robot, index, verb } of this.waiting(found, focus)) {
      const bodies = this.play.scene.robots;
      const wide = pen.measureText(verb).width + 14, tall = 22;
      const x = this.X(robot.x), y = this.Y(robot.y);
      const away = Math.max(this.zoom * bodies[index].radius, 4) + 8;
      const middle = Math.max(Math.min(x - wide / 2, this.sheet.width - wide - 2), 2);
      const spot = this.room(wide, tall, [
        [x + away, y - 11], [x - away - wide, y - 11], [middle, y + away], [middle, y - away - 34],
        [middle, y + away + 16], [middle, y - away - 50],
      ], index === focus);
      if (!spot) continue;
      pen.fillStyle = look.ink;
      pen.beginPath();
      pen.roundRect(spot.x, spot.y, spot.wide, spot.tall, 11);
      pen.fill();
      pen.fillStyle = look.panel;
      pen.fillText(verb, spot.x + 7, spot.y + 11.5);
    }
  }

  /** The first of some corners at which a text hides no robot (`must`: or if none, a robot) and no text; or null. */
  room(wide, tall, corners, must) {
    const tries = corners.map(([x, y]) => ({ x, y, wide, tall }));
    const inside = ({ x, y }) =>
      x > 0 && y > 0 && x + wide < this.sheet.width && y + tall < this.sheet.height;
    const overlaps = (one) => this.taken.some((other) =>
      one.x < other.x + other.wide && other.x < one.x + wide &&
      one.y < other.y + other.tall && other.y < one.y + tall);
    const hides = (one) => this.spots.some((spot) =>
      spot.x + spot.radius > one.x && spot.x - spot.radius < one.x + wide &&
      spot.y + spot.radius > one.y && spot.y - spot.radius < one.y + tall);
    const free = tries.filter((one) => inside(one) && !overlaps(one));
    const found = free.find((one) => !hides(one)) ?? (must && free[0]);
    if (found) this.taken.push(found);
    return found || null;
  }

  /** The robot at a place on the canvas, or -1; a crowd leaves room to choose places. */
  pick(x, y) {
    let best = -1, least = Infinity;
    for (const spot of this.spots) {
      const away = Math.hypot(spot.x - x, spot.y - y);
      const reach = Math.max(spot.radius + 4, this.crowd ? 0 : 14);
      if (away < reach && away < least) [best, least] = [spot.index, away];
    }
    return best;
  }
}
