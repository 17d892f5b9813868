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

/** One robot's part in an epoch: s(t) from its legs, (x, y) from its polyline. */
class Motion {
  constructor(ride) {
    this.ride = ride;
    [this.arcs, this.xs, this.ys] = ride.path;
    this.begins = ride.legs.map((leg) => leg[0]);
    this.length = this.arcs[this.arcs.length - 1];
    this.finish = ride.legs[ride.legs.length - 1][1];
    this.headings = this.turned();
    this.presumed = null;
    this.learn(ride.passed);
  }

  /** Take in the newest knots of its progress. */
  learn(knots) {
    const older = (this.knots || []).filter(([t]) => knots.length && t < knots[0][0]);
    this.knots = [...older, ...knots];
    this.known = this.knots.map(([t]) => t);
  }

  /** The plan time that it has passed at a time of the plan. */
  passed(t) {
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

  /** The wait that a robot is in at a plan time, or undefined. */
  wait(t) {
    const { halt } = this;
    if (halt && t >= halt[0]) return undefined;
    return this.ride.waits.find((wait) => t >= wait.since && t < wait.until);
  }
}

/** Before the first plan of a running fleet is heard. */
const NOTHING = {
  epoch: 0, begin: 0, start: 0, started: false, frozen: null,
  rides: [], aside: [], keep_out: [], zones: [],
};

/** A scene in time: all robots at any second. */
class Play {
  constructor(scene) {
    this.scene = scene;
    const epochs = scene.epochs.length ? scene.epochs : [NOTHING];
    this.epochs = epochs.map((epoch) => ({
      ...epoch,
      motions: new Map(epoch.rides.map((ride) => [ride.robot, new Motion(ride)])),
      why: new Map(epoch.aside.map((one) => [one.robot, one.why])),
    }));
    for (const epoch of this.epochs) epoch.planTime = (t) => (epoch.started ? t - epoch.start : -1);
    this.begins = this.epochs.map((epoch) => epoch.begin);
    this.silentFrom = Infinity;
    this.learned = 0;
    this.holds = scene.robots.map((_, index) => scene.held.filter((one) => one.robot === index));
    this.ghosts = new Map(scene.ghosts.map((ghost) => [ghost.robot, ghost]));
  }

  /**
   * Presume that no robot has heard a Command since a time: authorities end after the headroom [s].
   *
   * `since` is null if Commands are heard.  Returns the time at which all rest.
   */
  presume(since, headroom) {
    const epoch = this.epochs[this.epochs.length - 1], goes = epoch.started && epoch.frozen === null;
    const from = since === null || !goes ? null : Math.max(since + headroom - epoch.start, 0);
    this.silentFrom = from === null ? Infinity : since + headroom;
    let rest = since === null ? Infinity : since + headroom;
    for (const motion of epoch.motions.values()) {
      motion.presume(from);
      if (!motion.presumed) continue;
      this.silentFrom = Math.min(this.silentFrom, epoch.start + motion.presumed[0]);
      rest = Math.max(rest, epoch.start + motion.presumed[1]);
    }
    return rest;
  }

  epochAt(t) {
    return this.epochs[lastUpTo(this.begins, t)];
  }

  /** Whether robots are presumed at a time to have heard nothing for too long. */
  unheardAt(t) {
    return t >= this.silentFrom;
  }

  /** What the coordinator states at a time: "hold", "go", "freeze", or "arrived" for all at rest. */
  phaseAt(t) {
    const epoch = this.epochAt(t);
    if (epoch.frozen !== null && t >= epoch.frozen) return epoch.arrived ? "arrived" : "freeze";
    return epoch.planTime(t) < 0 ? "hold" : "go";
  }

  /** The one that holds a robot at a time, {robot, by, since, until}, or undefined. */
  held(index, t) {
    return this.holds[index].findLast((one) => t >= one.since && (one.until === null || t < one.until));
  }

  /** Learn how far late robots have come, by their names. */
  learn({ epoch, passed }) {
    const found = this.epochs.find((one) => one.epoch === epoch);
    this.scene.robots.forEach(({ id }, index) => {
      const motion = found && passed[id] ? found.motions.get(index) : undefined;
      if (motion) motion.learn(passed[id]);
    });
    this.learned++;
  }

  /** One robot at a time: {x, y, heading, s, length, v, state, lets, motion}. */
  robot(index, t) {
    const now = lastUpTo(this.begins, t);
    const motion = this.epochs[now].motions.get(index);
    if (!motion) return this.left(index, now);
    const clock = this.epochs[now].planTime(t), plan = motion.passed(clock), late = clock - plan;
    const [s, planned] = motion.progress(plan), wait = motion.wait(plan), { halt } = motion;
    const v = planned * (plan - motion.passed(clock - MOMENT)) / MOMENT;
    const held = this.held(index, t);
    let state = "drives", lets = -1;
    if ((motion.presumed || motion.ride.unheard) && halt && plan >= halt[0]) state = "unheard";
    else if (held) [state, lets] = ["held", held.by];
    else if (halt && plan >= halt[0]) state = plan < halt[1] ? "brakes" : "stopped";
    else if (plan >= motion.finish) state = "arrived";
    else if (plan < 0) state = "ready";
    else if (wait) [state, lets] = ["waits", wait.lets];
    return {
      ...motion.place(s), s, length: motion.length, v, state, lets, wait, held, late, plan, motion,
    };
  }

  /** Why a robot has no part in the epoch at a time. */
  why(index, t) {
    return this.epochAt(t).why.get(index) || "no plan";
  }

  /** A robot without a part in an epoch: it stays at the end of its last motion before. */
  left(index, now) {
    const why = this.epochs[now].why.get(index) || "no plan";
    for (let i = now - 1; i >= 0; i--) {
      const motion = this.epochs[i].motions.get(index);
      if (!motion) continue;
      const end = this.epochs[i].planTime(this.epochs[i + 1].begin);
      const [s] = motion.progress(motion.passed(end));
      return { ...motion.place(s), s, length: motion.length, v: 0, state: why, lets: -1 };
    }
    return null;
  }

  /** Where a robot truly was, or null when its black box does not tell. */
  truth(index, t) {
    const ghost = this.ghosts.get(index);
    if (!ghost || ghost.t.length === 0) return null;
    const { t: times, x: xs, y: ys } = ghost, i = lastUpTo(times, t);
    const size = i + 1 < times.length ? times[i + 1] - times[i] : 0;
    const part = size > 0 ? Math.min(Math.max((t - times[i]) / size, 0), 1) : 0;
    const between = (values) => values[i] + part * (values[Math.min(i + 1, times.length - 1)] - values[i]);
    return { x: between(xs), y: between(ys), over: t > times[times.length - 1] + 0.5 };
  }

  /** All robots by id, for scripts outside the page. */
  at(t) {
    const all = {};
    this.scene.robots.forEach((robot, index) => {
      const found = this.robot(index, t);
      if (found) {
        const { x, y, heading, s, v, state } = found;
        all[robot.id] = { x, y, heading, s, v, state };
      }
    });
    return all;
  }
}
