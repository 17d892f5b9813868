// Alarms: what needs a person, in groups, each with what can be done about it.

/** More alarms than these that say the same of several robots are one. */
const ALIKE = 3;

/** Alarms in groups that say the same and ask for the same. */
function grouped(alarms) {
  const what = ({ id, order, todo, is_acknowledged: seen }) => [order && id, todo, seen].join();
  return [...Map.groupBy(alarms, what).values()].flatMap((group) =>
    (group.length > ALIKE ? [group] : group.map((one) => [one])));
}

function inWords([first, ...others]) {
  if (!others.length) return first.text;
  const names = [first, ...others.slice(0, ALIKE - 1)].map(({ robot }) => robot).join(", ");
  const all = `${names} and ${others.length + 1 - ALIKE} more`;
  const text = first.text.replace(/;.*/, ""), { robot } = first;
  return text.replace(`${robot} is`, `${all} are`).replace(`${robot} stands`, `${all} stand`).replace(robot, all);
}

class AlarmList {
  /** `told`: acts(robot) that help it, buttons(robot, acts), show(robot) on the floor. */
  constructor(box, told) {
    this.box = box;
    this.told = told;
  }

  tell(alarms) {
    const actsOf = (alarm) => (alarm.order ? [] : this.told.acts(alarm.robot));
    const key = JSON.stringify([alarms, alarms.map(actsOf)]);
    if (key === this.key) return;
    this.key = key;
    this.box.hidden = alarms.length === 0;
    this.box.firstElementChild.replaceChildren(...grouped(alarms).map((group) => this.item(group, actsOf(group[0]))));
  }

  /** The entry of a group; several robots are acted on in the list of robots. */
  item(group, acts) {
    const [alarm] = group, seen = element("button", { type: "button", textContent: "seen" });
    seen.hidden = alarm.is_acknowledged || !mayCommand;
    seen.addEventListener("click", () => {
      for (const { id } of group) ask("POST", `alarms/${id}/acknowledge`);
    });
    const about = element("button", { type: "button", className: "about", textContent: inWords(group) });
    about.addEventListener("click", () => this.told.show(alarm.robot));
    const since = element("span", { className: "number", textContent: clockFace(1000 * alarm.since) });
    const todo = element("span", { className: "todo", textContent: alarm.todo });
    const buttons = group.length > 1 ? [] : this.told.buttons(alarm.robot, acts);
    const item = element("li", {}, since, about, todo, ...buttons, seen);
    item.classList.toggle("seen", alarm.is_acknowledged);
    return item;
  }
}
