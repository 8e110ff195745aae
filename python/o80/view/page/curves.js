// Curves over time, one chart for each field: desired dashed, observed solid, what chunks planned dotted.

// a colour of the style sheet, which knows light and dark
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`);

const TEXT_HEIGHT = 11; // of a mark [px]

function element(tag, text = "", kind = "") {
  const made = document.createElement(tag);
  made.textContent = text; // never HTML: names come from other programs
  if (kind) made.className = kind;
  return made;
}

function drawLine(pen, from, to) {
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.stroke();
}

class Chart {
  constructor(name, unit) {
    [this.name, this.unit] = [name, unit];
    this.box = element("div", "", "chart");
    this.head = element("header");
    this.canvas = element("canvas");
    this.box.append(this.head, this.canvas);
    this.parts = {};
    this.values(undefined);
  }

  values(texts) {
    this.head.replaceChildren(element("b", this.unit ? `${this.name} [${this.unit}]` : this.name));
    const unit = this.unit?.includes(" ") ? "" : this.unit; // "rad or m" stands in the head only
    for (const [part, text] of Object.entries(texts || {})) {
      this.head.append(element("span", `${part === "extended" ? "" : `${part} `}${readable(text, unit ?? "")}`, part));
    }
  }

  // seconds from `begin` to `end`; `marks` are seconds from `begin` and texts; `cursor` is the row
  // that is shown
  show(parts, { begin, end, marks }, cursor) {
    this.parts = {};
    for (const [part, [seconds, values]] of Object.entries(parts || {})) {
      this.parts[part] = { seconds: floats(seconds), values: floats(values) };
    }
    [this.begin, this.end, this.marks, this.cursor] = [begin, end, marks, cursor];
    this.draw();
  }

  range() {
    let [low, high] = [Infinity, -Infinity];
    for (const curve of Object.values(this.parts)) {
      for (const value of curve.values) {
        if (value < low && value > -Infinity) low = value;
        if (value > high && value < Infinity) high = value;
      }
    }
    if (low > high) [low, high] = [0, 1];
    const margin = 0.06 * (high - low) || 0.05 * Math.abs(high) || 0.5;
    return [low - margin, high + margin];
  }

  draw() {
    const scale = window.devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!width || !height) return;
    this.canvas.width = Math.round(width * scale);
    this.canvas.height = Math.round(height * scale);
    const pen = this.canvas.getContext("2d");
    pen.scale(scale, scale);
    pen.clearRect(0, 0, width, height);
    const [low, high] = this.range();
    const left = 46;
    const bottom = height - 14;
    const length = this.end - this.begin;
    const x = (seconds) => left + ((width - left - 4) * seconds) / length;
    const y = (value) => 4 + ((bottom - 8) * (high - value)) / (high - low);
    this.axes(pen, { low, high, left, bottom, width, length, x, y });
    pen.save();
    pen.beginPath();
    pen.rect(left, 0, width - left, bottom);
    pen.clip();
    for (const part of ["planned", "extended", "observed", "desired"]) {
      if (this.parts[part]) this.curve(pen, this.parts[part], part, x, y);
    }
    for (const { at, texts, lines } of joinedMarks(this.marks, x)) this.mark(pen, texts.join(", "), at, lines, bottom);
    pen.restore();
    pen.strokeStyle = colour("cursor");
    drawLine(pen, [x(this.cursor - this.begin), 0], [x(this.cursor - this.begin), bottom]);
  }

  // notes of programs or of persons: lines with a text
  mark(pen, text, at, lines, bottom) {
    pen.strokeStyle = pen.fillStyle = colour("mark");
    pen.lineWidth = 1;
    for (const each of lines) drawLine(pen, [each, 0], [each, bottom]);
    pen.save();
    pen.translate(at - 3, 4);
    pen.rotate(-Math.PI / 2);
    pen.font = "10px system-ui, sans-serif";
    pen.textAlign = "right";
    const most = Math.floor(bottom / 6); // characters that fit
    pen.fillText(text.length > most ? `${text.slice(0, most - 1)}\u2026` : text, 0, 0, bottom - 8);
    pen.restore();
  }

  axes(pen, { low, high, left, bottom, width, length, x, y }) {
    pen.font = "10px system-ui, sans-serif";
    pen.fillStyle = colour("dim");
    pen.strokeStyle = colour("grid");
    pen.lineWidth = 1;
    pen.textAlign = "right";
    for (const value of ticks(low, high, 4)) {
      drawLine(pen, [left, y(value)], [width - 4, y(value)]);
      pen.fillText(grouped(+value.toPrecision(6)), left - 4, Math.max(y(value) + 3, 8));
    }
    pen.textAlign = "center";
    for (const seconds of ticks(this.begin, this.end, 5)) {
      const at = x(seconds - this.begin);
      if (at > left + 12 && at < width - 14) pen.fillText(`${+seconds.toFixed(6)} s`, at, bottom + 12);
    }
  }

  curve(pen, { seconds, values }, part, x, y) {
    pen.strokeStyle = colour(part);
    pen.lineWidth = part === "planned" ? 1 : 1.5;
    pen.setLineDash({ desired: [5, 4], planned: [2, 3] }[part] || []);
    pen.beginPath();
    let drawing = false;
    for (let i = 0; i < seconds.length; ++i) {
      const there = Number.isFinite(values[i]); // a gap where a value is NaN
      if (there) pen[drawing ? "lineTo" : "moveTo"](x(seconds[i]), y(values[i]));
      drawing = there;
    }
    pen.stroke();
    pen.setLineDash([]);
  }
}

// marks whose texts would overprint each other get one text, in the order of time
function joinedMarks(marks, x) {
  const joined = [];
  for (const [seconds, text] of [...marks].sort(([one], [other]) => one - other)) {
    const last = joined.at(-1);
    if (last && x(seconds) - last.at < TEXT_HEIGHT) {
      last.texts.push(text);
      last.lines.push(x(seconds));
    } else joined.push({ at: x(seconds), texts: [text], lines: [x(seconds)] });
  }
  return joined;
}

// 15 710 and 0.5, but 1e+12
function grouped(value) {
  if (Math.abs(value) >= 1e9) return value.toExponential();
  return value.toLocaleString("en", { maximumSignificantDigits: 6 }).replaceAll(",", "\u202f");
}

const PREFIXES = { 9: "G", 6: "M", 3: "k", 0: "", "-3": "m", "-6": "\u00b5", "-9": "n" };
const PREFIXED = ["Pa", "N", "Nm", "m", "m/s", "rad", "rad/s", "s", "V", "A", "W", "J", "Hz"]; // units that take one

// a number with four digits, without powers of ten where a prefix or groups of digits do; or a word
function readable(value, unit) {
  if (typeof value !== "number" || value === 0) return `${value} ${typeof value === "number" ? unit : ""}`.trim();
  let power = Math.floor(Math.log10(Math.abs(value)));
  let prefix = "";
  if (PREFIXED.includes(unit) && !(power >= -3 && power <= 3)) {
    const thousands = Math.min(Math.max(Math.floor(power / 3) * 3, -9), 9);
    [value, power, prefix] = [value / 10 ** thousands, power - thousands, PREFIXES[thousands]];
  }
  const short = power < -4 || power > 9 ? value.toExponential(3).replace(/\.?0+e/, "e") : null;
  const digits = { maximumFractionDigits: Math.max(0, 3 - power) };
  return `${short ?? value.toLocaleString("en", digits).replaceAll(",", "\u202f")} ${prefix}${unit}`.trim();
}

// round numbers between two ends
function ticks(low, high, most) {
  const raw = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * power).find((each) => each >= raw);
  const found = [];
  for (let i = Math.ceil(low / step); i * step <= high && found.length < 20; ++i) found.push(i * step);
  return found;
}
