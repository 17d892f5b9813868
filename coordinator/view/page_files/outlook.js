// What the order that is being chosen would come to: its way, its arrival, for whom its robot would wait.

/** A chosen order is looked at again after so long [ms]: the fleet drives on. */
const LOOK_AGAIN = 3000;
const LOOK_SOON = 150;

/** Draw a target about a place. */
function drawTarget(view, pen, place, colour) {
  const x = view.X(place[0]), y = view.Y(place[1]);
  pen.strokeStyle = colour;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.arc(x, y, 9, 0, 7);
  pen.moveTo(x - 14, y);
  pen.lineTo(x + 14, y);
  pen.moveTo(x, y - 14);
  pen.lineTo(x, y + 14);
  pen.stroke();
}

/** Draw where a robot that is not heard may stand. */
function drawStretch(view, pen, look, robot) {
  if (!robot || robot.stretch.length < 2) return;
  pen.strokeStyle = look.red;
  pen.lineWidth = 5;
  pen.globalAlpha = 0.6;
  pen.beginPath();
  for (const [x, y] of robot.stretch) pen.lineTo(view.X(x), view.Y(y));
  pen.stroke();
  pen.globalAlpha = 1;
}

class Outlook {
  /**
   * `order` returns the order that is chosen, or null, `isStopped` whether the fleet is; `changed` is called
   * when the floor looks otherwise.
   */
  constructor(box, order, isStopped, changed) {
    Object.assign(this, { box, order, isStopped, changed, found: null, asked: 0 });
  }

  /** The order that is chosen is another one. */
  look(soon = LOOK_SOON) {
    clearTimeout(this.due);
    const asked = ++this.asked, order = this.order();
    if (order === null) return this.show(null);
    this.due = setTimeout(async () => {
      const found = document.hidden ? this.found : await ask("POST", "preview", order, () => null);
      if (asked !== this.asked) return;
      this.show(found);
      this.look(LOOK_AGAIN);
    }, soon);
    return null;
  }

  show(found) {
    this.found = found;
    this.box.textContent = found ? this.words(found) : "";
    this.box.classList.toggle("fails", Boolean(found && found.reason));
    this.changed();
  }

  words({ robot, begins, arrives, alone, waits, reason }) {
    if (reason) return robot ? `${robot}: ${reason}` : reason;
    const sets = begins > 1 ? `sets out in ${begins.toFixed(0)} s, ` : "";
    const rests = waits.map((one) =>
      `${one.seconds.toFixed(1)} s${one.robot ? ` for ${one.robot}` : ""}`);
    const waiting = rests.length ? `; waits ${rests.join(", ")}` : "; nobody has to wait";
    const once = this.isStopped() ? "once the fleet goes on, " : "";
    return `${once}${robot} ${sets}would be there in ${arrives.toFixed(0)} s (${alone.toFixed(0)} s alone)${waiting}`;
  }

  /** Draw the way, and where the robot would wait. */
  draw(view, pen, look) {
    if (!this.found || this.found.way.length < 2) return;
    pen.strokeStyle = look.ink;
    pen.lineWidth = 2;
    pen.setLineDash([7, 5]);
    pen.beginPath();
    for (const [x, y] of this.found.way) pen.lineTo(view.X(x), view.Y(y));
    pen.stroke();
    pen.setLineDash([]);
    pen.fillStyle = look.amber;
    for (const { place: [x, y], seconds } of this.found.waits) {
      if (seconds < 0.5) continue;
      pen.beginPath();
      pen.arc(view.X(x), view.Y(y), 6, 0, 7);
      pen.fill();
      pen.stroke();
    }
  }
}
