// Draws the splats of a holodeck: no server, no library, nothing from elsewhere.
//
// Pieces of the file arrive in order, coarse before fine, and are decoded to spheres and words on
// the graphics card. A frame picks a level for each patch of the hierarchy by its size in the
// picture, and draws runs of nodes. docs/splats.md of Holodeck describes the bytes.
'use strict';
(() => {
const $ = (id) => document.getElementById(id);
const EFFICACY = 179, NODE_BYTES = 24, MOST_NODES = 3400000, MOST_PATCHES = 700;
// Kept for children: spheres, and numbers of first children. With the card's: 44 bytes a node.
const fail = (sentence) => {
  $('notice').textContent = sentence;
  $('notice').hidden = false;
  document.body.dataset.failed = sentence;
};
window.addEventListener('error', (event) => fail(`This page cannot be shown: ${event.message}`));
window.addEventListener('unhandledrejection', (event) => fail(String(event.reason && event.reason.message || event.reason)));

// ---- The manifest ----
let site;
try {
  site = JSON.parse($('manifest').textContent);
} catch (error) {
  return fail('The list of contents of this export is damaged: it was cut off or changed.');
}
const isNumber = (x) => typeof x === 'number' && Number.isFinite(x);
const isVector = (v) => Array.isArray(v) && v.length === 3 && v.every(isNumber);
const isWhole = (n, most) => Number.isInteger(n) && n >= 0 && n <= most;
const isSound = site && site.format === 1 && isWhole(site.nodes, 2 ** 32) && site.nodes > 0
  && Array.isArray(site.levels) && site.levels.length > 0 && site.levels.length <= 48
  && site.levels[0] === 0 && site.levels.every((l, i) => isWhole(l, site.nodes - 1) && (i === 0 || l > site.levels[i - 1]))
  && isVector(site.centre) && isVector(site.up) && isVector(site.sky) && isNumber(site.radius) && site.radius > 0
  && isNumber(site.spacing) && site.spacing > 0 && isNumber(site.unit) && site.unit > 0 && isNumber(site.peak) && Math.abs(site.peak) <= 256
  && isNumber(site.exposure) && site.exposure > 0
  && Array.isArray(site.pieces) && site.pieces.every((p) => isWhole(p.bytes, 1 << 20) && p.bytes % 8 === 0 && isWhole(p.crc, 2 ** 32) && /^[\w./-]+$/.test(p.file))
  && site.pieces.reduce((sum, p) => sum + p.bytes, 0) === site.nodes * 8
  && Array.isArray(site.views) && site.views.every((v) => isVector(v.vp) && isVector(v.vd) && isNumber(v.vh))
  && (!site.surfaces || surfacesAreSound(site.surfaces))
  && Array.isArray(site.rooms) && Array.isArray(site.notes) && Array.isArray(site.colours) && site.colours.length === 256;
if (!isSound) return fail('The list of contents of this export is damaged: it was cut off or changed.');
document.title = `${site.title} – Holodeck`;
const nodes = Math.min(site.nodes, MOST_NODES);

// ---- Small mathematics ----
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const plus = (a, b, s = 1) => [a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const l = Math.hypot(...a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };
const up = unit(site.up);
const north = unit(Math.abs(up[2]) > 0.9 ? [0, 1, 0] : cross(up, [1, 0, 0]));
const east = cross(north, up);
const metre = 1 / site.unit;

// ---- The graphics card ----
const canvas = $('picture');
const gl = canvas.getContext('webgl2', { antialias: false, alpha: false, powerPreference: 'high-performance' });
if (!gl) return fail('This browser has no WebGL 2, which this page draws with.');
if (!gl.getExtension('EXT_color_buffer_float')) return fail('This graphics card cannot draw light of high dynamic range (EXT_color_buffer_float).');
const multi = gl.getExtension('WEBGL_multi_draw');
canvas.addEventListener('webglcontextlost', (event) => { event.preventDefault(); fail('The graphics card was lost. Load the page again.'); });

const program = (vertex, fragment) => {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, '#version 300 es\nprecision highp float;\nprecision highp int;\nprecision highp sampler2D;\n' + text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  for (const [place, names] of [['sphere', 'corner'], ['words', 'paint'], ['tint']].entries()) names.forEach((name) => gl.bindAttribLocation(made, place, name));
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(made));
  const place = (name) => gl.getUniformLocation(made, name);
  return { made, at: new Proxy({}, { get: (kept, name) => kept[name] || (kept[name] = place(name)) }) };
};

// Light is scaled so that the greatest is 2^10 in 16-bit floats: sums of it and its colours fit.
const splatVertex = `
in vec4 sphere; in uvec2 words; in vec3 tint;
uniform mat3 turn; uniform vec3 eye, lens; uniform vec2 size, middle; uniform float near, far, sliver; uniform bool onlyLeaves;
flat out vec3 centre, normal; flat out float radius, reach; flat out vec2 place; flat out vec4 light;
vec3 octahedron(uint code) {
  float u = float(code % 31u) / 15. - 1., v = float(min(code / 31u, 30u)) / 15. - 1., z = 1. - abs(u) - abs(v);
  vec2 s = vec2(u < 0. ? -1. : 1., v < 0. ? -1. : 1.);
  return normalize(z < 0. ? vec3(s * (1. - abs(vec2(v, u))), z) : vec3(u, v, z));
}
void main() {
  gl_Position = vec4(2., 2., 2., 1.); gl_PointSize = 1.;
  bool inner = (words.x >> 18u & 3u) != 0u;
  if (onlyLeaves && inner) return;
  centre = turn * (sphere.xyz - eye);
  radius = sphere.w;
  float depth = -centre.z;
  if (depth < near) return;
  normal = turn * octahedron(words.x >> 21u & 0x3FFu);
  uint cone = words.x >> 31u | (words.y & 1u) << 1u;
  // Small splats that face away are not drawn; spread by the sphere's own size.
  float sine = cone == 0u ? .0625 : cone == 1u ? .25 : cone == 2u ? .5625 : 2.;
  if (dot(normal, centre) > (sine + radius / length(centre)) * length(centre)) return;
  uint code = words.y >> 1u;
  float red = float(code >> 12u & 127u) / 126., blue = float(code >> 19u & 127u) / 126., green = max(0., 1. - red - blue);
  float luminance = (code & 4095u) == 0u ? 0. : exp2(10. - float(4095u - (code & 4095u)) / 128.);
  uint error = code >> 26u & 31u;
  float sum = luminance / max(1e-6, .2126 * red + .7152 * green + .0722 * blue);
  light = vec4(vec3(red, green, blue) * sum * tint * tint, error == 0u ? 1e4 : luminance * exp2(float(error) / 2.5 - 10.));
  vec2 shown = (centre.xy / depth - middle) / lens.xy;
  place = (shown * .5 + .5) * size;
  reach = radius / depth * lens.z;
  // Slivers narrower than a pixel, such as sides of floor boards, would be drawn as wide as one.
  if (!inner && radius < sliver && reach < .75) return;
  gl_PointSize = 2. * clamp(reach, .75, 512.) * SPREAD + 1.;
  gl_Position = vec4(shown, 0., 1.);
}`;
const splats = program('#define SPREAD 1.15\n' + splatVertex, `
uniform vec3 lens; uniform vec2 size, middle; uniform float near, far, lift; uniform bool blends;
flat in vec3 centre, normal; flat in float radius, reach; flat in vec2 place; flat in vec4 light;
layout(location = 0) out vec4 colour; layout(location = 1) out vec4 facts;
void main() {
  vec2 off = gl_FragCoord.xy - place;
  vec3 ray = vec3((gl_FragCoord.xy / size * 2. - 1.) * lens.xy + middle, -1.);
  float slope = dot(normal, ray), along = dot(normal, centre) / slope;
  vec3 to = ray * along - centre;
  float disc = abs(slope) > 1e-3 && along > 0. ? dot(to, to) / (radius * radius) : 1e9;
  float screen = dot(off, off) / .5625;
  float inside = min(disc, screen);
  if (!(inside <= 1.)) discard;
  float depth = disc <= 1. ? along : -centre.z;
  float pushed = max(near, depth + lift * radius);
  gl_FragDepth = clamp(log(pushed / near) / log(far / near), 0., 1.);
  float weight = blends ? exp(-2.5 * inside) : 1.;
  colour = vec4(light.rgb * weight, weight);
  facts = vec4(light.a * weight, depth * length(ray) / far * 1024. * weight, 0., weight);
}`);
const whole = 'void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4. - 1., 0., 1.); }';
const resolve = program(whole, `
uniform sampler2D colours, table; uniform vec2 size, corner, shownSize; uniform float factor; uniform vec3 sky; uniform int tone; uniform vec2 scale; uniform bool isLog;
out vec4 shown;
vec3 lit(ivec2 at) {
  vec4 found = texelFetch(colours, at, 0);
  if (found.a > 0.) return found.rgb / found.a;
  vec3 sum = vec3(0.); float weight = 0.; int count = 0;
  for (int d = 0; d < 8; d++) {
    ivec2 way = ivec2(round(vec2(cos(float(d) * .785398), sin(float(d) * .785398))));
    for (int s = 1; s <= 4; s++) {
      ivec2 other = at + way * s;
      if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, ivec2(size)))) break;
      vec4 near = texelFetch(colours, other, 0);
      if (near.a > 0.) { sum += near.rgb / near.a / float(s); weight += 1. / float(s); count++; break; }
    }
  }
  return count >= 6 ? sum / weight : sky;
}
void main() {
  vec3 light = lit(ivec2((gl_FragCoord.xy - corner) / shownSize * size));
  float luminance = dot(light, vec3(.2126, .7152, .0722));
  if (tone == 2) {
    float value = isLog ? log(max(luminance, 1e-20) / scale.x) / log(scale.y / scale.x) : (luminance - scale.x) / (scale.y - scale.x);
    shown = vec4(texelFetch(table, ivec2(int(clamp(value, 0., 1.) * 255. + .5), 0), 0).rgb, 1.); return;
  }
  if (tone == 3) { shown = vec4(luminance, luminance > 0. ? log2(luminance) : -100., 0., 1.); return; }
  vec3 value = light * factor;
  // The soft tone is proportional up to 60 % of white.
  if (tone == 0) value = mix(value, 1. - .4 * exp((.6 - value) / .4), greaterThan(value, vec3(.6)));
  value = clamp(value, 0., 1.);
  shown = vec4(mix(12.92 * value, 1.055 * pow(value, vec3(1. / 2.4)) - .055, greaterThan(value, vec3(.0031308))), 1.);
}`);
const light = 2 ** (site.peak - 10); // Radiance of 1 in the textures.

const buffer = gl.createBuffer();
const array = gl.createVertexArray(), empty = gl.createVertexArray();
gl.bindVertexArray(array);
gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
gl.bufferData(gl.ARRAY_BUFFER, nodes * NODE_BYTES, gl.STATIC_DRAW);
gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 4, gl.FLOAT, false, NODE_BYTES, 0);
gl.enableVertexAttribArray(1); gl.vertexAttribIPointer(1, 2, gl.UNSIGNED_INT, NODE_BYTES, 16);
gl.vertexAttrib3f(2, 1, 1, 1);
const colours = new Uint8Array(256 * 4);
site.colours.forEach((colour, at) => colours.set([parseInt(colour.slice(0, 2), 16), parseInt(colour.slice(2, 4), 16), parseInt(colour.slice(4, 6), 16), 255], at * 4));
const table = gl.createTexture();
gl.activeTexture(gl.TEXTURE1); gl.bindTexture(gl.TEXTURE_2D, table);
gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, colours);
gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
gl.activeTexture(gl.TEXTURE0);
const texture = (format, width, height) => {
  const made = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, made);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
  return made;
};
const target = (width, height, formats, depth) => {
  const frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  const textures = formats.map((format) => texture(format, width, height));
  textures.forEach((made, at) => gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + at, gl.TEXTURE_2D, made, 0));
  let buffer = null;
  if (depth) {
    buffer = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, buffer);
  }
  gl.drawBuffers(formats.map((_, at) => gl.COLOR_ATTACHMENT0 + at));
  const remove = () => { gl.deleteFramebuffer(frame); textures.forEach((made) => gl.deleteTexture(made)); gl.deleteRenderbuffer(buffer); };
  return { frame, textures, width, height, remove };
};
const small = target(64, 36, [gl.RGBA32F], false);
let screen = null;

// ---- The hierarchy ----
const spheres = new Float32Array(nodes * 4);
const firstChild = new Uint32Array(nodes + 1); // Of the first node at or after each.
let loaded = 0, children = 1, parent = -1, left = 0;
const centre = site.centre;
const RADII = Array.from({ length: 8 }, (_, code) => 2 ** (.4 * (code - 7)));
const LEAVES = Array.from({ length: 8 }, (_, code) => site.spacing * .15 * 2 ** (.5 * code));
const childrenOf = (word) => { const code = word >>> 18 & 3; return code === 0 ? 0 : code + 1; };
const CRC = new Uint32Array(256).map((_, n) => { for (let k = 0; k < 8; k++) n = n & 1 ? 0xEDB88320 ^ n >>> 1 : n >>> 1; return n; });
const crc32 = (bytes) => { let c = ~0; for (let i = 0; i < bytes.length; i++) c = CRC[(c ^ bytes[i]) & 255] ^ c >>> 8; return ~c >>> 0; };
const counts = [];

// Decodes a piece that follows the nodes that are there.
const decode = (bytes) => {
  const words = new Uint32Array(bytes.buffer, bytes.byteOffset, bytes.length / 4);
  const count = Math.min(words.length / 2, nodes - loaded);
  const packed = new ArrayBuffer(count * NODE_BYTES), floats = new Float32Array(packed), whole = new Uint32Array(packed);
  for (let at = 0; at < count; at++) {
    const number = loaded + at, word = words[2 * at], has = childrenOf(word);
    firstChild[number] = children;
    children += has;
    let [x, y, z, r] = [centre[0], centre[1], centre[2], site.radius];
    if (number > 0) {
      while (left === 0) {
        parent++;
        if (parent >= number) throw new Error('The data of this export contradicts itself: it was changed.');
        left = firstChild[parent + 1] - firstChild[parent];
      }
      left--;
      const from = parent * 4;
      [x, y, z, r] = [spheres[from], spheres[from + 1], spheres[from + 2], spheres[from + 3]];
    }
    x += ((word & 31) / 15 - 1) * r;
    y += ((word >>> 5 & 31) / 15 - 1) * r;
    z += ((word >>> 10 & 31) / 15 - 1) * r;
    const code = word >>> 15 & 7;
    r = has ? r * RADII[code] : LEAVES[code];
    const to = number * 4, put = at * 6;
    spheres[to] = floats[put] = x;
    spheres[to + 1] = floats[put + 1] = y;
    spheres[to + 2] = floats[put + 2] = z;
    spheres[to + 3] = floats[put + 3] = r;
    whole[put + 4] = word;
    whole[put + 5] = words[2 * at + 1];
    if (r < .12 * metre && r > .02 * metre) occupy(x, y, z);
  }
  firstChild[loaded + count] = children;
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferSubData(gl.ARRAY_BUFFER, loaded * NODE_BYTES, packed);
  loaded += count;
  arrived = true;
};

// ---- Walls: cells of a tenth of a metre with splats ----
const low = site.centre.map((x) => x - site.radius);
let cell = .1 * metre;
while ((2 * site.radius / cell) ** 3 > 6.4e7) cell *= 1.5;
const side = Math.ceil(2 * site.radius / cell);
const occupied = new Uint8Array(Math.ceil(side ** 3 / 8));
const cellOf = (x, y, z) => {
  const [i, j, k] = [Math.floor((x - low[0]) / cell), Math.floor((y - low[1]) / cell), Math.floor((z - low[2]) / cell)];
  return Math.min(i, j, k) < 0 || Math.max(i, j, k) >= side ? -1 : (k * side + j) * side + i;
};
const occupy = (x, y, z) => { const at = cellOf(x, y, z); if (at >= 0) occupied[at >> 3] |= 1 << (at & 7); };
const isWall = (p) => { const at = cellOf(p[0], p[1], p[2]); return at >= 0 && (occupied[at >> 3] >> (at & 7) & 1) === 1; };
const BODY = [[0, 0], [.22, 0], [-.22, 0], [0, .22], [0, -.22]];
const isFree = (p) => {
  for (const height of [0, -.35, -.7]) {
    for (const [a, b] of BODY) {
      if (isWall(plus(plus(plus(p, up, height * metre), east, a * metre), north, b * metre))) return false;
    }
  }
  return true;
};

// ---- Pieces ----
const fetchPiece = async (piece) => {
  const inline = $(piece.file);
  let bytes;
  if (inline) {
    bytes = Uint8Array.from(atob(inline.textContent), (c) => c.charCodeAt(0));
    inline.remove();
  } else {
    let answer;
    for (let attempt = 0; ; attempt++) {
      try {
        answer = await fetch(piece.file);
        if (answer.ok || attempt === 3) break;
      } catch (error) {
        if (attempt === 3) {
          const hint = location.protocol === 'file:' ? ' A folder must be served, as by `python3 -m http.server`; a single file (`--single`) need not.' : '';
          throw new Error(`${piece.file} cannot be loaded.${hint}`);
        }
      }
      await new Promise((done) => setTimeout(done, 300 << attempt));
    }
    if (!answer.ok) throw new Error(`${piece.file} cannot be loaded: ${answer.status}. A part of this export is missing.`);
    bytes = new Uint8Array(await answer.arrayBuffer());
  }
  if (bytes.length !== piece.bytes || crc32(bytes) !== piece.crc) throw new Error(`${piece.file} is damaged: it was cut off or changed.`);
  return bytes;
};
// The surfaces of the scene, once they are all here; before, splats in their colours are drawn.
let surfaces = null;
const areSurfacesHere = () => surfaces !== null && surfaces.isReady();
// Numbers of the first splats in the colours of their surfaces: whole levels.
const coloured = site.surfaces ? Math.min(site.surfaces.colours.bytes / 2, nodes) : 0;
const loadSurfaces = async () => {
  if (!site.surfaces) return;
  surfaces = startSurfaces({ gl, site, program, target, splatVertex, whole, drawRuns, choose, facts, light, metre, dot, plus });
  // A few requests at a time.
  let next = 0;
  const chain = async () => {
    while (next < site.surfaces.pieces.length) {
      const piece = site.surfaces.pieces[next++];
      surfaces.arrive(await fetchPiece(piece), piece);
    }
  };
  await Promise.all([chain(), chain(), chain(), chain()]);
  arrived = true;
};
// The first piece shows everything coarsely, and nothing else is requested before that is seen.
const first = async () => {
  const [bytes, tints] = await Promise.all([site.pieces[0], ...(site.surfaces ? [site.surfaces.colours] : [])].map(fetchPiece));
  if (tints) {
    const codes = new Uint16Array(tints.buffer, tints.byteOffset, coloured), shares = new Uint8Array(coloured * 4);
    codes.forEach((code, at) => shares.set([(code & 31) * 255 / 31, (code >> 5 & 63) * 255 / 63, (code >> 11) * 255 / 31], at * 4));
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, shares, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(2); gl.vertexAttribPointer(2, 3, gl.UNSIGNED_BYTE, true, 4, 0);
    gl.bindVertexArray(empty);
  }
  decode(bytes);
  counts.push([performance.now(), loaded]);
  for (let frames = 0; frames < 2; frames++) await new Promise(requestAnimationFrame);
};
const load = async () => {
  await first();
  await loadSurfaces();
  const waiting = new Map();
  let next = 1;
  for (let number = 1; number < site.pieces.length && loaded < nodes; number++) {
    while (next < site.pieces.length && next < number + 4) {
      const promise = fetchPiece(site.pieces[next]);
      promise.catch(() => {}); // It is awaited below.
      waiting.set(next++, promise);
    }
    const bytes = await waiting.get(number);
    waiting.delete(number);
    decode(bytes);
    counts.push([performance.now(), loaded]);
    $('s-loaded').textContent = loaded < site.nodes ? `${Math.round(100 * loaded / site.nodes)} % loaded` : '';
    document.body.dataset.loaded = loaded;
    // A frame between pieces.
    await new Promise((done) => setTimeout(done));
  }
  if (nodes < site.nodes) $('s-loaded').textContent = 'shown coarser than stored: memory is bounded to 200 MB';
  document.body.dataset.complete = 'yes';
  changed = true;
};

// ---- Patches: runs of nodes for each level ----
let patchLevel = 0;
while (patchLevel + 1 < site.levels.length && site.levels[patchLevel + 1] + 1 < nodes
  && (site.levels[patchLevel + 2] || nodes) - site.levels[patchLevel + 1] <= MOST_PATCHES) patchLevel++;
const starts = []; // starts[depth][patch]: its first node there; one more at the end.
const largest = []; // largest[depth][patch]: the greatest radius of its nodes there.
const levelEnd = (level) => Math.min(level + 1 < site.levels.length ? site.levels[level + 1] : nodes, nodes);
// Adds levels that have arrived completely.
const patches = () => {
  for (let level = patchLevel + starts.length; level < site.levels.length && loaded >= levelEnd(level); level++) {
    const first = site.levels[level], end = levelEnd(level);
    const next = starts.length === 0
      ? Uint32Array.from({ length: end - first + 1 }, (_, at) => first + at)
      : starts[starts.length - 1].map((node) => (node >= first ? end : Math.min(firstChild[node], end)));
    starts.push(next);
    const radii = new Float32Array(next.length - 1);
    for (let patch = 0; patch + 1 < next.length; patch++) {
      for (let node = next[patch]; node < next[patch + 1]; node++) radii[patch] = Math.max(radii[patch], spheres[node * 4 + 3]);
    }
    largest.push(radii);
  }
};

// ---- The eye ----
const eye = { at: [0, 0, 0], turn: 0, tilt: 0, angle: 75 };
const speed = [0, 0, 0];
const look = { auto: false, stops: 0, tone: 'soft', isLog: true, least: 1, most: 1000, factor: site.exposure };
let changed = true, arrived = false, isWorn = false, isMoving = false, lastMove = 0, cursor = null, solid = true;
const forward = () => plus(plus([0, 0, 0], plus(plus([0, 0, 0], north, Math.cos(eye.turn)), east, Math.sin(eye.turn)), Math.cos(eye.tilt)), up, Math.sin(eye.tilt));
const goTo = (view) => {
  eye.at = plus(view.vp, site.origin, -1);
  const ahead = unit(view.vd);
  eye.turn = Math.atan2(dot(ahead, east), dot(ahead, north));
  eye.tilt = Math.asin(Math.max(-1, Math.min(1, dot(ahead, up))));
  eye.angle = Math.max(20, Math.min(120, view.vh));
  moved();
};
const moved = () => { changed = true; isMoving = true; lastMove = performance.now(); };
const keys = new Set();
const WALK = { KeyW: [0, 1, 0], ArrowUp: [0, 1, 0], KeyS: [0, -1, 0], ArrowDown: [0, -1, 0], KeyA: [-1, 0, 0], KeyD: [1, 0, 0], KeyE: [0, 0, 1], KeyQ: [0, 0, -1] };
const step = (seconds) => {
  const wish = [0, 0, 0];
  for (const key of keys) (WALK[key] || []).forEach((x, at) => { wish[at] += x; });
  const turn = (keys.has('ArrowRight') ? 1 : 0) - (keys.has('ArrowLeft') ? 1 : 0);
  if (turn) { eye.turn += turn * 1.6 * seconds; moved(); }
  const pace = (keys.has('ShiftLeft') || keys.has('ShiftRight') ? 4 : 1.4) * metre;
  const share = 1 - Math.exp(-seconds / .08);
  for (let k = 0; k < 3; k++) speed[k] += share * (wish[k] * pace - speed[k]);
  if (Math.hypot(...speed) < .01 * metre) { if (!wish.some(Boolean)) speed.fill(0); return; }
  const ahead = plus(plus([0, 0, 0], north, Math.cos(eye.turn)), east, Math.sin(eye.turn));
  const right = plus(plus([0, 0, 0], east, Math.cos(eye.turn)), north, -Math.sin(eye.turn));
  walk(plus(plus([0, 0, 0], ahead, speed[1] * seconds), right, speed[0] * seconds));
  eye.at = plus(eye.at, up, speed[2] * seconds);
  moved();
};
// Moves the eye; along a wall if one is in the way. Who stands in a wall already may leave it.
const walk = (way) => {
  const parts = Math.max(1, Math.ceil(Math.hypot(...way) / (.05 * metre)));
  for (let part = 0; part < parts; part++) {
    const wasFree = isFree(eye.at);
    for (const axis of [east, north]) {
      const next = plus(eye.at, axis, dot(way, axis) / parts);
      if (!solid || !wasFree || isFree(next)) eye.at = next;
    }
  }
};

// ---- A frame ----
const facts = { frames: 0, script: 0, calls: 0, vertices: 0, splats: 0 };
const MOVING_PIXELS = 2.5, REST_PIXELS = 1, SCALES = [1, .7, .5, .35, .25];
let detail = 2;
const isQuick = () => isMoving || !document.body.dataset.complete;
const draw = () => {
  const start = performance.now();
  const ratio = Math.min(devicePixelRatio || 1, 1.5) * (isQuick() ? SCALES[detail] : 1);
  const width = Math.max(2, Math.round(canvas.clientWidth * ratio)), height = Math.max(2, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const ahead = forward(), right = unit(cross(ahead, up)), across = Math.tan(eye.angle * Math.PI / 360);
  facts.calls = facts.vertices = 0;
  drawLight({ at: eye.at, ahead, right, over: cross(right, ahead), half: [across, across * height / width], middle: [0, 0], width, height, isQuick: isQuick() });
  if (!isMoving && (look.auto || look.tone === 'false')) adapt();
  show(null, [0, 0, width, height], TONES[look.tone]);
  facts.frames++;
  facts.first = facts.first || firstPicture();
  facts.script = performance.now() - start;
};
// When the first picture is drawn, in milliseconds, and the bytes that have come by then.
const firstPicture = () => {
  const entries = [...performance.getEntriesByType('navigation'), ...performance.getEntriesByType('resource')];
  return { after: performance.now(), bytes: entries.reduce((sum, one) => sum + one.encodedBodySize, 0) };
};
// Draws the light of a view. `half` and `middle` are tangents: of half the picture's sides, and of
// its middle from the axis.
const drawLight = (view) => {
  const { width, height } = view, pixels = width / (2 * view.half[0]);
  if (!screen || screen.width !== width || screen.height !== height) {
    if (screen) screen.remove();
    screen = target(width, height, [gl.RGBA16F, gl.RGBA16F], true);
  }
  patches();
  if (areSurfacesHere()) {
    gl.bindVertexArray(array);
    gl.disableVertexAttribArray(2);
    surfaces.draw(view, screen);
    gl.bindVertexArray(empty);
    return;
  }
  const { ahead, right, over } = view;
  const near = .05 * metre, far = 4 * site.radius + near + Math.hypot(...plus(view.at, site.centre, -1));
  gl.bindFramebuffer(gl.FRAMEBUFFER, screen.frame);
  gl.viewport(0, 0, width, height);
  gl.enable(gl.DEPTH_TEST);
  gl.depthMask(true);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.useProgram(splats.made);
  gl.uniformMatrix3fv(splats.at.turn, false, [right[0], over[0], -ahead[0], right[1], over[1], -ahead[1], right[2], over[2], -ahead[2]]);
  gl.uniform3fv(splats.at.eye, view.at);
  gl.uniform3f(splats.at.lens, ...view.half, pixels);
  gl.uniform2fv(splats.at.middle, view.middle);
  gl.uniform2f(splats.at.size, width, height);
  gl.uniform1f(splats.at.near, near);
  gl.uniform1f(splats.at.far, far);
  gl.uniform1f(splats.at.sliver, .25 * site.spacing);
  const runs = choose(view, pixels);
  gl.depthFunc(gl.LEQUAL);
  gl.disable(gl.BLEND);
  const passes = view.isQuick ? [[false, 0]] : [[false, .6], [true, 0]];
  for (const [blends, lift] of passes) {
    gl.uniform1i(splats.at.blends, blends ? 1 : 0);
    gl.uniform1f(splats.at.lift, lift);
    const onlyDepth = lift > 0;
    gl.colorMask(!onlyDepth, !onlyDepth, !onlyDepth, !onlyDepth);
    if (blends) { gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE); gl.depthMask(false); }
    drawRuns(splats, runs);
  }
  gl.colorMask(true, true, true, true);
  gl.disable(gl.BLEND);
  gl.disable(gl.DEPTH_TEST);
  gl.bindVertexArray(empty);
};
const drawRuns = (program, runs) => {
  gl.bindVertexArray(array);
  for (const run of runs) {
    facts.vertices += run.counts.reduce((a, b) => a + b, 0);
    gl.uniform1i(program.at.onlyLeaves, run.onlyLeaves ? 1 : 0);
    if (multi) { multi.multiDrawArraysWEBGL(gl.POINTS, run.firsts, 0, run.counts, 0, run.firsts.length); facts.calls++; }
    else run.firsts.forEach((first, at) => { gl.drawArrays(gl.POINTS, first, run.counts[at]); facts.calls++; });
  }
};
const TONES = { soft: 0, linear: 1, false: 2 };
// Shows the light that was drawn last in a part of a frame: left, bottom, width and height.
const show = (frame, [left, bottom, width, height], tone) => {
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.viewport(left, bottom, width, height);
  gl.useProgram(resolve.made);
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, screen.textures[0]);
  gl.uniform1i(resolve.at.colours, 0);
  gl.uniform1i(resolve.at.table, 1);
  gl.uniform2f(resolve.at.size, screen.width, screen.height);
  gl.uniform2f(resolve.at.corner, left, bottom);
  gl.uniform2f(resolve.at.shownSize, width, height);
  gl.uniform1f(resolve.at.factor, look.factor * 2 ** look.stops * light);
  gl.uniform3fv(resolve.at.sky, site.sky.map((x) => x / light));
  gl.uniform1i(resolve.at.tone, tone);
  gl.uniform2f(resolve.at.scale, look.least / (EFFICACY * light), look.most / (EFFICACY * light));
  gl.uniform1i(resolve.at.isLog, look.isLog ? 1 : 0);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
};

// Chooses a level for each patch that is visible, and returns runs of nodes.
const choose = ({ at, ahead, right, over, half, middle, isQuick }, pixels) => {
  const isEarly = coloured > 0 && !areSurfacesHere();
  if (starts.length === 0 || isEarly) {
    // The beginning: the last whole level, or what there is.
    const known = isEarly ? Math.min(loaded, coloured) : loaded;
    let level = 0;
    while (level + 1 < site.levels.length && known >= levelEnd(level + 1)) level++;
    const first = site.levels[level], end = Math.min(levelEnd(level), known);
    const runs = [{ onlyLeaves: false, firsts: [first], counts: [Math.max(0, end - first)] }];
    return first > 0 ? [{ onlyLeaves: true, firsts: [0], counts: [first] }, ...runs] : runs;
  }
  const finest = isQuick ? MOVING_PIXELS : REST_PIXELS;
  // Inward normals of the picture's edges.
  const sides = [[right, 0], [over, 1]].flatMap(([axis, k]) => [-1, 1].map((way) =>
    unit(plus(plus([0, 0, 0], ahead, half[k] + way * middle[k]), axis, -way))));
  const count = starts[0].length - 1, depths = new Int8Array(count);
  for (let patch = 0; patch < count; patch++) {
    const from = starts[0][patch] * 4, r = spheres[from + 3];
    const to = [spheres[from] - at[0], spheres[from + 1] - at[1], spheres[from + 2] - at[2]];
    depths[patch] = sides.some((edge) => dot(edge, to) < -r) ? -1 : starts.length - 1;
    const distance = Math.max(Math.hypot(...to) - r, 1e-6);
    for (let depth = 0; depth < starts.length - 1 && depths[patch] >= 0; depth++) {
      if (2 * largest[depth][patch] * pixels / distance < finest) { depths[patch] = depth; break; }
    }
  }
  const runs = [];
  for (let depth = 0; depth < starts.length; depth++) {
    for (const onlyLeaves of [true, false]) {
      const run = { onlyLeaves, firsts: [], counts: [] };
      let end = -1;
      for (let patch = 0; patch < count; patch++) {
        if (onlyLeaves ? depths[patch] <= depth : depths[patch] !== depth) continue;
        const first = starts[depth][patch], next = starts[depth][patch + 1];
        if (first === end) run.counts[run.counts.length - 1] += next - first;
        else if (next > first) { run.firsts.push(first); run.counts.push(next - first); }
        end = next > first || first === end ? next : end;
      }
      if (run.firsts.length) runs.push(run);
    }
  }
  return runs;
};

// ---- Brightness ----
const adapt = () => {
  show(small.frame, [0, 0, small.width, small.height], 3);
  const values = new Float32Array(small.width * small.height * 4);
  gl.readPixels(0, 0, small.width, small.height, gl.RGBA, gl.FLOAT, values);
  const logs = [];
  for (let at = 0; at < values.length; at += 4) if (values[at] > 0) logs.push(values[at + 1]);
  if (!logs.length) return;
  const mean = logs.reduce((sum, log) => sum + log, 0) / logs.length;
  if (look.auto) look.factor = .18 / (2 ** mean * light);
  if (look.tone === 'false' && !look.fixed) {
    logs.sort((a, b) => a - b);
    const value = (share) => 2 ** logs[Math.floor(share * (logs.length - 1))] * light * EFFICACY;
    [look.least, look.most] = [look.isLog ? value(.01) : 0, Math.max(value(.99), value(.01) * 1.01)];
  }
  legend();
};
const words = (x) => !Number.isFinite(x) ? '–' : x === 0 ? '0' : x >= 1e5 || x < 1e-3 ? x.toExponential(2) : String(+x.toPrecision(3));
const legend = () => {
  $('legend').hidden = look.tone !== 'false';
  $('legend-least').textContent = words(look.least);
  $('legend-most').textContent = words(look.most);
};
$('legend-bar').style.background = `linear-gradient(90deg, ${site.colours.filter((_, at) => at % 15 === 0).map((c) => `#${c}`).join()})`;

// The light of a place of the picture, from 0 to 1 and from the top: as drawn, before tones.
const probe = (x, y) => {
  if (!screen) return null;
  const at = [Math.min(screen.width - 1, Math.floor(x * screen.width)), Math.min(screen.height - 1, Math.floor((1 - y) * screen.height))];
  gl.bindFramebuffer(gl.FRAMEBUFFER, screen.frame);
  const found = [0, 1].map((number) => {
    const value = new Float32Array(4);
    gl.readBuffer(gl.COLOR_ATTACHMENT0 + number);
    gl.readPixels(at[0], at[1], 1, 1, gl.RGBA, gl.FLOAT, value);
    return value;
  });
  const [colour, more] = found, weight = colour[3];
  if (!(weight > 0)) return null;
  const rgb = [0, 1, 2].map((k) => colour[k] / weight * light);
  const luminance = EFFICACY * (.2126 * rgb[0] + .7152 * rgb[1] + .0722 * rgb[2]);
  const far = 4 * site.radius + .05 * metre + Math.hypot(...plus(eye.at, site.centre, -1));
  return { rgb, luminance, error: EFFICACY * light * more[0] / weight, distance: more[1] / weight / 1024 * far };
};
// The radiance of each pixel as drawn, before tones, in rows from the top.
const pixels = () => {
  const { width, height, frame } = screen, values = new Float32Array(width * height * 4);
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.readBuffer(gl.COLOR_ATTACHMENT0);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, values);
  const rgb = new Float32Array(width * height * 3);
  for (let at = 0; at < width * height; at++) {
    const from = 4 * ((height - 1 - Math.floor(at / width)) * width + at % width), weight = values[from + 3];
    for (let k = 0; k < 3; k++) rgb[3 * at + k] = weight > 0 ? values[from + k] / weight * light : site.sky[k];
  }
  return { width, height, rgb };
};
const say = () => {
  const found = probe(...(cursor || [.5, .5]));
  $('p-luminance').textContent = found ? `${words(found.luminance)} ± ${words(found.error)} cd/m²` : 'nothing known';
  $('p-radiance').textContent = found ? found.rgb.map(words).join(' ') : '–';
  $('p-distance').textContent = found ? `${words(found.distance * site.unit)} m` : '–';
};

// ---- Plan ----
const plan = $('plan').getContext('2d');
const box = site.rooms.flat().reduce((box, p) => [Math.min(box[0], dot(p, east)), Math.min(box[1], dot(p, north)), Math.max(box[2], dot(p, east)), Math.max(box[3], dot(p, north))], [Infinity, Infinity, -Infinity, -Infinity]);
const zoom = Math.min(256 / (box[2] - box[0]), 180 / (box[3] - box[1]));
const onPlan = (p) => [10 + (dot(p, east) - box[0]) * zoom, 190 - (dot(p, north) - box[1]) * zoom];
const drawPlan = () => {
  if (!Number.isFinite(zoom) || $('panel').hidden) return;
  plan.clearRect(0, 0, 276, 200);
  plan.strokeStyle = '#9aa1ad';
  for (const room of site.rooms) {
    plan.beginPath();
    room.forEach((p, at) => (at ? plan.lineTo(...onPlan(p)) : plan.moveTo(...onPlan(p))));
    plan.closePath();
    plan.stroke();
  }
  const [x, y] = onPlan(plus(eye.at, site.origin));
  plan.fillStyle = '#ffb454';
  plan.beginPath();
  plan.moveTo(x, y);
  plan.arc(x, y, 14, eye.turn - Math.PI / 2 - .6, eye.turn - Math.PI / 2 + .6);
  plan.fill();
};
$('plan').addEventListener('click', (event) => {
  const [x, y] = [event.offsetX * 276 / event.target.clientWidth, event.offsetY * 200 / event.target.clientHeight];
  const there = plus(plus(plus([0, 0, 0], up, dot(plus(eye.at, site.origin), up)), east, box[0] + (x - 10) / zoom), north, box[1] + (190 - y) / zoom);
  eye.at = plus(there, site.origin, -1);
  moved();
});

// ---- Hands ----
const press = (name) => ({ KeyH: home, KeyZ: full, KeyV: panel, F4: walls, KeyX: auto, KeyJ: () => tone(look.tone === 'false' ? 'soft' : 'false') }[name]);
const home = () => goTo(site.views[0]);
const full = () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen().catch(() => {}));
const panel = () => { $('panel').hidden = !$('panel').hidden; $('b-panel').setAttribute('aria-pressed', String(!$('panel').hidden)); drawPlan(); };
const walls = () => { solid = !solid; $('b-solid').setAttribute('aria-pressed', String(solid)); };
const auto = () => { look.auto = !look.auto; if (!look.auto) look.factor = site.exposure; $('b-auto').setAttribute('aria-pressed', String(look.auto)); changed = true; };
const tone = (name) => {
  look.tone = name;
  document.querySelectorAll('[data-tone]').forEach((button) => button.setAttribute('aria-pressed', String(button.dataset.tone === name)));
  legend();
  changed = true;
};
$('b-home').onclick = home; $('b-full').onclick = full; $('b-panel').onclick = panel; $('b-solid').onclick = walls; $('b-auto').onclick = auto;
document.querySelectorAll('[data-tone]').forEach((button) => { button.onclick = () => tone(button.dataset.tone); });
$('r-stops').oninput = () => { look.stops = +$('r-stops').value; $('o-stops').textContent = look.stops; changed = true; };
$('r-angle').oninput = () => { eye.angle = +$('r-angle').value; moved(); };
$('r-height').oninput = () => { eye.at = plus(eye.at, up, (+$('r-height').value - heightOf()) * metre); moved(); };
$('b-log').onclick = () => { look.isLog = !look.isLog; look.fixed = false; $('b-log').setAttribute('aria-pressed', String(look.isLog)); changed = true; };
$('f-scale').onsubmit = (event) => {
  event.preventDefault();
  const [least, most] = [$('t-least'), $('t-most')].map((input) => parseFloat(input.value));
  look.fixed = Number.isFinite(least) && Number.isFinite(most) && most > least && (!look.isLog || least > 0);
  for (const id of ['t-least', 't-most']) $(id).setAttribute('aria-invalid', String(!look.fixed));
  if (look.fixed) [look.least, look.most] = [least, most];
  tone('false');
};
// Height over the floor below, metres: the first cells with splats below the feet.
const heightOf = () => {
  for (let h = .2; h < 4; h += .05) if (isWall(plus(eye.at, up, -h * metre))) return h;
  return 1.6;
};
window.addEventListener('keydown', (event) => {
  if (event.target.tagName === 'INPUT' && event.target.type !== 'range' || event.ctrlKey || event.metaKey || event.altKey) return;
  const action = press(event.code);
  if (action && !event.repeat) { action(); event.preventDefault(); }
  if (WALK[event.code] || event.code.startsWith('Arrow')) event.preventDefault();
  keys.add(event.code);
});
window.addEventListener('keyup', (event) => keys.delete(event.code));
window.addEventListener('blur', () => keys.clear());
const fingers = new Map();
const stage = $('stage');
stage.addEventListener('pointerdown', (event) => {
  if (event.target.closest('button')) return;
  stage.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
});
stage.addEventListener('pointermove', (event) => {
  cursor = [event.clientX / canvas.clientWidth, event.clientY / canvas.clientHeight];
  const before = fingers.get(event.pointerId);
  if (!before) return say();
  const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
  const scale = eye.angle * Math.PI / 180 / canvas.clientWidth;
  if (fingers.size >= 2) {
    const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
    const was = spread();
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    walk(plus([0, 0, 0], forward(), (spread() - was) * .01 * metre));
  } else {
    eye.turn -= dx * scale;
    eye.tilt = Math.max(-1.5, Math.min(1.5, eye.tilt + dy * scale));
  }
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
  moved();
});
for (const name of ['pointerup', 'pointercancel']) stage.addEventListener(name, (event) => fingers.delete(event.pointerId));
stage.addEventListener('wheel', (event) => { event.preventDefault(); walk(plus([0, 0, 0], forward(), -Math.sign(event.deltaY) * .25 * metre)); moved(); }, { passive: false });
document.querySelectorAll('#pad button').forEach((button) => {
  button.onpointerdown = (event) => { event.preventDefault(); keys.add(button.dataset.key); };
  for (const name of ['pointerup', 'pointerleave', 'pointercancel']) button.addEventListener(name, () => keys.delete(button.dataset.key));
});
window.addEventListener('resize', () => { changed = true; });
site.views.forEach((view) => {
  const button = document.createElement('button');
  button.type = 'button';
  button.textContent = view.name;
  button.onclick = () => goTo(view);
  const item = document.createElement('li');
  item.append(button);
  $('views').append(item);
});
site.notes.forEach((note) => { const item = document.createElement('li'); item.textContent = note; $('notes').append(item); });

// ---- The clock ----
let before = performance.now(), began = 0, fence = null;
// While the eye moves, a slow card draws fewer pixels and coarser splats.
const follow = (milliseconds) => {
  if (milliseconds > 40) detail = Math.min(SCALES.length - 1, detail + 1);
  else if (milliseconds < 18) detail = Math.max(0, detail - 1);
};
const tick = (now) => {
  requestAnimationFrame(tick);
  // A headset has a clock of its own.
  if (isWorn) { before = now; return; }
  step(Math.min(.1, (now - before) / 1000));
  before = now;
  if (isMoving && now - lastMove > 150) { isMoving = false; changed = true; }
  // One frame is under way at a time, so a slow card never falls behind the hand.
  if (fence) {
    if (gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) return;
    gl.deleteSync(fence);
    fence = null;
    facts.frame = now - began;
    if (facts.wasMoving) follow(facts.frame);
  }
  if (loaded === 0) return;
  // What has just arrived is worth a frame now and then, and one at the end.
  const hasNews = arrived && (now - began > Math.max(500, 2 * (facts.frame || 0)) || document.body.dataset.complete);
  if (!changed && !hasNews) return;
  began = now;
  draw();
  fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  facts.wasMoving = isQuick();
  changed = arrived = false;
  if (!isMoving) say();
  drawPlan();
  $('s-frame').textContent = `${(facts.vertices / 1e6).toFixed(2)} M splats, ${facts.script.toFixed(1)} ms of script`;
  $('s-view').textContent = plus(eye.at, site.origin).map((x) => x.toFixed(2)).join(' ');
  $('o-angle').textContent = `${Math.round(eye.angle)}°`;
  $('r-angle').value = eye.angle;
  document.body.dataset.frames = facts.frames;
  document.body.dataset.moving = isMoving ? 'yes' : 'no';
};
// What tests and other pages may ask.
window.holodeck = { site, eye, facts, look, probe, pixels, goTo, isFree, counts };
startHeadset({
  gl, eye, facts, axes: { up, north, east }, metre, dot, plus, walk, heightOf,
  // Draws a view into a part of a frame, with the page's exposure and tone.
  drawPart: (view, frame, part) => { drawLight(view); show(frame, part, TONES[look.tone]); },
  wear: (isOn) => { isWorn = isOn; moved(); },
});
goTo(site.views[0]);
requestAnimationFrame(tick);
load().catch((error) => fail(error.message));
})();
