// The page in a headset (WebXR): both eyes from the newest pose of the head, at the headset's rate.
//
// The headset's space is metres over the person's real floor. It stands on the scene's floor below
// the page's eye, and moves when the person walks with a stick or a trigger.
'use strict';
const startHeadset = ({ gl, eye, facts, axes: { up, north, east }, metre, dot, plus, walk, heightOf, drawPart, wear }) => {
const button = document.getElementById('b-headset'), note = document.getElementById('headset-note');
const SPEED = 1.4, RISE = .7; // Metres a second.
const STEP = Math.PI / 6; // A turn by the stick: steps make fewer people sick than a motion.
const DEAD = .2; // A stick at rest is not exactly at 0.
const SCALES = [1, .8, .65, .5]; // Of the sides of each eye's picture.
let session = null, layer = null, space = null, isOnFloor = true;
let origin = null, turn = 0; // Where the headset's space is 0 in the scene, and the heading of its -z.
let before = 0, isTurned = false, detail = 0;
const selecting = new Set();
const say = (sentence) => { note.textContent = sentence; note.hidden = !sentence; };

// ---- Where the person is ----
const vector = ({ x, y, z }) => [x, y, z];
const column = (matrix, at) => [matrix[at], matrix[at + 1], matrix[at + 2]];
// A direction of the headset's space in the scene.
const toScene = ([x, y, z]) => {
  const ahead = plus(plus([0, 0, 0], north, Math.cos(turn)), east, Math.sin(turn));
  const right = plus(plus([0, 0, 0], east, Math.cos(turn)), north, -Math.sin(turn));
  return plus(plus(plus([0, 0, 0], right, x), up, y), ahead, -z);
};
const place = (position) => plus(origin, toScene(vector(position)), metre);
// The heading of a pose in the headset's space; looking straight up or down, that of the forehead.
const heading = ({ matrix }) => {
  const [x, y, z] = column(matrix, 8), [fx, , fz] = column(matrix, 4);
  return Math.abs(y) < .99 ? Math.atan2(-x, z) : Math.atan2(fx * Math.sign(y), -fz * Math.sign(y));
};
// Puts the head where the page's eye is, and its heading along the eye's.
const enter = (head) => {
  turn = eye.turn - heading(head);
  const [x, y, z] = vector(head.position);
  const level = plus(eye.at, toScene([x, 0, z]), -metre);
  origin = isOnFloor ? plus(level, up, -heightOf() * metre) : plus(level, up, -y * metre);
};

// ---- Walking ----
// Left stick: walk where the head looks. Right stick: turn in steps, rise and sink. Trigger: walk
// where it points.
const move = (frame, head, seconds) => {
  let [ahead, right, rise, side] = [0, 0, 0, 0];
  let way = [0, 0, 0];
  const towards = (angle, share) => plus(way, toScene([Math.sin(angle), 0, -Math.cos(angle)]), share);
  for (const source of session.inputSources) {
    if (selecting.has(source)) {
      const ray = frame.getPose(source.targetRaySpace, space);
      if (ray) way = towards(heading(ray.transform), 1);
    }
    const stick = source.gamepad ? source.gamepad.axes : [];
    const [x, y] = (stick.length >= 4 ? [stick[2], stick[3]] : [stick[0] || 0, stick[1] || 0]).map((value) => (Math.abs(value) < DEAD ? 0 : value));
    if (source.handedness === 'right') [side, rise] = [side + x, rise - y];
    else [ahead, right] = [ahead - y, right + x];
  }
  if (ahead || right) {
    const facing = heading(head);
    way = towards(facing, ahead);
    way = towards(facing + Math.PI / 2, right);
  }
  const here = eye.at;
  const length = Math.hypot(...way), share = SPEED * seconds * metre / Math.max(1, length);
  if (length) walk(way.map((x) => x * share));
  if (rise) eye.at = plus(eye.at, up, rise * RISE * seconds * metre);
  origin = plus(origin, plus(eye.at, here, -1));
  const turns = Math.abs(side) > .6;
  if (turns && !isTurned) {
    turn += Math.sign(side) * STEP;
    origin = plus(eye.at, toScene(vector(head.position)), -metre);
  }
  isTurned = turns;
};

// ---- Frames ----
// A headset that gets too few frames gets smaller pictures. One that gets all of them gets larger
// ones again, and after each failure waits for twice as long before it tries.
let since = 0, count = 0, calm = 0, patience = 2;
const pace = (now) => {
  count++;
  if (now - since < 500) return;
  const late = (now - since) / count * (session.frameRate || 72) / 1000;
  if (since && late > 1.25 && detail < SCALES.length - 1) {
    detail++;
    [calm, patience] = [0, Math.min(64, patience * 2)];
  } else if (detail > 0 && ++calm > patience) [detail, calm] = [detail - 1, 0];
  [since, count] = [now, 0];
};
const draw = (now, frame) => {
  session.requestAnimationFrame(draw);
  const pose = frame.getViewerPose(space);
  if (!pose) return; // The headset does not know where it is.
  const start = performance.now(), head = pose.transform;
  if (!origin) enter(head);
  eye.at = place(head.position);
  move(frame, head, before ? Math.min(.1, (now - before) / 1000) : 0);
  before = now;
  pace(now);
  facts.calls = facts.vertices = 0;
  for (const view of pose.views) {
    if (view.requestViewportScale) view.requestViewportScale(SCALES[detail]);
    const part = layer.getViewport(view);
    if (!part || part.width < 1 || part.height < 1) continue;
    const p = view.projectionMatrix, { matrix, position } = view.transform;
    drawPart({
      at: place(position),
      right: toScene(column(matrix, 0)), over: toScene(column(matrix, 4)), ahead: toScene(column(matrix, 8).map((x) => -x)),
      half: [1 / p[0], 1 / p[5]], middle: [p[8] / p[0], p[9] / p[5]],
      width: part.width, height: part.height, isQuick: true,
    }, layer.framebuffer, [part.x, part.y, part.width, part.height]);
  }
  // The page goes on where the person stops.
  const ahead = toScene(column(head.matrix, 8).map((x) => -x));
  eye.turn = turn + heading(head);
  eye.tilt = Math.asin(Math.max(-1, Math.min(1, dot(ahead, up))));
  facts.frames++;
  facts.script = performance.now() - start;
  document.body.dataset.worn = facts.frames;
};

// ---- A session ----
const ended = () => {
  session = layer = space = origin = null;
  selecting.clear();
  button.setAttribute('aria-pressed', 'false');
  delete document.body.dataset.worn;
  wear(false);
};
const begin = async () => {
  say('');
  // Before anything else, while the browser still knows that a person asked.
  const begun = await navigator.xr.requestSession('immersive-vr', { optionalFeatures: ['local-floor'] });
  let isOver = false;
  begun.addEventListener('end', () => { isOver = true; ended(); });
  begun.addEventListener('selectstart', (event) => selecting.add(event.inputSource));
  begun.addEventListener('selectend', (event) => selecting.delete(event.inputSource));
  begun.addEventListener('inputsourceschange', (event) => event.removed.forEach((source) => selecting.delete(source)));
  try {
    await gl.makeXRCompatible();
    [space, isOnFloor] = await begun.requestReferenceSpace('local-floor').then((found) => [found, true], async () => [await begun.requestReferenceSpace('local'), false]);
    layer = new XRWebGLLayer(begun, gl, { antialias: false, alpha: false, depth: false, stencil: false });
    await begun.updateRenderState({ baseLayer: layer });
  } catch (error) {
    await begun.end().catch(() => {}); // It may have ended by itself.
    throw error;
  }
  if (isOver) return;
  session = begun;
  [origin, before, since, count, calm] = [null, 0, 0, 0, 0];
  button.setAttribute('aria-pressed', 'true');
  wear(true);
  session.requestAnimationFrame(draw);
};
button.onclick = () => {
  if (session) return session.end().catch(() => {}); // It may have ended by itself.
  button.disabled = true;
  return begin().catch((error) => say(`The headset cannot be used: ${error.message}`)).finally(() => { button.disabled = false; });
};
// Headsets come and go. Browsers have them on https and on this machine only.
const look = () => navigator.xr.isSessionSupported('immersive-vr').then((is) => { button.hidden = !is; }, () => {});
if (navigator.xr) {
  navigator.xr.addEventListener('devicechange', look);
  look();
}
};
