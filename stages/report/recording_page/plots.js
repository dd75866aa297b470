"use strict";
/* Plots of a recording that follow its moving hand: tip errors of every digit, angles of one joint. They take the
   numbers from the viewer (viewer.js), turn it to the frame that is clicked, and mark the frame that it shows.
   A canvas is drawn only when what it shows changes; while the hand plays, a line above it moves. */
(() => {
const {abs, ceil, floor, log10, max, min, round} = Math;
const LEFT = 44, RIGHT = 10, TITLE = 20, AXIS = 36; // of a plot, CSS pixels
const GAP_STEPS = 1.9; // as in print_figures/over_time.py: a longer step between frames is a gap
const LOG_RATIO = 8, LOG_FLOOR_MM = .1; // an error below is noise
const LEAST_SPAN_DEG = 10;
const MARK_EVERY = 120; // CSS pixels between the marks of a line
const ANGLES = ["flexion", "abduction", "rotation"];
const TELL_MS = 150; // between two new texts while the hand plays

const on = (target, event, act, options) => target.addEventListener(event, act, options);
const clamp = (value, low, high) => min(high, max(low, value));
const minus = (words) => words.replace("-", "−");

/* As many decimals as the step that the numbers are stored by has. */
const decimals = (step) => max(0, ceil(-log10(step) - 1e-9));

function steps(low, high, about) {
  if (!(high > low)) return [low];
  const rough = (high - low) / about, power = 10 ** floor(log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * .999);
  const ticks = [];
  for (let n = ceil(low / step - 1e-9); n * step <= high + step * 1e-9; n++) ticks.push(n * step);
  return ticks;
}

function logSteps(low, high) {
  const ticks = [];
  for (let power = floor(log10(low)); power <= ceil(log10(high)); power++) {
    for (const step of high / low < 100 ? [1, 3] : [1]) ticks.push(Number((step * 10 ** power).toPrecision(1)));
  }
  return ticks.filter((tick) => tick >= low && tick <= high);
}

/* One series of a block: values by frame index, NaN in gaps. */
const series = ({values, count, width}, item, part = 0) => (index) => values[(index * count + item) * width + part];

/* Smallest, largest, and what an error is in the middle and at the low end; null where it is never known. */
function summary(at, count) {
  const known = [];
  for (let i = 0; i < count; i++) if (!isNaN(at(i))) known.push(at(i));
  if (!known.length) return null;
  const sorted = Float64Array.from(known).sort(), quantile = (q) => sorted[floor(q * (sorted.length - 1))];
  return {low: sorted[0], high: sorted.at(-1), median: quantile(.5), floor: quantile(.02)};
}

/* A canvas with strips above a common time axis, and the lines that mark a moment on it. */
class Plot {
  constructor(element, stripHeight) {
    Object.assign(this, {element, stripHeight, canvas: element.querySelector("canvas")});
    for (const name of ["cursor", "hover", "band"]) this[name] = element.querySelector(`.plot-${name}`);
  }

  get width() { return max(50, this.element.clientWidth - LEFT - RIGHT); }

  /* strips: [{title, low, high, ticks, logarithmic, lines: [{at, colour, mark}]}] */
  draw(strips, time, colours) {
    const {canvas, element, stripHeight} = this, ratio = min(2, devicePixelRatio), each = TITLE + stripHeight;
    const high = strips.length * each + AXIS, wide = element.clientWidth;
    if (!wide) return;
    canvas.style.height = `${high}px`;
    Object.assign(canvas, {width: round(wide * ratio), height: round(high * ratio)});
    const to = this.to = canvas.getContext("2d");
    Object.assign(this, {time, colours, foot: high - AXIS});
    to.scale(ratio, ratio);
    to.font = "11px system-ui, sans-serif";
    strips.forEach((strip, i) => this.strip(strip, (i + 1) * each));
    this.timeAxis();
  }

  x(seconds) { return LEFT + (seconds - this.time.from) / (this.time.to - this.time.from) * this.width; }

  seconds(x) { return this.time.from + (x - LEFT) / this.width * (this.time.to - this.time.from); }

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

  timeTicks() { return steps(this.time.from, this.time.to, clamp(this.width / 90, 2, 14)); }

  timeAxis() {
    const {soft} = this.colours, {foot} = this, ticks = this.timeTicks(), digits = decimals(ticks[1] - ticks[0] || 1);
    for (const tick of ticks) {
      const x = round(this.x(tick)) + .5;
      this.line(x, foot, x, foot + 5, soft);
      this.words(minus(tick.toFixed(digits)), x, foot + 16, "center", soft);
    }
    this.line(LEFT, foot + .5, LEFT + this.width, foot + .5, soft);
    this.words(wording("time"), LEFT + this.width / 2, foot + 30, "center", soft);
  }

  strip({title, low, high, ticks, logarithmic, lines}, foot) {
    const {to, colours, stripHeight} = this, scale = logarithmic ? Math.log : (value) => value;
    const span = scale(high) - scale(low);
    const y = (value) => foot - (scale(clamp(value, low, high)) - scale(low)) / span * stripHeight;
    const digits = logarithmic ? 0 : decimals(ticks[1] - ticks[0] || 1);
    for (const tick of this.timeTicks()) {
      const x = round(this.x(tick)) + .5;
      this.line(x, foot - stripHeight, x, foot, colours.rule);
    }
    for (const tick of ticks) {
      const level = round(y(tick)) + .5;
      this.line(LEFT, level, LEFT + this.width, level, tick === 0 ? colours.soft : colours.rule);
      this.words(minus(logarithmic ? String(tick) : tick.toFixed(digits)), LEFT - 6, level + 4, "right", colours.soft);
    }
    to.save();
    to.beginPath();
    to.rect(LEFT, foot - stripHeight - 2, this.width, stripHeight + 4);
    to.clip();
    for (const line of lines) this.curve(line, y);
    to.restore();
    this.words(title, LEFT, foot - stripHeight - 6, "left", colours.ink);
    if (!lines.some(({known}) => known)) {
      this.words(wording(lines.length ? "unknown" : "no_model"), LEFT + 6, foot - 8, "left", colours.soft);
    }
  }

  /* Of every pixel column the first, smallest, largest and last value, so that no peak is lost. */
  curve({at, colour, mark, phase}, y) {
    const {to, time} = this, {times, usual} = time;
    Object.assign(to, {strokeStyle: colour, lineWidth: 1.3, lineJoin: "round", lineCap: "round"});
    to.beginPath();
    let column = null, up = true;
    const flush = () => {
      if (!column) return;
      const {x, first, least, most, last} = column;
      to[up ? "moveTo" : "lineTo"](x, y(first));
      if (up) to.lineTo(x, y(first));
      for (const value of [least, most, last]) if (value !== first || value !== last) to.lineTo(x, y(value));
      [column, up] = [null, false];
    };
    const {first, last} = time.indices();
    for (let i = first; i <= last; i++) {
      const value = at(i), far = i > first && times[i] - times[i - 1] > usual * GAP_STEPS;
      if (isNaN(value) || far) {
        flush();
        up = true;
      }
      if (isNaN(value)) continue;
      const x = this.x(times[i]);
      if (column && floor(x) === floor(column.x)) {
        column.least = min(column.least, value);
        column.most = max(column.most, value);
        column.last = value;
      } else {
        flush();
        column = {x, first: value, least: value, most: value, last: value};
      }
    }
    flush();
    to.stroke();
    if (mark) this.marks(at, colour, mark, phase, y);
  }

  marks(at, colour, mark, phase, y) {
    const {to, time} = this, shape = new Path2D(mark);
    for (let x = LEFT + MARK_EVERY * (phase % 1 + .15); x < LEFT + this.width; x += MARK_EVERY) {
      const index = time.index(this.seconds(x)), value = at(index);
      if (isNaN(value) || abs(this.x(time.times[index]) - x) > MARK_EVERY / 8) continue;
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
    const x = seconds === null || !this.time ? NaN : this.x(seconds);
    line.hidden = !(x >= LEFT - .5 && x <= LEFT + this.width + .5);
    if (!line.hidden) line.style.transform = `translateX(${x.toFixed(1)}px)`;
  }

  showBand(from, to) {
    this.band.hidden = from === null;
    if (from === null) return;
    const [a, b] = [from, to].map((seconds) => clamp(this.x(seconds), LEFT, LEFT + this.width));
    Object.assign(this.band.style, {left: `${min(a, b)}px`, width: `${abs(b - a)}px`, bottom: `${AXIS}px`});
  }
}

/* The stretch of time that all plots show. */
class Stretch {
  constructor(viewer) {
    const {times} = viewer;
    Object.assign(this, {viewer, times, last: times.length - 1, end: times.at(-1) || 1});
    const apart = Float64Array.from({length: this.last}, (_, i) => times[i + 1] - times[i]).sort();
    this.usual = apart[apart.length >> 1] || 0;
    this.all();
  }

  all() { this.show(0, this.end); }

  /* At least some frames wide, and within the recording. */
  show(from, to) {
    const wide = clamp(to - from, min(this.end, 8 * this.usual || this.end), this.end);
    this.from = clamp((from + to - wide) / 2, 0, this.end - wide);
    this.to = this.from + wide;
  }

  zoom(factor, around) {
    const wide = (this.to - this.from) * factor;
    this.show(around - wide / 2, around + wide / 2);
  }

  /* Index of the frame nearest to a moment. */
  index(seconds) {
    const {times} = this, before = this.viewer.upTo(times, seconds);
    return before < this.last && times[before + 1] - seconds <= seconds - times[before] ? before + 1 : before;
  }

  /* Of the frames in view, one more at either end. */
  indices() { return {first: max(0, this.index(this.from) - 1), last: min(this.last, this.index(this.to) + 1)}; }
}

class Plots {
  constructor(root, viewer) {
    Object.assign(this, {root, viewer, time: new Stretch(viewer), hovered: null, told: 0});
    this.part = {};
    for (const part of root.querySelectorAll("[data-part]")) this.part[part.dataset.part] = part;
    this.rows = [...root.querySelectorAll("[data-model]")];
    this.boxes = this.rows.map((row) => row.querySelector("input"));
    this.angles = viewer.header.extra.angles;
    this.steps = Object.fromEntries(viewer.header.blocks.map(({name, step}) => [name, step]));
    this.plots = {};
    for (const element of root.querySelectorAll("[data-plot]")) {
      this.plots[element.dataset.plot] = new Plot(element, element.dataset.plot === "angles" ? 96 : 62);
    }
    this.all = Object.values(this.plots);
    this.known = this.rows.map((_, m) => viewer.digits.map((_, d) => summary(this.error(m, d), viewer.last + 1)));
    this.choose(viewer.shown);
    this.listJoints();
    this.listen();
    for (const live of root.querySelectorAll(".plots-live")) live.hidden = false;
    root.classList.add("drawn");
    this.paint();
    this.follow();
  }

  /* A model's place in the study: its colour and its mark go by it. */
  place(model) { return this.viewer.header.skeletons[model].place; }

  mark(model) { return this.rows[model].querySelector("[data-mark]").getAttribute("d"); }

  error(model, digit) { return series(this.viewer.blocks[`errors${model}`], digit); }

  angle(part) {
    const own = Number(this.part["angle-model"].value);
    return series(this.viewer.blocks[`angles${own}`], Number(this.part.joint.value), part);
  }

  choose(shown) { this.boxes.forEach((box, m) => (box.checked = shown.includes(m))); }

  get chosen() { return this.boxes.flatMap((box, m) => (box.checked ? [m] : [])); }

  /* The joints of the model that was chosen; the same joint stays if it has it, else the one that moved most. */
  listJoints() {
    if (!this.plots.angles) return;
    const {joint} = this.part, own = Number(this.part["angle-model"].value), {joints} = this.angles[own];
    const before = joint.selectedOptions[0]?.text;
    joint.replaceChildren(...joints.map((name, i) => new Option(name, i)));
    const moved = joints.map((_, j) => {
      const flexion = summary(series(this.viewer.blocks[`angles${own}`], j, 0), this.viewer.last + 1);
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
    const style = getComputedStyle(this.root), read = (name) => style.getPropertyValue(name).trim();
    const colours = Object.fromEntries(["paper", "ink", "soft", "rule"].map((name) => [name, read(`--${name}`)]));
    this.plots.errors.draw(this.errorStrips(read), this.time, colours);
    this.plots.angles?.draw(this.angleStrips(read), this.time, colours);
    this.rows.forEach((row, m) => row.classList.toggle("off", !this.boxes[m].checked));
    this.follow();
  }

  errorStrips(read) {
    const {chosen} = this, known = chosen.flatMap((m) => this.known[m].filter(Boolean));
    const high = max(.1, ...known.map((own) => own.high));
    const {log} = this.part, dwarfed = high / min(...known.map((own) => max(own.median, LOG_FLOOR_MM))) > LOG_RATIO;
    if (!this.scaled) log.checked = dwarfed;
    const low = max(LOG_FLOOR_MM, min(...known.map((own) => own.floor)));
    const logarithmic = log.checked && high > low;
    const scale = logarithmic ? {low, high: high * 1.1} : {low: 0, high: high * 1.02};
    scale.ticks = logarithmic ? logSteps(scale.low, scale.high) : steps(0, scale.high, 2);
    return this.viewer.digits.map((digit, d) => ({
      ...scale, logarithmic, title: d ? digit : `${digit}: ${wording("tip_error")}`,
      lines: chosen.map((m, n) => ({
        at: this.error(m, d), known: this.known[m][d], colour: read(`--model${this.place(m) % 7}`),
        mark: this.mark(m), phase: n / chosen.length,
      })),
    }));
  }

  angleStrips(read) {
    const joint = this.part.joint.selectedOptions[0].text;
    return ANGLES.map((angle, part) => {
      const at = this.angle(part), known = summary(at, this.viewer.last + 1) ?? {low: 0, high: 0};
      const lacking = max(0, LEAST_SPAN_DEG - (known.high - known.low)) / 2 + (known.high - known.low) * .04;
      const [low, high] = [known.low - lacking, known.high + lacking];
      const title = `${part ? "" : `${joint}: `}${wording(angle)} [deg], ${wording(`sense_${angle}`)}`;
      return {title, low, high, ticks: steps(low, high, 3), lines: [{at, known: known.median !== undefined, colour: read("--ink")}]};
    });
  }

  /* ---- the moment ---- */

  /* Mark the frame that the hand shows, and say its numbers unless others are pointed at. */
  follow() {
    const now = this.time.times[this.viewer.index];
    for (const plot of this.all) plot.mark(plot.cursor, now);
    if (this.hovered === null) this.tell(this.viewer.index);
  }

  point(index) {
    this.hovered = index;
    for (const plot of this.all) {
      plot.mark(plot.hover, index === null ? null : this.time.times[index]);
      if (index !== null) plot.hover.firstChild.textContent = `${this.time.times[index].toFixed(3)} s`;
    }
    this.tell(index ?? this.viewer.index);
  }

  /* The numbers of a frame, where they can be read; while the hand plays only now and then. */
  tell(index) {
    const now = performance.now();
    clearTimeout(this.later);
    if (this.hovered === null && now - this.told < TELL_MS) {
      this.later = setTimeout(() => this.tell(this.hovered ?? this.viewer.index), TELL_MS);
      return;
    }
    this.told = now;
    const {viewer, part} = this, where = viewer.moment(index);
    const said = this.rows.map((row, m) => viewer.digits.map((digit, d) => {
      const mm = this.error(m, d)(index), words = isNaN(mm) ? "–" : mm.toFixed(decimals(this.steps[`errors${m}`]));
      row.cells[d + 1].textContent = words;
      return `${digit} ${words}`;
    }));
    part["error-where"].textContent = wording("tip_error_at", {where});
    const errors = this.chosen.map((m) => `${viewer.header.skeletons[m].model}: ${said[m].join(", ")} mm`);
    this.value(this.plots.errors, index, `${where}; ${errors.join("; ")}`);
    if (!this.plots.angles) return;
    const step = this.steps[`angles${this.part["angle-model"].value}`];
    const angles = ANGLES.map((angle, part) => {
      const degrees = this.angle(part)(index);
      return `${wording(angle)} ${isNaN(degrees) ? "–" : `${minus(degrees.toFixed(decimals(step)).replace(/^-(0\.?0*)$/, "$1"))}°`}`;
    });
    part["angle-where"].textContent = `${where}: ${angles.join(", ")}`;
    this.value(this.plots.angles, index, `${part.joint.selectedOptions[0].text}, ${part["angle-where"].textContent}`);
  }

  value({element}, index, words) {
    const {frames, last} = this.viewer;
    const range = {valuemin: frames[0], valuemax: frames[last], valuenow: frames[index], valuetext: words};
    for (const [name, value] of Object.entries(range)) element.setAttribute(`aria-${name}`, value);
  }

  /* ---- controls ---- */

  zoom(how) {
    const around = this.time.times[this.viewer.index];
    if (how === "all") this.time.all();
    else this.time.zoom(how === "in" ? .5 : 2, around);
    this.paint();
  }

  listen() {
    const {root, part, viewer} = this;
    viewer.onframe(() => this.follow());
    on(document, "viewershown", () => {
      if (!this.picked) this.choose(viewer.shown);
      this.paint();
    });
    for (const box of this.boxes) {
      on(box, "change", () => {
        this.picked = true;
        this.paint();
      });
    }
    on(part.log, "change", () => {
      this.scaled = true;
      this.paint();
    });
    for (const button of root.querySelectorAll("[data-zoom]")) on(button, "click", () => this.zoom(button.dataset.zoom));
    if (part.joint) {
      on(part["angle-model"], "change", () => this.listJoints());
      for (const select of [part["angle-model"], part.joint]) on(select, "change", () => this.paint());
    }
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
    const {element} = plot, place = (event) => event.clientX - element.getBoundingClientRect().left;
    const moment = (event) => clamp(plot.seconds(place(event)), this.time.from, this.time.to);
    let held = null; // what the pointer that is down does: {from: where its band starts, or null; x, pointer}
    on(element, "pointerdown", (event) => {
      if (event.button || held) return;
      element.setPointerCapture(event.pointerId);
      const below = event.clientY - element.getBoundingClientRect().top > plot.foot;
      held = {from: event.shiftKey || below ? moment(event) : null, x: place(event), pointer: event.pointerId};
      if (held.from === null) this.viewer.goTo(this.time.index(moment(event)));
    });
    on(element, "pointermove", (event) => {
      if (held && event.pointerId !== held.pointer) return;
      if (held && held.from === null) this.viewer.goTo(this.time.index(moment(event)));
      else if (held) for (const each of this.all) each.showBand(held.from, moment(event));
      this.point(event.pointerType === "touch" && !held ? null : this.time.index(moment(event)));
    });
    const end = (event) => {
      if (!held || event.pointerId !== held.pointer) return;
      const {from, x} = held, to = moment(event);
      held = null;
      for (const each of this.all) each.showBand(null);
      if (event.type === "pointerup" && from !== null) {
        if (abs(place(event) - x) < 5) this.viewer.goTo(this.time.index(to));
        else this.time.show(min(from, to), max(from, to));
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
      viewer.pause();
      this.point(null);
      viewer.goTo(clamp(viewer.index + frames, 0, viewer.last));
    } else if (zoom) this.zoom(zoom);
    else return;
    event.preventDefault();
  }
}

for (const root of document.querySelectorAll("[data-plots]")) {
  const hand = document.querySelector("[data-hand-viewer]"), start = () => new Plots(root, hand.viewer);
  if (hand.viewer) start(); else on(hand, "viewerready", start, {once: true});
}
})();
