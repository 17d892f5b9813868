// What the whole fleet does, in words that nobody mistakes: it runs, brakes, or is stopped.

/** A fleet's phase in words, and the colour of its badge. */
const FLEET = {
  hold: ["ready, not started", "ready"], go: ["running", "runs"], stop: ["stopped", "stopped"],
  freeze: ["frozen", "stopped"], over: ["mission over", "ready"],
  unheard: ["no word: robots may be driving", "warns"], held: ["stopped: it will not set out", "stopped"],
};

/** A fleet counts as standing when no robot has moved for this long [ms]: they creep at the end. */
const SETTLES = 1000;
let moved = -Infinity;

/** [words, colour] of a fleet in a phase; `found`: its robots now, null if the page shows the past. */
function fleetState(phase, found) {
  const [words, colour] = FLEET[phase] ?? ["", ""];
  if (!words || !found) return [words && `${words}; the page shows the past`, colour];
  const count = (test) => found.filter((robot) => robot && test(robot)).length;
  const driving = count((robot) => robot.state === "brakes" || robot.v > STANDS);
  if (driving) moved = performance.now();
  const unheard = count((robot) => robot.state === "unheard"), more = unheard ? `; ${unheard} not heard` : "";
  const moves = driving ? `${driving} driving` : "robots may start at any time";
  const braking = driving ? `${driving} still moving` : "all nearly stand";
  if (phase === "stop" && performance.now() - moved < SETTLES) return [`braking: ${braking}${more}`, "brakes"];
  if (phase === "stop") return [`stopped: all ${unheard ? "that are heard " : ""}stand${more}`, colour];
  return phase === "go" ? [`running: ${moves}${more}`, unheard ? "warns" : colour] : [words, colour];
}

/** Say so in a badge, and what the button beside it does; STOP shows that it is pressed. */
function tellFleet(phase, found) {
  const [words, colour] = fleetState(phase, found);
  write(byId("state"), words);
  update(document.body.dataset, { fleet: colour });
  const brakes = colour === "brakes";
  update(byId("go-on"), {
    hidden: phase !== "stop" && phase !== "held",
    textContent: "resume",
    title: brakes ? "Robots still brake: let them drive on at once" : "Let the fleet go on where it was stopped",
  });
  byId("stop").setAttribute("aria-pressed", String(phase === "stop" || phase === "held"));
}
