"use strict";
/* The coach's page: shows the state and the live poses that /events sends, and enters marks at /enter.
   Sentences come with the state; the words of buttons and labels are here. Lengths are mm, times s.
   The token that the address brings stays in this page's storage: it is a header, and no cookie, which would go
   to every port of this computer. window.coach: the newest state, which frames were drawn, where points were. */
(() => {
const DELAY_S = .4, MOST_FRAMES = 300, SILENT_S = 5, STILL_S = 2, SURE_S = 4, SAID_S = 6, BAR_TIMES = 4;
const TEXTS = {
  en: {
    sound: "Sound", password: "Password", open: "Open", ready: "Done", skip: "Skip", undo: "Undo",
    finish: "Finish", sure: "Finish: press again", believe: "settled", care: "with care", no: "not yet", asked: "asked for now",
    settled: "{settled} of {of} joints settled", scale: "Error (1 sd); the line is at the {wanted_mm} mm wanted.",
    touch: "A touch", fingertip: "Fingertip of", meets: "rests on", enter: "Enter", length: "A length", quantity: "Of",
    value: "mm", sd: "± mm (1 sd)", log: "What has happened", hands: "{ready} of {all} hands done", sent: "Entered.",
    since: "since {since}", times: "{times} times", seconds: "{seconds} s", hand: "The hand as it moves now", drawing: "How to move",
    lost: "Connection lost: the last state is {age} s old.", never: "Nothing has come from the coach yet.",
    still: "No poses come: the hand is {age} s old.", unsent: "Not entered: no connection.", 401: "This page asks for the password.",
    403: "This page has no key: open the address that the terminal shows.", 503: "Too many pages are open: close one.",
    right: "right", left: "left", thumb: "thumb", index: "index finger", middle: "middle finger", ring: "ring finger", little: "little finger",
  },
  ja: {
    sound: "音", password: "パスワード", open: "開く", ready: "できた", skip: "とばす", undo: "取り消す",
    finish: "終了", sure: "終了:もう一度押す", believe: "決まった", care: "注意して使う", no: "まだ", asked: "いま動かす関節",
    settled: "{of} 関節のうち {settled} が決まった", scale: "誤差(1 sd)。線は目標の {wanted_mm} mm。",
    touch: "触れる", fingertip: "指先", meets: "触れる先", enter: "入力", length: "長さ", quantity: "どこ",
    value: "mm", sd: "± mm(1 sd)", log: "これまでの経過", hands: "{all} 手のうち {ready} が済んだ", sent: "入力した。",
    since: "{since} から", times: "{times} 回", seconds: "{seconds} 秒", hand: "いまの手の動き", drawing: "動かし方",
    lost: "接続が切れた:最後の状態は {age} 秒前。", never: "コーチからまだ何も届いていない。",
    still: "姿勢が届いていない:手は {age} 秒前のもの。", unsent: "入力できない:接続がない。", 401: "パスワードが必要。",
    403: "このページには鍵がない:端末に表示されたアドレスを開く。", 503: "開いているページが多すぎる:どれかを閉じる。",
    right: "右手", left: "左手", thumb: "親指", index: "示指", middle: "中指", ring: "環指", little: "小指",
  },
};
const $ = (id) => document.getElementById(id);
const now = () => performance.now() / 1000;
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const page = {state: null, heard: null, cut: false, refused: 0, said: 0, link: null, colours: {}, audio: null};
const live = {frames: [], lag: null, heard: null, shown: null, dirty: false, base: null, box: null};
const coach = window.coach = {page, live, drawn: [], points: []};

/* ---- words ---- */

const say = (key, values = {}) => (TEXTS[document.documentElement.lang][key] ?? key).replace(/\{(\w+)\}/g, (_, name) => values[name]);
const joined = (parts, mark = " · ") => parts.filter((part) => part).join(mark);

function put(id, text) { // what has not changed is not said again by a screen reader
  if ($(id).textContent !== text) $(id).textContent = text;
  $(id).hidden = !text;
}

function make(tag, more = {}, ...inside) {
  const made = Object.assign(document.createElement(tag), more);
  made.append(...inside);
  return made;
}

function speak() {
  for (const part of document.querySelectorAll("[data-text]")) part.textContent = say(part.dataset.text);
  for (const id of ["hand", "drawing"]) $(id).setAttribute("aria-label", say(id));
}

/* ---- vectors ---- */

const minus = (a, b) => a.map((part, i) => part - b[i]);
const plus = (a, b) => a.map((part, i) => part + b[i]);
const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
const boxOf = (list) => [Math.min, Math.max].map((end) => [0, 1, 2].map((i) => end(...list.map((v) => v[i]))));

function turn([w, x, y, z], v) {
  const t = cross([x, y, z], v).map((part) => 2 * part);
  return plus(plus(v, t.map((part) => w * part)), cross([x, y, z], t));
}

/* From a hand's frame, x distal and z dorsal, to right, up (distal) and towards the viewer (dorsal): no hand is
   mirrored. A little from the thumb's side and the wrist, to see fingers bend. */
function seen([x, y, z]) {
  const side = page.state.title?.hand === "left" ? -.6 : .6, [c, s, d, t] = [Math.cos(side), Math.sin(side), Math.cos(.3), Math.sin(.3)];
  const [across, near] = [s * z - c * y, c * z + s * y];
  return [across, d * x + t * near, d * near - t * x];
}

/* ---- drawing ---- */

function dot(pen, [x, y], radius, look) {
  pen.strokeStyle = page.colours[look];
  pen.lineWidth = Math.max(1.5, radius / 3);
  for (const from of look === "care" ? [0, Math.PI / 2] : [0]) { // the left half over all of it
    pen.beginPath();
    pen.arc(x, y, radius, from, 3 * from || 7);
    pen.fillStyle = from || look === "believe" ? page.colours[look] : page.colours.paper;
    pen.fill();
    if (!from) pen.stroke();
  }
}

/* Draw points (null where there is none) as `seen`, so that a box [low, high] of them fits the canvas. joint_of: the
   joint, or receiver, of each point. */
function paint(canvas, points, {lines, joint_of: joints}, [low, high], faint = 1) {
  const verdicts = new Map(page.state.joints?.map((own) => [own.joint, own.verdict]));
  const looks = joints.map((joint) => (canvas.id === "hand" && verdicts.get(joint)) || "plain");
  const named = [page.state.request?.joints ?? [], ...page.state.findings]; // what is asked for, and what is wrong
  const hot = joints.map((joint) => joint && named.some((own) => own.includes(joint)));
  const ratio = devicePixelRatio || 1, [wide, tall] = [canvas.clientWidth, canvas.clientHeight];
  const pen = canvas.getContext("2d"), size = minus(high, low), centre = low.map((part, i) => part + size[i] / 2);
  const scale = .84 * Math.min(wide / Math.max(size[0], 60), tall / Math.max(size[1], 60));
  if (canvas.width !== Math.round(wide * ratio)) canvas.width = Math.round(wide * ratio);
  if (canvas.height !== Math.round(tall * ratio)) canvas.height = Math.round(tall * ratio);
  pen.setTransform(ratio, 0, 0, ratio, wide * ratio / 2, tall * ratio / 2);
  if (faint === 1) pen.clearRect(-wide, -tall, 2 * wide, 2 * tall);
  pen.globalAlpha = faint;
  pen.lineCap = "round";
  const at = points.map((point) => {
    if (!point) return null;
    const [x, y, z] = minus(point, centre), near = scale * 700 / (700 - z);
    return [x * near, -y * near, z];
  });
  const depth = ([a, b]) => at[a][2] + at[b][2], drawn = lines.filter(([a, b]) => at[a] && at[b]);
  for (const [a, b] of drawn.sort((one, other) => depth(one) - depth(other))) {
    for (const [width, colour] of [[9, page.colours.soft], [7, hot[a] || hot[b] ? page.colours.accent : page.colours.bone]]) {
      pen.beginPath();
      pen.moveTo(...at[a].slice(0, 2));
      pen.lineTo(...at[b].slice(0, 2));
      pen.lineWidth = Math.max(width - 6, width * scale * .8);
      pen.strokeStyle = colour;
      pen.stroke();
    }
  }
  const order = at.map((_, i) => i).filter((i) => at[i]).sort((i, j) => at[i][2] - at[j][2]);
  for (const i of order) {
    const radius = looks[i] === "plain" ? Math.max(1, 2.5 * scale) : Math.max(4, 4.6 * scale);
    if (hot[i]) dot(pen, at[i], radius * 1.8, "accent");
    dot(pen, at[i], radius, looks[i]);
  }
}

/* The earliest batches say how far the recording's clock is behind this one's. One that comes much later or
   earlier: this computer slept, or another recording has begun. */
function hear({times_s, poses}) {
  const lag = now() - times_s.at(-1);
  if (live.lag === null || Math.abs(lag - live.lag) > 1) Object.assign(live, {frames: [], lag});
  live.lag = Math.min(lag, live.lag + .01);
  live.frames.push(...times_s.map((time, i) => ({time, poses: poses[i]})));
  live.frames.splice(0, live.frames.length - MOST_FRAMES);
  live.heard = now();
}

/* Before there is a skeleton: every digit's receivers, in their order, from the hand's. */
const chains = (receivers) => ({
  lines: receivers.map((name, i) => [receivers[i - 1]?.split("_")[0] === name.split("_")[0] ? i - 1 : 0, i]),
  joint_of: receivers.map((name) => (name.includes("_") ? name : "")),
});

function drawHand() {
  const {state} = page, until = now() - live.lag - DELAY_S;
  while (live.frames.length > 1 && live.frames[1].time <= until) live.frames.shift();
  const frame = live.frames[0]?.time <= until ? live.frames[0] : live.shown;
  if (!state || !frame || (frame === live.shown && !live.dirty)) return;
  if (frame !== live.shown) coach.drawn = [...coach.drawn.slice(-MOST_FRAMES), frame.time];
  Object.assign(live, {shown: frame, dirty: false});
  const {skeleton, receivers} = state, poses = new Map(receivers.map((name, i) => [name, frame.poses[i]]));
  live.base = poses.get("hand") ?? live.base;
  if (!live.base) return;
  const carried = skeleton?.carried_by ?? receivers, [w, x, y, z] = live.base.slice(3);
  const points = carried.map((name, i) => {
    const pose = poses.get(name), place = skeleton ? skeleton.at_mm[i] : [0, 0, 0];
    return pose && seen(turn([w, -x, -y, -z], minus(plus(turn(pose.slice(3), place), pose), live.base)));
  });
  const known = points.filter((point) => point);
  if (!known.length) return;
  const [low, high] = boxOf(known), [before, after] = live.box ?? [low, high], shrunk = after.map((x, i) => (x - before[i]) / 1000);
  live.box = [low.map((x, i) => Math.min(x, before[i] + shrunk[i])), high.map((x, i) => Math.max(x, after[i] - shrunk[i]))];
  paint($("hand"), points, skeleton ?? chains(receivers), live.box);
  coach.points = points;
}

/* To and fro; where no motion is wanted, both ends over each other. */
function drawRequest() {
  const {request, skeleton} = page.state ?? {}, frames = request?.drawing, canvas = $("drawing");
  canvas.hidden = !frames?.length;
  if (canvas.hidden) return;
  const last = frames.length - 1, sway = calm.matches ? 1 : (1 - Math.cos(Math.PI * now() / 1.6)) / 2;
  const frame = Math.round(sway * last);
  if (frame === page.drawn && !page.dirty) return;
  Object.assign(page, {drawn: frame, dirty: false});
  const points = frames.map((own) => own.map((point) => point && seen(point)));
  const box = boxOf(points.flat().filter((point) => point));
  paint(canvas, points[frame], skeleton, box);
  if (calm.matches) paint(canvas, points[0], skeleton, box, .35);
}

function tick() {
  drawHand();
  drawRequest();
  requestAnimationFrame(tick);
}

function readColours() {
  const read = getComputedStyle(document.documentElement), hue = (name) => read.getPropertyValue(`--${name}`).trim();
  page.colours = {believe: hue("green"), care: hue("amber"), accent: hue("blue")};
  for (const name of ["no", "plain", "paper", "soft", "bone"]) page.colours[name] = hue(name);
  page.dirty = live.dirty = true;
}

/* ---- the state ---- */

function jointRow({joint, name, sd_mm, verdict, reason}, state) {
  const known = typeof sd_mm === "number", bar = make("span", {className: "bar"}, make("i"));
  if (known) bar.firstChild.style.width = `${100 * Math.min(1, sd_mm / BAR_TIMES / state.wanted_mm)}%`;
  return make("li", {className: `${verdict} ${state.request?.joints?.includes(joint) ? "asked" : ""}`, title: reason ?? ""},
    make("i", {className: `mark ${verdict}`}),
    make("span", {}, name, make("span", {className: "unseen", textContent: `: ${say(verdict)}`})),
    known ? bar : make("i"), make("b", {textContent: known ? `${sd_mm.toFixed(1)} mm` : ""}));
}

function handItem({subject, hand, done}, title) {
  const item = make("li", {textContent: joined([done ? "✓" : "–", subject, say(hand)], " ")});
  if (subject === title.subject && hand === title.hand) item.setAttribute("aria-current", "true");
  return item;
}

function offer(select, choices) {
  if (select.dataset.choices === JSON.stringify(choices)) return; // what was chosen stays chosen
  select.dataset.choices = JSON.stringify(choices);
  select.replaceChildren(...choices.map((value) => make("option", {value, textContent: say(value.replace(/^\w+ /, ""))})));
  if (select.name === "other") select.selectedIndex = 1; // a digit does not rest on itself
}

function show(state) {
  const {title, request, done, marks, findings, joints, hands} = state;
  const own = joined([title.study, title.subject, say(title.hand)]);
  document.querySelector("main").hidden = false;
  put("title", own);
  document.title = joined([own, "Shukotsu"], " – ");
  put("file", joined([title.file, say("since", title)], ", "));
  put("time", `${Math.floor(state.time_s / 60)}:${String(Math.floor(state.time_s % 60)).padStart(2, "0")}`);
  put("request", request?.sentence ?? state.summary ?? "");
  $("request").classList.toggle("long", $("request").textContent.length > 120);
  put("how", joined([request?.times > 1 && say("times", request), request && say("seconds", request)]));
  put("done", done?.sentence ?? "");
  $("done").dataset.success = done?.success ?? "";
  const message = state.phase === "lost" ? "" : state.message;
  if (message) page.said = now(); // the coach says it once, and the next state is there soon
  if (message || now() - page.said > SAID_S) put("message", message);
  $("findings").hidden = !findings.length;
  if ($("findings").textContent !== findings.join("")) $("findings").replaceChildren(...findings.map((text) => make("li", {textContent: text})));
  put("settled", joints.length ? say("settled", state) : "");
  put("scale", joints.length ? say("scale", state) : "");
  $("joints").replaceChildren(...joints.map((joint) => jointRow(joint, state)));
  put("of-study", hands.length ? say("hands", {ready: hands.filter((hand) => hand.done).length, all: hands.length}) : "");
  $("hands").replaceChildren(...hands.map((hand) => handItem(hand, title)));
  $("log").replaceChildren(...state.log.toReversed().map(({time_s, sentence}) =>
    make("li", {}, make("time", {textContent: `${time_s.toFixed(1)} s`}), sentence)));
  offer($("touch").digit, marks.digits);
  offer($("touch").other, [...marks.digits.map((digit) => `meets ${digit}`), ...marks.points.map((point) => `point ${point}`)]);
  offer($("length").quantity, marks.quantities);
  for (const id of ["touch", "length"]) $(id).parentElement.hidden = !$(id).querySelector("option");
  for (const button of document.querySelectorAll("main button")) {
    button.disabled = state.phase === "ended" || (!request && /done|skip/.test(button.dataset.enter));
  }
  page.dirty = live.dirty = true;
}

function take(state) {
  const before = page.state;
  page.state = state;
  show(state);
  if (state.summary && !before?.summary) tone(523, 659, 784);
  else if (state.done && state.done.number !== before?.done?.number) tone(...(state.done.success === false ? [330, 247] : [659, 880]));
}

function tone(...pitches) {
  pitches.forEach((pitch, i) => {
    if (!page.audio) return;
    const source = page.audio.createOscillator(), volume = page.audio.createGain(), at = page.audio.currentTime + .16 * i;
    source.frequency.value = pitch;
    volume.gain.setValueAtTime(.2, at);
    volume.gain.exponentialRampToValueAtTime(.001, at + .3);
    source.connect(volume).connect(page.audio.destination);
    source.start(at);
    source.stop(at + .3);
  });
}

/* Say what no longer comes. A hand that does not move looks like one that is held still. */
function watch() {
  const age = (since) => (since === null ? 0 : now() - since), silent = age(page.heard), still = age(live.heard);
  const phase = page.state?.phase, lost = phase !== "ended" && (page.cut || silent > SILENT_S); // an end is no loss
  if (silent > SILENT_S && !page.cut) page.link.abort(); // nor does the browser see that a network is gone
  const coarse = (time) => ({age: 5 * Math.floor(time / 5)}), refused = page.refused && say(String(page.refused));
  put("lost", lost ? joined([page.state ? say("lost", coarse(silent)) : !refused && say("never"), refused], " ")
    : phase === "lost" ? page.state.message // each change is read aloud
    : still > STILL_S && phase !== "ended" ? say("still", coarse(still)) : "");
  $("key").hidden = page.refused !== 401;
  document.body.classList.toggle("lost", lost || still > STILL_S || phase === "lost");
}

/* ---- the server ---- */

function ask(path, body, signal) {
  const headers = {"Content-Type": "application/json", "X-Coach-Token": sessionStorage.token ?? ""};
  return fetch(path, {method: body ? "POST" : "GET", headers, body: body && JSON.stringify(body), signal});
}

async function enter(entry) {
  const reply = await ask("/enter", entry).catch(() => null);
  put("sent", !reply ? say("unsent") : reply.ok ? say("sent") : await reply.text());
  setTimeout(put, 3000, "sent", "");
}

/* Read Server-Sent Events until they end; throws where the connection breaks. */
async function read(reply) {
  const reader = reply.body.pipeThrough(new TextDecoderStream()).getReader(), acts = {state: take, poses: hear};
  for (let rest = "", part; !(part = await reader.read()).done;) {
    const events = (rest + part.value).split("\n\n");
    rest = events.pop();
    Object.assign(page, {heard: now(), cut: false});
    for (const event of events) {
      const [, kind, data] = event.match(/^event: (\w+)\ndata: (.*)$/);
      acts[kind]?.(JSON.parse(data));
    }
  }
}

async function follow() {
  for (let wait_s = .5; ; wait_s = Math.min(2 * wait_s, 5)) {
    page.link = new AbortController();
    try {
      const reply = await ask("/events", null, page.link.signal);
      page.refused = reply.ok ? 0 : reply.status;
      if (reply.ok) wait_s = .25;
      if (reply.ok) await read(reply);
    } catch {} // it broke, or was never there
    page.cut = true;
    watch();
    await new Promise((go) => setTimeout(go, 1000 * wait_s));
  }
}

function listen() {
  for (const button of document.querySelectorAll("[data-enter]")) {
    const kind = button.dataset.enter;
    button.addEventListener("click", () => {
      const name = (key) => (button.textContent = say(button.dataset.text = key));
      if (button.dataset.text === "finish") setTimeout(name, 1000 * SURE_S, "finish", name("sure"));
      else enter(/done|skip/.test(kind) ? {kind, number: page.state.request.number} : {kind});
    });
  }
  const submit = (id, act) => $(id).addEventListener("submit", (event) => {
    event.preventDefault();
    act(Object.fromEntries(new FormData($(id))));
  });
  submit("touch", ({digit, other}) => {
    const [kind, name] = other.split(/ (.*)/);
    enter({kind: "touch", digit, ...(kind === "meets" ? {meets: name} : {part: "tip", point: name})});
  });
  submit("length", ({quantity, value_mm, sd_mm}) =>
    enter({kind: "length", quantity, value_mm: Number(value_mm), sd_mm: Number(sd_mm)}));
  submit("key", async ({password}) => {
    const reply = await ask("/open", {password});
    $("key").reset();
    if (!reply.ok) return put("message", await reply.text());
    sessionStorage.token = (await reply.json()).token;
    location.reload();
  });
  $("sound").addEventListener("click", () => {
    page.audio = page.audio ? void page.audio.close() : new AudioContext();
    $("sound").setAttribute("aria-pressed", Boolean(page.audio));
    tone(659, 880);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);
  new ResizeObserver(() => (page.dirty = live.dirty = true)).observe($("hand"));
  addEventListener("hashchange", () => location.reload());
}

if (location.hash) {
  sessionStorage.token = location.hash.slice(1);
  history.replaceState(null, "", location.pathname); // not where it could be read over a shoulder
}
listen();
speak();
readColours();
tick();
watch();
setInterval(watch, 500);
follow();
})();
