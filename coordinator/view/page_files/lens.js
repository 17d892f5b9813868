// Which part of the floor is seen: all of it, or an enlarged part.

const MOST_ENLARGED = 40;

class Lens {
  constructor() { this.all(); }

  /** See all of the floor. */
  all() {
    this.factor = 1;
    this.x = this.y = 0;
  }

  get key() { return `${this.factor} ${this.x} ${this.y}`; }

  /** Enlarge by a share about a place on the floor, which stays where it is on the screen. */
  by(share, place) {
    const before = this.factor;
    this.factor = Math.min(Math.max(before * share, 1), MOST_ENLARGED);
    const kept = before / this.factor;
    this.x = place.x + (this.x - place.x) * kept;
    this.y = place.y + (this.y - place.y) * kept;
  }

  /** Look at a place on the floor. */
  to({ x, y }) {
    Object.assign(this, { x, y });
  }

  /** Look elsewhere, by metres. */
  move(dx, dy) {
    this.x += dx;
    this.y += dy;
  }

  /** Keep the view on the floor; the arguments are its bounds and half the view's size [m]. */
  hold([x0, y0, x1, y1], wide, tall) {
    const held = (at, low, high, half) =>
      2 * half >= high - low ? 0.5 * (low + high) : Math.min(Math.max(at, low + half), high - half);
    this.x = held(this.x, x0, x1, wide);
    this.y = held(this.y, y0, y1, tall);
  }
}
