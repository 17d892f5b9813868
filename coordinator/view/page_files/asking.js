// What the desk is asked over HTTP.

const mayCommand = document.documentElement.dataset.command === "true";

/** Ask the desk; return its answer, or null after telling what is wrong. */
async function ask(method, path, body, tell = (problem) => desk.say(problem, true)) {
  const options = { method, headers: { "Content-Type": "application/json" } };
  if (body !== undefined) options.body = JSON.stringify(body);
  try {
    const answer = await fetch(`api/${path}`, options), found = await answer.json();
    if (answer.ok) return found;
    tell((found.problems || [found.error]).join("; "));
  } catch {
    tell("the desk does not answer");
  }
  return null;
}

/** What can be done with a robot, in words. */
const ACTS = {
  admit: { words: "admit", title: "Let it take part again after it came back" },
  leave: { words: "take out", title: "Take it out of the fleet, once it was carried away" },
};
