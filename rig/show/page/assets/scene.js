// The mechanism and the jaw on it in space, at the time of the cursor: turned by dragging, with the views of dentistry.
Masseter.block('scene', (holder, data, clock) => {
  const { element, space } = Masseter;
  const { add, less, scaled, dot, unit, cross, placed, beyond } = space;
  const ACTUAL = 1, DESIRED = 8;
  const VIEWS = {
    space: ['in space', -0.95, 0.32], sagittal: ['sagittal', -Math.PI / 2, 0], frontal: ['frontal', 0, 0], horizontal: ['from above', Math.PI, Math.PI / 2],
  };
  const FACTORS = [1, 10, 100, 1000];
  // An arrow of this length, m, is a force of 100 N.
  const PER_100_N = 0.02;
  // The path that lies further back than this is pale, s.
  const RECENT_S = 1;
  // How long a force is shown after its time, s.
  const HELD_S = 0.03;
  const [incisal, left, right] = data.jaw;
  const closed = data.closed;
  // The views of the jaw draw the same poses.
  Masseter.scene = data;

  const canvas = element('canvas', { tabindex: 0, role: 'application', 'aria-roledescription': '3-D view', 'aria-label':
    'The mechanism and the jaw at the time of the cursor. Arrow keys turn the view, plus and minus zoom, 1 to 4 choose a view, 0 resets it.' });
  const pen = canvas.getContext('2d');
  let camera = null, drag = null, factor = 1, isOfJaw = true, view = 'space', isWaiting = false;

  const choice = (name, options, chosen, act) => element('span', { class: 'choice', role: 'group', 'aria-label': name }, ...options.map(([value, words]) =>
    element('button', { type: 'button', 'data-value': value, 'aria-pressed': String(value === chosen), onclick: (event) => {
      event.target.parentNode.querySelectorAll('button').forEach((button) => button.setAttribute('aria-pressed', String(button === event.target)));
      act(value);
    } }, words)));
  const views = choice('view', Object.entries(VIEWS).map(([name, [words]]) => [name, words]), view, (name) => look(name));
  const parts = choice('part', [['jaw', 'jaw'], ['whole', 'whole robot']], 'jaw', (part) => { isOfJaw = part === 'jaw'; look(view); });
  const errors = element('label', {}, 'error × ', element('select', { 'aria-label': 'exaggeration of the error', onchange: (event) => { factor = Number(event.target.value); redraw(); } },
    ...FACTORS.map((value) => element('option', { value }, String(value)))));
  const key = (colour, words, isDashed) => element('span', {}, element('i', { class: isDashed ? 'dashed' : '', style: `--c:var(--${colour})` }), words);
  const words = element('output', { class: 'state', 'aria-live': 'off' });
  holder.append(element('div', { class: 'scene' }, element('div', { class: 'tools' }, views, parts, errors), canvas, element('p', { class: 'keys' },
    key(data.actual_name === 'true' ? 'true' : 'estimated', `${data.actual_name} jaw and path`), key('desired', 'desired', true), key('jaw', 'condyles, Bonwill triangle'),
    data.teeth.length && data.forces.length ? key('limit', 'force on a tooth') : null, words)));

  const colour = (name) => getComputedStyle(canvas).getPropertyValue(`--${name}`).trim();
  const poseOf = (frame, offset) => frame.slice(offset, offset + 7);

  // The shape of half a mandible: upper and lower border from the chin to the condyle, from the incisal point, mm, for
  // condyles 80 mm behind, 33 mm above and 50 mm aside. Drawn after anatomy, not measured.
  const UPPER = [[-4, 0, -8], [-7, 9, -8], [-17, 17.5, -8], [-30, 24.5, -7], [-40, 29, -6], [-51, 35, 2], [-58, 41, 21], [-65, 44, 18], [-72, 47, 20], [-77, 49.5, 31], [-80, 50, 35]];
  const LOWER = [[-3, 0, -26], [-7, 11, -27], [-22, 21, -28], [-39, 30, -28], [-54, 36, -27], [-68, 40, -23], [-76, 42.5, -14], [-79, 44.5, -2], [-81, 46.5, 10], [-83, 49, 22], [-83, 50, 33]];
  // More points on a smooth curve through these (Catmull and Rom).
  function rounded(points) {
    const MORE = 4, at = (place) => points[Math.max(0, Math.min(points.length - 1, place))];
    const between = (place, share) => [0, 1, 2].map((axis) => {
      const [a, b, c, d] = [-1, 0, 1, 2].map((step) => at(place + step)[axis]);
      return b + share / 2 * (c - a + share * (2 * a - 5 * b + 4 * c - d + share * (3 * (b - c) + d - a)));
    });
    return [...points.slice(0, -1).flatMap((_, place) => Array.from({ length: MORE }, (_, step) => between(place, step / MORE))), at(points.length - 1)];
  }
  function half(condyle) {
    const from = less(condyle, incisal), size = [from[0] / -80, from[1] / 50, from[2] / 33];
    const point = (p) => add(incisal, p.map((mm, axis) => mm * size[axis]));
    return [UPPER.map(point), LOWER.map(point)];
  }
  const halves = [left, right].map(half).map((borders) => borders.map(rounded));

  function frameAt(seconds) {
    let low = 0, high = data.frames.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (data.frames[middle][0] <= seconds) low = middle; else high = middle - 1;
    }
    return low;
  }

  // Without a cursor: the newest pose of a run that goes on, the first fault of one that stopped, or else the jaw at its widest.
  let widest = null;
  function firstLook() {
    if (Masseter.page.life === 'live') return Infinity;
    if (Masseter.moments.length && clock.moment) return Masseter.moments[0].at_s;
    const opening = (frame) => space.length(less(placed(poseOf(frame, ACTUAL), incisal), placed(closed, incisal)));
    const motion = data.frames.filter(([at]) => at >= (Masseter.page.time.motion_s ?? 0));
    widest ??= motion.reduce((most, frame) => (opening(frame) > most[0] ? [opening(frame), frame[0]] : most), [-1, 0])[1];
    return widest;
  }

  function forcesAt(seconds) {
    const at = data.forces.findLast?.(([time]) => time <= seconds + HELD_S);
    return at && seconds - at[0] <= HELD_S ? at : null;
  }

  function look(name) {
    view = name;
    views.querySelectorAll('button').forEach((button) => button.setAttribute('aria-pressed', String(button.dataset.value === name)));
    const [, turn, tilt] = VIEWS[name];
    const size = [canvas.clientWidth || 800, canvas.clientHeight || 460];
    const middle = isOfJaw ? add(placed(closed, scaled(add(incisal, scaled(add(left, right), 0.5)), 0.5)), [0, 0, -0.012]) : [0, 0, (closed[2] + 0.03) / 2];
    const span = isOfJaw ? [0.15, 0.116] : [0.24, closed[2] + 0.09];
    camera = { turn, tilt, middle, zoom: Math.min(size[0] / span[0], size[1] / span[1]) };
    redraw();
  }

  function base(solid, still, pose) {
    const edge = colour('line'), metal = colour('metal');
    solid.face(data.centres, colour('mesh'), { opacity: 0.8, rim: edge, lift: -1 });
    data.corners.forEach((corner, leg) => {
      const [centre, along] = [data.centres[leg], unit(data.along[leg])];
      const rail = data.slide_ends.map((end) => add(centre, scaled(along, end)));
      solid.tube(...rail, 0.0035, still);
      rail.forEach((end) => solid.ball(end, 0.005, still));
      const top = placed(pose, corner);
      const hinge = add(centre, scaled(along, dot(less(top, centre), along)));
      carriage(solid, hinge, along);
      const inner = add(hinge, scaled(unit(less(top, hinge)), 0.165));
      solid.tube(hinge, inner, 0.0065, metal);
      solid.tube(inner, top, 0.0026, still);
      solid.ball(inner, 0.0068, metal);
      solid.ball(top, 0.0034, metal);
    });
  }

  function carriage(solid, hinge, along) {
    const [long, wide, high] = [along, unit(cross([0, 0, 1], along)), [0, 0, 1]].map((axis, at) => scaled(axis, [0.012, 0.009, 0.007][at]));
    const corner = (a, b, c) => add(add(add(hinge, scaled(long, a)), scaled(wide, b)), scaled(high, c));
    const square = (f) => [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => f(a, b));
    for (const side of [-1, 1]) {
      [(a, b) => corner(side, a, b), (a, b) => corner(a, side, b), (a, b) => corner(a, b, side)].forEach((f) => solid.face(square(f), colour('metal'), { rim: colour('muted') }));
    }
  }

  // Half the widths of teeth from the middle on, by the last digit of their numbers, mm, as they fit the arch of the robot.
  const HALF_WIDTHS = [1.9, 2.0, 2.4, 2.6, 2.8, 3.7, 3.7, 3.4];
  function tooth(solid, pose, [number, at], up, fill) {
    const size = HALF_WIDTHS[(number - 1) % 10] / 1000;
    const ring = (height, share) => [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => placed(pose, add(at, [a * size * share, b * size * share, up * height])));
    const [crown, neck] = [ring(-0.0008, 0.75), ring(-0.0068, 1)];
    for (let side = 0; side < 4; side += 1) solid.face([crown[side], crown[(side + 1) % 4], neck[(side + 1) % 4], neck[side]], fill, { rim: colour('muted') });
    [crown, neck].forEach((end) => solid.face(end, fill, { rim: colour('muted') }));
  }

  function mandible(solid, pose, fill) {
    for (const [upper, lower] of halves) {
      for (let at = 0; at + 1 < upper.length; at += 1) {
        solid.face([upper[at], upper[at + 1], lower[at + 1], lower[at]].map((point) => placed(pose, point)), fill, { isSealed: true });
      }
    }
    data.teeth.forEach((one) => tooth(solid, pose, one, 1, colour('tooth')));
  }

  function outlineOf(solid, pose, stroke) {
    const style = { width: 2, dash: [6, 4], lift: 0.4 };
    for (const [upper, lower] of halves) solid.line([...upper, ...lower.toReversed()].map((point) => placed(pose, point)), stroke, style);
  }

  // The path of a point until now: pale, and dark where it is recent.
  function trace(solid, point, at, offset, stroke, style) {
    const step = Math.max(1, Math.ceil(data.frames.length / 1500));
    const [from, to] = clock.window.map(frameAt), points = [], recent = [];
    for (let frame = from; frame <= to; frame += step) {
      const place = placed(poseOf(data.frames[frame], offset), point);
      points.push(place);
      if (data.frames[frame][0] <= data.frames[at][0] && data.frames[frame][0] > data.frames[at][0] - RECENT_S) recent.push(place);
    }
    solid.line(points, stroke, { opacity: 0.45, width: 1.3, lift: 0.45, ...style });
    if (!style) solid.line(recent, stroke, { width: 3, lift: 0.46 });
  }

  function triad(solid, [, height]) {
    const origin = [78, height - 44], LONG = 30;
    [['x forward', [1, 0, 0]], ['y left', [0, 1, 0]], ['z up', [0, 0, 1]]].forEach(([name, axis], at) => {
      const [dx, dy] = [dot(axis, solid.right) * LONG, -dot(axis, solid.up) * LONG];
      pen.setLineDash([]);
      pen.strokeStyle = colour(['c1', 'c2', 'c0'][at]);
      pen.lineWidth = 2;
      pen.beginPath();
      pen.moveTo(...origin);
      pen.lineTo(origin[0] + dx, origin[1] + dy);
      pen.stroke();
      if (Math.hypot(dx, dy) < 8) return;
      pen.fillStyle = colour('text');
      pen.font = '11.5px system-ui, sans-serif';
      pen.textAlign = dx < -4 ? 'right' : 'left';
      pen.fillText(name, origin[0] + dx + Math.sign(dx || 1) * 4, origin[1] + dy + (dy < -4 ? -3 : 10));
      pen.textAlign = 'left';
    });
  }

  function scaleBar([width, height]) {
    const lengths = [1, 2, 5, 10, 20, 50, 100, 200], mm = lengths.findLast((one) => one * camera.zoom / 1000 < 130) || 1;
    const long = mm * camera.zoom / 1000, [x, y] = [width - 20 - long, height - 22];
    pen.setLineDash([]);
    pen.strokeStyle = colour('text');
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(x, y - 5);
    pen.lineTo(x, y);
    pen.lineTo(x + long, y);
    pen.lineTo(x + long, y - 5);
    pen.stroke();
    pen.fillStyle = colour('text');
    pen.font = '12px system-ui, sans-serif';
    pen.textAlign = 'center';
    pen.fillText(`${mm} mm`, x + long / 2, y - 6);
    pen.textAlign = 'left';
  }

  function draw() {
    isWaiting = false;
    const ratio = devicePixelRatio || 1, size = [canvas.clientWidth, canvas.clientHeight];
    if (!size[0] || !camera) return;
    [canvas.width, canvas.height] = size.map((pixels) => Math.round(pixels * ratio));
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, ...size);
    const solid = Masseter.solid(pen, camera, size);
    if (!data.frames.length) return;
    const at = frameAt(clock.cursor ?? firstLook()), frame = data.frames[at];
    const [actual, desired] = [poseOf(frame, ACTUAL), poseOf(frame, DESIRED)];
    const shown = factor === 1 ? actual : beyond(desired, actual, factor);
    const own = colour(data.actual_name === 'true' ? 'true' : 'estimated');
    base(solid, colour('muted'), actual);
    mandible(solid, shown, colour('bone'));
    data.teeth.forEach((one) => tooth(solid, closed, one, -1, colour('mesh')));
    if (factor > 1) outlineOf(solid, desired, colour('desired'));
    const points = data.jaw.map((point) => placed(shown, point));
    solid.line(points, colour('jaw'), { isClosed: true, width: 1.4, dash: [5, 3], lift: 0.3 });
    points.forEach((point, place) => solid.ball(point, 0.0024, place ? colour('jaw') : own, 0.5));
    trace(solid, incisal, at, DESIRED, colour('desired'), { width: 5, opacity: 0.3, lift: 0.44 });
    trace(solid, incisal, at, ACTUAL, own);
    [left, right].forEach((point) => trace(solid, point, at, ACTUAL, colour('jaw')));
    const load = forces(solid, shown, frame[0]);
    solid.finish();
    triad(solid, size);
    scaleBar(size);
    const error = space.length(less(placed(actual, incisal), placed(desired, incisal))) * 1000;
    const away = scaled(less(placed(actual, incisal), placed(closed, incisal)), 1000);
    words.textContent = `${clock.text(frame[0])}: incisal point ${['forward', 'left', 'up'].map((name, axis) => `${name} ${Masseter.fixed(away[axis], 1)}`).join(', ')} mm, ${Masseter.fixed(error, 3)} mm from desired${load ? `; teeth ${Masseter.fixed(load, 0)} N` : ''}`;
  }

  // Arrows that end at the teeth; returns the sum of the forces, N.
  function forces(solid, pose, seconds) {
    const now = forcesAt(seconds);
    let sum = 0;
    for (let at = 1; now && at < now.length; at += 4) {
      const head = placed(pose, data.teeth[now[at]][1]), force = now.slice(at + 1, at + 4);
      sum += space.length(force);
      solid.arrow(less(head, scaled(force, PER_100_N / 100)), head, colour('limit'), 0.6);
    }
    return sum;
  }

  function redraw() {
    if (isWaiting) return;
    isWaiting = true;
    requestAnimationFrame(draw);
  }

  function turn(dx, dy) {
    camera.turn -= dx;
    camera.tilt = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, camera.tilt + dy));
    views.querySelectorAll('button').forEach((button) => button.setAttribute('aria-pressed', 'false'));
    redraw();
  }

  function zoom(by) {
    camera.zoom = Math.max(400, Math.min(40000, camera.zoom * by));
    redraw();
  }

  canvas.onpointerdown = (event) => { drag = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); };
  canvas.onpointermove = (event) => {
    if (!drag) return;
    turn((event.clientX - drag[0]) * 0.01, (event.clientY - drag[1]) * 0.01);
    drag = [event.clientX, event.clientY];
  };
  canvas.onpointerup = canvas.onpointercancel = () => { drag = null; };
  canvas.ondblclick = () => look(view);
  canvas.addEventListener('wheel', (event) => {
    if (!event.ctrlKey && document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(Math.exp(-Math.max(-100, Math.min(100, event.deltaY)) / 400));
  }, { passive: false });
  canvas.onkeydown = (event) => {
    const STEP = 0.08, names = Object.keys(VIEWS);
    const acts = { ArrowLeft: () => turn(-STEP, 0), ArrowRight: () => turn(STEP, 0), ArrowUp: () => turn(0, -STEP), ArrowDown: () => turn(0, STEP),
      '+': () => zoom(1.2), '=': () => zoom(1.2), '-': () => zoom(1 / 1.2), 0: () => look(view) };
    names.forEach((name, at) => { acts[at + 1] = () => look(name); });
    if (!acts[event.key] || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    acts[event.key]();
  };
  ['cursor', 'window', 'mode'].forEach((what) => clock.on(what, redraw));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
  let wasWide = 0;
  new ResizeObserver(() => {
    if (canvas.clientWidth === wasWide) return;
    wasWide = canvas.clientWidth;
    look(view);
  }).observe(canvas);
  look(view);
  return {
    // More of the `frames`, or of the `forces`.
    append(what, moments) {
      const known = data[what], last = known.length ? known[known.length - 1][0] : -Infinity;
      known.push(...moments.filter(([at]) => at > last));
      redraw();
    },
  };
});
