// The orders: which wait, are under way and are over, with whom and when.

const ORDER_STATES = ["waiting", "under way", "done", "cancelled", "refused"];
const [WAITING, UNDER_WAY, DONE] = [0, 1, 2];
/** The coordinator's own orders: what they are, and what their robots do where no reason is said. */
const OWN = {
  room: { name: "aside", words: "makes room" }, way: { name: "detour", words: "goes another way" },
};
const own = (id) => OWN[id.match(/^(room|way)-\d+$/)?.[1]];
/** A text with short names of orders. */
const inShort = (text) => text.replace(/\b(order-[0-9a-f]{4})[0-9a-f]{4}\b/g, "$1")
  .replace(/\broom-\d+\b/g, "a move aside").replace(/\bway-\d+\b/g, "a detour");
/** So many orders that are over are listed, the last ones. */
const LISTED = 30;

const clockFace = (ms) => new Date(ms).toTimeString().slice(0, 8);

/** A time in words: the time of the day, where it is known, and the seconds. */
function moment(t, day) {
  const seconds = `${t.toFixed(1)} s`, at = day(t);
  return at === null ? seconds : `${clockFace(at)} · ${seconds}`;
}

/** What becomes of an order at a time: {id, since, state, robot, planned, reason, arrived}; else null. */
function orderAt(order, t) {
  const step = order.steps.findLast((one) => one[0] <= t);
  if (!step) return null;
  const [since, state, robot, planned, reason] = step;
  const arrived = order.arrived !== null && order.arrived <= t && state !== WAITING ? order.arrived : null;
  return { id: order.id, since, state, robot, planned, reason, arrived, given: order.steps[0][0] };
}

const isSilent = (robot) => Boolean(robot && robot.state === "unheard");

/** One row per order: those under way, those that wait, then the last ones that are over. */
class OrderList {
  /** `cancel` takes an order back by its id; null where that cannot be done. */
  constructor(list, day, choose, cancel = null) {
    this.cancel = cancel;
    this.day = day;
    this.choose = choose;
    this.list = list;
    this.title = byId("orders-title");
    this.rows = [];
    this.sight = new Sight();
  }

  /** Show the orders of another scene; return whether they have changed.  Rows stay, so that nothing moves. */
  show(play) {
    const steps = (one) => one.scene.orders.map((order) => order.steps.length).join();
    const changed = Boolean(this.play) && steps(play) !== steps(this.play);
    this.play = play;
    return changed;
  }

  /** The robot that does an order at a time; -1 before one is known, null once it is over. */
  robotOf(id, t) {
    const order = this.play.scene.orders.find((one) => one.id === id), found = order && orderAt(order, t);
    if (!found) return -1;
    return found.state === UNDER_WAY || found.state === WAITING ? found.robot : null;
  }

  /** The orders at a time, in the order of the list. */
  at(t) {
    const found = this.play.scene.orders.map((order) => orderAt(order, t)).filter(Boolean);
    const of = (...states) => found.filter((one) => states.includes(one.state));
    const over = of(2, 3, 4).sort((a, b) => b.since - a.since);
    const going = of(UNDER_WAY).sort((a, b) => a.planned - b.planned);
    return { found, listed: [...going, ...of(WAITING), ...over.slice(0, LISTED)] };
  }

  /** Tell the orders at a time; in rows out of sight only if `all` are told. */
  tell(t, robots, look, all) {
    const { found, listed } = this.at(t);
    update(this.title.parentElement, { hidden: found.length === 0 });
    const counts = ORDER_STATES.map((name, state) => [name, found.filter((one) => one.state === state).length]);
    const told = counts.filter(([, count]) => count).map(([name, count]) => `${count} ${name}`);
    write(this.title, ["Orders", ...told.length ? [told.join(", ")] : []].join(": "));
    while (this.rows.length < listed.length) this.rows.push(this.row());
    this.rows.forEach((row, i) => {
      const one = listed[i];
      update(row.item, { hidden: !one });
      if (one && (all || this.sight.has(row.item))) this.fill(row, one, robots[one.robot], t, look);
    });
    const going = listed.filter((one) => one.state === UNDER_WAY).reverse(); // The first one stands, of two.
    return new Map(going.map((one) => [one.robot, own(one.id) ? this.owns(one) : inShort(one.id)]));
  }

  row() {
    const parts = ["swatch", "id", "state", "number"].map((className) => element("span", { className }));
    const button = element("button", { type: "button" }, ...parts), item = element("li", {}, button);
    const row = { item, button, parts, robot: -1, id: "" };
    if (this.cancel) {
      row.end = element("button", { type: "button", className: "cancel", textContent: "cancel" });
      row.end.addEventListener("click", () => this.cancel(row.id));
      item.append(row.end);
    }
    button.addEventListener("click", () => { if (row.robot >= 0) this.choose(row.robot); });
    this.list.append(item);
    this.sight.watch(item);
    return row;
  }

  fill(row, one, robot, t, look) {
    const [swatch, id, state, number] = row.parts, known = one.robot >= 0;
    row.robot = one.robot;
    row.id = one.id;
    if (row.end) {
      const isOver = one.state !== UNDER_WAY && one.state !== WAITING;
      update(row.end, { hidden: isOver, ariaLabel: `Cancel ${one.id}` });
    }
    update(row.button.dataset, { state: ORDER_STATES[one.state] });
    const colour = known ? look.robot(one.robot) : "transparent";
    if (row.colour !== colour) swatch.style.setProperty("--colour", row.colour = colour);
    write(id, own(one.id)?.name ?? inShort(one.id));
    update(row.button, { title: `${one.id}, given ${this.when(one.given)}` });
    write(state, this.words(one, robot, t));
    write(number, this.timeOf(one, robot, t));
  }

  /** The time of the day, where it is known, else the seconds. */
  when(t) {
    const at = this.day(t);
    return at === null ? `${t.toFixed(1)} s` : clockFace(at);
  }

  /** The time that matters of an order, and which one it is. */
  timeOf(one, robot, t) {
    if (one.arrived !== null) return `at ${this.when(one.arrived)}`;
    if (one.state === WAITING || isSilent(robot) && one.state === UNDER_WAY) return `given ${this.when(one.given)}`;
    if (one.state !== UNDER_WAY || one.planned === null) return `at ${this.when(one.since)}`;
    if (this.play.phaseAt(t) === "stop") return "once the fleet goes on";
    const late = this.late(one, robot, t), due = late >= 1 ? `due ${this.when(one.planned)}, ` : "";
    return `${due}about ${this.when(one.planned + Math.max(late, 0))}`;
  }

  /** How much later than planned [s] a robot does an order. */
  late(one, robot, t) {
    if (one.arrived !== null) return one.arrived - one.planned;
    return robot && robot.motion ? robot.late + this.play.putOff(t) - this.play.putOff(one.since) : 0;
  }

  /** What a robot does by an order of the coordinator's own, and for whom, where that is said. */
  owns({ id, state, reason, robot }) {
    const said = state === UNDER_WAY && reason, { orders, robots } = this.play.scene;
    const whose = said && orders.find((one) => said.endsWith(` ${one.id}`)), by = whose ? whose.steps.at(-1)[2] : -1;
    return by < 0 || by === robot ? inShort(said || own(id).words) : said.replace(/\S+$/, robots[by].id);
  }

  words(one, robot, t) {
    const name = one.robot < 0 ? "" : this.play.scene.robots[one.robot].id, late = this.late(one, robot, t);
    const lateness = one.planned !== null && late > LATE ? `, ${late.toFixed(1)} s late` : "";
    if (isSilent(robot) && [WAITING, UNDER_WAY].includes(one.state)) return `waits for ${name} to come back`;
    if (own(one.id) && [WAITING, UNDER_WAY].includes(one.state)) return `${name} ${this.owns(one)}${lateness}`;
    if (one.state === UNDER_WAY) {
      return `${name} ${one.arrived === null ? "arrives" : "is at the goal"}${lateness}`;
    }
    if (one.state === DONE) return `${name} was there${lateness}`;
    if (one.state === WAITING) return inShort(one.reason) || (name ? `${name} gets a course` : "gets a robot");
    return one.reason ? `${ORDER_STATES[one.state]}: ${inShort(one.reason)}` : ORDER_STATES[one.state];
  }
}
