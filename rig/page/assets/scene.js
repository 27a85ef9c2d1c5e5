// Shows the recorded motion of the mechanism: a wire model, projected in parallel, turned by dragging.
Masseter.block('scene', (holder, data, clock) => {
  const { element } = Masseter;
  const canvas = element('canvas', { width: 1200, height: 560, role: 'img', 'aria-label': 'The mechanism: three slides, three legs, the platform and the jaw\u2019s points at the time of the cursor.' });
  const pen = canvas.getContext('2d');
  const keys = [['true', data.actual_name], ['estimated', 'estimated'], ['desired', 'desired'], ['jaw', 'incisal point and condyles']];
  holder.append(element('div', { class: 'scene' }, canvas, element('p', { class: 'keys' },
    ...keys.filter(([, name], at) => at !== 1 || name !== data.actual_name).map(([colour, name]) => element('span', { style: `--c:var(--${colour})` }, `${name} `)), 'Drag to turn.')));
  const ACTUAL = 1, DESIRED = 8, ESTIMATED = 15;
  let turn = -2.2, tilt = 0.35, drag = null;

  const colour = (name) => getComputedStyle(canvas).getPropertyValue(`--${name}`);
  const add = (a, b) => a.map((x, i) => x + b[i]);
  const scale = (a, s) => a.map((x) => x * s);
  const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

  // A point of the platform frame in the base frame, by the pose at `offset` of a frame of the animation.
  function placed(point, frame, offset) {
    const w = frame[offset + 3], v = frame.slice(offset + 4, offset + 7);
    const t = scale(cross(v, point), 2);
    return add(add(add(point, scale(t, w)), cross(v, t)), frame.slice(offset, offset + 3));
  }

  function frameAt(seconds) {
    let low = 0, high = data.frames.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (data.frames[middle][0] <= seconds) low = middle; else high = middle - 1;
    }
    return data.frames[low];
  }

  // The line of sight: turned about the vertical, then tilted.
  function project(p) {
    const x = p[0] * Math.cos(turn) - p[1] * Math.sin(turn);
    const y = p[0] * Math.sin(turn) + p[1] * Math.cos(turn);
    const up = (p[2] - 0.15) * Math.cos(tilt) + y * Math.sin(tilt);
    const size = canvas.height / 0.42;
    return [canvas.width / 2 + x * size, canvas.height / 2 - up * size];
  }

  function path(points, stroke, width, closed, dash) {
    pen.beginPath();
    points.map(project).forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    if (closed) pen.closePath();
    pen.strokeStyle = stroke;
    pen.lineWidth = width;
    pen.setLineDash(dash || []);
    pen.stroke();
  }

  function disc(point, fill, radius) {
    const [x, y] = project(point);
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    pen.fillStyle = fill;
    pen.fill();
  }

  function platform(frame, offset, stroke, width, dash) {
    path(data.corners.map((corner) => placed(corner, frame, offset)), stroke, width, true, dash);
  }

  function draw() {
    pen.clearRect(0, 0, canvas.width, canvas.height);
    if (!data.frames.length) return;
    const frame = frameAt(clock.cursor ?? data.frames[0][0]);
    const [still, leg, jaw] = ['muted', 'text', 'jaw'].map(colour);
    path(data.centres, still, 1, true);
    data.corners.forEach((corner, at) => {
      const [centre, along] = [data.centres[at], data.along[at]];
      path(data.slide_ends.map((end) => add(centre, scale(along, end))), still, 4);
      const top = placed(corner, frame, ACTUAL);
      const hinge = add(centre, scale(along, dot(add(top, scale(centre, -1)), along)));
      path([hinge, top], leg, 5);
      disc(hinge, leg, 5);
    });
    const points = data.jaw.map((point) => placed(point, frame, ACTUAL));
    path(points, jaw, 1, true);
    points.forEach((point) => disc(point, jaw, 4));
    platform(frame, DESIRED, colour('desired'), 2, [2, 6]);
    platform(frame, ACTUAL, colour('true'), 3);
    // Without truth the estimate is the actual pose.
    if (frame.length > ESTIMATED) platform(frame, ESTIMATED, colour('estimated'), 2, [8, 8]);
  }

  canvas.onpointerdown = (event) => {
    drag = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  };
  canvas.onpointermove = (event) => {
    if (!drag) return;
    turn += (event.clientX - drag[0]) * 0.01;
    tilt = Math.max(-1.5, Math.min(1.5, tilt + (event.clientY - drag[1]) * 0.01));
    drag = [event.clientX, event.clientY];
    draw();
  };
  canvas.onpointerup = () => { drag = null; };
  clock.on('cursor', draw);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
  draw();
  return {
    append(_, frames) {
      const last = data.frames.length ? data.frames[data.frames.length - 1][0] : -Infinity;
      data.frames.push(...frames.filter(([at]) => at > last));
      draw();
    },
  };
});
