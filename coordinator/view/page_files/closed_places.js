// Places of the floor that are closed: which there are, closing one, and opening it again.

class ClosedPlaces {
  /** `changed` is called when the floor looks otherwise, `say` with what has been done, in words. */
  constructor(list, changed, say) {
    Object.assign(this, { list, changed, say });
    this.blocks = [];
    this.names = null;
  }

  /** Take in the names of the closed places. */
  hear(names) {
    const key = names.join();
    if (key === this.names) return;
    this.names = key;
    this.learn();
  }

  async learn() {
    const found = await ask("GET", "blocks");
    if (found === null) return;
    this.blocks = found;
    this.list.replaceChildren(...found.map((one) => {
      const open = element("button", { type: "button", textContent: "open again" });
      open.addEventListener("click", async () => {
        if (await ask("DELETE", `blocks/${one.id}`)) this.say(`${one.id} is open again`);
      });
      const text = element("span", { textContent: `${one.id} is closed` });
      return element("li", {}, text, ...mayCommand ? [open] : []);
    }));
    this.changed();
  }

  /** Close a square of 1 m around a place; return whether it is closed. */
  async close([x, y]) {
    const corner = (dx, dy) => [x + dx, y + dy];
    const polygon = [corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)];
    const found = await ask("POST", "blocks", { polygon });
    if (found !== null) this.say(`${found.id} is closed`);
    return found !== null;
  }

  draw(view, pen, look) {
    pen.strokeStyle = pen.fillStyle = look.red;
    pen.lineWidth = 1.5;
    for (const { polygon } of this.blocks) {
      pen.beginPath();
      for (const [x, y] of polygon) pen.lineTo(view.X(x), view.Y(y));
      pen.closePath();
      pen.globalAlpha = 0.18;
      pen.fill();
      pen.globalAlpha = 1;
      pen.stroke();
    }
  }
}
