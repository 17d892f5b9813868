// A scene in time: what every robot does at any second.

/** Before the first plan of a running fleet is heard. */
const NOTHING = {
  epoch: 0, begin: 0, start: 0, started: false, frozen: null,
  rides: [], aside: [], keep_out: [], zones: [], stops: [],
};

/** Courses that are looked at every POINTS [m] come near each other within NEAR [m] more. */
const POINTS = 0.2;
const NEAR = 0.1;

/** A robot that is slower than this [m/s] stands. */
const STANDS = 0.01;

/** Shorter waits [s] are no events. */
const SHORT = 0.05;

/** The course of several that a robot drives at a time of the plan. */
const driven = (courses, clock) => courses.findLast((one) => one.since <= clock);

/** A scene in time: all robots at any second. */
class Play {
  static versions = 0;

  constructor(scene) {
    this.scene = scene;
    const epochs = scene.epochs.length ? scene.epochs : [NOTHING];
    this.epochs = epochs.map((epoch) => ({
      ...epoch,
      courses: Map.groupBy(epoch.rides.map((ride) => Motion.of(ride)), (one) => one.ride.robot),
      why: new Map(epoch.aside.map((one) => [one.robot, one.why])),
    }));
    for (const epoch of this.epochs) epoch.planTime = (t) => (epoch.started ? t - epoch.start : -1);
    this.begins = this.epochs.map((epoch) => epoch.begin);
    this.silentFrom = Infinity;
    this.learned = 0;
    this.version = ++Play.versions;
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
    for (const courses of epoch.courses.values()) {
      const motion = courses.findLast((one) => one.since < Infinity) || courses[0];
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

  /** All courses that were driven: whose, which, in which epoch, from when to when. */
  spans() {
    return this.epochs.flatMap((epoch, number) => {
      const next = this.epochs[number + 1], end = next ? next.begin : this.scene.end;
      return [...epoch.courses].flatMap(([index, courses]) => {
        const begun = courses.filter((one) => one.since < Infinity);
        return begun.map((motion, i) => ({
          index, motion, epoch,
          from: Math.max(epoch.begin, epoch.start + motion.since, this.scene.begin),
          to: Math.min(end, i + 1 < begun.length ? epoch.start + begun[i + 1].since : end),
        }));
      });
    });
  }

  /** What is stated at a time: "hold", "go", "stop", "freeze", or "arrived" for all at rest. */
  phaseAt(t) {
    const epoch = this.epochAt(t);
    if (epoch.stops.some((one) => t >= one.since && (one.until === null || t < one.until))) return "stop";
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
      if (!found || !passed[id]) return;
      const [revision, knots] = passed[id];
      const motion = (found.courses.get(index) || []).find((one) => one.ride.revision === revision);
      if (motion) motion.learn(knots);
    });
    this.learned++;
  }

  /** One robot at a time: {x, y, heading, s, length, v, state, lets, yields, motion, next}. */
  robot(index, t) {
    const now = lastUpTo(this.begins, t), epoch = this.epochs[now], clock = epoch.planTime(t);
    const courses = epoch.courses.get(index) || [], motion = driven(courses, clock);
    if (!motion) return this.left(index, now);
    const next = courses.findLast((one) => one.ride.revision > motion.ride.revision && one.ride.told <= clock);
    const plan = motion.passed(clock), late = clock - plan - this.putOff(t);
    const [s, planned] = motion.progress(plan), wait = motion.wait(plan), { halt } = motion;
    const v = planned * (plan - motion.passed(clock - MOMENT)) / MOMENT;
    const held = this.held(index, t);
    let state = "drives", lets = -1;
    if ((motion.presumed || motion.ride.unheard) && halt && plan >= halt[0]) state = "unheard";
    else if (halt && plan >= halt[0]) state = plan < halt[1] ? "brakes" : "stopped";
    else if (plan < motion.finish && this.phaseAt(t) === "stop") state = v > STANDS ? "brakes" : "stands";
    else if (held) [state, lets] = ["held", held.by];
    else if (plan >= motion.finish) state = "arrived";
    else if (plan < 0) state = "ready";
    else if (wait) [state, lets] = ["waits", wait.lets];
    return {
      ...motion.place(s), s, length: motion.length, v, state, lets, wait, held, late, plan, motion, next,
      yields: state === "drives" ? motion.yields(plan) : [],
    };
  }

  /** For whom robots wait, slow down or leave their shortest ways, as marks; of one robot or of all. */
  reasons(focus) {
    const name = (index) => this.scene.robots[index].id;
    return this.spans().filter(({ index }) => focus < 0 || focus === index).flatMap((span) => {
      const { index, motion, epoch, from, to } = span;
      const waits = motion.ride.waits.filter((one) => one.lets >= 0 && one.until - one.since > SHORT)
        .map((one) => [one.since, `waits ${(one.until - one.since).toFixed(1)} s for ${name(one.lets)}`]);
      const yields = motion.ride.yields.map((one) => {
        const lost = one.lost > 0 ? `, loses ${one.lost.toFixed(1)} s` : "";
        return [one.since, `${one.how} ${name(one.other)}${lost}`];
      });
      return [...waits, ...yields]
        .map(([since, text]) => ({ t: epoch.start + motion.when(since), text: `${name(index)} ${text}` }))
        .filter(({ t }) => t >= from - SHORT && t <= to)
        .map((one) => ({ ...one, kind: "reason", robot: index }));
    });
  }

  /** The robots that one meets on its course at a time, itself among them. */
  company(index, t) {
    const { robots, margin } = this.scene, mine = this.robot(index, t)?.motion;
    const found = new Set([index]);
    if (!mine) return found;
    const points = mine.points();
    robots.forEach(({ radius }, other) => {
      const his = other === index ? undefined : this.robot(other, t)?.motion;
      const need = (radius + robots[index].radius + margin + NEAR) ** 2;
      if (his && his.points().some((a) => points.some((b) => (a.x - b.x) ** 2 + (a.y - b.y) ** 2 < need))) {
        found.add(other);
      }
    });
    return found;
  }

  /** How much later than planned robots that are on time are at a time, because the plan stood. */
  putOff(t) {
    const stop = this.epochAt(t).stops.findLast((one) => one.until !== null && one.until <= t);
    return stop ? stop.late : 0;
  }

  /** Why a robot has no part in the epoch at a time. */
  why(index, t) {
    const epoch = this.epochAt(t);
    return epoch.why.get(index) || (epoch.courses.has(index) ? "not here yet" : "no plan");
  }

  /** A robot without a part in an epoch: it stays at the end of its last motion before. */
  left(index, now) {
    const why = this.epochs[now].why.get(index) || "no plan";
    for (let i = now - 1; i >= 0; i--) {
      const end = this.epochs[i].planTime(this.epochs[i + 1].begin);
      const motion = driven(this.epochs[i].courses.get(index) || [], end);
      if (!motion) continue;
      const [s] = motion.progress(motion.passed(end));
      return { ...motion.place(s), s, length: motion.length, v: 0, state: why, lets: -1, yields: [] };
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
