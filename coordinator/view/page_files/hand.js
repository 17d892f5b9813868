// Pointers: on the floor the wheel, a pinch and a drag move the lens, a press selects a robot; on the
// diagram they choose the time.

const STILL = 5;

class Hand {
  /** `floor()` is the view; `told` has changed(), point(place), press(), leave(). */
  constructor(canvas, lens, floor, told) {
    Object.assign(this, { canvas, lens, floor, told });
    this.fingers = new Map();
    this.moved = 0;
    const on = (name, act, options) => canvas.addEventListener(name, (event) => act(event), options);
    on("pointerdown", (event) => this.down(event));
    on("pointermove", (event) => this.move(event));
    on("pointerup", (event) => this.up(event));
    on("pointercancel", (event) => this.fingers.delete(event.pointerId));
    on("pointerleave", () => told.leave());
    on("wheel", (event) => this.wheel(event), { passive: false });
  }

  down(event) {
    if (this.fingers.size === 0) this.moved = 0;
    this.fingers.set(event.pointerId, at(event));
    this.canvas.setPointerCapture(event.pointerId);
    this.told.point(at(event));
  }

  move(event) {
    const before = this.fingers.get(event.pointerId), now = at(event);
    if (!before) return this.told.point(now);
    this.moved += Math.hypot(now.x - before.x, now.y - before.y);
    if (this.fingers.size === 2) this.pinch(event.pointerId, before, now);
    else if (this.moved > STILL) this.drag(before, now);
    this.fingers.set(event.pointerId, now);
    return this.told.point(now);
  }

  up(event) {
    this.fingers.delete(event.pointerId);
    if (this.fingers.size === 0 && this.moved <= STILL) this.told.press();
  }

  drag(before, now) {
    const { zoom } = this.floor();
    this.lens.move((before.x - now.x) / zoom, (now.y - before.y) / zoom);
    this.told.changed();
  }

  /** Zoom by two fingers: the place between them stays between them. */
  pinch(moving, before, now) {
    const [other] = [...this.fingers].find(([id]) => id !== moving).slice(1);
    const apart = (one) => Math.max(Math.hypot(one.x - other.x, one.y - other.y), 1);
    const middle = (one) => ({ x: 0.5 * (one.x + other.x), y: 0.5 * (one.y + other.y) });
    this.enlarge(apart(now) / apart(before), middle(before));
    this.drag(middle(before), middle(now));
  }

  /** Zoom by the wheel; if the page scrolls, only by a pinch on a touchpad (which sets ctrl). */
  wheel(event) {
    const page = document.scrollingElement;
    if (!event.ctrlKey && page.scrollHeight > page.clientHeight) return;
    event.preventDefault();
    const step = event.deltaY * (event.deltaMode ? 16 : 1) * (event.ctrlKey ? 0.01 : 0.0016);
    this.enlarge(Math.exp(-step), at(event));
  }

  /** Enlarge about a place on the canvas, its middle unless one is given. */
  enlarge(share, spot) {
    this.lens.by(share, this.floor().placeAt(spot));
    this.told.changed();
  }
}

function at(event) {
  const box = event.currentTarget.getBoundingClientRect();
  return { x: event.clientX - box.left, y: event.clientY - box.top };
}

/** Let a pointer on the diagram choose the time, and preview it. */
function watchDiagram(canvas) {
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    setFollowing(false);
    seek(diagram.time(at(event).x));
  });
  canvas.addEventListener("pointermove", (event) => {
    const place = at(event);
    if (event.buttons) seek(diagram.time(place.x));
    preview = diagram.time(place.x);
    hoverOver(diagram.pick(place.x, place.y));
  });
  canvas.addEventListener("pointerleave", leave);
}
