// The texts beside the pictures: the terms of the plan, every robot, what happened.

const byId = (name) => document.getElementById(name);

/** Change what is otherwise: the browser styles and lays out a page again even for the same. */
function update(box, properties) {
  for (const [name, value] of Object.entries(properties)) if (box[name] !== value) box[name] = value;
}

function write(box, text) {
  update(box, { textContent: text });
}

function element(name, properties, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

/** Which of some boxes are in sight. */
class Sight {
  constructor() {
    this.seen = new WeakSet();
    this.observer = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) this.seen[isIntersecting ? "add" : "delete"](target);
    });
  }

  watch(box) { this.observer.observe(box); }

  has(box) { return this.seen.has(box); }
}

/** Up to so many robots are listed without search and order. */
const FEW = 8;
/** The least lateness [s] that is told. */
const LATE = 0.2;

function said(robot, bodies, why) {
  if (!robot) return why;
  if (robot.state === "held") {
    return `held by ${bodies[robot.lets].id} since ${robot.held.since.toFixed(1)} s`;
  }
  if (robot.state === "drives" && robot.late > LATE) {
    return `${robot.v > STANDS ? "drives" : "stands"}, ${robot.late.toFixed(1)} s late`;
  }
  if (robot.state === "waits") {
    const left = `${(robot.wait.until - robot.plan).toFixed(1)} s`;
    return robot.lets >= 0 ? `waits for ${bodies[robot.lets].id}, ${left}` : `waits ${left}`;
  }
  const yields = robot.yields.map((one) => `${one.how} ${bodies[one.other].id}`);
  if (yields.length) return yields.join(", ");
  return { unheard: "no word, drawn at rest", awaited: "has not said hello" }[robot.state] ?? robot.state;
}

/** Show the terms of the plan, and the proof's verdict unless the fleet is silent. */
function describe(scene, unheard) {
  const count = scene.robots.length;
  write(byId("name"), scene.name);
  write(byId("terms"), `${count} robot${count === 1 ? "" : "s"} · τ ${scene.tau} s` +
    ` · margin ${scene.margin} m · policy ${scene.policy}`);
  const verdict = byId("verdict"), { epochs } = scene;
  const of = epochs.length > 1 ? `, epoch ${epochs[epochs.length - 1].epoch}` : "";
  const off = desk.offPath(), left = off.length > 1 ? "off their paths are" : "off its path is";
  const without = off.length ? `; ${off.join(", ")} ${left} not covered` : "";
  update(verdict, {
    hidden: scene.proven === null || unheard,
    textContent: scene.proven ? `newest plan proven${of}${without}` : `proof fails${of}`,
    title: "Robots that keep to their courses, as they were sent, touch nobody",
    className: scene.proven && !off.length ? "holds" : "fails",
  });
}

/** How much a robot's state needs a person: the lowest number first. */
const TROUBLE = [
  ["unheard"], ["lost", "no course", "not fit", "no way", "plan not heard", "stopped"], ["held"], ["waits"],
  ["brakes"], ["drives"],
];

/** What several robots do, where the word for one differs. */
const DOING = {
  waits: "waiting", drives: "driving", brakes: "braking", stands: "standing", unheard: "not heard",
  awaited: "not heard yet",
};

function rank(state) {
  const found = TROUBLE.findIndex((states) => states.includes(state));
  return found < 0 ? TROUBLE.length : found;
}

/** One row per robot: its colour, what it does, how far it has come. */
class RobotList {
  constructor(list, play, choose, hover) {
    this.bodies = play.scene.robots;
    this.rows = this.bodies.map((body, index) => {
      const [swatch, state, speed, bar] = ["swatch", "state", "number", "bar"]
        .map((className) => element("span", { className }));
      const button = element("button", { type: "button" },
        swatch, element("span", { className: "id", textContent: body.id }), state, speed,
        element("span", { className: "track" }, bar));
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => choose(index));
      button.addEventListener("pointerenter", () => hover(index));
      button.addEventListener("pointerleave", () => hover(-1));
      button.title = `Show ${body.id} alone`;
      return { button, swatch, state, speed, bar };
    });
    this.items = this.rows.map((row) => element("li", {}, row.button));
    list.replaceChildren(...this.items);
    this.sight = new Sight();
    for (const item of this.items) this.sight.watch(item);
    this.focus = -1;
    this.many = this.rows.length > FEW;
    byId("find").hidden = !this.many;
    list.classList.toggle("many", this.many);
  }

  paint(look) {
    this.rows.forEach((row, index) => row.swatch.style.setProperty("--colour", look.robot(index)));
  }

  choose(focus) {
    this.focus = focus;
    if (focus >= 0 && this.many) byId("robots").parentElement.scrollTop = 0;
    this.rows.forEach((row, index) => row.button.setAttribute("aria-pressed", String(index === focus)));
  }

  /** Tell what every robot does; in rows out of sight only what is new, unless `all` are told. */
  tell(found, reasons, orders, all) {
    this.rows.forEach((row, index) => {
      const robot = found[index], unheard = desk.isUnheard(this.bodies[index].id);
      const does = unheard ? "not heard" : said(robot, this.bodies, reasons[index]);
      row.text = orders.has(index) ? `${does} · ${orders.get(index)}` : does;
      const state = unheard ? "unheard" : robot ? robot.state : reasons[index];
      if (!all && row.button.dataset.state === state && !this.sight.has(this.items[index])) return;
      row.button.dataset.state = state;
      write(row.state, row.text);
      write(row.speed, robot && robot.v > 0.005 ? `${robot.v.toFixed(2)} m/s` : "");
      update(this.items[index].dataset, { gone: desk.isGone(this.bodies[index].id) ? "true" : "" });
      row.bar.style.scale = robot ? `${(robot.s / robot.length).toFixed(3)} 1` : "0 1";
    });
    this.sift();
  }

  /** Where a robot stands in the list: those in trouble on top, then, of many, the chosen one. */
  place(index, state, troubled) {
    const first = this.many && index === this.focus ? 1 : 0;
    if (state === "unheard" || troubled.has(index)) return -first;
    if (first || !this.many) return 2 - first;
    return byId("trouble").checked ? 2 + rank(state) : 2 + TROUBLE.length;
  }

  /** Show the robots that are looked for, in order; count them by what they do. */
  sift() {
    const troubled = desk.troubled();
    const wanted = byId("search").value.trim().toLowerCase();
    const counts = new Map();
    this.rows.forEach((row, index) => {
      const { state } = row.button.dataset, item = this.items[index], isGone = Boolean(item.dataset.gone);
      if (!isGone) counts.set(state, (counts.get(state) || 0) + 1);
      const order = this.place(index, state, troubled);
      if (item.style.order !== String(order)) item.style.order = order;
      const told = `${this.bodies[index].id} ${row.text}`.toLowerCase();
      update(item, { hidden: isGone || !told.includes(wanted) });
    });
    const told = [...counts].sort(([a], [b]) => rank(a) - rank(b))
      .map(([state, count]) => `${count} ${DOING[state] ?? state}`);
    write(byId("robots-title"), `Robots: ${told.join(", ")}`);
  }
}

/** The marks: ticks on the slider, and a list of buttons that jump to each and to each reason. */
class EventList {
  /** `show` is called with the mark that somebody chooses; the newest one stands on top. */
  constructor(list, ticks, play, reasons, show, day) {
    const marks = [...play.scene.marks, ...reasons].sort((a, b) => a.t - b.t);
    this.box = byId("events-title").parentElement;
    this.box.hidden = marks.length === 0;
    this.list = list;
    this.times = marks.map((mark) => mark.t);
    this.newest = null;
    list.replaceChildren(...marks.toReversed().map((mark) => {
      const button = element("button", { type: "button" },
        element("span", { className: "number", textContent: moment(mark.t, day) }),
        element("span", { className: `mark ${mark.kind}` }),
        element("span", { textContent: mark.text }));
      button.addEventListener("click", () => show(mark));
      return element("li", {}, button);
    }));
    ticks.replaceChildren(...play.scene.marks.map((mark) => {
      const tick = element("span", { className: `mark ${mark.kind}` });
      tick.style.setProperty("--t", Math.max(mark.t - play.scene.begin, 0));
      return tick;
    }));
  }

  /** Highlight the newest event at a time, and scroll to it when it changes. */
  tell(t) {
    const newest = this.times.findLastIndex((time) => time <= t + 0.05);
    if (newest === this.newest) return;
    this.newest = newest;
    const now = this.times.length - 1 - newest;
    [...this.list.children].forEach((row, index) => {
      if (index === now) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
    });
    const row = this.list.children[Math.min(now, this.times.length - 1)];
    if (!row) return;
    const box = this.box.getBoundingClientRect(), { top, bottom } = row.getBoundingClientRect();
    if (bottom > box.bottom) this.box.scrollTop += bottom - box.bottom + 6;
    else if (top < box.top) this.box.scrollTop -= box.top - top + 6;
  }
}

/** Numbers beside the pointer. */
class Tip {
  constructor(box) {
    this.box = box;
  }

  tell(play, index, t, found, x, y) {
    const robot = found[index];
    this.box.hidden = !robot;
    if (!robot) return;
    const bodies = play.scene.robots, lines = [
      said(robot, bodies),
      `${robot.s.toFixed(2)} of ${robot.length.toFixed(2)} m, ${robot.v.toFixed(2)} m/s`,
      `at ${robot.x.toFixed(2)}, ${robot.y.toFixed(2)} m`,
    ];
    const near = this.nearest(found, index);
    if (near) lines.push(`${near.away.toFixed(2)} m to ${bodies[near.other].id}`);
    const truth = play.truth(index, t);
    if (truth) {
      const off = 1000 * Math.hypot(truth.x - robot.x, truth.y - robot.y);
      lines.push(`true place ${off.toFixed(0)} mm off${truth.over ? ", when last recorded" : ""}`);
    }
    this.box.replaceChildren(element("strong", { textContent: bodies[index].id }),
      ...lines.map((line) => element("span", { textContent: line })));
    const room = this.box.parentElement.getBoundingClientRect();
    this.box.style.left = `${Math.max(Math.min(x + 14, room.width - this.box.offsetWidth - 4), 4)}px`;
    this.box.style.top = `${Math.max(Math.min(y + 14, room.height - this.box.offsetHeight - 4), 4)}px`;
  }

  nearest(found, index) {
    let best = null;
    found.forEach((robot, other) => {
      if (!robot || other === index) return;
      const away = Math.hypot(robot.x - found[index].x, robot.y - found[index].y);
      if (!best || away < best.away) best = { other, away };
    });
    return best;
  }
}
