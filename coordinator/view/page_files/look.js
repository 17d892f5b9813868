// Colours: those of Okabe and Ito, which colour-blind people can distinguish, for light and dark.

const HUES = {
  light: ["#0072b2", "#c84f00", "#00805c", "#b25089", "#a87400", "#2b8fc4", "#57606a", "#7c7600"],
  dark: ["#58aee6", "#ff9050", "#35c79c", "#e39bc6", "#eab13e", "#90d2f5", "#adb6c1", "#cfc650"],
};
const SHADES = { light: [1, 0.72, 0.86, 0.6], dark: [1, 0.74, 0.88, 0.62] };

function shaded(colour, share) {
  const part = (at) => Math.round(parseInt(colour.slice(at, at + 2), 16) * share);
  return `rgb(${part(1)} ${part(3)} ${part(5)})`;
}

/** The page's colours as they are now; `robot(i)` is a robot's. */
class Look {
  constructor() {
    const style = getComputedStyle(document.documentElement);
    const theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
    const read = (name) => style.getPropertyValue(`--${name}`).trim();
    this.dark = theme === "dark";
    for (const name of ["ink", "muted", "line", "panel", "ground", "solid", "amber", "red"]) {
      this[name] = read(name);
    }
    this.onRobot = this.dark ? "#0d1117" : "#ffffff";
    const colours = Array.from({ length: 32 }, (_, index) =>
      shaded(HUES[theme][index % 8], SHADES[theme][Math.floor(index / 8)]));
    const font = read("font");
    this.font = (size, weight = 400) => `${weight} ${size}px ${font}`;
    this.robot = (index) => colours[index % 32];
  }
}

/**
 * A canvas that is as sharp as the screen; `resize` returns whether its size has changed.
 *
 * Reading its size makes the browser lay out the page, so it is read only when `Sheet.layouts` has
 * increased.
 */
class Sheet {
  static layouts = 0;

  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.width = this.height = this.scale = 0;
    this.layout = -1;
  }

  resize() {
    const scale = window.devicePixelRatio || 1;
    if (this.layout === Sheet.layouts && scale === this.scale) return false;
    this.layout = Sheet.layouts;
    const box = this.canvas.getBoundingClientRect();
    const same = box.width === this.width && box.height === this.height && scale === this.scale;
    if (same) return false;
    [this.width, this.height, this.scale] = [box.width, box.height, scale];
    this.canvas.width = Math.round(box.width * scale);
    this.canvas.height = Math.round(box.height * scale);
    return true;
  }

  /** An empty sheet of the same size, for what seldom changes. */
  twin() {
    const canvas = document.createElement("canvas");
    canvas.width = this.canvas.width;
    canvas.height = this.canvas.height;
    const pen = canvas.getContext("2d");
    pen.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    return { canvas, pen };
  }

  begin(background) {
    this.pen.setTransform(1, 0, 0, 1, 0, 0);
    this.pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (background && background.width && background.height) this.pen.drawImage(background, 0, 0);
    this.pen.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    return this.pen;
  }
}

/** Round steps of 1, 2 or 5 that make about `count` of a range. */
function roundStep(range, count) {
  const raw = Math.max(range, 1e-6) / count, power = 10 ** Math.floor(Math.log10(raw));
  return power * ([1, 2, 5].find((factor) => factor * power >= raw) || 10);
}
