// What the page hears of a running fleet, and for how long the coordinator has been silent: when the
// headroom has passed, all robots have stopped.

/** The coordinator counts as silent when its last Command is older than the headroom by this [s]. */
const RESERVE = 0.4;
/** For how long [s] the page goes on after the Command's phase was OVER. */
const AFTERWARDS = 1;
/** The page's server counts as ended when it has sent nothing for this long [s]. */
const PATIENCE = 2;

/** What a difference (coordinator/desk/differences.py) makes of a value, which stays as it is. */
function changed(old, difference) {
  if (difference === null) return old;
  const [kind, first, second, come] = difference;
  if (kind === "=") return first;
  if (kind === "{") {
    const made = { ...old };
    for (const key of second) delete made[key];
    for (const [key, one] of Object.entries(first)) made[key] = changed(old[key], one);
    return made;
  }
  const gone = new Set(first), items = old.filter((_, index) => !gone.has(index));
  for (const [index, one] of Object.entries(second)) items[index] = changed(items[index], one);
  for (const [index, one] of come) items.splice(index, 0, one);
  return items;
}

class Word {
  /**
   * `scene` gets every new scene, `late` how far late robots have come, `fleet` what is new of the
   * fleet, `gone` robots that left; `changed` is called when messages stop or come again.
   */
  constructor(told) {
    this.told = told;
    this.open = true;
    this.begin();
  }

  /** Forget everything: after a reconnection, another server may count time from another zero. */
  begin() {
    this.clock = this.last = this.silence = null;
    this.past = [];
    this.alive = performance.now();
  }

  show(scene) {
    this.scene = scene;
    this.told.scene({ ...scene });
  }

  listen() {
    const source = new EventSource("api/events?scenes=1");
    const hear = (name, take) => source.addEventListener(name, (event) => {
      this.alive = performance.now();
      take(JSON.parse(event.data));
    });
    hear("scene", (scene) => this.show(scene));
    hear("change", (difference) => this.show(changed(this.scene, difference)));
    for (const name of ["late", "gone"]) hear(name, this.told[name]);
    hear("fleet", (found) => {
      if (this.last) this.last.over ||= found.phase === "over";
      this.told.fleet(found);
    });
    hear("clock", ({ now, speed }) => {
      const first = this.clock === null;
      this.clock = { now, speed, heard: this.alive };
      if (first) this.told.changed();
    });
    hear("word", (found) => {
      if (found) this.last = { ...found, heard: this.alive };
    });
    source.addEventListener("open", () => {
      if (!this.open) this.begin();
      this.open = true;
    });
    source.addEventListener("error", () => { this.open = false; });
  }

  /** Update whether the fleet is silent; to be called for every frame. */
  look() {
    const gone = !this.open || performance.now() - this.alive > 1000 * PATIENCE;
    const { last, silence } = this, over = last !== null && last.over;
    const silent = !gone && last !== null && (over || last.age > last.headroom + RESERVE);
    const kind = gone ? (over ? "over" : "gone") : silent ? (over ? "over" : "silent") : "";
    if (kind === (silence ? silence.kind : "")) return;
    if (silence && silence.kind !== "over" && !kind) this.past.push({ ...silence, until: this.time() });
    this.silence = kind ? this.silenced(kind, silence) : null;
    this.told.changed();
  }

  silenced(kind, before) {
    const { last } = this, known = this.clock !== null && last !== null;
    const since = before && before.kind !== "over" && before.since !== null ? before.since :
      known ? this.timeAt(last.heard - 1000 * last.age) : null;
    const [lamp, why] = {
      over: ["over", ""],
      gone: ["no word", "the desk has ended, no word"],
      silent: ["no word", "no word from the coordinator"],
    }[kind];
    const ended = known ? this.time() : null;
    return { kind, since, ended, headroom: last ? last.headroom : 0, lamp, why };
  }

  /** The beginnings and ends of all silences, as marks. */
  marks() {
    const all = this.silence ? [...this.past, this.silence] : this.past;
    return all.filter((one) => one.kind !== "over" && one.since !== null).flatMap(({ since, until, why }) => [
      { t: since, kind: "silent", text: why },
      ...until === undefined ? [] : [{ t: until, kind: "go", text: "messages arrive again" }],
    ]);
  }

  /** The fleet's time now; null before it is known; without a server not beyond `known`. */
  time(known = Infinity) {
    if (this.clock === null) return null;
    const t = this.timeAt(performance.now()), { kind, since, ended } = this.silence || {};
    const last = { over: since + AFTERWARDS, gone: Math.max(known, ended) }[kind] ?? Infinity;
    return Math.min(t, last);
  }

  /** The time of the day at a time of the fleet [ms since 1970]; null before it is known. */
  day(t) {
    if (this.clock === null) return null;
    return performance.timeOrigin + this.clock.heard + 1000 * (t - this.clock.now) / this.clock.speed;
  }

  timeAt(at) {
    return this.clock.now + this.clock.speed * (at - this.clock.heard) / 1000;
  }
}
