// The operator's desk: what the fleet is told.

/** For so long [ms] a button says that it was pressed; the fleet answers sooner. */
const ASKED_MS = 5000;
const ANSWER_STAYS_MS = 2000;

class Desk {
  /**
   * `told`: names() of the robots, chosen() and choose(index), show(index) on the floor,
   * robotOf(id) of an order (-1: none yet, null: it is over), changed() when the floor looks otherwise.
   */
  constructor(told) {
    this.told = told;
    this.goal = null;
    this.answers = [];
    /** The orders that were sent from here and are not over, each with its id; null until that is known. */
    this.asked = new Map();
    this.closed = new ClosedPlaces(byId("blocks"), told.changed, (text) => this.say(text));
    this.alarms = new AlarmList(byId("alarms"), {
      acts: (name) => this.acts(name),
      buttons: (name, acts) => this.buttons(name, acts),
      show: (name) => {
        const index = told.names().indexOf(name);
        if (index >= 0) told.show(index);
      },
    });
    this.fleet = null;
    /** Whether a fleet that has yet to set out was stopped from here. */
    this.isHeld = false;
    this.robots = new Map();
    /** What was asked for a robot a moment ago. */
    this.pressed = new Map();
    this.form = byId("order-form");
    const isStopped = () => this.fleet?.phase === "stop";
    this.outlook = new Outlook(byId("outlook"), () => this.order(), isStopped, told.changed);
    byId("command").hidden = byId("give").hidden = byId("end-mission").hidden = !mayCommand;
    if (!mayCommand) return;
    byId("space-does").textContent = "STOP: all robots brake at once";
    const on = (name, act) => byId(name).addEventListener("click", act);
    on("stop", () => this.stop());
    on("go-on", async () => {
      if (await this.command("go on", "POST", "resume", "the fleet goes on")) this.isHeld = false;
    });
    on("end-mission", async () => {
      if (!window.confirm("End the mission when all robots rest? It takes no further orders.")) return;
      const found = await this.command("end", "POST", "end", "the fleet ends when all robots rest");
      if (found) update(byId("end-mission"), { disabled: true, textContent: "mission ends" });
    });
    on("close-place", async () => {
      if (this.goal === null) this.say("click a place on the floor first", true);
      else if (await this.closed.close(this.goal)) this.clear();
    });
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.send();
    });
    byId("order-place").addEventListener("input", () => this.readGoal());
    byId("order-robot").addEventListener("change", () => {
      this.told.choose(this.told.names().indexOf(this.whose()));
      this.readGoal();
    });
    for (const name of ["order-dwell", "order-priority", "order-now"]) {
      byId(name).addEventListener("input", () => this.readGoal());
    }
  }

  /** Tell what has been answered, for a while; an answer a moment ago stays beside a new one. */
  say(text, isWrong = false, isAnswer = true) {
    const box = byId("answer"), at = performance.now();
    const stays = (one) => one.isAnswer && one.isWrong === isWrong && at - one.at < ANSWER_STAYS_MS;
    this.answers = text ? [{ text, at, isAnswer, isWrong }, ...this.answers.filter(stays).slice(0, 1)] : [];
    box.textContent = inShort(this.answers.map((one) => one.text).join("; "));
    box.classList.toggle("fails", isWrong);
    clearTimeout(this.fades);
    this.fades = setTimeout(() => { box.textContent = ""; }, 15000);
  }

  /** Ask for something, and say so until it is answered. */
  async command(what, method, path, done) {
    this.say(`asked: ${what}`, false, false);
    const found = await ask(method, path);
    if (found) this.say(done ?? found.text);
    return found;
  }

  async stop() {
    const found = await this.command("STOP", "POST", "freeze", "");
    this.isHeld = ["hold", "freeze"].includes(found?.phase);
  }

  /** Take in news of the fleet; only robots that have changed are in it. */
  hear(fleet) {
    for (const robot of fleet.robots) this.robots.set(robot.id, robot);
    this.closed.hear(fleet.blocks);
    this.fleet = fleet;
    if (this.alarms.tell(fleet.alarms)) this.told.changed();
    this.tellActs();
    update(byId("end-mission"), { hidden: fleet.phase === "over" || !mayCommand });
  }

  /** Tell what the fleet does; `found`: its robots now, null if they are not shown. */
  tellState(found, isUnheard) {
    if (!mayCommand || !this.fleet) return;
    const { phase, is_heard: isHeard } = this.fleet;
    this.isHeld &&= ["hold", "freeze"].includes(phase);
    tellFleet(isUnheard || !isHeard ? "unheard" : this.isHeld ? "held" : phase, found);
  }

  /** Robots off their paths: no proof speaks of them. */
  offPath() {
    return [...this.robots.values()].filter(({ fault }) => fault === "off its path").map(({ id }) => id);
  }

  /** The numbers of the robots that alarms are about. */
  troubled() {
    const alarms = this.fleet ? this.fleet.alarms : [], names = this.told.names();
    return new Set(alarms.filter((one) => !one.order).map((one) => names.indexOf(one.robot)));
  }

  /** Whether the coordinator is heard, and a robot that was is not any more. */
  isUnheard(name) {
    const robot = this.robots.get(name);
    return Boolean(this.fleet && this.fleet.is_heard && robot && robot.age !== null && !robot.is_heard);
  }

  /** Whether a robot is yet to be heard, in a fleet that is yet to set out. */
  isAwaited(name) {
    return this.fleet?.phase === "hold" && (this.robots.get(name)?.age ?? null) === null;
  }

  /** Whether a robot has left the fleet. */
  isGone(name) {
    return Boolean(this.fleet) && this.fleet.phase !== "hold" && this.robots.size > 0 && !this.robots.has(name);
  }

  /** Whether a robot is heard, but has no course and no order that will give it one. */
  isBack(name) {
    const robot = this.robots.get(name);
    return Boolean(this.fleet?.is_heard && robot?.is_heard && robot.phase === "idle" && !robot.order);
  }

  forget(names) {
    for (const name of names) this.robots.delete(name);
  }

  /** What can be done with a robot, {act, later: why not yet}: one that drives is left alone. */
  acts(name) {
    const robot = this.robots.get(name), leave = { act: "leave", later: "" };
    const asked = this.pressed.get(name) === "admit" ? "(asked)" : "";
    if (!robot || !mayCommand) return [];
    if (!robot.is_heard) return [{ act: "admit", later: "once heard" }, leave];
    if (["idle", "frozen"].includes(robot.phase)) return [{ act: "admit", later: asked }, leave];
    return robot.phase === "done" ? [leave] : [];
  }

  /** Buttons that do this with a robot, and name it. */
  buttons(name, acts) {
    return acts.map(({ act, later }) => {
      const { words, title } = ACTS[act];
      const button = element("button", {
        type: "button", textContent: `${words} ${name} ${later}`.trim(), disabled: Boolean(later),
        title: later.endsWith("heard") ? "It is not heard: start its program where it stands first" : title,
      });
      button.dataset.act = act;
      button.addEventListener("click", () => this.robot(name, act));
      return button;
    });
  }

  /** Offer what can be done with the chosen robot. */
  tellActs() {
    const name = this.whose(), acts = this.acts(name), key = JSON.stringify([name, acts]);
    if (key === this.offered) return;
    this.offered = key;
    byId("robot-acts").replaceChildren(...this.buttons(name, acts));
  }

  /** Offer the robots that there are. */
  offer(names) {
    const key = names.join();
    if (key === this.names) return;
    this.names = key;
    const option = (value, textContent) => element("option", { value, textContent });
    const robots = names.map((name) => option(name, name));
    byId("order-robot").replaceChildren(option("", "any robot"), ...robots);
    this.chosen(this.told.chosen());
  }

  /** A robot was chosen; -1: none. */
  chosen(index) {
    if (!mayCommand) return;
    const name = this.told.names()[index] ?? "";
    byId("order-robot").value = name;
    this.tellActs();
    this.readGoal();
  }

  whose() {
    return byId("order-robot").value;
  }

  /** A place of the floor was clicked; return whether it is taken as a goal. */
  pick(place) {
    if (!mayCommand || !place) return false;
    byId("order-place").value = `${place.x.toFixed(2)}, ${place.y.toFixed(2)}`;
    this.readGoal();
    return true;
  }

  readGoal() {
    const numbers = byId("order-place").value.split(/[\s,;]+/).filter(Boolean).map(Number);
    const fits = [2, 3].includes(numbers.length) && numbers.every(Number.isFinite);
    this.goal = fits ? numbers : null;
    const isNobodys = byId("order-now").checked && !this.whose();
    byId("order-send").disabled = !fits || isNobodys;
    write(byId("needs"), isNobodys ? "choose whom to redirect" : "click a place first");
    byId("needs").hidden = fits && !isNobodys;
    this.outlook.look();
    this.told.changed();
  }

  /** The order that is chosen; null before a place is. */
  order() {
    const number = (name) => Number(byId(name).value) || 0;
    return this.goal && {
      goal: this.goal, robot: this.whose(), dwell: number("order-dwell"), priority: number("order-priority"),
      now: byId("order-now").checked,
    };
  }

  async send() {
    const order = this.order();
    if (order === null) return;
    this.clear();
    this.say(`asked: ${order.robot || "any robot"} to ${order.goal.join(", ")}`, false, false);
    this.asked.set(order, null);
    const found = await ask("POST", "orders", order);
    if (found === null) {
      this.asked.delete(order);
      this.chooseAgain(order);
      return;
    }
    this.asked.set(order, found.id);
    this.say(`${found.id} is taken${found.robot ? ` for ${found.robot}` : ""}`);
  }

  /** Choose what was refused, so that it can be corrected, unless something else is chosen by now. */
  chooseAgain({ goal, robot, now }) {
    if (byId("order-place").value || this.whose() !== robot) return;
    byId("order-place").value = goal.join(", ");
    byId("order-now").checked = now;
    this.readGoal();
  }

  /** Forget the place that was clicked. */
  clear() {
    byId("order-place").value = "";
    byId("order-now").checked = false;
    this.readGoal();
  }

  cancel(id) {
    this.command(`cancel ${id}`, "DELETE", `orders/${id}`, `${id} is cancelled`);
  }

  robot(name, act) {
    const question = `Take ${name} out of the fleet? Others will drive where it stands: carry it away first.`;
    if (act === "leave" && !window.confirm(question)) return;
    this.pressed.set(name, act);
    setTimeout(() => this.pressed.delete(name), ASKED_MS);
    this.command(`${ACTS[act].words} ${name}`, "POST", `robots/${name}/${act}`);
  }

  /** Draw closed places, whom alarms are about, and the goal that is being chosen. */
  draw(view, pen, look, found) {
    const names = this.told.names();
    for (const index of this.troubled()) {
      if (!found[index]) continue;
      drawStretch(view, pen, look, this.robots.get(names[index]));
      view.ring(pen, found[index], index, look.red, 4);
    }
    this.drawAsked(view, pen, look);
    this.closed.draw(view, pen, look);
    if (this.goal === null) return;
    this.outlook.draw(view, pen, look);
    drawTarget(view, pen, this.goal, look.ink);
  }

  /** Draw the places to which robots were sent from here, in their colours, until their orders are over. */
  drawAsked(view, pen, look) {
    for (const [order, id] of this.asked) {
      const robot = this.told.robotOf(id);
      if (robot === null) this.asked.delete(order);
      const index = robot ?? -1, known = index >= 0 ? index : this.told.names().indexOf(order.robot);
      if (robot !== null) drawTarget(view, pen, order.goal, known < 0 ? look.ink : look.robot(known));
    }
  }
}
