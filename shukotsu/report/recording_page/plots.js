/* Plots of a recording that follow its moving hand: tip errors of every digit, angles of one joint. They take the
   numbers from the viewer (viewer.js, whose `on`, `clamp` and `partsOf` serve here too), turn it to the
   frame that is clicked, and mark the frame that it shows. A canvas is drawn only when what it shows changes; while
   the hand plays, a line above it moves. */
(() => {
const {abs, ceil, log10, round} = Math;
const LEFT = 44, RIGHT = 10, TITLE = 20, AXIS = 36; // of a plot, CSS pixels
const GAP_STEPS = 1.9; // as in figures/recording_figures.py: a longer step between frames is a gap
const LOG_RATIO = 8, LOG_FLOOR_MM = .1; // an error below is noise
const LEAST_SPAN_DEG = 10;
const MARK_EVERY = 120; // CSS pixels between the marks of a line
const ANGLES = ["flexion", "abduction", "rotation"];

/* A number with a true minus sign, and as many decimals as the step that it is stored or ticked by has. */
function numeral(value, step) {
  const digits = max(0, ceil(-log10(step) - 1e-9));
  return isNaN(value) ? "–" : value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1").replace("-", "−");
}

function ticksOf(low, high, about) {
  if (!(high > low)) return [low];
  const rough = (high - low) / about, power = 10 ** floor(log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * .999);
  const first = ceil(low / step - 1e-9), last = floor(high / step + 1e-9);
  return Array.from({length: last - first + 1}, (_, i) => (first + i) * step);
}

function logTicks(low, high) {
  const ticks = [];
  for (let power = floor(log10(low)); power <= ceil(log10(high)); power++) {
    for (const step of high / low < 100 ? [1, 3] : [1]) ticks.push(Number((step * 10 ** power).toPrecision(1)));
  }
  return ticks.filter((tick) => tick >= low && tick <= high);
}

/* One series of a block: values by frame index, NaN in gaps. */
const series = ({values, count, width}, item, part = 0) => (index) => values[(index * count + item) * width + part];

/* Smallest, largest, and what an error is in the middle and at the low end; null where no value is known. */
function summary(at, count) {
  const sorted = Float64Array.from({length: count}, (_, i) => at(i)).filter((value) => !isNaN(value)).sort();
  const quantile = (q) => sorted[floor(q * (sorted.length - 1))];
  return sorted.length ? {low: sorted[0], high: sorted.at(-1), median: quantile(.5), floor: quantile(.02)} : null;
}

/* The stretch of time that all plots show. */
class Stretch {
  constructor(viewer) {
    const {times, last} = viewer;
    const steps = Float64Array.from({length: last}, (_, i) => times[i + 1] - times[i]).sort();
    Object.assign(this, {viewer, times, last, end: times.at(-1) || 1, usual: steps[last >> 1] || 0});
    this.show(0, this.end);
  }

  /* At least some frames wide, and within the recording. */
  show(from, to) {
    const wide = clamp(to - from, min(this.end, 8 * this.usual || this.end), this.end);
    this.from = clamp((from + to - wide) / 2, 0, this.end - wide);
    this.to = this.from + wide;
  }

  /* Index of the frame nearest to a moment. */
  index(seconds) {
    const {times} = this, before = this.viewer.upTo(seconds);
    return before < this.last && times[before + 1] - seconds <= seconds - times[before] ? before + 1 : before;
  }
}

/* A canvas with strips above a common time axis, and the lines that mark a moment on it. */
class Plot {
  constructor(element, stripHeight, time) {
    Object.assign(this, {element, stripHeight, time, canvas: element.querySelector("canvas")});
    for (const name of ["cursor", "hover", "band"]) this[name] = element.querySelector(`.plot-${name}`);
  }

  get width() { return max(50, this.element.clientWidth - LEFT - RIGHT); }

  x(seconds) { return LEFT + (seconds - this.time.from) / (this.time.to - this.time.from) * this.width; }

  /* The moment below a pointer. */
  moment({clientX}) {
    const x = clientX - this.element.getBoundingClientRect().left, {from, to} = this.time;
    return clamp(from + (x - LEFT) / this.width * (to - from), from, to);
  }

  /* strips: [{title, low, high, ticks, logarithmic, lines: [{at, sd, colour, mark}]}] */
  draw(strips, colours) {
    const {canvas, element, stripHeight} = this, ratio = min(2, devicePixelRatio), each = TITLE + stripHeight;
    const high = strips.length * each + AXIS, wide = element.clientWidth;
    if (!wide) return;
    canvas.style.height = `${high}px`;
    Object.assign(canvas, {width: round(wide * ratio), height: round(high * ratio)});
    Object.assign(this, {colours, to: canvas.getContext("2d"), foot: high - AXIS});
    this.to.scale(ratio, ratio);
    this.to.font = "11px system-ui, sans-serif";
    this.ticks = ticksOf(this.time.from, this.time.to, clamp(this.width / 90, 2, 14));
    strips.forEach((strip, i) => this.strip(strip, (i + 1) * each));
    this.timeAxis();
  }

  line(x, y, x2, y2, colour) {
    Object.assign(this.to, {strokeStyle: colour, lineWidth: 1});
    this.to.beginPath();
    this.to.moveTo(x, y);
    this.to.lineTo(x2, y2);
    this.to.stroke();
  }

  words(text, x, y, align, colour) {
    Object.assign(this.to, {textAlign: align, fillStyle: colour});
    this.to.fillText(text, x, y);
  }

  timeAxis() {
    const {foot, ticks, colours: {soft}} = this;
    for (const tick of ticks) {
      const x = round(this.x(tick)) + .5;
      this.line(x, foot, x, foot + 5, soft);
      this.words(numeral(tick, ticks[1] - ticks[0] || 1), x, foot + 16, "center", soft);
    }
    this.line(LEFT, foot + .5, LEFT + this.width, foot + .5, soft);
    this.words(wording("time"), LEFT + this.width / 2, foot + 30, "center", soft);
  }

  strip({title, low, high, ticks, logarithmic, lines}, foot) {
    const {to, stripHeight, width, colours: {ink, soft, rule}} = this, scale = logarithmic ? Math.log : (value) => value;
    const share = (value) => (scale(clamp(value, low, high)) - scale(low)) / (scale(high) - scale(low));
    const y = (value) => foot - share(value) * stripHeight;
    for (const tick of this.ticks) {
      const x = round(this.x(tick)) + .5;
      this.line(x, foot - stripHeight, x, foot, rule);
    }
    for (const tick of ticks) {
      const level = round(y(tick)) + .5, words = logarithmic ? String(tick) : numeral(tick, ticks[1] - ticks[0] || 1);
      this.line(LEFT, level, LEFT + width, level, tick === 0 ? soft : rule);
      this.words(words, LEFT - 6, level + 4, "right", soft);
    }
    to.save();
    to.beginPath();
    to.rect(LEFT, foot - stripHeight - 2, width, stripHeight + 4);
    to.clip();
    for (const line of lines) {
      if (line.sd) this.spread(line, y);
      this.curve(line, y);
    }
    to.restore();
    this.words(title, LEFT + 4, foot - stripHeight - 6, "left", ink);
    if (!lines.some(({known}) => known)) {
      this.words(wording(lines.length ? "unknown" : "no_model"), LEFT + 6, foot - 8, "left", soft);
    }
  }

  /* Indexes of the frames in view that have a value, in runs without a gap. */
  runs(at) {
    const {times, usual, last, from, to} = this.time, runs = [], end = min(last, this.time.index(to) + 1);
    for (let i = max(0, this.time.index(from) - 1), before = NaN; i <= end; i++) {
      if (isNaN(at(i))) continue;
      if (before !== i - 1 || times[i] - times[before] > usual * GAP_STEPS) runs.push([]);
      runs.at(-1).push(i);
      before = i;
    }
    return runs;
  }

  /* Of every pixel column the first, smallest, largest and last value, so that no peak is lost. */
  curve({at, colour, mark, phase}, y) {
    const {to, time: {times}} = this;
    Object.assign(to, {strokeStyle: colour, lineWidth: 1.3, lineJoin: "round", lineCap: "round"});
    to.beginPath();
    for (const run of this.runs(at)) {
      let column = null, pen = "moveTo";
      const flush = () => {
        for (const value of column ? [column.first, column.least, column.most, column.last] : []) {
          to[pen](column.x, y(value));
          pen = "lineTo";
        }
      };
      for (const i of run) {
        const value = at(i), x = this.x(times[i]);
        if (!column || floor(x) !== floor(column.x)) {
          flush();
          column = {x, first: value, least: value, most: value};
        }
        Object.assign(column, {least: min(column.least, value), most: max(column.most, value), last: value});
      }
      flush();
    }
    to.stroke();
    if (mark) this.marks(at, colour, new Path2D(mark), phase, y);
  }

  /* One standard deviation to either side of a line. */
  spread({at, sd, colour}, y) {
    const {to, time: {times}} = this;
    Object.assign(to, {fillStyle: colour, globalAlpha: .2});
    for (const run of this.runs((i) => at(i) + sd(i))) {
      to.beginPath();
      for (const i of run) to.lineTo(this.x(times[i]), y(at(i) + sd(i)));
      for (const i of run.reverse()) to.lineTo(this.x(times[i]), y(at(i) - sd(i)));
      to.fill();
    }
    to.globalAlpha = 1;
  }

  marks(at, colour, shape, phase, y) {
    const {to, time} = this, every = MARK_EVERY / this.width * (time.to - time.from);
    for (let seconds = time.from + every * (phase % 1 + .15); seconds < time.to; seconds += every) {
      const index = time.index(seconds), value = at(index);
      if (isNaN(value) || abs(time.times[index] - seconds) > every / 8) continue;
      to.save();
      to.translate(this.x(time.times[index]), y(value));
      Object.assign(to, {fillStyle: colour, strokeStyle: this.colours.paper, lineWidth: 1});
      to.fill(shape);
      to.stroke(shape);
      to.restore();
    }
  }

  /* Put a line at a moment; nothing where that is not in view. */
  mark(line, seconds) {
    const x = seconds === null ? NaN : this.x(seconds);
    line.hidden = !(x >= LEFT - .5 && x <= LEFT + this.width + .5);
    if (!line.hidden) line.style.transform = `translateX(${x.toFixed(1)}px)`;
  }

  showBand(from, to) {
    this.band.hidden = from === null;
    const [a, b] = [this.x(from), this.x(to)];
    if (from !== null) Object.assign(this.band.style, {left: `${min(a, b)}px`, width: `${abs(b - a)}px`});
  }
}

class Plots {
  constructor(root, viewer) {
    Object.assign(this, {root, viewer, part: partsOf(root), time: new Stretch(viewer), hovered: null});
    this.rows = [...root.querySelectorAll("[data-model]")];
    this.boxes = this.rows.map((row) => row.querySelector("input"));
    this.angles = viewer.header.extra.angles;
    this.steps = Object.fromEntries(viewer.header.blocks.map(({name, step}) => [name, step]));
    this.plots = {};
    for (const element of root.querySelectorAll("[data-plot]")) {
      const {plot} = element.dataset;
      this.plots[plot] = new Plot(element, plot === "angles" ? 96 : 62, this.time);
    }
    this.all = Object.values(this.plots);
    this.known = this.rows.map((_, m) => viewer.digits.map((_, d) => summary(this.error(m, d), viewer.last + 1)));
    this.choose();
    this.listJoints();
    this.listen();
    for (const live of root.querySelectorAll(".plots-live")) live.hidden = false;
    root.classList.add("drawn");
    this.paint();
    this.tell();
  }

  error(model, digit) { return series(this.viewer.blocks[`errors${model}`], digit); }

  angle(joint, part, block = "angles") {
    return series(this.viewer.blocks[`${block}${this.part["angle-model"].value}`], Number(joint), part);
  }

  /* The models that the viewer shows, until others are ticked. */
  choose() { this.boxes.forEach((box, m) => (box.checked = this.viewer.shown.includes(m))); }

  get chosen() { return this.boxes.flatMap((box, m) => (box.checked ? [m] : [])); }

  /* The joints of the model that was chosen; the same joint stays if it has it, else the one that moved most. */
  listJoints() {
    if (!this.plots.angles) return;
    const {joint} = this.part, {joints} = this.angles[this.part["angle-model"].value];
    const before = joint.selectedOptions[0]?.text;
    joint.replaceChildren(...joints.map((name, i) => new Option(name, i)));
    const moved = joints.map((_, j) => {
      const flexion = summary(this.angle(j, 0), this.viewer.last + 1);
      return flexion ? flexion.high - flexion.low : -1;
    });
    joint.value = joints.includes(before) ? joints.indexOf(before) : moved.indexOf(max(...moved));
  }

  /* ---- drawing ---- */

  /* Draw before the next picture of the page, however often that is asked for. */
  paint() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.paintNow();
    });
  }

  paintNow() {
    const style = getComputedStyle(this.root), read = (name) => style.getPropertyValue(`--${name}`).trim();
    const colours = Object.fromEntries(["paper", "ink", "soft", "rule"].map((name) => [name, read(name)]));
    this.plots.errors?.draw(this.errorStrips(read), colours);
    this.plots.angles?.draw(this.angleStrips(colours.ink), colours);
    this.rows.forEach((row, m) => row.classList.toggle("off", !this.boxes[m].checked));
    this.follow();
  }

  errorStrips(read) {
    const {chosen, part: {log}} = this, known = chosen.flatMap((m) => this.known[m].filter(Boolean));
    const high = max(.1, ...known.map((error) => error.high));
    const usual = min(...known.map(({median}) => max(median, LOG_FLOOR_MM)));
    if (!this.scaled) log.checked = high / usual > LOG_RATIO;
    const low = max(LOG_FLOOR_MM, min(...known.map((error) => error.floor))), logarithmic = log.checked && high > low;
    const scale = logarithmic
      ? {logarithmic, low, high: high * 1.1, ticks: logTicks(low, high * 1.1)}
      : {logarithmic, low: 0, high: high * 1.02, ticks: ticksOf(0, high * 1.02, 2)};
    return this.viewer.digits.map((digit, d) => ({
      ...scale, title: d ? digit : `${digit}: ${wording("tip_error")}`,
      lines: chosen.map((m, n) => ({
        at: this.error(m, d), known: this.known[m][d], phase: n / chosen.length,
        colour: read(`model${this.viewer.header.skeletons[m].place % 7}`),
        mark: this.rows[m].querySelector("[data-mark]").getAttribute("d"),
      })),
    }));
  }

  angleStrips(colour) {
    const {joint} = this.part;
    return ANGLES.map((angle, part) => {
      const at = this.angle(joint.value, part), sd = this.angle(joint.value, part, "angle_sds");
      const count = this.viewer.last + 1, known = summary(at, count), end = (side) => (i) => at(i) + side * (sd(i) || 0);
      const [low, high] = known ? [summary(end(-1), count).low, summary(end(1), count).high] : [0, 0];
      const pad = max(0, LEAST_SPAN_DEG - (high - low)) / 2 + (high - low) * .04;
      const title = `${part ? "" : `${joint.selectedOptions[0].text}: `}${wording(angle)} [deg], ${wording(`sense_${angle}`)}`;
      return {title, low: low - pad, high: high + pad, ticks: ticksOf(low - pad, high + pad, 3), lines: [{at, sd, known, colour}]};
    });
  }

  /* ---- the moment ---- */

  /* Mark the frame that the hand shows. */
  follow() {
    for (const plot of this.all) plot.mark(plot.cursor, this.time.times[this.viewer.index]);
  }

  point(index) {
    this.hovered = index;
    for (const plot of this.all) {
      plot.mark(plot.hover, index === null ? null : this.time.times[index]);
      if (index !== null) plot.hover.firstChild.textContent = `${this.time.times[index].toFixed(3)} s`;
    }
    this.tell();
  }

  /* The numbers of the frame that is pointed at, else of the one that the hand shows. */
  tell() {
    const {viewer, part} = this, index = this.hovered ?? viewer.index, where = viewer.moment(index);
    const words = this.rows.map((row, m) => viewer.digits.map((digit, d) => {
      const cell = row.cells[d + 1];
      cell.textContent = numeral(this.error(m, d)(index), this.steps[`errors${m}`]);
      return `${digit} ${cell.textContent}`;
    }));
    if (this.plots.errors) {
      part["error-where"].textContent = wording("tip_error_at", {where});
      const errors = this.chosen.map((m) => `${viewer.header.skeletons[m].model}: ${words[m].join(", ")} mm`);
      this.describe(this.plots.errors, index, `${where}; ${errors.join("; ")}`);
    }
    if (!this.plots.angles) return;
    const step = this.steps[`angles${part["angle-model"].value}`];
    const angles = ANGLES.map((angle, i) => {
      const degrees = numeral(this.angle(part.joint.value, i)(index), step);
      return `${wording(angle)} ${degrees === "–" ? degrees : `${degrees}°`}`;
    });
    part["angle-where"].textContent = `${where}: ${angles.join(", ")}`;
    this.describe(this.plots.angles, index, `${part.joint.selectedOptions[0].text}, ${part["angle-where"].textContent}`);
  }

  /* What a reader of the screen hears of a plot. */
  describe({element}, index, words) {
    const {frames, last} = this.viewer;
    Object.assign(element, {
      ariaValueMin: frames[0], ariaValueMax: frames[last], ariaValueNow: frames[index], ariaValueText: words,
    });
  }

  /* ---- controls ---- */

  zoom(how) {
    const {time} = this, half = (time.to - time.from) * (how === "in" ? .25 : 1), around = time.times[this.viewer.index];
    if (how === "all") time.show(0, time.end);
    else time.show(around - half, around + half);
    this.paint();
  }

  listen() {
    const {root, part, viewer} = this;
    on(document, "viewermoved", () => this.follow());
    on(document, "viewertold", () => this.hovered ?? this.tell());
    on(document, "viewershown", () => {
      if (!this.picked) this.choose();
      this.paint();
    });
    on(root, "change", ({target}) => {
      this.picked ||= this.boxes.includes(target);
      this.scaled ||= target === part.log;
      if (target === part["angle-model"]) this.listJoints();
      this.paint();
      this.tell();
    });
    for (const button of root.querySelectorAll("[data-zoom]")) on(button, "click", () => this.zoom(button.dataset.zoom));
    on(matchMedia("(prefers-color-scheme: dark)"), "change", () => this.paint());
    on(matchMedia("print"), "change", () => this.paintNow()); // paper has its own colours, and waits for no frame
    const size = new ResizeObserver(() => this.paint());
    for (const plot of this.all) {
      size.observe(plot.element);
      on(plot.element, "keydown", (event) => this.key(event));
      this.listenToPointers(plot);
    }
  }

  listenToPointers(plot) {
    const {element} = plot, {viewer, time} = this;
    let held = null; // what the pointer that is down does: {from: where its band starts, or null; x, pointer}
    on(element, "pointerdown", (event) => {
      if (event.button || held) return;
      element.setPointerCapture(event.pointerId);
      const below = event.clientY - element.getBoundingClientRect().top > plot.foot, moment = plot.moment(event);
      held = {from: event.shiftKey || below ? moment : null, x: event.clientX, pointer: event.pointerId};
      if (held.from === null) viewer.goTo(time.index(moment));
    });
    on(element, "pointermove", (event) => {
      if (held && event.pointerId !== held.pointer) return;
      const moment = plot.moment(event);
      if (held && held.from === null) viewer.goTo(time.index(moment));
      else if (held) for (const each of this.all) each.showBand(held.from, moment);
      this.point(event.pointerType === "touch" && !held ? null : time.index(moment));
    });
    const end = (event) => {
      if (!held || event.pointerId !== held.pointer) return;
      const {from, x} = held, to = plot.moment(event);
      held = null;
      for (const each of this.all) each.showBand(null);
      if (event.type === "pointerup" && from !== null) {
        if (abs(event.clientX - x) < 5) viewer.goTo(time.index(to));
        else time.show(min(from, to), max(from, to));
        this.paint();
      }
      if (event.pointerType === "touch") this.point(null);
    };
    on(element, "pointerup", end);
    on(element, "pointercancel", end);
    on(element, "pointerleave", () => this.point(null));
    on(element, "dblclick", () => this.zoom("all"));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const {viewer} = this, second = max(1, round(1 / (this.time.usual || 1))), by = event.shiftKey ? 10 : 1;
    const frames = {
      ArrowLeft: -by, ArrowDown: -by, ArrowRight: by, ArrowUp: by, PageUp: second, PageDown: -second,
      Home: -viewer.last, End: viewer.last,
    }[event.key];
    const zoom = {"+": "in", "=": "in", "-": "out", Escape: "all"}[event.key];
    if (frames) {
      this.point(null);
      viewer.step(frames);
    } else if (zoom) this.zoom(zoom);
    else return;
    event.preventDefault();
  }
}

const plots = document.querySelector("[data-plots]"), hand = document.querySelector("[data-hand-viewer]");
if (plots) {
  on(hand, "viewerloaded", () => {
    new Plots(plots, hand.viewer);
    hand.querySelector("form").hidden = false; // its time and its numbers serve the plots where no hand can be drawn
  });
}
})();
