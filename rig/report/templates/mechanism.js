// Plays the recorded motion of the mechanism: a wire model, projected in parallel, turned by dragging.
'use strict';
{
  const animation = JSON.parse(document.getElementById('animation').textContent);
  const canvas = document.getElementById('mechanism');
  const pen = canvas.getContext('2d');
  const play = document.getElementById('play');
  const time = document.getElementById('time');
  const clock = document.getElementById('clock');
  const COLOURS = { still: '#888', leg: '#444', actual: '#0072b2', estimated: '#d55e00', desired: '#009e73', jaw: '#b00020' };
  const ACTUAL = 1, DESIRED = 8, ESTIMATED = 15;
  const end = animation.frames[animation.frames.length - 1][0];
  let turn = -2.2, tilt = 0.35, at = 0, playing = true, before = null, drag = null;

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
    let low = 0, high = animation.frames.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (animation.frames[middle][0] <= seconds) low = middle; else high = middle - 1;
    }
    return animation.frames[low];
  }

  // The line of sight: turned about the vertical, then tilted.
  function project(p) {
    const x = p[0] * Math.cos(turn) - p[1] * Math.sin(turn);
    const y = p[0] * Math.sin(turn) + p[1] * Math.cos(turn);
    const up = (p[2] - 0.15) * Math.cos(tilt) + y * Math.sin(tilt);
    const size = canvas.height / 0.42;
    return [canvas.width / 2 + x * size, canvas.height / 2 - up * size];
  }

  function path(points, colour, width, closed, dash) {
    pen.beginPath();
    points.map(project).forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    if (closed) pen.closePath();
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.setLineDash(dash || []);
    pen.stroke();
  }

  function dot2d(point, colour, radius) {
    const [x, y] = project(point);
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    pen.fillStyle = colour;
    pen.fill();
  }

  function platform(frame, offset, colour, width, dash) {
    path(animation.corners.map((corner) => placed(corner, frame, offset)), colour, width, true, dash);
  }

  function draw() {
    const frame = frameAt(at);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    path(animation.centres, COLOURS.still, 1, true);
    animation.corners.forEach((corner, leg) => {
      const [centre, along] = [animation.centres[leg], animation.along[leg]];
      path(animation.slide_ends.map((end) => add(centre, scale(along, end))), COLOURS.still, 4);
      const top = placed(corner, frame, ACTUAL);
      const hinge = add(centre, scale(along, dot(add(top, scale(centre, -1)), along)));
      path([hinge, top], COLOURS.leg, 5);
      dot2d(hinge, COLOURS.leg, 5);
    });
    const jaw = animation.jaw.map((point) => placed(point, frame, ACTUAL));
    path(jaw, COLOURS.jaw, 1, true);
    jaw.forEach((point) => dot2d(point, COLOURS.jaw, 4));
    platform(frame, DESIRED, COLOURS.desired, 2, [2, 6]);
    platform(frame, ACTUAL, COLOURS.actual, 3);
    // Without truth the estimate is the actual pose.
    if (frame.length > ESTIMATED) platform(frame, ESTIMATED, COLOURS.estimated, 2, [8, 8]);
    clock.textContent = (animation.began_s + at).toFixed(2) + ' s';
    time.value = end > 0 ? at / end : 0;
  }

  function step(now) {
    if (playing && before !== null) at = (at + (now - before) / 1000) % (end || 1);
    before = now;
    draw();
    requestAnimationFrame(step);
  }

  play.onclick = () => {
    playing = !playing;
    play.textContent = playing ? 'pause' : 'play';
  };
  time.oninput = () => {
    at = time.value * end;
    playing = false;
    play.textContent = 'play';
  };
  canvas.onpointerdown = (event) => {
    drag = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  };
  canvas.onpointermove = (event) => {
    if (!drag) return;
    turn += (event.clientX - drag[0]) * 0.01;
    tilt = Math.max(-1.5, Math.min(1.5, tilt + (event.clientY - drag[1]) * 0.01));
    drag = [event.clientX, event.clientY];
  };
  canvas.onpointerup = () => { drag = null; };
  requestAnimationFrame(step);
}
