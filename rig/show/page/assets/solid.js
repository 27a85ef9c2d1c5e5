// Bodies in space on a canvas: faces, tubes, balls, lines and arrows in parallel projection, the farthest drawn first.
{
  const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
  const less = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const length = (a) => Math.hypot(...a);
  const unit = (a) => scaled(a, 1 / (length(a) || 1));
  const between = (a, b, share) => add(a, scaled(less(b, a), share));

  // Poses are x y z, w x y z.
  const turned = (pose, v) => {
    const w = pose[3], q = pose.slice(4, 7), t = scaled(cross(q, v), 2);
    return add(add(v, scaled(t, w)), cross(q, t));
  };
  const placed = (pose, point) => add(turned(pose, point), pose);
  const times = ([w, x, y, z], [a, b, c, d]) => [w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a];
  const inverse = ([w, x, y, z]) => [w, -x, -y, -z];
  // The rotation vector of a quaternion, rad.
  const turnOf = (q) => {
    const [w, ...v] = q[0] < 0 ? q.map((part) => -part) : q;
    const sine = length(v);
    return sine < 1e-12 ? scaled(v, 2) : scaled(v, 2 * Math.atan2(sine, w) / sine);
  };
  const quaternion = (turn) => {
    const angle = length(turn), half = angle < 1e-12 ? 0.5 : Math.sin(angle / 2) / angle;
    return [Math.cos(angle / 2), ...scaled(turn, half)];
  };
  // The pose `factor` times as far from one pose as another is.
  const beyond = (from, to, factor) => [...add(from, scaled(less(to, from), factor)),
    ...times(quaternion(scaled(turnOf(times(to.slice(3), inverse(from.slice(3)))), factor)), from.slice(3))];

  Masseter.space = { add, less, scaled, dot, cross, length, unit, between, turned, placed, times, inverse, turnOf, beyond };

  // Light comes from above the viewer's left shoulder: the share of it on a face of this normal.
  const LIGHT = unit([-0.35, 0.55, 0.75]);

  function mixed(colour, share, other) {
    return `color-mix(in srgb, ${colour} ${Math.round(share * 100)}%, ${other})`;
  }

  // What is drawn in a frame, seen by a camera: { turn, tilt, zoom (px per m), middle }.
  Masseter.solid = (pen, camera, [width, height]) => {
    const [ca, sa, ce, se] = [Math.cos(camera.turn), Math.sin(camera.turn), Math.cos(camera.tilt), Math.sin(camera.tilt)];
    const toViewer = [ce * ca, ce * sa, se], right = [-sa, ca, 0], up = cross(toViewer, right);
    const parts = [];
    const project = (point) => {
      const from = less(point, camera.middle);
      return [width / 2 + dot(from, right) * camera.zoom, height / 2 - dot(from, up) * camera.zoom];
    };
    const depth = (points) => points.reduce((sum, point) => sum + dot(point, toViewer), 0) / points.length;
    const later = (points, draw, lift = 0) => parts.push([depth(points) + lift, draw]);

    function outline(points, isClosed) {
      pen.beginPath();
      points.forEach((point, at) => { const [x, y] = project(point); if (at) pen.lineTo(x, y); else pen.moveTo(x, y); });
      if (isClosed) pen.closePath();
    }

    const solid = {
      project, right, up, toViewer,
      // A flat face; its brightness follows its direction.
      face(points, colour, { opacity = 1, rim = null, isSealed = false, lift = 0 } = {}) {
        const normal = unit(cross(less(points[1], points[0]), less(points[2], points[0])));
        const seen = [dot(normal, right), dot(normal, up), dot(normal, toViewer)];
        const light = Math.abs(dot(seen[2] < 0 ? scaled(seen, -1) : seen, LIGHT));
        later(points, () => {
          outline(points, true);
          pen.globalAlpha = opacity;
          pen.fillStyle = light > 0.6 ? mixed(colour, 1.45 - 0.75 * light, '#fff') : mixed(colour, 0.62 + 0.62 * light, '#000');
          pen.fill();
          pen.globalAlpha = 1;
          // Neighbours of one surface leave no seam.
          if (isSealed) { pen.strokeStyle = pen.fillStyle; pen.lineWidth = 0.8; pen.setLineDash([]); pen.stroke(); }
          if (rim) { pen.strokeStyle = rim; pen.lineWidth = 1; pen.setLineDash([]); pen.stroke(); }
        }, lift);
      },
      // A round bar of this radius, m.
      tube(from, to, radius, colour) {
        const PARTS = 5, wide = 2 * radius * camera.zoom;
        for (let part = 0; part < PARTS; part += 1) {
          const ends = [between(from, to, part / PARTS), between(from, to, (part + 1) / PARTS)];
          later(ends, () => {
            const [[x1, y1], [x2, y2]] = ends.map(project), along = Math.hypot(x2 - x1, y2 - y1) || 1;
            const side = [(y1 - y2) / along, (x2 - x1) / along];
            pen.setLineDash([]);
            pen.lineCap = 'butt';
            [[1, 0, mixed(colour, 0.55, '#000')], [0.78, -0.1, colour], [0.3, -0.22, mixed(colour, 0.5, '#fff')]].forEach(([share, shift, stroke]) => {
              const [dx, dy] = side.map((part) => part * shift * wide * Math.sign(side[0] || 1));
              pen.beginPath();
              pen.moveTo(x1 + dx, y1 + dy);
              pen.lineTo(x2 + dx, y2 + dy);
              pen.strokeStyle = stroke;
              pen.lineWidth = Math.max(0.8, wide * share);
              pen.stroke();
            });
          });
        }
      },
      ball(at, radius, colour, lift = 0) {
        later([at], () => {
          const [x, y] = project(at), size = Math.max(2, radius * camera.zoom);
          const shade = pen.createRadialGradient(x - size * 0.35, y - size * 0.4, size * 0.1, x, y, size);
          shade.addColorStop(0, mixed(colour, 0.35, '#fff'));
          shade.addColorStop(0.55, colour);
          shade.addColorStop(1, mixed(colour, 0.6, '#000'));
          pen.beginPath();
          pen.arc(x, y, size, 0, 7);
          pen.fillStyle = shade;
          pen.fill();
        }, lift);
      },
      // A line through points, in one piece.
      line(points, stroke, { width: wide = 1.5, dash = [], opacity = 1, isClosed = false, lift = 0 } = {}) {
        if (points.length < 2) return;
        later(points, () => {
          outline(points, isClosed);
          pen.globalAlpha = opacity;
          pen.strokeStyle = stroke;
          pen.lineWidth = wide;
          pen.lineJoin = 'round';
          pen.lineCap = dash.length ? 'butt' : 'round';
          pen.setLineDash(dash);
          pen.stroke();
          pen.globalAlpha = 1;
        }, lift);
      },
      // An arrow whose head is at `to`.
      arrow(from, to, colour, lift = 0.5) {
        later([from, to], () => {
          const [[x1, y1], [x2, y2]] = [from, to].map(project), long = Math.hypot(x2 - x1, y2 - y1);
          if (long < 2) return;
          const [ux, uy] = [(x2 - x1) / long, (y2 - y1) / long], head = Math.min(9, long * 0.6);
          pen.setLineDash([]);
          pen.strokeStyle = colour;
          pen.fillStyle = colour;
          pen.lineWidth = 2.2;
          pen.beginPath();
          pen.moveTo(x1, y1);
          pen.lineTo(x2 - ux * head, y2 - uy * head);
          pen.stroke();
          pen.beginPath();
          pen.moveTo(x2, y2);
          pen.lineTo(x2 - ux * head - uy * head * 0.45, y2 - uy * head + ux * head * 0.45);
          pen.lineTo(x2 - ux * head + uy * head * 0.45, y2 - uy * head - ux * head * 0.45);
          pen.fill();
        }, lift);
      },
      text(at, words, colour, [dx, dy] = [8, 4], halo = null) {
        later([at], () => {
          const [x, y] = project(at);
          pen.font = '12px system-ui, sans-serif';
          pen.setLineDash([]);
          if (halo) { pen.strokeStyle = halo; pen.lineWidth = 3; pen.strokeText(words, x + dx, y + dy); }
          pen.fillStyle = colour;
          pen.fillText(words, x + dx, y + dy);
        }, 1);
      },
      // Draws all of it.
      finish() { parts.sort((a, b) => a[0] - b[0]).forEach(([, draw]) => draw()); },
    };
    return solid;
  };
}
