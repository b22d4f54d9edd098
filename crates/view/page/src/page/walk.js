// The page of a session: sends a person's inputs, and shows the frames that arrive.
'use strict';

const $ = id => document.getElementById(id);
const stage = $('stage'), picture = $('picture'), moving = $('moving'), overlay = $('overlay');
const grid = overlay.getContext('2d');

/** Most pixels of a picture at rest. More would take longer and hardly be visible. */
const MOST_PIXELS = 2.1e6;
/** Share of a picture's pixels without light of their own from which the picture is called a guess. */
const MOST_GUESSED = 0.3;
/** Share of a picture's pixels without known light from which grids of sections show where they are. */
const NOTHING_KNOWN = 0.95;

let socket = null, retry = 400, client = 0, key = '', number = 0, drives = false, ended = false;
let header = null, facts = null, state = null, hasPicture = false;
let gridIsDrawn = false;
let display = { locked: null, stops: 0, tone: 'soft', false_color: false, contours: false, log: false, range: null };
let gridMode = 'auto', movedAt = -1e9;
/** Limits of a saved picture's size. */
let limits = { most_pixels: 0, most_side: 0 };
const sentAt = new Map(), latencies = [], drawnAt = [];

// ---- connection

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/session`);
  socket.binaryType = 'arraybuffer';
  socket.onopen = () => { retry = 400; ended = false; };
  socket.onmessage = event => {
    if (typeof event.data === 'string') told(JSON.parse(event.data));
    else frameCame(event.data);
  };
  socket.onclose = () => {
    drives = false;
    loading(ended ? '' : 'Lost the connection. Trying again …');
    setTimeout(connect, retry);
    retry = Math.min(retry * 1.6, 4000);
  };
}

function say(what, more = {}) {
  if (!socket || socket.readyState !== WebSocket.OPEN) return 0;
  number += 1;
  socket.send(JSON.stringify({ n: number, say: { do: what, ...more } }));
  return number;
}

/** Sends an input that changes the view, and measures its latency. */
function act(what, more) {
  const n = say(what, more);
  if (n && drives) {
    sentAt.set(n, performance.now());
    if (sentAt.size > 500) sentAt.delete(sentAt.keys().next().value);
  }
  $('welcome').classList.add('gone');
}

function told(message) {
  switch (message.is) {
    case 'hello': greet(message); break;
    case 'facts': facts = message; drawPlan(); break;
    case 'state': state = message; showState(); break;
    case 'roles': roles(message); break;
    case 'under': showUnder(message.under); break;
    case 'error': notice(message.text, 6000); break;
  }
}

/**
 * The screens of a wall, by name, and the number of the one that this page shows. Their pictures
 * stand side by side in each frame.
 */
let screens = [], screen = 0;

function learnScreens(names) {
  const wanted = new URLSearchParams(location.search).get('screen');
  screens = names;
  screen = Math.max(0, screens.indexOf(wanted));
  if (wanted !== null && !screens.includes(wanted))
    notice(screens.length ? `No screen is named ${wanted}. There are: ${screens.join(', ')}` : 'This session has no screens: state them by --screen.', 0);
  document.body.dataset.screen = screens[screen] || '';
  for (const canvas of [picture, moving]) Object.assign(canvas.style, screens.length ?
    { width: `${100 * screens.length}%`, left: `${-100 * screen}%`, objectFit: 'fill' } : { width: '', left: '', objectFit: '' });
}

/** The server's session, and the view to return to if another one begins. */
let session = null, viewBefore = null;

function greet(message) {
  [client, key] = [message.client, message.key];
  // A session that has begun anew knows nothing of where the eye was. An address may name a view.
  if (session !== message.session) viewBefore = session ? header && header.options : viewOfAddress();
  session = message.session;
  learn(message);
  learnScreens(message.screens);
  pictureLinks();
  sendDisplay();
  if (document.hidden) say('hidden', { hidden: true });
}

/** Returns the view in the page's address, as Radiance's options. */
function viewOfAddress() {
  const [name, view] = [location.hash.slice(1, 6), location.hash.slice(6)];
  try { return name === 'view=' ? decodeURIComponent(view) : null; } catch { return null; }
}

addEventListener('hashchange', () => {
  const view = viewOfAddress();
  if (view) command(`view ${view}`);
});

function roles({ drives: now, clients }) {
  const began = now && !drives;
  drives = now;
  $('s-role').textContent = clients > 1 ? (now ? `you drive, ${clients - 1} watch` : 'you watch') : '';
  for (const button of document.querySelectorAll('[data-take]')) button.hidden = now;
  if (!began) return;
  sendSize();
  if (viewBefore) command(`view ${viewBefore}`);
  viewBefore = null;
}

// ---- frames

/** Frames are drawn one after the other, in order of arrival. */
let drawing = Promise.resolve();

function frameCame(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const next = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  next.came = performance.now();
  let at = 4 + length;
  const parts = next.parts.map(([x, y, w, h, bytes]) => {
    const blob = new Blob([new Uint8Array(buffer, at, bytes)], { type: next.type });
    at += bytes;
    return createImageBitmap(blob).then(bitmap => ({ x, y, w, h, bitmap }));
  });
  drawing = drawing.then(() => Promise.all(parts)).then(decoded => draw(next, decoded))
    .catch(error => notice(`A frame cannot be shown: ${error}`, 6000))
    .then(() => say('shown', { update: next.update }));
}

function draw(next, parts) {
  const canvas = canvasFor(next.size, next.rest), pen = canvas.getContext('2d', { alpha: false });
  for (const { x, y, bitmap } of parts) {
    pen.drawImage(bitmap, x, y);
    bitmap.close();
  }
  moving.hidden = canvas !== moving;
  const now = performance.now();
  const isNew = !header || header.frame !== next.frame;
  if (!next.rest) movedAt = now;
  header = next;
  if (isNew) {
    drawnAt.push(now);
    measure(now);
  }
  hasPicture = true;
  hasLight ||= next.unknown <= NOTHING_KNOWN;
  pictureCame();
  if (next.under) showUnder(next.under);
  $('guess').hidden = next.unknown + next.guessed < MOST_GUESSED;
  if (document.activeElement !== $('t-view')) $('t-view').value = next.options;
  if (document.activeElement !== $('r-angle')) {
    const stated = / -vh ([\d.]+)/.exec(` ${next.options}`);
    $('r-angle').disabled = next.view.kind !== 'v' || !stated;
    if (stated) [$('r-angle').value, $('o-angle').textContent] = [stated[1], `${Math.round(stated[1])}°`];
  }
  if (document.activeElement !== $('r-lift')) {
    const percent = Math.round(100 * next.view.shift[1]);
    [$('r-lift').value, $('o-lift').textContent] = [percent, `${percent} %`];
    $('r-lift').disabled = $('b-upright').disabled = next.view.kind !== 'v';
  }
  drawLegend(next.legend);
  document.body.dataset.frame = next.frame;
  document.body.dataset.rest = next.rest;
  document.body.dataset.exact = next.exact;
  document.body.dataset.options = next.options;
  drawGrid();
  drawEye();
  showStatus();
}

/**
 * Returns the canvas for a frame: that of pictures at rest, or a smaller one above it that the
 * browser enlarges. A frame of another size arrives whole, so the canvas may change its size.
 */
function canvasFor([width, height], isAtRest) {
  const has = canvas => canvas.width === width && canvas.height === height;
  const canvas = isAtRest || has(picture) ? picture : moving;
  if (!has(canvas)) [canvas.width, canvas.height] = [width, height];
  return canvas;
}

/** Returns the visible canvas. */
function shown() { return moving.hidden ? picture : moving; }

function measure(now) {
  const sent = sentAt.get(header.input);
  if (sent !== undefined) {
    latencies.push(now - sent);
    if (latencies.length > 200) latencies.shift();
    for (const n of [...sentAt.keys()]) if (n <= header.input) sentAt.delete(n);
  }
  while (drawnAt.length && drawnAt[0] < now - 1000) drawnAt.shift();
}

function median(values) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted.length ? sorted[sorted.length >> 1] : null;
}

function sendSize() {
  // A page that is not laid out yet has no size; an observer reports it later.
  if (stage.clientWidth < 16 || stage.clientHeight < 16) return;
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  let width = stage.clientWidth * ratio, height = stage.clientHeight * ratio;
  const share = Math.min(1, Math.sqrt(MOST_PIXELS / (width * height)));
  [width, height] = [width, height].map(side => Math.max(16, Math.round(side * share)));
  say('size', { width: width * (screens.length || 1), height });
}

// ---- status and notices

function short(count) {
  for (const [unit, size] of [['G', 1e9], ['M', 1e6], ['k', 1e3]])
    if (count >= size) return `${(count / size).toPrecision(3)} ${unit}`;
  return `${Math.round(count)}`;
}

function field(id, value, unit) {
  const at = $(id);
  at.replaceChildren();
  if (value === null || value === undefined) return;
  const bold = document.createElement('b');
  bold.textContent = value;
  at.append(bold, unit ? ` ${unit}` : '');
}

function showStatus() {
  const now = performance.now();
  const isWalking = now - movedAt < 1000 && drawnAt.length > 3;
  field('s-fps', isWalking ? drawnAt.length : null, 'frames/s');
  const latency = median(latencies.slice(-60));
  field('s-latency', latency === null ? null : Math.round(latency), 'ms from hand to eye');
  field('s-size', header ? `${header.size[0]}×${header.size[1]}` : null);
}

function showState() {
  const { phase, text, trouble } = state;
  if (phase === 'loading') loading(text ? text[0].toUpperCase() + text.slice(1) + ' …' : 'Loading …');
  if (phase === 'ended') {
    ended = true;
    notice(`${text} Start holodeck again, and this page goes on.`, 0);
    return;
  }
  if (phase === 'running' && hasPicture) pictureCame();
  field('s-view', state.view_samples ? short(state.view_samples) : null, 'samples of this view');
  field('s-gleams', state.gleams ? `${state.gleams} %` : null, 'of pixels with guessed gleams');
  const traced = state.traces ? `${short(state.samples_per_second)}/s` : null;
  field('s-traced', state.paused ? 'paused' : traced, state.paused ? '' : 'traced');
  const none = state.traces && state.workers === 0;
  const workers = state.workers === 1 ? 'worker' : 'workers';
  field('s-workers', state.traces ? (none ? 'no worker' : state.workers) : 'stored rays only',
    none ? 'traces: it is starting, or has died' : state.traces ? workers : '');
  $('s-workers').classList.toggle('bad', none);
  field('s-memory', state.memory ? Math.round(state.memory / 1048576) : null, 'MiB');
  press('b-pause', state.paused);
  showSaving();
  press('b-lock', state.locked);
  press('b-solid', state.solid);
  $('b-pause').disabled = !state.traces;
  listViews();
  if (!corner) showFocus(state.focus);
  for (const id of ['b-kill', 'b-restart', 'b-scene', 'b-over']) $(id).disabled = !state.crew;
  if (document.activeElement !== $('l-driver')) $('l-driver').value = state.driver;
  listParts();
  showLight();
  if (state.question && drives && !$('question').open) {
    $('question-text').textContent = state.question;
    $('question').dataset.answer = state.answer;
    $('question').showModal();
  } else if (!state.question && $('question').open) $('question').close('no');
  if (trouble) notice(trouble, 0, 'trouble');
  else if ($('notice').dataset.of === 'trouble') $('notice').hidden = true;
  drawNorth();
  drawEye();
  drawGrid();
  showStatus();
}

/** Lists the parts of the driver's method, each with a box that switches it. */
function listParts() {
  const list = $('parts'), parts = state.parts || [];
  list.hidden = !parts.length;
  const names = parts.map(part => part.name).join();
  if (list.dataset.names !== names) {
    list.dataset.names = names;
    list.querySelectorAll('label').forEach(label => label.remove());
    for (const part of parts) {
      const label = document.createElement('label'), box = document.createElement('input');
      const name = document.createElement('b'), meaning = document.createElement('span');
      box.type = 'checkbox';
      box.dataset.part = part.name;
      box.onchange = () => command(`${box.checked ? 'with' : 'without'} ${part.name}`);
      name.textContent = part.name;
      meaning.textContent = part.meaning;
      label.append(box, name, meaning);
      list.append(label);
    }
  }
  for (const part of parts) list.querySelector(`[data-part="${part.name}"]`).checked = part.on;
}

function press(id, on) { $(id).setAttribute('aria-pressed', on); }

/** True once a picture has shown light. */
let hasLight = false;

/** Says what a picture waits for that shows no light yet. */
function pictureCame() {
  const isShown = hasLight || drawsScene() || (state && state.uncovered);
  loading(isShown ? '' : 'Finding the first light …');
}

function loading(text) {
  $('loading').hidden = !text;
  $('loading-text').textContent = text;
}

let noticeTimer = 0;
function notice(text, milliseconds, of = '', [label, undo] = []) {
  const at = $('notice');
  at.textContent = text;
  if (label) {
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = label;
    button.onclick = () => { undo(); at.hidden = true; stage.focus(); };
    at.append(' ', button);
  }
  at.dataset.of = of;
  at.hidden = false;
  clearTimeout(noticeTimer);
  if (milliseconds) noticeTimer = setTimeout(() => { at.hidden = true; }, milliseconds);
}

/** Returns a length in scene units as metres, centimetres or kilometres. */
function lengthOf(units) {
  const metres = units * (facts && facts.unit > 0 ? facts.unit : 1);
  const [size, name] = metres >= 1000 ? [1000, 'km'] : metres >= 1 ? [1, 'm'] : metres >= 0.01 ? [0.01, 'cm'] : [0.001, 'mm'];
  return `${Number((metres / size).toPrecision(3))} ${name}`;
}

function showUnder(under) {
  const number = value => value === 0 ? '0' : value >= 1e5 || value < 1e-3 ? value.toExponential(2) : value.toPrecision(4);
  const error = under.error === null ? '' : ` ± ${Number(under.error.toPrecision(2))}`;
  // Nothing is known of the surface there, though the driver shows something.
  const isGuess = under.samples !== null && under.error === null && under.hits;
  $('p-luminance').textContent = isGuess ? `guess: ${number(Number(under.luminance.toPrecision(2)))} cd/m²`
    : `${number(under.luminance)}${error} cd/m²`;
  $('p-samples').textContent = under.samples === null ? 'not said' : under.samples;
  $('p-radiance').textContent = under.radiance.map(number).join('  ');
  $('p-distance').textContent = under.distance ? lengthOf(under.distance) : under.hits ? 'not known' : 'nothing hit';
}

// ---- geometry

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const plus = (a, b, f = 1) => [a[0] + f * b[0], a[1] + f * b[1], a[2] + f * b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => { const l = Math.hypot(...a) || 1; return a.map(x => x / l); };

/** Returns the point at shares of a section's axes. */
function pointOf({ origin, axes }, [a, b, c]) {
  return plus(plus(plus(origin, axes[0], a), axes[1], b), axes[2], c);
}

/** Returns a point's place in shares of a section's axes. */
function sharesOf({ origin, axes: [a, b, c] }, point) {
  const d = minus(point, origin), volume = dot(a, cross(b, c));
  return [dot(d, cross(b, c)), dot(d, cross(c, a)), dot(d, cross(a, b))].map(x => x / volume);
}

/** Returns a point's camera coordinates: right, up, forward. */
function toCamera(view, point) {
  const d = minus(point, view.eye);
  return [dot(d, view.right), dot(d, view.up), dot(d, view.direction)];
}

/** Returns the eye's current pose, even if its view cannot be shown. */
function eyeNow() {
  if (state && (state.uncovered || state.trouble) && state.pose) {
    const [eye, direction, up] = state.pose, right = unit(cross(direction, up));
    return { kind: 'v', eye, direction, right, up: cross(right, direction), extent: [1.2, 0.7], shift: [0, 0] };
  }
  return header && header.view;
}

// ---- grids of sections

/** Returns whether the driver shows the scene before any light is known. */
function drawsScene() { return state && state.driver === 'surfaces'; }

function drawGrid() {
  const view = eyeNow();
  const width = stage.clientWidth, height = stage.clientHeight;
  if (overlay.width !== width || overlay.height !== height) [overlay.width, overlay.height] = [width, height];
  if (gridIsDrawn) grid.clearRect(0, 0, width, height);
  gridIsDrawn = false;
  if (!view || !facts || view.kind !== 'v' || screens.length) return;
  const unknown = header ? header.unknown : 1;
  const strength = gridMode === 'on' ? 0.5 : gridMode === 'off' ? 0 :
    state && state.uncovered ? 0.5 : unknown > NOTHING_KNOWN && !drawsScene() ? 0.35 : 0;
  if (!strength) return;
  const canvas = shown(), scale = Math.min(width / canvas.width, height / canvas.height);
  const sides = [canvas.width * scale, canvas.height * scale];
  const corner = [(width - sides[0]) / 2, (height - sides[1]) / 2];
  const near = 1e-3 * Math.hypot(...facts.sections[0].axes[0]);
  const place = ([x, y, z]) => [
    corner[0] + sides[0] * (0.5 - view.shift[0] + x / z / view.extent[0]),
    corner[1] + sides[1] * (0.5 + view.shift[1] - y / z / view.extent[1])];
  // All lines of a kind are one path. A stroke for each would take longer than the picture.
  const edges = new Path2D(), cells = new Path2D();
  const line = (path, from, to) => {
    let [a, b] = [toCamera(view, from), toCamera(view, to)];
    if (a[2] < near && b[2] < near) return;
    const cut = (p, q) => p[2] >= near ? p : plus(p, minus(q, p), (near - p[2]) / (q[2] - p[2]));
    [a, b] = [cut(a, b), cut(b, a)];
    path.moveTo(...place(a));
    path.lineTo(...place(b));
  };
  grid.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue('--accent');
  for (const section of facts.sections) {
    for (let axis = 0; axis < 3; axis++) {
      const [p, q] = [(axis + 1) % 3, (axis + 2) % 3];
      for (const [across, along] of [[p, q], [q, p]]) {
        const count = Math.min(section.grid[across], 64);
        for (let cell = 0; cell <= count; cell++) {
          const path = cell === 0 || cell === count ? edges : cells;
          for (const side of [0, 1]) {
            const from = [0, 0, 0];
            from[axis] = side;
            from[across] = cell / count;
            const to = [...from];
            to[along] = 1;
            line(path, pointOf(section, from), pointOf(section, to));
          }
        }
      }
    }
  }
  for (const [path, share, thickness] of [[edges, 1, 1.4], [cells, 0.35, 0.7]]) {
    grid.globalAlpha = strength * share;
    grid.lineWidth = thickness;
    grid.stroke(path);
  }
  grid.globalAlpha = 1;
  gridIsDrawn = true;
}

// ---- plan

let plane = null;

function drawPlan() {
  if (!facts || !facts.sections.length) return;
  // Browsers store SVG numbers in 32 bits, so places are relative to a section's corner.
  const { right: u, ahead: v, base } = facts.plan, along = way => [dot(way, u), -dot(way, v)];
  plane = { u, v, along, flat: point => along(minus(point, base)) };
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map(i => [i & 1, i >> 1 & 1, i >> 2]);
  const outlines = facts.sections.map(section => hull(corners.map(corner => plane.flat(pointOf(section, corner)))));
  const all = outlines.flat(), xs = all.map(p => p[0]), ys = all.map(p => p[1]);
  const size = Math.max(Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys)) || 1;
  const margin = 0.12 * size;
  plane.size = size;
  const svg = $('plan'), make = svgNode;
  svg.setAttribute('viewBox', [Math.min(...xs) - margin, Math.min(...ys) - margin,
    Math.max(...xs) - Math.min(...xs) + 2 * margin, Math.max(...ys) - Math.min(...ys) + 2 * margin].join(' '));
  svg.replaceChildren(...outlines.map((outline, i) => make('polygon', {
    points: outline.map(p => p.join(',')).join(' '), class: facts.sections[i].interior ? 'section' : 'section exterior' })),
    make('path', { class: 'walls', id: 'walls' }), make('g', { id: 'places' }), make('g', { id: 'north' }), make('path', { class: 'gaze', id: 'gaze' }), make('circle', { class: 'eye', id: 'eye', r: 0.022 * size }));
  drawPlaces();
  drawNorth();
  drawEye();
}

function svgNode(name, attributes) {
  const node = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const key in attributes) node.setAttribute(key, attributes[key]);
  return node;
}

/** Draws where north is in the corner of the plan, if the scene has a sky with a sun. */
function drawNorth() {
  if (!plane || !state) return;
  const { sky, options } = state.light || {}, angle = Number(options?.north || 0), size = plane.size;
  $('north').replaceChildren();
  if (!sky || !(options.place || options.weather)) return;
  const [left, top] = $('plan').getAttribute('viewBox').split(' ').map(Number), length = 0.04 * size;
  const arrow = svgNode('path', { d: `M0 ${length}V${-length}M${-length / 2} 0L0 ${-length}L${length / 2} 0` });
  const letter = svgNode('text', { y: -1.3 * length, 'font-size': 0.05 * size, 'text-anchor': 'middle' });
  letter.textContent = 'N';
  $('north').append(arrow, letter);
  $('north').setAttribute('transform', `translate(${left + 0.07 * size} ${top + 0.11 * size}) rotate(${angle})`);
}

/** Draws the named views on the plan. A click on one goes there. */
function drawPlaces() {
  if (!plane || !state) return;
  $('places').replaceChildren(...state.views.flatMap(([name, options], index) => {
    const found = /-vp (\S+) (\S+) (\S+)/.exec(options);
    if (!found) return [];
    const eye = found.slice(1).map(Number), [x, y] = plane.flat(eye), size = plane.size;
    const place = svgNode('g', { class: 'place' }), title = svgNode('title', {});
    const label = svgNode('text', { x: x + 0.03 * size, y: y + 0.018 * size, 'font-size': 0.055 * size });
    title.textContent = label.textContent = name;
    place.append(title, svgNode('circle', { cx: x, cy: y, r: 0.014 * size }), label);
    place.dataset.height = storeyOf(eye)?.height;
    place.addEventListener('click', event => {
      event.stopPropagation();
      command(`view ${index + 1}`);
      stage.focus();
    });
    return [place];
  }));
}

function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const side = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
  const half = list => {
    const kept = [];
    for (const point of list) {
      while (kept.length > 1 && side(kept[kept.length - 2], kept[kept.length - 1], point) <= 0) kept.pop();
      kept.push(point);
    }
    return kept.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

/** Returns the storey whose cut is nearest to the height of the eye. */
function storeyOf(eye) {
  const height = dot(eye, facts.up), off = storey => Math.abs(storey.height - height);
  return facts.plan.storeys.reduce((best, storey) => best && off(best) <= off(storey) ? best : storey, null);
}

/** Draws the walls of a storey, unless they are drawn. */
function drawWalls(storey) {
  if (!storey) return;
  for (const place of $('places').children) place.toggleAttribute('hidden', place.dataset.height !== String(storey.height));
  if ($('walls').dataset.height === String(storey.height)) return;
  const { lines } = storey, path = [];
  for (let i = 0; i + 3 < lines.length; i += 4) path.push(`M${lines[i]} ${-lines[i + 1]}L${lines[i + 2]} ${-lines[i + 3]}`);
  $('walls').dataset.height = storey.height;
  $('walls').setAttribute('d', path.join(''));
}

function drawEye() {
  const view = eyeNow();
  if (!view || !facts) return;
  showLost(view);
  if (!plane || !$('eye')) return;
  const [x, y] = plane.flat(view.eye), length = 0.22 * plane.size;
  const half = view.extent[0] / 2;
  const ends = [-half, half].map(s => plane.along(plus(view.direction, view.right, s))).map(([a, b]) => {
    const l = Math.hypot(a, b) || 1;
    return [x + a / l * length, y + b / l * length];
  });
  drawWalls(storeyOf(view.eye));
  $('eye').setAttribute('cx', x);
  $('eye').setAttribute('cy', y);
  $('gaze').setAttribute('d', `M${x} ${y}L${ends[0].join(' ')}L${ends[1].join(' ')}Z`);
}

/** The sign that shows the way back when the eye has left all sections. */
function showLost(view) {
  const inside = section => sharesOf(section, view.eye).every(x => x >= 0 && x <= 1);
  const onlyInteriors = facts.sections.every(section => section.interior);
  const isMissing = header && header.uncovered > 0.02;
  const lost = (state && state.uncovered) || isMissing && onlyInteriors && !facts.sections.some(inside);
  $('lost').hidden = !lost;
  if (!lost) return;
  const middles = facts.sections.map(section => pointOf(section, [0.5, 0.5, 0.5]));
  middles.sort((a, b) => Math.hypot(...minus(a, view.eye)) - Math.hypot(...minus(b, view.eye)));
  const [x, y, z] = toCamera(view, middles[0]);
  const angle = z > 0 && Math.hypot(x, y) < 0.2 * z ? null : Math.atan2(x, y);
  $('lost-arrow').textContent = angle === null ? '◎' : '↑';
  $('lost-arrow').style.transform = angle === null ? '' : `rotate(${angle}rad)`;
  const distance = lengthOf(Math.hypot(...minus(middles[0], view.eye)));
  $('lost-text').textContent = angle === null ? `Outside the known rooms: the next one is ahead, ${distance} away`
    : z < 0 ? `Outside the known rooms: the next one is behind you, ${distance} away` : `Outside the known rooms: turn to the next one, ${distance} away`;
}

$('plan').addEventListener('click', event => {
  const view = eyeNow();
  if (!plane || !view) return;
  const svg = $('plan'), point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  const [x, y] = plane.flat(view.eye);
  command(`go ${plus(plus(view.eye, plane.u, point.x - x), plane.v, -(point.y - y)).join(' ')}`);
  stage.focus();
});

// ---- keys

/** All actions in the server's order, and each action by its keys. */
let actions = [], drivers = [];
const actionOf = new Map();
const held = new Set();
let lastHold = '{}';

function learn({ actions: all, gestures, drivers: names, most_pixels, most_side }) {
  limits = { most_pixels, most_side };
  actions = all;
  drivers = names;
  actionOf.clear();
  for (const action of actions) for (const key of action.keys) actionOf.set(key, action);
  $('l-driver').replaceChildren(...drivers.map(name => new Option(name, name)));
  const rows = [...actions.map(({ shown, help }) => [shown, help]), ...gestures];
  $('keys').replaceChildren(...rows.map(([keys, what]) => {
    const row = document.createElement('div'), key = document.createElement('kbd'), text = document.createElement('span');
    key.textContent = keys;
    text.textContent = what;
    row.append(key, text);
    return row;
  }));
}

/** Ends the saving of a picture, while one is being saved by this page. */
let cancelSaving = null;

/** Returns the chosen size of saved pictures: '' for the shown one, null if it is no size. */
function chosenSize() {
  const text = $('t-size').value.trim().replace(/\s*[×X*x]\s*/, 'x');
  if (!text) return '';
  const sides = (text.match(/^(\d{1,5})x(\d{1,5})$/) || []).slice(1).map(Number);
  const fits = sides.length === 2 && sides.every(side => side >= 1 && side <= limits.most_side)
    && sides[0] * sides[1] <= limits.most_pixels;
  return fits ? sides.join('x') : null;
}

/** Sets the links to the picture, as it is seen and in radiance, at the chosen size. */
function pictureLinks() {
  const size = chosenSize(), isWrong = size === null;
  for (const end of ['png', 'exr', 'hdr']) {
    const link = $(`s-${end}`);
    link.href = `picture.${end}?client=${client}${size ? `&size=${size}` : ''}`;
    link.setAttribute('aria-disabled', isWrong || (Boolean(size) && cancelSaving !== null));
  }
  $('t-size').setAttribute('aria-invalid', isWrong);
  $('size-hint').textContent = isWrong
    ? `A size is like 3840x2160, with at most ${Math.floor(limits.most_pixels / 1e6)} million pixels.` : '';
}

/** Saves a picture of a chosen size. The page receives it while it is drawn. */
async function savePicture(link) {
  if (cancelSaving) return;
  const abort = new AbortController();
  cancelSaving = () => abort.abort();
  pictureLinks();
  showSaving();
  try {
    const answer = await fetch(link.href, { method: 'POST', signal: abort.signal });
    if (!answer.ok) throw new Error(await answer.text());
    const name = /filename="([^"]+)"/.exec(answer.headers.get('content-disposition') || '');
    const file = URL.createObjectURL(await answer.blob()), save = document.createElement('a');
    save.href = file;
    save.download = name ? name[1] : 'holodeck';
    save.click();
    setTimeout(() => URL.revokeObjectURL(file), 60000);
    notice(`${save.download} is saved.`, 4000);
  } catch (error) {
    notice(abort.signal.aborted ? 'The picture is not saved.' : `The picture is not saved: ${error.message}`, 6000);
  } finally {
    cancelSaving = null;
    pictureLinks();
    showSaving();
  }
}

/** Shows how far the picture is that is being saved, here or by another page. */
function showSaving() {
  const share = state ? state.saving : null, isOurs = cancelSaving !== null;
  $('saving').hidden = !isOurs && share === null;
  $('saving-share').value = share || 0;
  $('saving-text').textContent = `${Math.round(100 * (share || 0))} %`;
  $('b-cancel').hidden = !isOurs;
}

for (const link of document.querySelectorAll('[href^="picture."]')) link.addEventListener('click', event => {
  const size = chosenSize();
  if (size === '') return;
  event.preventDefault();
  if (size !== null) savePicture(link);
  else $('t-size').focus();
});
$('b-cancel').onclick = () => { if (cancelSaving) cancelSaving(); };

/** Sends a command line to the stage. */
function command(line) { act('command', { line }); }

function sendHeld() {
  const controls = {}, doing = [...held].map(key => actionOf.get(key).does), orbits = doing.includes('orbit');
  for (const { hold, pace } of doing) {
    if (pace) controls.pace = pace;
    if (!hold) continue;
    let [part, amount] = hold;
    if (orbits) part = part === 'right' ? 'around' : part === 'ahead' ? 'over' : part;
    if (part === 'over') amount = -amount;
    controls[part] = (controls[part] || 0) + amount;
  }
  const text = JSON.stringify(controls);
  if (text !== lastHold) act('hold', controls);
  lastHold = text;
}

function nextDriver() {
  const at = drivers.indexOf(state && state.driver);
  command(`driver ${drivers[(at + 1) % drivers.length]}`);
}

function nextTone() {
  const buttons = [...document.querySelectorAll('[data-tone]')];
  buttons[(buttons.findIndex(button => button.dataset.tone === display.tone) + 1) % buttons.length].click();
}

/** Actions of the page itself. */
const LOCAL = {
  grid: () => toggleGrid(), exposure: () => lockExposure(display.locked === null),
  brighter: () => stops(display.stops + 0.5), darker: () => stops(display.stops - 0.5),
  false_color: () => toggleLook('false_color'), contours: () => toggleLook('contours'),
  next_tone: () => nextTone(), log_scale: () => setScale(!display.log, display.range), save_radiance: () => document.querySelector('[href^="picture.exr"]').click(),
  mouse_look: () => lookWithMouse(), next_driver: () => nextDriver(),
  full_screen: () => fullScreen(), panel: () => togglePanel(), bare: () => document.body.classList.toggle('bare'),
  theme: () => theme(), save: () => $('s-png').click(), help: () => $('help').showModal(), quit: () => $('quit').showModal(),
};

/** Performs an action; `key` is the key that was pressed. */
function perform({ name, does }, key = '') {
  if (does === 'stage') command(name);
  else if (does === 'named_view') command(`view ${key.slice(-1)}`);
  else if (does.toggle) command(does.toggle[state && state[does.toggle[0]] ? 2 : 1]);
  else if (does.local) LOCAL[does.local]();
}

/** Names of keys that the table of actions names by their place, by the character that they type. */
const PLACES = { ',': 'Comma', '.': 'Period', ' ': 'Space' };

/**
 * Returns the name of an event's key in the table of actions. Motions are by place, so that the keys
 * of a hand lie together on every layout. Commands are by the printed letter.
 */
function keyOf({ code, key }) {
  const placed = actionOf.get(code);
  if (placed && (placed.does.hold || placed.does.pace || placed.does === 'orbit')) return code;
  if (actionOf.has(key)) return key;
  const printed = PLACES[key] || (/^[a-z]$/i.test(key) ? `Key${key.toUpperCase()}` : '');
  const named = actionOf.get(printed);
  // A letter of a motion that is printed elsewhere does nothing there.
  if (named) return named.does.hold || named.does.pace || named.does === 'orbit' ? '' : printed;
  // Digits that need Shift, letters of other scripts, and keys that type nothing.
  const isOther = key.length > 1 || code.startsWith('Digit') || key.charCodeAt(0) > 127;
  return placed && isOther ? code : '';
}

function isTyping(target) {
  return target.closest('input, textarea, select, dialog') !== null;
}

addEventListener('keydown', event => {
  if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
  const onButton = event.target.closest('button, a') && (event.code === 'Space' || event.code === 'Enter');
  if (onButton) return;
  const key = keyOf(event), action = actionOf.get(key);
  if (!action) return;
  event.preventDefault();
  if (action.does.hold || action.does.pace || action.does === 'orbit') {
    if (!held.has(key)) { held.add(key); sendHeld(); }
  } else if (!event.repeat || key === '+' || key === '-') perform(action, key);
});
addEventListener('keyup', event => { if (held.delete(event.code)) sendHeld(); });
addEventListener('blur', () => { held.clear(); sendHeld(); });

// ---- pointer

const pointers = new Map();
let button = 0, cursorAt = 0;
/** First corner of the rectangle that is being dragged, in shares of the picture. */
let corner = null;
/** Whether the pointer holds an object. */
let holds = false;

/** Returns a pointer's place in shares of the picture, or of this page's screen. */
function shares(event) {
  const box = stage.getBoundingClientRect(), canvas = shown();
  if (screens.length) return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  const scale = Math.min(box.width / canvas.width, box.height / canvas.height);
  const [w, h] = [canvas.width * scale, canvas.height * scale];
  return [(event.clientX - box.left - (box.width - w) / 2) / w, (event.clientY - box.top - (box.height - h) / 2) / h];
}

/** Returns a pointer's place in shares of the frame. */
function inFrame(event) {
  const [x, y] = shares(event);
  return screens.length ? [(screen + x) / screens.length, y] : [x, y];
}

/** Returns the angles of the whole picture. */
function angles() {
  if (!header || header.view.kind !== 'v') return [1, 0.6];
  return header.view.extent.map(side => 2 * Math.atan(side / 2));
}

function sendCursor(event) {
  const now = performance.now();
  if (now - cursorAt < 33) return;
  cursorAt = now;
  const isInside = shares(event).every(x => x >= 0 && x <= 1);
  say('cursor', { at: isInside ? inFrame(event) : null });
}

stage.addEventListener('pointerdown', event => {
  if (event.target.closest('button')) return;
  stage.focus({ preventScroll: true });
  if (pointers.size === 0) { cursorAt = 0; sendCursor(event); button = event.button; }
  corner = (event.ctrlKey || event.metaKey) && !screens.length ? shares(event) : null;
  holds = event.shiftKey && !corner && event.button === 0;
  if (holds) say('grab', { at: shares(event) });
  pointers.set(event.pointerId, event);
  stage.setPointerCapture(event.pointerId);
  stage.classList.add('grabbing');
});
stage.addEventListener('pointermove', event => {
  const before = pointers.get(event.pointerId);
  if (document.pointerLockElement === stage) {
    act('turn', { right: event.movementX * 0.0025, up: -event.movementY * 0.0025 });
    return;
  }
  if (!before) { sendCursor(event); return; }
  pointers.set(event.pointerId, event);
  if (pointers.size > 1) { twoFingers(event, before); return; }
  const [x, y] = shares(event), [bx, by] = shares(before), [across, along] = angles();
  const [dx, dy] = [x - bx, y - by];
  if (!dx && !dy) return;
  if (corner) { showFocus(between(corner, [x, y])); return; }
  if (holds) { act('drag', { at: [x, y] }); return; }
  if (button === 2) act('orbit', { right: dx * Math.PI, up: -dy * Math.PI / 2 });
  else if (button === 1) act('slide', { right: -dx, up: dy });
  else act('turn', { right: -dx * across, up: dy * along });
});
/** Returns the rectangle between two corners, inside the picture: left, top, right, bottom. */
function between(a, b) {
  const inside = x => Math.min(1, Math.max(0, x));
  return [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[0], b[0]), Math.max(a[1], b[1])].map(inside);
}

/** Outlines the part of the picture that is traced first. */
function showFocus(part) {
  const box = $('focus'), canvas = shown();
  box.hidden = !part;
  if (!part) return;
  const scale = Math.min(stage.clientWidth / canvas.width, stage.clientHeight / canvas.height);
  const [w, h] = [canvas.width * scale, canvas.height * scale];
  const [left, top] = [(stage.clientWidth - w) / 2, (stage.clientHeight - h) / 2];
  Object.assign(box.style, { left: `${left + part[0] * w}px`, top: `${top + part[1] * h}px`,
    width: `${(part[2] - part[0]) * w}px`, height: `${(part[3] - part[1]) * h}px` });
}

for (const type of ['pointerup', 'pointercancel']) stage.addEventListener(type, event => {
  if (corner) {
    const part = between(corner, shares(event));
    const isLarge = part[2] - part[0] > 0.02 && part[3] - part[1] > 0.02;
    say('focus', { part: isLarge && type === 'pointerup' ? part : null });
    if (!isLarge) showFocus(null);
    corner = null;
  }
  holds = false;
  pointers.delete(event.pointerId);
  if (pointers.size === 0) stage.classList.remove('grabbing');
});
stage.addEventListener('pointerleave', () => say('cursor', { at: null }));

// ---- models that are dropped

let drops = 0;
/** Whether a drag brings files. */
const hasFiles = event => [...event.dataTransfer.types].includes('Files');

for (const type of ['dragenter', 'dragover']) addEventListener(type, event => {
  if (!hasFiles(event)) return;
  event.preventDefault();
  event.dataTransfer.dropEffect = drives ? 'copy' : 'none';
});
addEventListener('drop', event => {
  if (!hasFiles(event)) return;
  event.preventDefault();
  const at = shares(event), files = [...event.dataTransfer.files];
  if (!drives) notice('Another page drives: take over first', 6000);
  else if (!at.every(x => x >= 0 && x <= 1)) notice('Drop the model on the picture', 6000);
  else carryIn(files, at);
});

/** Sends the files of a model, and has it put where the picture shows this place. */
async function carryIn(files, at) {
  const drop = ++drops, model = files.find(file => /\.(glb|gltf|obj)$/i.test(file.name));
  if (!model) { notice('Drop a model: a .glb, .gltf or .obj, with all files that it names', 6000); return; }
  for (const [index, file] of files.entries()) {
    notice(`Sending ${file.name}, file ${index + 1} of ${files.length}`, 600000, 'drop');
    const answer = await fetch(`dropped/${client}/${drop}/${encodeURIComponent(file.name)}`, { method: 'PUT', headers: { authorization: `Bearer ${key}` }, body: file })
      .catch(error => ({ ok: false, text: () => error.message }));
    if (!answer.ok) { notice(`${file.name} was not sent: ${await answer.text()}`, 8000); return; }
  }
  notice(`Reading ${model.name}`, 2000, 'drop');
  say('drop', { number: drop, name: model.name, at });
}
stage.addEventListener('contextmenu', event => event.preventDefault());

/** Two fingers: spreading approaches, pinching backs off, a common motion shifts the picture. */
function twoFingers(event, before) {
  const other = [...pointers.values()].find(pointer => pointer.pointerId !== event.pointerId);
  const apart = (a, b) => Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) || 1;
  const steps = Math.log(apart(event, other) / apart(before, other)) / -Math.log(0.9);
  const [x, y] = shares(event), [bx, by] = shares(before), [ox, oy] = shares(other);
  say('cursor', { at: [(x + ox) / 2, (y + oy) / 2].map(share => Math.min(1, Math.max(0, share))) });
  if (Math.abs(steps) > 1e-3) act('wheel', { steps });
  act('slide', { right: -(x - bx) / 2, up: (y - by) / 2 });
}

stage.addEventListener('wheel', event => {
  event.preventDefault();
  // A notch is 100 pixels, 3 lines or a page. Browsers send a pinch as small steps with Ctrl.
  const notch = event.deltaMode === 2 ? 1 : event.deltaMode === 1 ? 3 : event.ctrlKey ? 10 : 100;
  // With Shift, browsers may take a wheel as a sideways one.
  const lines = (event.deltaY || event.deltaX) / notch;
  if (event.shiftKey) { act('spin', { at: shares(event), degrees: 15 * Math.max(-4, Math.min(4, lines)) }); return; }
  cursorAt = 0;
  sendCursor(event);
  act('wheel', { steps: Math.max(-4, Math.min(4, -lines)) });
}, { passive: false });

function lookWithMouse() {
  if (document.pointerLockElement) document.exitPointerLock();
  else stage.requestPointerLock();
}

// ---- walking by touch

for (const button of document.querySelectorAll('#pad button')) {
  const key = button.dataset.key;
  const release = () => { if (held.delete(key)) sendHeld(); };
  button.addEventListener('pointerdown', event => {
    event.preventDefault();
    button.setPointerCapture(event.pointerId);
    held.add(key);
    sendHeld();
  });
  for (const type of ['pointerup', 'pointercancel', 'lostpointercapture']) button.addEventListener(type, release);
  button.addEventListener('contextmenu', event => event.preventDefault());
}

// ---- tools

function lockExposure(on) {
  if (on && !(header && header.exposure)) { notice('Only the tones Soft and Linear have an exposure to lock.', 3000); return; }
  display.locked = on ? header.exposure / 2 ** display.stops : null;
  sendDisplay();
}

function toggleLook(part) {
  display[part] = !display[part];
  sendDisplay();
}

/** Returns the number in a field, rounded as on the server; NaN if the field has no number. */
function numberIn(id) { return $(id).value.trim() === '' ? NaN : Math.fround(Number($(id).value.replace(',', '.'))); }

/** Sends the scale of false colour and contours, if its range is valid. */
function setScale(log, range) {
  const [least, most] = range || [0, 1];
  const isRange = least >= 0 && least < most && most < Infinity;
  if (!isRange) { notice('A range needs two numbers in cd/m², the smaller one first, such as 10 and 1000.', 5000); return; }
  // The least number whose logarithm the server can compute.
  if (range && log && least < 2 ** -126) { notice('A logarithmic scale cannot begin at 0: choose a low end above 0.', 5000); return; }
  Object.assign(display, { log, range });
  if (!display.false_color && !display.contours) display.false_color = true;
  sendDisplay();
}

/** Draws the legend: a bar of the colours, and the ticks that have room for their labels. */
function drawLegend(legend) {
  const text = JSON.stringify(legend), box = $('legend');
  if (box.dataset.drawn === text) return;
  box.dataset.drawn = text;
  box.hidden = !legend;
  if (!legend) return;
  $('legend-unit').textContent = legend.unit;
  [$('t-least').placeholder, $('t-most').placeholder] = legend.range.map(end => Number(end.toPrecision(3)));
  $('legend-bar').style.background = `linear-gradient(to top, ${legend.colours.join()})`;
  const height = $('legend-bar').clientHeight;
  let last = -Infinity;
  $('legend-ticks').replaceChildren(...legend.ticks.map(({ place, label }) => {
    const tick = document.createElement('li');
    tick.style.bottom = `${100 * place}%`;
    if (place * height - last >= 14) {
      const text = document.createElement('span');
      text.textContent = label;
      tick.append(text);
      last = place * height;
    }
    return tick;
  }));
}

function stops(value) {
  display.stops = Math.max(-8, Math.min(8, value));
  sendDisplay();
}

function sendDisplay() {
  press('b-auto', display.locked === null);
  press('b-locked', display.locked !== null);
  for (const button of document.querySelectorAll('[data-tone]')) press(button.id, button.dataset.tone === display.tone);
  press('b-false', display.false_color);
  press('b-contours', display.contours);
  press('b-log-off', !display.log);
  press('b-log-on', display.log);
  press('b-range', !display.range);
  $('r-stops').value = display.stops;
  $('o-stops').textContent = display.stops > 0 ? `+${display.stops}` : display.stops;
  store('display', display);
  say('display', display);
}

function toggleGrid() {
  gridMode = { auto: 'on', on: 'off', off: 'auto' }[gridMode];
  press('b-grid', gridMode === 'on');
  store('grid', gridMode);
  notice(`Outlines of the rooms: ${{ auto: 'where nothing is known', on: 'always', off: 'never' }[gridMode]}`, 1800);
  drawGrid();
}

function togglePanel() {
  const panel = $('panel');
  panel.hidden = !panel.hidden;
  $('b-panel').setAttribute('aria-expanded', !panel.hidden);
  store('panel', !panel.hidden);
  drawPlan();
}

function fullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen().catch(() => notice('This browser allows no full screen here.', 4000));
}

function theme(name) {
  const root = document.documentElement;
  root.dataset.theme = name || (root.dataset.theme === 'light' ? 'dark' : 'light');
  $('b-theme').textContent = root.dataset.theme === 'light' ? 'Dark theme' : 'Light theme';
  store('theme', root.dataset.theme);
  drawGrid();
}

function store(key, value) { try { localStorage.setItem(`holodeck ${key}`, JSON.stringify(value)); } catch { /* a browser that keeps nothing */ } }
function stored(key) { try { return JSON.parse(localStorage.getItem(`holodeck ${key}`)); } catch { return null; } }

// ---- views

let listed = '';

function listViews() {
  const text = JSON.stringify([state.views, state.traces]);
  if (text === listed) return;
  listed = text;
  drawPlaces();
  $('views').replaceChildren(...state.views.map(([name], index) => {
    const item = document.createElement('li'), go = document.createElement('button'), forget = document.createElement('button');
    go.type = forget.type = 'button';
    go.className = 'name';
    go.textContent = index < 9 ? `${index + 1}  ${name}` : name;
    go.onclick = () => command(`view ${index + 1}`);
    forget.className = 'forget';
    forget.textContent = '×';
    forget.hidden = !state.traces;
    forget.setAttribute('aria-label', `Remove ${name}`);
    forget.onclick = () => {
      command(`forget ${name}`);
      notice(`“${name}” is removed.`, 12000, '', ['Undo', () => command('restore')]);
      stage.focus();
    };
    item.append(go, forget);
    return item;
  }));
  $('f-name').hidden = !state.traces;
  $('views-hint').textContent = state.traces ? 'Views that you keep stay in the holodeck.' : 'A replay only reads the holodeck, and keeps no views.';
}

$('f-view').addEventListener('submit', event => {
  event.preventDefault();
  command(`view ${$('t-view').value.trim().replace(/\s+/g, ' ')}`);
  $('t-view').blur();
});
$('t-view').addEventListener('keydown', event => {
  if (event.key === 'Enter' && !event.shiftKey) { event.preventDefault(); $('f-view').requestSubmit(); }
  if (event.key === 'Escape') stage.focus();
});
$('f-name').addEventListener('submit', event => {
  event.preventDefault();
  const name = $('t-name').value.trim();
  if (!name) return;
  command(`keep ${name}`);
  $('t-name').value = '';
  stage.focus();
});
$('b-link').onclick = () => {
  if (!header) return;
  // The token is not part of it: whoever opens the link has the page already.
  const link = `${location.origin}/#view=${encodeURIComponent(header.options)}`;
  navigator.clipboard.writeText(link).then(() => notice('A link to this view is copied.', 3000), () => notice(link, 0));
};
$('b-copy').onclick = () => { $('t-view').select(); navigator.clipboard.writeText($('t-view').value).catch(() => document.execCommand('copy')); };

// ---- buttons

for (const button of document.querySelectorAll('[data-action]'))
  button.onclick = () => perform(actions.find(({ name }) => name === button.dataset.action));
for (const button of document.querySelectorAll('[data-take]')) button.onclick = () => say('take_over');
$('b-auto').onclick = () => lockExposure(false);
$('b-locked').onclick = () => lockExposure(true);
for (const button of document.querySelectorAll('[data-tone]')) button.onclick = () => {
  Object.assign(display, { tone: button.dataset.tone, false_color: false });
  sendDisplay();
};
$('b-log-off').onclick = () => setScale(false, display.range);
$('b-log-on').onclick = () => setScale(true, display.range);
$('b-range').onclick = () => { $('t-least').value = $('t-most').value = ''; setScale(display.log, null); };
$('f-scale').addEventListener('submit', event => {
  event.preventDefault();
  setScale(display.log, [numberIn('t-least'), numberIn('t-most')]);
});
$('r-angle').oninput = () => {
  $('o-angle').textContent = `${$('r-angle').value}°`;
  if (header && header.view.kind === 'v') command(`view -vh ${$('r-angle').value}`);
};
$('r-lift').oninput = () => {
  $('o-lift').textContent = `${$('r-lift').value} %`;
  command(`view -vl ${$('r-lift').value / 100}`);
};
$('b-upright').onclick = () => {
  const view = header && header.view;
  if (!view || view.kind !== 'v') return;
  // The middle of the picture stays where it is.
  const up = unit(facts.up), middle = plus(view.direction, view.up, view.shift[1] * view.extent[1]);
  const rise = dot(middle, up), level = plus(middle, up, -rise), run = Math.hypot(...level);
  // A view that is almost vertical has no upright walls.
  if (Math.abs(rise) > 2 * run) return notice('Walls cannot be upright in a view straight up or down.', 4000);
  command(`view -vd ${unit(level).join(' ')} -vu ${up.join(' ')} -vl ${rise / run / view.extent[1]}`);
};
$('r-stops').oninput = () => stops(Number($('r-stops').value));
$('question').addEventListener('close', () => {
  if ($('question').returnValue === 'yes') command($('question').dataset.answer); else if (state && state.question) command('cancel');
});
$('l-driver').onchange = () => { command(`driver ${$('l-driver').value}`); stage.focus(); };
$('t-size').oninput = pictureLinks;
$('quit').addEventListener('close', () => { if ($('quit').returnValue === 'quit') command('quit'); });
document.addEventListener('visibilitychange', () => say('hidden', { hidden: document.hidden }));
let resizing = 0;
function sizeChanged() {
  clearTimeout(resizing);
  resizing = setTimeout(() => { if (drives) sendSize(); drawGrid(); }, 150);
}
new ResizeObserver(sizeChanged).observe(stage);
/** A screen of another density needs another number of pixels, though the page's size stays. */
function watchDensity() {
  matchMedia(`(resolution: ${window.devicePixelRatio}dppx)`).addEventListener('change', () => {
    sizeChanged();
    watchDensity();
  }, { once: true });
}
watchDensity();

wireLight();
Object.assign(display, stored('display'));
gridMode = stored('grid') || gridMode;
press('b-grid', gridMode === 'on');
if (stored('panel')) togglePanel();
theme(stored('theme') || (matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark'));
stage.focus();
connect();
