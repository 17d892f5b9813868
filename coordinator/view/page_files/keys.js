// What the keys of the keyboard do.

const KEYS = {
  " ": () => { if (mayCommand) desk.stop(); else setRunning(!running); },
  ArrowLeft: (event) => seek(now - (event.shiftKey ? 5 : 0.5)),
  ArrowRight: (event) => seek(now + (event.shiftKey ? 5 : 0.5)),
  ArrowUp: () => jump(-1),
  ArrowDown: () => jump(1),
  Home: () => seek(play.scene.begin),
  End: () => seek(play.scene.end),
  ".": () => faster(1),
  ">": () => faster(1),
  ",": () => faster(-1),
  "<": () => faster(-1),
  "+": () => hand.enlarge(ENLARGED),
  "=": () => hand.enlarge(ENLARGED),
  "-": () => hand.enlarge(1 / ENLARGED),
  0: () => seeAll(),
  Escape: () => { if (focus >= 0) chooseToggled(focus); },
};

function jump(direction) {
  const times = [play.scene.begin, ...play.scene.marks.map((mark) => mark.t), play.scene.end];
  const found = direction > 0 ? times.find((t) => t > now + 0.05) : times.findLast((t) => t < now - 0.05);
  if (found !== undefined) seek(found);
}

function faster(step) {
  const { speed } = controls;
  speed.selectedIndex = Math.min(Math.max(speed.selectedIndex + step, 0), speed.options.length - 1);
}

function pressed(event) {
  const act = KEYS[event.key], target = event.target;
  if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
  const clicks = event.key === " " && !mayCommand && target.closest("button, summary, input[type=checkbox]");
  const typed = target.closest("select, input:not([type=range], [type=checkbox])");
  const own = clicks || (typed && event.key !== "Escape");
  if (own) return;
  event.preventDefault();
  const stops = mayCommand && event.key === " ";
  if (!TIMELESS.has(event.key) && !stops) setFollowing(false);
  act(event);
}
