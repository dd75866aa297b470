"use strict";
/* The moving hand: reads what Python packs (__init__.py) and draws it with WebGL 2. Lengths are mm, times s.
   Nothing moves before Play is pressed, so that prefers-reduced-motion has nothing to turn off.
   An element with data-hand-viewer gets a property `viewer` and sends "viewerloaded", "viewerready" where it can
   draw, then "viewermoved" with another frame, "viewershown" when other skeletons are chosen and "viewertold" with
   new words; all bubble. Without WebGL a still picture stands for the hand, and all else goes on.
     viewer.goTo(index), viewer.play(), viewer.pause(); viewer.index, viewer.last
     viewer.shown: places in header.skeletons of those in view; viewer.pictures(): the same by picture
     viewer.frames, viewer.times: of each index; viewer.header.extra: what the page was given besides
     viewer.blocks[name]: {values, count, width}, values in the order (index, item, part), NaN in gaps */
const {floor, min, max, PI} = Math, QUARTER = PI / 2;
const FIELD = Math.tan(PI / 15); // half of a view 24 degrees high
const LINE = 14; // px from the name of a fingertip to one above it
const CLASSES_MM = [0.5, 1, 2, 4, 8]; // upper ends; the last class is open
const FLOATS = 12; // an instance: both ends, both radii, colour
const SIDES = 16;

const on = (target, event, act, options) => target.addEventListener(event, act, options);
const clamp = (value, low, high) => min(high, max(low, value));
const partsOf = (root) =>
  Object.fromEntries([...root.querySelectorAll("[data-part]")].map((part) => [part.dataset.part, part]));

/* ---- the recording ---- */

async function inflated(base64) {
  const packed = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/* The blocks by name, values in the order (frame, item, part), NaN in gaps. */
async function unpack(header) {
  const raw = await inflated(header.data), blocks = {};
  let start = 0;
  for (const {name, frames, count, width, planes, step} of header.blocks) {
    const wide = count * width, size = frames * wide;
    const values = width === 1 ? new Float64Array(size) : new Float32Array(size);
    for (let channel = 0; channel < wide; channel++) {
      for (let frame = 0, steps = 0; frame < frames; frame++) {
        let code = 0;
        for (let plane = planes - 1; plane >= 0; plane--) {
          code = code * 256 + raw[start + plane * size + channel * frames + frame];
        }
        if (code) steps += code % 2 ? (code - 1) / 2 : -code / 2;
        values[frame * wide + channel] = code ? steps * step : NaN;
      }
    }
    blocks[name] = {values, count, width};
    start += planes * size;
  }
  header.data = "";
  return blocks;
}

/* ---- vectors, matrices by rows ---- */

const apply = (m, v) => [0, 3, 6].map((row) => m[row] * v[0] + m[row + 1] * v[1] + m[row + 2] * v[2]);
const times = (a, b) => a.map((_, i) => {
  const row = i - (i % 3), column = i % 3;
  return a[row] * b[column] + a[row + 1] * b[column + 3] + a[row + 2] * b[column + 6];
});
const minus = (a, b) => a.map((part, i) => part - b[i]);
const along = (a, direction, length) => a.map((part, i) => part + direction[i] * length);

function rotation([w, x, y, z]) {
  const s = 2 / (w * w + x * x + y * y + z * z);
  return [
    1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
    s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x),
    s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y),
  ];
}

/* Turned about the screen's vertical, then its horizontal. */
function turned(m, right, down) {
  const [c, s, d, t] = [Math.cos(right), Math.sin(right), Math.cos(down), Math.sin(down)];
  return times([1, 0, 0, 0, d, -t, 0, t, d], times([c, 0, s, 0, 1, 0, -s, 0, c], m));
}

/* ---- drawing ---- */

const VERTEX = `#version 300 es
layout(location=0) in vec4 ring; layout(location=1) in vec3 shape;
layout(location=2) in vec3 a; layout(location=3) in vec3 b;
layout(location=4) in vec2 radius; layout(location=5) in vec4 colour;
uniform mat3 turn; uniform vec3 centre, eye; uniform vec4 lens;
out vec3 normal; out vec4 tint;
void main() {
  vec3 axis = b - a;
  float span = length(axis);
  vec3 w = span > 1e-4 ? axis / span : vec3(0, 1, 0);
  vec3 u = normalize(cross(w, abs(w.z) < .9 ? vec3(0, 0, 1) : vec3(1, 0, 0)));
  vec3 side = u * ring.x + cross(w, u) * ring.y;
  float r = mix(radius.x, radius.y, ring.z);
  vec3 p = turn * (a + w * (ring.z * span + ring.w * r) + side * shape.x * r - centre) - eye;
  normal = turn * (side * shape.y + w * shape.z);
  tint = colour;
  gl_Position = vec4(p.xy * lens.xy, p.z * lens.z + lens.w, -p.z);
}`;
const FRAGMENT = `#version 300 es
precision mediump float;
in vec3 normal; in vec4 tint;
out vec4 pixel;
void main() {
  vec3 n = normalize(normal);
  if (n.z < 0.) n = -n;
  float lit = .42 + .48 * max(dot(n, vec3(-.35, .55, .76)), 0.) + .16 * n.z;
  float shine = .22 * pow(max(dot(n, vec3(-.19, .29, .94)), 0.), 24.);
  pixel = vec4((tint.rgb * lit + shine) * tint.a, tint.a);
}`;

/* Solids of revolution; each ring: place along the axis, beyond it (radii), radius, normal (out, along). */
const arc = (steps, at, from, to) => Array.from({length: steps + 1}, (_, i) => {
  const angle = from + (to - from) * i / steps;
  return [at, Math.sin(angle), Math.cos(angle), Math.cos(angle), Math.sin(angle)];
});
const SOLIDS = {
  bone: [[0, 0, 1, 1, 0], [.16, 0, .78, .97, .25], [.5, 0, .58, 1, 0], [.84, 0, .76, .97, -.25], [1, 0, 1, 1, 0]],
  ball: arc(8, 0, -QUARTER, QUARTER),
  rod: [[0, 0, 1, 1, 0], [1, 0, 1, 1, 0]],
  disc: [[0, 0, 0, 0, 1], [0, 0, 1, 0, 1]],
};

function solid(gl, rings) {
  const vertices = [], order = [];
  rings.forEach(([at, beyond, radius, out, forward], row) => {
    for (let i = 0; i <= SIDES; i++) {
      const angle = 2 * PI * i / SIDES, corner = row * (SIDES + 1) + i;
      vertices.push(Math.cos(angle), Math.sin(angle), at, beyond, radius, out, forward);
      const below = corner - SIDES - 1;
      if (row && i) order.push(below - 1, corner, corner - 1, below - 1, below, corner);
    }
  });
  const array = gl.createVertexArray(), instances = gl.createBuffer();
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(vertices), gl.STATIC_DRAW);
  attribute(gl, 0, 4, 7, 0, 0);
  attribute(gl, 1, 3, 7, 4, 0);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(order), gl.STATIC_DRAW);
  gl.bindBuffer(gl.ARRAY_BUFFER, instances);
  attribute(gl, 2, 3, FLOATS, 0, 1);
  attribute(gl, 3, 3, FLOATS, 3, 1);
  attribute(gl, 4, 2, FLOATS, 6, 1);
  attribute(gl, 5, 4, FLOATS, 8, 1);
  return {array, instances, corners: order.length};
}

function attribute(gl, place, size, stride, at, divisor) {
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, size, gl.FLOAT, false, 4 * stride, 4 * at);
  gl.vertexAttribDivisor(place, divisor);
}

/* Whether the processor draws: smooth edges would halve the frames, so a picture at rest alone has them. */
function isSlow() {
  const gl = document.createElement("canvas").getContext("webgl2", {failIfMajorPerformanceCaveat: true});
  const named = gl?.getExtension("WEBGL_debug_renderer_info");
  const renderer = gl?.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return !gl || /swiftshader|llvmpipe|software/i.test(renderer);
}

/* Where the browser has no WebGL 2, `gl` is null and nothing can be drawn. */
class Painter {
  constructor(canvas) {
    this.slow = isSlow();
    this.gl = canvas.getContext("webgl2", {antialias: !this.slow, preserveDrawingBuffer: true});
    if (this.gl) this.prepare();
  }

  prepare() {
    const gl = this.gl, program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.place = Object.fromEntries(
      ["turn", "centre", "eye", "lens"].map((name) => [name, gl.getUniformLocation(program, name)]));
    this.solids = Object.entries(SOLIDS).map(([name, rings]) => [name, solid(gl, rings)]);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  clear(width, height) {
    if (this.gl.canvas.width !== width || this.gl.canvas.height !== height) {
      Object.assign(this.gl.canvas, {width, height});
    }
    this.gl.clearColor(0, 0, 0, 0);
    this.gl.clear(this.gl.COLOR_BUFFER_BIT | this.gl.DEPTH_BUFFER_BIT);
  }

  /* Draw shapes, lists of instances by solid, into a part of the canvas. */
  paint(shapes, [x, y, width, height], {turn, centre, pan, distance}) {
    const gl = this.gl, near = distance / 20, far = distance * 4, deep = 1 / (near - far);
    gl.viewport(x, y, width, height);
    gl.uniformMatrix3fv(this.place.turn, true, turn);
    gl.uniform3fv(this.place.centre, centre);
    gl.uniform3f(this.place.eye, pan[0], pan[1], distance);
    gl.uniform4f(this.place.lens, height / width / FIELD, 1 / FIELD, (near + far) * deep, 2 * near * far * deep);
    for (const [name, {array, instances, corners}] of this.solids) {
      const list = shapes[name];
      if (!list.length) continue;
      gl.depthMask(name !== "disc");
      gl[name === "disc" ? "disable" : "enable"](gl.CULL_FACE);
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, instances);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(list), gl.DYNAMIC_DRAW);
      gl.drawElementsInstanced(gl.TRIANGLES, corners, gl.UNSIGNED_SHORT, 0, list.length / FLOATS);
    }
    gl.depthMask(true);
  }
}

/* ---- the viewer ---- */

class HandViewer {
  constructor(root, header, blocks) {
    const {digits, skeletons} = header;
    Object.assign(this, {root, header, digits, skeletons, blocks, index: 0, asleep: true, playing: false});
    Object.assign(this, {times: blocks.time.values, frames: blocks.frame.values});
    Object.assign(this, {last: this.frames.length - 1, shown: header.shown, part: partsOf(root)});
    this.canvas = this.part.canvas;
    this.painter = new Painter(this.canvas);
    this.still = this.baseAt(0);
    this.home();
    this.readColours();
    this.listen();
  }

  vector(block, item, frame = this.index) {
    const {values, count, width} = this.blocks[block], at = (frame * count + item) * width;
    return Array.from(values.subarray(at, at + width));
  }

  /* Where the view stands: transmitter frame to right, up (distal), towards the viewer (dorsal). In a gap of
     the base receiver it stands where it stood last. */
  baseAt(frame) {
    const {base, firstBase, upright} = this.header;
    let last = max(frame, firstBase);
    while (isNaN(this.vector("receivers", base, last)[0])) last--;
    const [w, x, y, z] = this.vector("rotations", base, last);
    return {turn: times(upright, rotation([w, -x, -y, -z])), origin: this.vector("receivers", base, last)};
  }

  error(skeleton, digit) { return this.vector(`errors${skeleton}`, digit)[0]; }

  /* A point in the transmitter frame: it rides on a receiver, or is stored because the skeleton is fitted. */
  place(s, point, frame = this.index) {
    const {seats} = this.skeletons[s];
    if (!seats) return this.vector(`points${s}`, point, frame);
    if (!seats[point]) return [NaN, NaN, NaN];
    const [receiver, local] = seats[point], turn = rotation(this.vector("rotations", receiver, frame));
    return along(this.vector("receivers", receiver, frame), apply(turn, local), 1);
  }

  seen(place, base) { return apply(base.turn, minus(place, base.origin)); }

  /* ---- the camera ---- */

  home() {
    Object.assign(this, {turn: [1, 0, 0, 0, 1, 0, 0, 0, 1], pan: [0, 0], zoom: 1});
    this.wake();
  }

  look(from) {
    const thumb = this.header.hand === "right" ? QUARTER : -QUARTER;
    const [right, down] = {back: [0, 0], palm: [PI, 0], thumb: [thumb, 0], tips: [PI, QUARTER]}[from];
    this.home();
    this.orbit(right, down);
  }

  orbit(right, down) {
    this.turn = turned(this.turn, right, down);
    this.wake();
  }

  /* Move the picture by CSS pixels. */
  shift(right, down) {
    const scale = this.mmPerPixel();
    this.pan = [this.pan[0] - right * scale, this.pan[1] + down * scale];
    this.wake();
  }

  enlarge(factor) {
    this.zoom = clamp(this.zoom * factor, .3, 8);
    this.wake();
  }

  distance() {
    const [, , width, height] = this.parts()[0], [wide, high, deep] = this.header.half, across = max(wide, deep);
    return (across + max(across * height / width, high) / FIELD) / this.zoom;
  }

  mmPerPixel() { return 2 * FIELD * this.distance() / this.canvas.clientHeight; }

  /* The pictures' places in CSS pixels. */
  parts() {
    const pictures = this.pictures(), width = this.canvas.clientWidth / pictures.length;
    return pictures.map((_, i) => [i * width, 0, width, this.canvas.clientHeight]);
  }

  /* ---- what is drawn ---- */

  /* Which skeletons each picture holds. */
  pictures() {
    return this.part.over?.checked ? [this.shown] : this.shown.map((s) => [s]);
  }

  readColours() {
    const style = getComputedStyle(this.root);
    const read = (name) => {
      const hex = style.getPropertyValue(`--${name}`).match(/[0-9a-f]{2}/gi);
      return hex.map((part) => parseInt(part, 16) / 255);
    };
    this.colours = {bone: read("bone"), plain: read("plain"), verdict: ["ink", "amber", "no", "no"].map(read)};
    for (const [name, n] of [["digit", 5], ["model", 7], ["error", 7], ["axis", 3]]) {
      this.colours[name] = Array.from({length: n}, (_, i) => read(name + i));
    }
    this.wake();
  }

  class(mm) {
    return this.colours.error[mm === null || isNaN(mm) ? 6 : CLASSES_MM.filter((end) => mm >= end).length];
  }

  shapes(skeletons, base) {
    const shapes = {bone: [], ball: [], rod: [], disc: []};
    const add = (kind, a, b, radii, colour, alpha = 1) => {
      if (!isNaN(a[0] + b[0])) shapes[kind].push(...a, ...b, ...radii, ...colour, alpha);
    };
    for (const s of skeletons) {
      this.addSkeleton(s, skeletons.length > 1, base, add);
      this.addAxes(s, base, add);
    }
    if (this.part.receivers.checked) this.addReceivers(base, add);
    return shapes;
  }

  addSkeleton(s, together, base, add) {
    const {points, bones, sd, belief, tips} = this.skeletons[s], {colours} = this, by = this.part.colour.value;
    const places = points.map((_, i) => this.seen(this.place(s, i), base)), slim = by === "sd" ? .55 : 1;
    const errors = this.digits.map((_, d) => this.class(this.error(s, d)));
    const balls = points.map(() => [0, colours.plain]);
    const grow = (i, size, colour) => (balls[i] = [max(balls[i][0], size), colour ?? balls[i][1]]);
    for (const [start, end, digit, level, shared] of bones) {
      const alone = {digit: colours.digit[digit % 5], tip: errors[digit]}[by] ?? colours.bone;
      const colour = together ? colours.model[this.skeletons[s].place % 7] : alone;
      const thick = slim * max(2.6, 4.3 - .5 * level), thin = thick - .5 * slim;
      if (level < 0) {
        add("rod", places[start], places[end], [1.1, 1.1], colours.plain);
        grow(start, 4.4);
        continue;
      }
      add("bone", places[start], places[end], [shared ? 2.6 : thick, thin], colour);
      grow(start, shared ? 4.4 : thick * 1.08, shared ? null : colour);
      grow(end, thin * 1.06, colour);
    }
    places.forEach((place, i) => {
      let [size, colour] = balls[i];
      // A ball that stands for a number is as large as viewer.html.j2 says in words.
      const digit = tips.indexOf(i), mm = {sd: sd[i], tip: digit < 0 ? undefined : this.error(s, digit)}[by];
      if (mm !== undefined) [size, colour] = [3 + min(8, mm || 0), this.class(mm)];
      else if (digit < 0 && (by === "verdict" || (by === "digit" && belief[i]))) colour = colours.verdict[belief[i]];
      else colour = colour.map((part) => part * .8 + .2);
      add("ball", place, place, [size, size], colour);
    });
  }

  direction(receiver, axis, base) {
    return apply(base.turn, apply(rotation(this.vector("rotations", receiver)), axis));
  }

  addReceivers(base, add) {
    this.header.receivers.forEach((_, i) => this.colours.axis.forEach((colour, axis) => {
      const origin = this.seen(this.vector("receivers", i), base), unit = [0, 1, 2].map((part) => +(part === axis));
      add("rod", origin, along(origin, this.direction(i, unit, base), 10), [.8, .8], colour);
    }));
  }

  /* Of each joint its rotation axis, and the plane that its digit bends in. */
  addAxes(s, base, add) {
    const {plain} = this.colours, {axes, planes} = this.part;
    for (const {point, receiver, axis, plane, normal} of this.skeletons[s].axes) {
      const centre = this.seen(this.place(s, point), base), way = this.direction(receiver, axis, base);
      if (axes.checked) add("rod", along(centre, way, -13), along(centre, way, 13), [.7, .7], plain);
      if (!planes.checked || plane === null) continue;
      add("disc", centre, along(centre, this.direction(plane, normal, base), 1), [11, 11], plain, .22);
    }
  }

  draw() {
    const {clientWidth, clientHeight} = this.canvas;
    if (!this.painter.gl || !clientWidth) return;
    const ratio = min(2, this.painter.slow ? 1 + this.calm : devicePixelRatio), parts = this.parts();
    const base = this.part.follow.checked ? this.baseAt(this.index) : this.still;
    this.painter.clear(Math.round(clientWidth * ratio), Math.round(clientHeight * ratio));
    const camera = {turn: this.turn, centre: this.header.middle, pan: this.pan, distance: this.distance()};
    this.pictures().forEach((skeletons, i) => {
      this.painter.paint(this.shapes(skeletons, base), parts[i].map((length) => length * ratio), camera);
    });
    this.placeLabels(parts, base, camera);
    const scale = this.mmPerPixel(), bar = [1, 5, 10, 20, 50, 100].findLast((mm) => mm / scale < 110);
    this.part.scale.style.width = `${bar / scale}px`;
    this.part.scale.textContent = `${bar} mm`;
  }

  placeLabels(parts, base, {turn, centre, pan, distance}) {
    const shown = this.pictures().map(([first]) => first), labels = this.part.labels.children;
    const n = this.digits.length, taken = [];
    for (let i = 0; i < labels.length; i++) {
      const picture = floor(i / n), part = parts[picture], s = shown[picture];
      labels[i].hidden = !part || !this.part.names.checked;
      if (labels[i].hidden) continue;
      const tip = this.seen(this.place(s, this.skeletons[s].tips[i % n]), base), p = apply(turn, minus(tip, centre));
      const pixels = part[3] / (2 * FIELD * (distance - p[2]));
      const x = part[0] + part[2] / 2 + (p[0] - pan[0]) * pixels;
      const wide = labels[i].halfWide ||= labels[i].offsetWidth / 2 + 2; // measured once: that costs a layout
      let y = part[3] / 2 - (p[1] - pan[1]) * pixels;
      // A name that would lie on another goes above it.
      const hit = () => taken.find((name) => Math.abs(name.x - x) < name.wide + wide && Math.abs(name.y - y) < LINE);
      for (let other = hit(); other; other = hit()) y = other.y - LINE;
      taken.push({x, y, wide});
      labels[i].hidden = !(x > part[0] && x < part[0] + part[2] && y > 0 && y < part[3]);
      labels[i].style.transform = `translate(${x.toFixed(1)}px,${y.toFixed(1)}px)`;
    }
  }

  /* ---- time ---- */

  /* Index of the last frame that is not after a time. */
  upTo(time) { return max(0, this.times.findLastIndex((moment) => moment <= time)); }

  goTo(index) {
    this.show(clamp(index, 0, this.last));
    this.since = null;
  }

  step(by) {
    this.pause();
    this.goTo(this.index + by);
  }

  play() {
    if (this.index === this.last) this.goTo(0);
    this.setPlaying(true);
  }

  pause() { this.setPlaying(false); }

  toggle() { this[this.playing ? "pause" : "play"](); }

  setPlaying(playing) {
    Object.assign(this, {playing, since: null});
    this.wake();
    this.tell();
  }

  show(index) {
    if (index === this.index) return;
    this.index = index;
    this.wake();
    this.send("viewermoved");
  }

  wake(calm = false) {
    this.calm = calm;
    if (!this.asleep) return;
    this.asleep = false;
    requestAnimationFrame((now) => this.tick(now));
  }

  /* By the recording's clock: a slow machine drops frames and is never late. */
  tick(now) {
    this.asleep = true;
    if (this.playing) {
      this.since ??= {now, time: this.times[this.index]};
      const begin = this.times[0], end = this.times[this.last], passed = (now - this.since.now) / 1000 * this.part.speed.value;
      const time = this.since.time + passed;
      if (time < end) this.show(this.upTo(time));
      else if (this.part.loop.checked && end > begin) {
        this.since = {now, time: begin + (time - end) % (end - begin)};
        this.show(this.upTo(this.since.time));
      } else {
        this.show(this.last);
        this.pause();
      }
    }
    this.draw();
    // Without a graphics processor a line of text costs as much as the hand: while it plays, five times a second.
    if (!this.playing || now - this.told > 200) this.tell(now);
    clearTimeout(this.rest);
    if (this.playing) this.wake();
    else if (!this.calm) this.rest = setTimeout(() => this.wake(true), 200);
  }

  /* ---- controls ---- */

  moment(index) {
    return wording("moment", {frame: this.frames[index], time_s: this.times[index].toFixed(3)});
  }

  tell(now = 0) {
    this.told = now;
    this.part.slider.value = this.index;
    this.part.where.textContent = this.moment(this.index);
    this.part.play.textContent = wording(this.playing ? "pause" : "play");
    this.part.slider.setAttribute("aria-valuetext", this.part.where.textContent);
    this.digits.forEach((_, d) => {
      const errors = this.shown.map((s) => this.error(s, d));
      this.part[`error${d}`].textContent = errors.map((mm) => (isNaN(mm) ? "–" : mm.toFixed(1))).join(" | ");
    });
    this.send("viewertold");
  }

  send(event) { this.root.dispatchEvent(new Event(event, {bubbles: true})); }

  /* The skeletons that the two lists name. One that was the second and becomes the first changes places. */
  choose() {
    const {first, second, over} = this.part, before = this.shown;
    if (!first) return;
    if (first.value === second.value) second.value = before[0];
    for (const option of second.options) option.disabled = option.value === first.value;
    over.disabled = !second.value;
    this.shown = [first.value, second.value].filter((value) => value).map(Number);
    if (`${this.shown}` !== `${before}`) this.send("viewershown");
  }

  /* Names over the pictures, what the numbers are, what can be asked for; viewer.css shows the legends. */
  describe() {
    this.choose();
    const {part, root} = this, shown = this.shown.map((s) => this.skeletons[s]);
    const axes = shown.flatMap((skeleton) => skeleton.axes), colour = part.colour.value;
    Object.assign(root.dataset, {colour, together: this.pictures()[0].length > 1, axes: part.receivers.checked});
    for (const i of [0, 1]) {
      part[`name${i}`].hidden = !shown[i];
      part[`name${i}`].textContent = part[`key${i}`].textContent = shown[i]?.model;
      part[`mark${i}`].style.setProperty("--mark", `var(--model${(shown[i]?.place ?? 0) % 7})`);
    }
    part.axes.disabled = !axes.length;
    part.planes.disabled = axes.every(({plane}) => plane === null);
    part.ball.textContent = wording(colour === "tip" ? "fingertip" : "joint");
    part.what.textContent = `${part.colour.selectedOptions[0].text}, mm:`;
    this.tell();
    this.wake();
  }

  listen() {
    const {root, part} = this;
    Object.assign(part.slider, {max: this.last, value: 0});
    on(part.play, "click", () => this.toggle());
    on(part.back, "click", () => this.step(-1));
    on(part.on, "click", () => this.step(1));
    on(part.slider, "input", (event) => this.goTo(Number(event.target.value)));
    on(part.speed, "change", () => (this.since = null));
    on(part.follow, "change", () => (this.still = this.baseAt(this.index)));
    for (const button of root.querySelectorAll("[data-look]")) {
      on(button, "click", () => this.look(button.dataset.look));
    }
    on(root, "change", () => this.describe());
    on(root, "keydown", (event) => this.key(event));
    on(matchMedia("(prefers-color-scheme: dark)"), "change", () => this.readColours());
    new ResizeObserver(() => this.wake()).observe(this.canvas);
    on(this.canvas, "webglcontextlost", (event) => event.preventDefault());
    on(this.canvas, "webglcontextrestored", () => this.wake(this.painter.prepare()));
    this.listenToPointers();
    this.describe();
  }

  listenToPointers() {
    const {canvas} = this, held = new Map(); // the last event of each pointer that is down
    /* One finger that moves up or down scrolls the page; two move and enlarge the hand. */
    canvas.addEventListener("touchmove", (event) => event.touches.length > 1 && event.preventDefault(), {passive: false});
    on(canvas, "pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, event);
    });
    on(canvas, "lostpointercapture", (event) => held.delete(event.pointerId));
    on(canvas, "pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) return;
      const [right, down] = [event.clientX - before.clientX, event.clientY - before.clientY];
      const other = [...held.values()].find(({pointerId}) => pointerId !== event.pointerId);
      held.set(event.pointerId, event);
      if (other) {
        const apart = ({clientX, clientY}) => 1 + Math.hypot(clientX - other.clientX, clientY - other.clientY);
        this.enlarge(apart(event) / apart(before));
        this.shift(right / 2, down / 2);
      } else if (event.shiftKey) this.shift(right, down);
      else this.orbit(right * .01, down * .01);
    });
    on(canvas, "wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return; // else the page could not be scrolled
      event.preventDefault();
      this.enlarge(Math.exp(-event.deltaY * (event.ctrlKey ? .01 : .0015)));
    }, {passive: false});
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select")) return;
    const arrow = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}[event.key];
    if (arrow && event.target !== this.canvas) return;
    if (event.key === " " && event.target.matches("button, [type=checkbox]")) return;
    const act = {
      " ": () => this.toggle(), ",": () => this.step(-1), ".": () => this.step(1),
      "+": () => this.enlarge(1.15), "-": () => this.enlarge(1 / 1.15), 0: () => this.home(),
    }[event.key];
    if (arrow && event.shiftKey) this.shift(20 * arrow[0], 20 * arrow[1]);
    else if (arrow) this.orbit(.09 * arrow[0], .09 * arrow[1]);
    else if (act) act();
    else return;
    event.preventDefault();
  }
}

async function start(root) {
  const lack = (error) => (root.querySelector(".viewer-lacking").textContent = wording("still", {error}));
  try {
    const header = JSON.parse(root.querySelector("script[type='application/json']").textContent);
    const viewer = root.viewer = new HandViewer(root, header, await unpack(header)), moves = !!viewer.painter.gl;
    root.querySelector("form").hidden = !moves;
    root.classList.toggle("moving", moves);
    if (!moves) lack(wording("no_webgl"));
    viewer.send("viewerloaded");
    if (moves) viewer.send("viewerready");
  } catch (error) {
    lack(error.message);
  }
}

document.querySelectorAll("[data-hand-viewer]").forEach(start);
