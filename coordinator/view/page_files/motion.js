// Where robots are: computed from their plans, never from positions that somebody sent.

/** The last index whose value in ascending `values` is not above x; at least 0. */
function lastUpTo(values, x) {
  let low = 0, high = values.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (values[middle] <= x) low = middle; else high = middle - 1;
  }
  return low;
}

/** The time [s] over which the speed of a late robot is taken. */
const MOMENT = 0.05;

/** One course of a robot: s(t) from its legs, (x, y) from its polyline; driven from `since` on. */
class Motion {
  /** The motions of rides that are drawn; a ride that stays between two scenes keeps its motion. */
  static known = new WeakMap();

  static of(ride) {
    if (!Motion.known.has(ride)) Motion.known.set(ride, new Motion(ride));
    return Motion.known.get(ride);
  }

  constructor(ride) {
    this.ride = ride;
    [this.arcs, this.xs, this.ys] = ride.path;
    this.begins = ride.legs.map((leg) => leg[0]);
    this.length = this.arcs[this.arcs.length - 1];
    this.finish = ride.legs[ride.legs.length - 1][1];
    this.headings = this.turned();
    this.since = ride.told === null ? -Infinity : ride.since ?? Infinity;
    this.presumed = null;
    this.learn(ride.passed);
  }

  /** Take in the newest knots of its progress. */
  learn(knots) {
    const older = (this.knots || []).filter(([t]) => knots.length && t < knots[0][0]);
    this.knots = [...older, ...knots];
    this.known = this.knots.map(([t]) => t);
  }

  /** The plan time that it has passed at a time of the plan; no more than where its next course begins. */
  passed(t) {
    return Math.min(this.reported(t), this.ride.ends ?? Infinity);
  }

  /** The plan time that it has passed by its reports. */
  reported(t) {
    const { knots } = this, last = knots.length - 1;
    if (last < 1 || t <= knots[0][0]) return t;
    const i = Math.min(lastUpTo(this.known, t), last - 1);
    const [[t0, p0], [t1, p1]] = [knots[i], knots[i + 1]], rate = (p1 - p0) / (t1 - t0);
    if (t <= t1) return p0 + rate * (t - t0);
    return rate > 0 ? p1 + Math.min(rate, 1) * (t - t1) : p1;
  }

  /** When it has passed a plan time; the time of the last knot if it never does. */
  when(passed) {
    const { knots } = this, last = knots.length - 1;
    if (last < 1 || passed <= knots[0][1]) return passed;
    const after = knots.findIndex((knot) => knot[1] >= passed);
    const [[t0, p0], [t1, p1]] = after < 1 ? knots.slice(-2) : knots.slice(after - 1, after + 1);
    const rate = (p1 - p0) / (t1 - t0);
    if (after >= 1) return t0 + (passed - p0) / rate;
    return rate > 0 ? t1 + (passed - p1) / Math.min(rate, 1) : t1;
  }

  /** Where it left its plan: as the robot reported, else as is presumed. */
  get halt() {
    return this.ride.halt || this.presumed;
  }

  /** Presume that the robot's authority ends at a plan time: it brakes in time to rest there. */
  presume(t) {
    this.presumed = null;
    if (t === null || this.ride.halt || t >= this.finish) return;
    const { brake } = this.ride, slowing = (v) => (brake > 0 ? v / brake : 0);
    const [end] = this.planned(t);
    let low = 0, high = t;
    for (let i = 0; i < 40; i++) {
      const middle = 0.5 * (low + high), [s, v] = this.planned(middle);
      if (s + 0.5 * v * slowing(v) <= end) low = middle; else high = middle;
    }
    const [s, v] = this.planned(low);
    this.presumed = [low, low + slowing(v), s, end];
  }

  /** Headings at the polyline's points, without jumps: the mean of the pieces beside them. */
  turned() {
    const { xs, ys } = this, pieces = [];
    for (let i = 0; i + 1 < xs.length; i++) {
      const angle = Math.atan2(ys[i + 1] - ys[i], xs[i + 1] - xs[i]);
      const before = i ? pieces[i - 1] : angle;
      const turn = angle - before;
      pieces.push(before + turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI)));
    }
    return xs.map((_, i) => {
      const last = pieces[Math.max(i - 1, 0)], next = pieces[Math.min(i, pieces.length - 1)];
      return 0.5 * (last + next);
    });
  }

  /** [arc length, speed] at a plan time, had the robot kept to its plan. */
  planned(t) {
    const [t0, t1, s0, s1, v0, v1] = this.ride.legs[lastUpTo(this.begins, t)];
    const passed = t - t0;
    if (passed <= 0) return [s0, 0];
    if (t >= t1) return [s1, 0];
    const rate = (v1 - v0) / (t1 - t0);
    return [s0 + passed * (v0 + 0.5 * rate * passed), v0 + rate * passed];
  }

  /** [arc length, speed] when it has passed a plan time; after a halt it brakes and rests. */
  progress(t) {
    const { halt } = this;
    if (!halt || t < halt[0]) return this.planned(t);
    const [t0, t1, s0, s1] = halt;
    if (t >= t1) return [s1, 0];
    const part = (t - t0) / (t1 - t0);
    return [s0 + (s1 - s0) * part * (2 - part), 2 * (s1 - s0) * (1 - part) / (t1 - t0)];
  }

  /** {x, y, heading} at an arc length. */
  place(s) {
    const { arcs, xs, ys, headings } = this;
    const i = Math.min(lastUpTo(arcs, s), arcs.length - 2);
    const part = Math.min(Math.max((s - arcs[i]) / (arcs[i + 1] - arcs[i]), 0), 1);
    const between = (values) => values[i] + part * (values[i + 1] - values[i]);
    return { x: between(xs), y: between(ys), heading: between(headings) };
  }

  /** Points [x, y] from one arc length to another. */
  stretch(from, to) {
    const points = [this.place(from)];
    for (let i = lastUpTo(this.arcs, from) + 1; i < this.arcs.length && this.arcs[i] < to; i++) {
      points.push({ x: this.xs[i], y: this.ys[i] });
    }
    points.push(this.place(to));
    return points;
  }

  /** Points along the whole course. */
  points() {
    if (!this.spots) {
      const count = Math.ceil(this.length / POINTS);
      this.spots = Array.from({ length: count + 1 }, (_, i) => this.place(this.length * i / Math.max(count, 1)));
    }
    return this.spots;
  }

  /** How it gives way to others at a plan time without a rest. */
  yields(t) {
    const { halt } = this;
    if (halt && t >= halt[0]) return [];
    return this.ride.yields.filter((one) => t >= one.since && t < one.until);
  }

  /** The wait that a robot is in at a plan time, or undefined. */
  wait(t) {
    const { halt } = this;
    if (halt && t >= halt[0]) return undefined;
    return this.ride.waits.find((wait) => t >= wait.since && t < wait.until);
  }
}
