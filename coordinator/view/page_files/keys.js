// What the keys of the keyboard do.

const KEYS = {
  " ": () => setRunning(!running),
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

function pressed(event) {
  const act = KEYS[event.key], target = event.target;
  if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
  const clicks = event.key === " " && target.closest("button, summary, input[type=checkbox]");
  const own = target.closest("select") || clicks;
  if (own) return;
  event.preventDefault();
  if (!TIMELESS.has(event.key)) setFollowing(false);
  act(event);
}
