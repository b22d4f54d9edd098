// Surfaces of the scene, which the splats light.
//
// A view's triangles are drawn first: the normal, the depth and the colour that each pixel shows.
// Then each splat adds its light to the pixels whose surface is at its place and faces its way. The
// picture is the mean of that light times the colour. A flat mirror shows the same of the mirrored
// room.
'use strict';
const surfacesAreSound = (s) => {
  const isNumber = (x) => typeof x === 'number' && Number.isFinite(x);
  const isVector = (v) => Array.isArray(v) && v.length === 3 && v.every(isNumber);
  const isWhole = (n, most) => Number.isInteger(n) && n >= 0 && n <= most;
  const isPiece = (p) => p && isWhole(p.bytes, 1 << 20) && isWhole(p.crc, 2 ** 32) && /^[\w./-]+$/.test(p.file);
  const isChunk = (c) => isWhole(c.corners, 65536) && isWhole(c.triangles, 65536) && isVector(c.low) && isVector(c.step);
  return Array.isArray(s.pieces) && s.pieces.length <= 256 && s.pieces.every((p) => isPiece(p) && Array.isArray(p.chunks)
      && p.chunks.every(isChunk) && p.chunks.reduce((sum, c) => sum + 8 * c.corners + 6 * c.triangles, 0) === p.bytes)
    && isPiece(s.colours) && s.colours.bytes % 2 === 0
    && Array.isArray(s.paints) && s.paints.length <= 65536
    && s.paints.every((p) => Array.isArray(p) && isVector(p[0]) && isWhole(p[1] + 1, 4))
    && Array.isArray(s.mirrors) && s.mirrors.length <= 4
    && s.mirrors.every((m) => isVector(m.normal) && isNumber(m.offset) && isVector(m.centre) && isNumber(m.radius));
};
const startSurfaces = ({ gl, site, program, target, splatVertex, whole, drawRuns, choose, facts, light, metre, dot, plus }) => {
  const table = site.surfaces;
  // Splats light what is within this many of their radii, and this far off their plane.
  const REACH = 1.5, THICKNESS = .6;
  // Coarser splats light what finer ones leave dark. They weigh this share.
  const COARSER = 6, SHARE = 1 / 1024;
  const corners = `
in vec3 corner; in uint paint;
uniform vec3 low, step, eye, lens; uniform vec2 middle; uniform mat3 turn; uniform float near;
out vec3 place; flat out int number;
void main() {
  place = turn * (low + corner * step - eye);
  number = int(paint);
  // The far plane is at infinity.
  gl_Position = vec4((place.xy + place.z * middle) / lens.xy, -place.z - 2. * near, -place.z);
}`;
  const lookup = `
uniform sampler2D paints; uniform vec4 cut;
in vec3 place; flat in int number;
vec4 paintHere() {
  // What lies behind a mirror is not in it.
  if (dot(cut.xyz, place) < cut.w) discard;
  return texelFetch(paints, ivec2(number & 255, number >> 8), 0);
}`;
  const opaque = program(corners, lookup + `
layout(location = 0) out vec4 surface; layout(location = 1) out vec4 colour;
void main() {
  vec4 paint = paintHere();
  vec3 normal = cross(dFdx(place), dFdy(place));
  float size = length(normal);
  normal = size > 0. ? normal / size : -normalize(place);
  surface = vec4(dot(normal, place) > 0. ? -normal : normal, -place.z);
  colour = vec4(paint.rgb, paint.a + 2.);
}`);
  const glass = program(corners, lookup + `
layout(location = 0) out vec4 surface; layout(location = 1) out vec4 colour;
void main() { surface = vec4(0.); colour = vec4(paintHere().rgb, 1.); }`);
  const lamp = program(`#define SPREAD ${REACH}\n` + splatVertex, `
uniform vec3 lens; uniform vec2 size, middle; uniform float far, share; uniform sampler2D surfaces;
flat in vec3 centre, normal; flat in float radius, reach; flat in vec2 place; flat in vec4 light;
layout(location = 0) out vec4 colour; layout(location = 1) out vec4 facts;
void main() {
  vec4 surface = texelFetch(surfaces, ivec2(gl_FragCoord.xy), 0);
  vec3 ray = vec3((gl_FragCoord.xy / size * 2. - 1.) * lens.xy + middle, -1.);
  vec3 to = ray * surface.w - centre;
  float inside = dot(to, to) / (radius * radius), facing = dot(normal, surface.xyz);
  if (!(surface.w > 0. && inside < ${REACH * REACH} && abs(dot(to, surface.xyz)) < ${THICKNESS} * radius && facing > .3)) discard;
  float weight = share * facing * facing * exp(-2. * inside);
  colour = vec4(light.rgb * weight, weight);
  facts = vec4(light.a * weight, 0., 0., weight);
}`);
  const compose = program(whole, `
uniform sampler2D surfaces, colours, lights, errors; uniform vec3 lens, sky; uniform vec2 size, middle; uniform float far;
layout(location = 0) out vec4 colour; layout(location = 1) out vec4 facts;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 surface = texelFetch(surfaces, at, 0), paint = texelFetch(colours, at, 0);
  vec3 ray = vec3((gl_FragCoord.xy / size * 2. - 1.) * lens.xy + middle, -1.);
  if (!(surface.w > 0.)) { colour = vec4(sky * paint.rgb, 1.); facts = vec4(0., 1e30, 0., 1.); return; }
  vec4 light = texelFetch(lights, at, 0);
  float error = texelFetch(errors, at, 0).x;
  if (!(light.a > 0.)) {
    // A surface without samples has the light of the nearest like it.
    for (int ring = 1; ring <= 12 && !(light.a > 0.); ring++) {
      for (int way = 0; way < 12; way++) {
        ivec2 other = at + ivec2(round(float(ring) * vec2(cos(float(way) * .5236), sin(float(way) * .5236))));
        if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, ivec2(size)))) continue;
        vec4 beside = texelFetch(surfaces, other, 0);
        if (beside.w > 0. && dot(beside.xyz, surface.xyz) > .7) { light += texelFetch(lights, other, 0); error += texelFetch(errors, other, 0).x; }
      }
    }
  }
  if (!(light.a > 0.)) { colour = vec4(0.); facts = vec4(0.); return; }
  colour = vec4(light.rgb / light.a * paint.rgb, 1.);
  facts = vec4(error / light.a * dot(paint.rgb, vec3(.2126, .7152, .0722)), surface.w * length(ray) / far * 1024., 0., 1.);
}`);
  const reflect = program(whole, `
uniform sampler2D colours, reflected, errors; uniform float number;
layout(location = 0) out vec4 colour; layout(location = 1) out vec4 facts;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 paint = texelFetch(colours, at, 0), found = texelFetch(reflected, at, 0);
  if (abs(paint.a - number) > .25 || found.a <= 0.) discard;
  colour = vec4(found.rgb * paint.rgb, found.a);
  facts = texelFetch(errors, at, 0);
}`);

  const paints = gl.createTexture();
  const rows = Math.max(1, Math.ceil(table.paints.length / 256)), values = new Float32Array(rows * 1024);
  table.paints.forEach(([colour, mirror], at) => values.set([...colour, mirror], at * 4));
  gl.bindTexture(gl.TEXTURE_2D, paints);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 256, rows, 0, gl.RGBA, gl.FLOAT, values);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);

  const chunks = [];
  let arrived = 0;
  const arrive = (bytes, piece) => {
    let from = bytes.byteOffset;
    for (const { corners, triangles, low, step, is_glass: isGlass } of piece.chunks) {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Uint8Array(bytes.buffer, from, 8 * corners), gl.STATIC_DRAW);
      const numbers = bytes.buffer.slice(from + 8 * corners, from + 8 * corners + 6 * triangles);
      if (new Uint16Array(numbers).some((number) => number >= corners)) throw new Error('The data of this export contradicts itself: it was changed.');
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint8Array(numbers), gl.STATIC_DRAW);
      const [place, paint] = [gl.getAttribLocation(opaque.made, 'corner'), gl.getAttribLocation(opaque.made, 'paint')];
      gl.enableVertexAttribArray(place); gl.vertexAttribPointer(place, 3, gl.UNSIGNED_SHORT, false, 8, 0);
      gl.enableVertexAttribArray(paint); gl.vertexAttribIPointer(paint, 1, gl.UNSIGNED_SHORT, 8, 6);
      const half = step.map((size) => size * 32767.5);
      chunks.push({ array, triangles, low, step, isGlass, centre: plus(low, half), radius: Math.hypot(...half) });
      from += 8 * corners + 6 * triangles;
    }
    gl.bindVertexArray(null);
    arrived++;
  };

  // Textures of a view: its surfaces, its light, and the picture.
  const buffersOf = (width, height) => {
    const surface = target(width, height, [gl.RGBA32F, gl.RGBA16F], true), lights = target(width, height, [gl.RGBA16F, gl.RGBA16F], false);
    return { width, height, surface, lights, picture: null, remove() { surface.remove(); lights.remove(); if (this.picture) this.picture.remove(); } };
  };
  const kept = [null, null];
  const buffers = (number, width, height) => {
    if (!kept[number] || kept[number].width !== width || kept[number].height !== height) {
      if (kept[number]) kept[number].remove();
      kept[number] = buffersOf(width, height);
    }
    return kept[number];
  };
  const bind = (program, names) => names.forEach(([name, texture], unit) => {
    // The page's table of colours stays in unit 1.
    const place = unit === 0 ? 0 : unit + 1;
    gl.activeTexture(gl.TEXTURE0 + place);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.uniform1i(program.at[name], place);
    gl.activeTexture(gl.TEXTURE0);
  });
  const isSeen = (view, centre, radius) => {
    const to = plus(centre, view.at, -1), ahead = dot(to, view.ahead);
    return ahead > -radius && [[view.right, 0], [view.over, 1]].every(([axis, k]) => {
      const off = dot(to, axis) - ahead * view.middle[k];
      return Math.abs(off) - Math.max(ahead, 0) * view.half[k] < radius * (1 + view.half[k] + Math.abs(view.middle[k]));
    });
  };

  // Draws one view without its mirrors into `picture`. `cut` is a plane in the eye's coordinates.
  // Only the part `shown` is needed.
  const drawOne = (view, set, picture, cut, shown = view) => {
    const { width, height, ahead, right, over } = view, pixels = width / (2 * view.half[0]);
    const turn = [right[0], over[0], -ahead[0], right[1], over[1], -ahead[1], right[2], over[2], -ahead[2]];
    const near = .05 * metre, far = 4 * site.radius + near + Math.hypot(...plus(view.at, site.centre, -1));
    const use = (program) => {
      gl.useProgram(program.made);
      gl.uniformMatrix3fv(program.at.turn, false, turn);
      gl.uniform3fv(program.at.eye, view.at);
      gl.uniform3f(program.at.lens, ...view.half, pixels);
      gl.uniform2fv(program.at.middle, view.middle);
      gl.uniform2f(program.at.size, width, height);
      gl.uniform1f(program.at.near, near);
      gl.uniform1f(program.at.far, far);
      gl.uniform4fv(program.at.cut, cut);
    };
    gl.viewport(0, 0, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, set.surface.frame);
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LESS);
    gl.depthMask(true);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferfv(gl.COLOR, 1, [1, 1, 1, 0]);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    const seen = chunks.filter((chunk) => isSeen(shown, chunk.centre, chunk.radius));
    const drawChunks = (program, some) => {
      use(program);
      bind(program, [['paints', paints]]);
      for (const chunk of some) {
        gl.uniform3fv(program.at.low, chunk.low);
        gl.uniform3fv(program.at.step, chunk.step);
        gl.bindVertexArray(chunk.array);
        gl.drawElements(gl.TRIANGLES, 3 * chunk.triangles, gl.UNSIGNED_SHORT, 0);
        facts.calls++;
        facts.triangles += chunk.triangles;
      }
    };
    drawChunks(opaque, seen.filter((chunk) => !chunk.isGlass));
    const panes = seen.filter((chunk) => chunk.isGlass);
    if (panes.length) {
      gl.drawBuffers([gl.NONE, gl.COLOR_ATTACHMENT1]);
      gl.enable(gl.BLEND);
      gl.blendFuncSeparate(gl.DST_COLOR, gl.ZERO, gl.ZERO, gl.ONE);
      gl.depthMask(false);
      drawChunks(glass, panes);
      gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1]);
    }
    gl.disable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, set.lights.frame);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE);
    use(lamp);
    bind(lamp, [['surfaces', set.surface.textures[0]]]);
    for (const [pixelsOfSplat, share] of [[1, 1], [COARSER, SHARE]]) {
      gl.uniform1f(lamp.at.share, share);
      drawRuns(lamp, choose(shown, pixels / pixelsOfSplat));
    }
    gl.disable(gl.BLEND);
    gl.bindFramebuffer(gl.FRAMEBUFFER, picture.frame);
    use(compose);
    bind(compose, [['surfaces', set.surface.textures[0]], ['colours', set.surface.textures[1]], ['lights', set.lights.textures[0]], ['errors', set.lights.textures[1]]]);
    gl.uniform3fv(compose.at.sky, site.sky.map((x) => x / light));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  };
  // Returns the view of a mirrored eye, and the plane behind which nothing is seen.
  const mirrored = (view, { normal, offset }) => {
    const height = dot(normal, view.at) - offset, side = Math.sign(height) || 1;
    const flip = (v) => plus(v, normal, -2 * dot(normal, v));
    const other = { ...view, at: plus(view.at, normal, -2 * height), ahead: flip(view.ahead), right: flip(view.right), over: flip(view.over) };
    const cut = [dot(other.right, normal), dot(other.over, normal), -dot(other.ahead, normal)].map((x) => x * side);
    return [other, [...cut, Math.abs(height) + 1e-3 * metre]];
  };
  const NOTHING_CUT = [0, 0, 0, -1];
  // Returns the part of a view around a sphere, as shares of its width and height.
  const around = (view, centre, radius) => {
    const to = plus(centre, view.at, -1), ahead = dot(to, view.ahead);
    return [view.right, view.over].map((axis, k) => {
      const off = dot(to, axis), distance = Math.hypot(off, ahead);
      if (distance <= radius) return [0, 1];
      return [-1, 1].map((way) => {
        const angle = Math.atan2(off, ahead) + way * Math.asin(radius / distance);
        if (Math.abs(angle) >= 1.5) return way < 0 ? 0 : 1;
        return Math.min(1, Math.max(0, .5 + .5 * (Math.tan(angle) - view.middle[k]) / view.half[k]));
      });
    });
  };
  // Draws a view into `picture`.
  const draw = (view, picture) => {
    const { width, height } = view, set = buffers(0, width, height);
    facts.triangles = 0;
    drawOne(view, set, picture, NOTHING_CUT);
    table.mirrors.forEach((mirror, number) => {
      if (!isSeen(view, mirror.centre, mirror.radius)) return;
      const ends = around(view, mirror.centre, mirror.radius);
      const [[x, endX], [y, endY]] = [[ends[0], width], [ends[1], height]].map(([[low, high], size]) => [Math.floor(low * size), Math.ceil(high * size)]);
      if (endX <= x || endY <= y) return;
      const back = buffers(1, width, height);
      if (!back.picture) back.picture = target(width, height, [gl.RGBA16F, gl.RGBA16F], false);
      const [other, cut] = mirrored(view, mirror);
      const part = {
        ...other,
        half: ends.map(([low, high], k) => (high - low) * view.half[k]),
        middle: ends.map(([low, high], k) => (low + high - 1) * view.half[k] + view.middle[k]),
      };
      gl.enable(gl.SCISSOR_TEST);
      gl.scissor(x, y, endX - x, endY - y);
      drawOne(other, back, back.picture, cut, part);
      gl.bindFramebuffer(gl.FRAMEBUFFER, picture.frame);
      gl.useProgram(reflect.made);
      bind(reflect, [['colours', set.surface.textures[1]], ['reflected', back.picture.textures[0]], ['errors', back.picture.textures[1]]]);
      gl.viewport(0, 0, width, height);
      gl.uniform1f(reflect.at.number, number + 2);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      gl.disable(gl.SCISSOR_TEST);
    });
  };
  return { pieces: table.pieces, arrive, draw, isReady: () => arrived === table.pieces.length };
};
