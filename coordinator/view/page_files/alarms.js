// Alarms: what needs a person, in groups, each with what can be done about it.

/** More alarms than these that say the same of several robots are one. */
const ALIKE = 3;

/** What an alarm says and asks for: those with the same are alike, and so are refused orders. */
function kindOf({ id, order, text, todo, is_acknowledged: seen }) {
  return [order && !isRefused(text) && id, todo, seen].join();
}

const isRefused = (text) => text.includes(" is refused: ");

function inWords(group) {
  const [{ robot, text: whole }] = group;
  if (group.length === 1) return whole;
  if (isRefused(whole)) return `${group.length} orders are refused: ${whole.split(": ").slice(1).join(": ")}`;
  const text = whole.replace(/\. It stands.*/, "");
  const names = group.map((one) => one.robot).sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
  const all = `${names.slice(0, ALIKE).join(", ")} and ${names.length - ALIKE} more`;
  const [one, many] = [[`${robot} is`, `${all} are`], [`${robot} stands`, `${all} stand`], [robot, all]]
    .find(([words]) => text.includes(words));
  return text.replace(one, many);
}

class AlarmList {
  /** `told`: acts(robot) that help it, buttons(robot, acts), show(robot) on the floor. */
  constructor(box, told) {
    this.box = box;
    this.told = told;
    /** The kinds of alarms that are told one by one, however many there are. */
    this.unfolded = new Set();
  }

  /** Show the alarms; return whether they have changed. */
  tell(alarms) {
    const actsOf = (alarm) => (alarm.order ? [] : this.told.acts(alarm.robot));
    const key = JSON.stringify([alarms, alarms.map(actsOf)]);
    if (key === this.key) return false;
    this.key = key;
    this.box.hidden = alarms.length === 0;
    const items = [...Map.groupBy(alarms, kindOf)].flatMap(([kind, group]) => {
      if (group.length <= ALIKE) return group.map((one) => this.item([one], actsOf(one)));
      const fold = element("button", { type: "button", className: "fold" });
      fold.textContent = this.unfolded.has(kind) ? "all as one" : "one by one";
      fold.addEventListener("click", () => {
        if (!this.unfolded.delete(kind)) this.unfolded.add(kind);
        this.key = null;
        this.tell(alarms);
        this.box.querySelector(".fold").focus();
      });
      const whole = this.item(group, [], fold);
      return this.unfolded.has(kind) ? [whole, ...group.map((one) => this.item([one], actsOf(one)))] : [whole];
    });
    this.box.firstElementChild.replaceChildren(...items);
    return true;
  }

  /** The entry of one alarm, or of a group that `fold` shows one by one. */
  item(group, acts, ...fold) {
    const [alarm] = group, seen = element("button", { type: "button", textContent: "mark as seen" });
    seen.title = "Somebody sees to it: it turns grey, and stays until its reason is over";
    seen.hidden = alarm.is_acknowledged || !mayCommand;
    seen.addEventListener("click", () => {
      for (const { id } of group) ask("POST", `alarms/${id}/acknowledge`);
    });
    const about = element("button", { type: "button", className: "about", textContent: inShort(inWords(group)) });
    about.addEventListener("click", () => this.told.show(alarm.robot));
    const since = element("span", { className: "number", textContent: clockFace(1000 * alarm.since) });
    const todo = element("span", { className: "todo", textContent: alarm.todo });
    const item = element("li", {}, since, about, todo, ...fold, ...this.told.buttons(alarm.robot, acts), seen);
    item.classList.toggle("seen", alarm.is_acknowledged);
    return item;
  }
}
