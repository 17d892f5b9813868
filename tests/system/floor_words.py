"""The names that the page writes on the floor: [text, left, width, middle] in pixels."""

WORDS = """(() => {
  const told = [], own = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
    if (this.canvas.id === "floor") {
      told.push([text, x - this.measureText(text).width / 2, this.measureText(text).width, y]);
    }
    own.call(this, text, x, y);
  };
  splinefleet.draw();
  CanvasRenderingContext2D.prototype.fillText = own;
  return told.filter(([text]) => text.startsWith("R"));
})()"""
