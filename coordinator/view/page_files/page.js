// The page: time, controls, and what happens when.

const live = document.documentElement.dataset.live === "true";
const shown = { paths: true, zones: true, waits: true, heat: false, chart: true, ghosts: true };
const controls = {
  play: byId("play"), shape: byId("play-shape"), slider: byId("slider"), clock: byId("clock"),
  phase: byId("phase"), speed: byId("speed"), follow: byId("follow"),
};
const lens = new Lens();
const tip = new Tip(byId("tip"));
const flow = new Flow(byId("flow"));
const ENLARGED = 1.5;
const TIMELESS = new Set(["+", "=", "-", "0", ".", ">", ",", "<", "Escape"]);
const PHASES = { hold: "ready", go: "go", stop: "told to stop", freeze: "frozen", arrived: "arrived" };

let look = new Look();
const floor = new FloorView(byId("floor"), shown, lens);
const diagram = new DiagramView(byId("diagram"));
let play, robots, events, eventsKey, axis;
let now = 0, running = false, focus = -1, hover = -1, stale = true;
let pointer = null, preview = null;
let listed = -Infinity, listedAll = -Infinity, following = live, names = null;

function load(scene) {
  const first = !play;
  play = new Play(scene);
  floor.show(play);
  diagram.show(play);
  const found = scene.robots.map((robot) => robot.id).join();
  if (found !== names) {
    robots = new RobotList(byId("robots"), play, chooseToggled, hoverOver);
    robots.paint(look);
    robots.choose(focus);
    listed = -Infinity;
    if (mayCommand && !names) byId("show-chart").checked = shown.chart = scene.robots.length <= FEW;
  }
  names = found;
  desk.offer(scene.robots.map((robot) => robot.id));
  if (orders.show(play) && !isWatched()) listed = -Infinity;
  describe(scene, live && isUnheard());
  update(byId("ghosts-label"), { hidden: scene.ghosts.length === 0 });
  setEnd(live ? roundedUp(scene.end) : scene.end);
  presume();
  now = first ? scene.begin : Math.max(now, scene.begin);
  stale = true;
}

const desk = new Desk({
  names: () => play.scene.robots.map((robot) => robot.id),
  chosen: () => focus,
  choose: (index) => { if (index !== focus) chooseToggled(index < 0 ? focus : index); },
  show,
  robotOf: (id) => orders.robotOf(id, word.time() ?? now),
  changed: () => { stale = true; listed = -Infinity; },
});
const orders = new OrderList(byId("orders"), day, chooseToggled, mayCommand ? (id) => desk.cancel(id) : null);

/** List what happens, and why the chosen robot does what it does; in a small fleet, why all do. */
function list() {
  const told = focus >= 0 || play.scene.robots.length <= FEW;
  const reasons = told ? play.reasons(focus) : [];
  const key = JSON.stringify([play.scene.marks, play.scene.begin, reasons]);
  if (events && key === eventsKey) return;
  eventsKey = key;
  listed = -Infinity;
  if (events) hurry();
  events = new EventList(byId("events"), byId("ticks"), play, reasons, showMark, day);
}

/** The time of the day at a time [ms since 1970]; null if it is not known. */
function day(t) {
  const { scene } = play;
  if (live) return word.day(t);
  return scene.day === null ? null : scene.day + 1000 * t / scene.speed;
}

/** Show when, and to whom, something happened. */
function showMark({ t, robot }) {
  setFollowing(false);
  seek(t);
  if (robot !== undefined && robot >= 0 && robot !== focus) chooseToggled(robot);
}

function hoverOver(index) {
  hover = index;
  stale = true;
}

/** The end of a running fleet's time axis: it stays for a while, since drawing it anew is slow. */
const roundedUp = (t) => Math.ceil(t / 10) * 10;

function setEnd(end) {
  play.scene.end = end;
  const { begin } = play.scene, key = [begin, end].join();
  if (key === axis) return;
  axis = key;
  Object.assign(controls.slider, { min: begin, max: end });
  byId("ticks").style.setProperty("--end", end - begin);
  byId("end").textContent = `of ${end.toFixed(1)} s`;
}

function seek(t) {
  now = Math.min(Math.max(t, play.scene.begin), play.scene.end);
  stale = true;
}

function setRunning(on) {
  if (on && now >= play.scene.end) now = play.scene.begin;
  running = on;
  controls.play.setAttribute("aria-label", on ? "Pause" : "Play");
  controls.shape.setAttribute("d", on ? "M3 1.5h3.5v13H3zM9.5 1.5H13v13H9.5z" : "M3 1.5 14 8 3 14.5z");
}

function setFollowing(on) {
  following = live && on;
  controls.follow.setAttribute("aria-pressed", String(following && !word.silence));
}

function chooseToggled(index) {
  focus = focus === index ? -1 : index;
  robots.choose(focus);
  desk.chosen(focus);
  list();
  stale = true;
}

/** Choose a robot and bring it into sight. */
function show(index) {
  if (index !== focus) chooseToggled(index);
  const robot = play.robot(index, now);
  if (robot) lens.to(robot);
  byId("floor").scrollIntoView({ block: "nearest" });
  stale = true;
}

/** Draw everything as it is now. */
function draw() {
  const found = play.scene.robots.map(({ id }, index) => {
    if (following && desk.isGone(id)) return null;
    const robot = play.robot(index, now), isUnheard = following && desk.isUnheard(id);
    if (robot && following && desk.isAwaited(id)) return { ...robot, v: 0, state: "awaited" };
    const rests = ["unheard", "arrived"].includes(robot?.state);
    if (following && rests && desk.isBack(id)) return { ...robot, state: "no course" };
    return robot && isUnheard ? { ...robot, v: 0, state: "unheard" } : robot;
  });
  floor.draw(now, found, focus, hover, look, desk.troubled());
  if (shown.heat) flow.draw(floor, floor.sheet.pen, look);
  desk.draw(floor, floor.sheet.pen, look, found);
  if (shown.chart) diagram.draw(now, found, focus, hover, look);
  if (preview !== null && hover >= 0) {
    floor.preview(play.robot(hover, preview), hover, preview, look);
    if (shown.chart) diagram.preview(preview, look);
  }
  if (pointer) tip.tell(play, hover, now, found, pointer.x, pointer.y);
  tell(found);
}

/** Tell in words how everything is now; seldom while it moves. */
function tell(found) {
  const time = performance.now(), isSoon = time - listed < textsStay();
  if (following && isSoon) return;
  controls.slider.value = now;
  write(controls.clock, `${now.toFixed(1)} s`);
  if (running && isSoon) return;
  listed = time;
  const all = !isWatched() || !many() || time - listedAll > 5000;
  if (all) listedAll = time;
  const epoch = play.epochAt(now), phase = play.unheardAt(now) ? "no word" : PHASES[play.phaseAt(now)];
  const text = play.epochs.length > 1 || play.scene.source === "log" ? `epoch ${epoch.epoch}, ${phase}` : "";
  write(controls.phase, text);
  controls.slider.setAttribute("aria-valuetext", `${now.toFixed(1)} seconds${text ? `, ${text}` : ""}`);
  const at = day(now);
  write(byId("day"), at === null ? "" : clockFace(at));
  events.tell(now);
  flow.look(play, now);
  desk.tellState(following ? found : null, isUnheard());
  const busy = orders.tell(now, found, look, all);
  robots.tell(found, play.scene.robots.map((_, index) => play.why(index, now)), busy, all);
}

const hand = new Hand(byId("floor"), lens, () => floor, {
  changed: seenOtherwise,
  leave,
  point: (place) => {
    pointer = place;
    floor.tellWhere(pointer);
    hoverOver(floor.pick(place.x, place.y));
  },
  press: () => {
    if (hover >= 0) chooseToggled(hover);
    else if (!desk.pick(pointer && floor.placeAt(pointer)) && focus >= 0) chooseToggled(focus);
  },
});

/** While only a part of the floor is seen, a finger moves the floor and not the page. */
function seenOtherwise() {
  const part = lens.factor > 1;
  byId("floor").classList.toggle("part", part);
  byId("zoom-all").hidden = !part;
  stale = true;
}

function seeAll() {
  lens.all();
  seenOtherwise();
}

function leave() {
  pointer = preview = null;
  floor.tellWhere(null);
  byId("tip").hidden = true;
  hoverOver(-1);
}

function repaint() {
  look = new Look();
  robots.paint(look);
  stale = true;
}

/** What is known of a running fleet, and of its clock, which the page follows. */
const word = new Word({
  scene: load,
  late: (found) => { play.learn(found); },
  fleet: (found) => {
    const isTurn = desk.fleet && desk.fleet.phase !== found.phase;
    desk.hear(found);
    describe(play.scene, isUnheard());
    if (isTurn) turn();
  },
  gone: (found) => desk.forget(found),
  changed: () => {
    presume();
    tellWord();
  },
});

/** While the fleet is silent, draw robots where their authority has stopped them, and list it. */
function presume() {
  const { silence } = word, heard = play.heardMarks || play.scene.marks;
  play.heardMarks = heard;
  play.scene.marks = [...heard, ...word.marks()].sort((a, b) => a.t - b.t);
  const since = silence && silence.kind !== "over" ? silence.since : null;
  play.known = play.presume(since, since === null ? 0 : silence.headroom);
  list();
  stale = true;
}

function tellWord() {
  const { silence } = word;
  const since = silence && silence.since !== null ? ` since ${silence.since.toFixed(1)} s` : "";
  byId("word").textContent = silence && silence.why ? silence.why + since : "";
  controls.follow.textContent = silence ? silence.lamp : "live";
  describe(play.scene, isUnheard());
  setFollowing(following);
}

/** Whether the fleet is silent, so that its present plan is not known. */
const isUnheard = () => Boolean(word.silence && word.silence.kind !== "over");

function followLive() {
  const t = word.time(play.known);
  if (t === null) return;
  if (t > play.scene.end) setEnd(roundedUp(t));
  seek(t);
}

for (const name of ["search", "trouble"]) {
  byId(name).addEventListener("input", () => { listed = -Infinity; stale = true; });
}
load(JSON.parse(byId("scene").textContent));
watchDiagram(byId("diagram"));
document.addEventListener("keydown", pressed);
controls.play.addEventListener("click", () => { setFollowing(false); setRunning(!running); });
controls.slider.addEventListener("input", () => {
  setFollowing(false);
  seek(Number(controls.slider.value));
});
controls.follow.addEventListener("click", () => setFollowing(!following));
for (const name of Object.keys(shown)) {
  byId(`show-${name}`).addEventListener("change", (event) => {
    shown[name] = event.target.checked;
    stale = true;
  });
}
const watcher = new ResizeObserver(() => {
  Sheet.layouts++;
  stale = true;
  hurry();
});
for (const id of ["floor", "diagram"]) watcher.observe(byId(id));
byId("zoom-in").addEventListener("click", () => hand.enlarge(ENLARGED));
byId("zoom-out").addEventListener("click", () => hand.enlarge(1 / ENLARGED));
byId("zoom-all").addEventListener("click", seeAll);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
controls.follow.hidden = !live;
if (live) word.listen();
