// The jaw for researchers: paths of its points in the planes of dentistry, hinge axis, course, velocities, and cycles. Poses
// come from the data of the 3-D view, cycles from the block's own.
{
  const { element, svg, space } = Masseter;
  const { add, less, scaled, dot, cross, placed, times, inverse, turnOf } = space;
  const ACTUAL = 1, DESIRED = 8;
  const ROOM = { left: 44, right: 12, top: 8, below: 36 };
  // Width in which planes are drawn, px; they scale with the page.
  const WIDTH = 340;
  // A turn below which a hinge axis is noise, degrees.
  const LEAST_TURN = 2;
  // Frames on either side over which a velocity is taken.
  const AROUND = 1;

  // What follows the cursor until the next redraw.
  let followers = [];

  // Position and turn of the jaw in each frame, in mm and degrees from the closed jaw, in the axes forward, left and up.
  function pathOf(scene, offset) {
    const { closed, jaw, frames } = scene, home = jaw.map((point) => placed(closed, point));
    return frames.map((frame) => {
      const pose = frame.slice(offset, offset + 7), turn = turnOf(times(pose.slice(3), inverse(closed.slice(3))));
      const [incisal, left, right] = jaw.map((point, at) => scaled(less(placed(pose, point), home[at]), 1000));
      return { at: frame[0], incisal, left, right, turn: scaled(turn, 180 / Math.PI) };
    });
  }

  // The finite helical axis of a frame from the closed jaw, from the closed incisal point, mm: where the axis meets the
  // midsagittal plane, and its direction. None for a small turn, or an axis along the plane.
  function hinge({ incisal, turn }) {
    const degrees = space.length(turn), angle = degrees * Math.PI / 180, axis = scaled(turn, 1 / degrees);
    if (!(degrees > LEAST_TURN) || Math.abs(axis[1]) < 0.2) return null;
    const across = less(incisal, scaled(axis, dot(incisal, axis)));
    const point = scaled(add(across, scaled(cross(axis, across), 1 / Math.tan(angle / 2))), 0.5);
    const at = less(point, scaled(axis, point[1] / axis[1]));
    return { at, tilt: Math.acos(Math.min(1, Math.abs(axis[1]))) * 180 / Math.PI };
  }

  const span = (values) => values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
  const fileName = (text) => text.toLowerCase().replace(/[^a-z0-9]+/g, '-').replace(/^-|-$/g, '');

  // A drawing as PNG: one in mm with 300 dots per inch, one in px twice as large.
  function savePng(name, text, [width, height]) {
    const times = text.includes('mm" height') ? 300 / 25.4 : 2;
    const image = new Image(), address = URL.createObjectURL(new Blob([text], { type: 'image/svg+xml' }));
    image.onload = () => {
      const canvas = element('canvas', { width: Math.round(times * width), height: Math.round(times * height) });
      canvas.getContext('2d').drawImage(image, 0, 0, canvas.width, canvas.height);
      URL.revokeObjectURL(address);
      canvas.toBlob((blob) => Masseter.save(name, 'image/png', blob));
    };
    image.src = address;
  }

  function menu(title, svgText, csvText) {
    const name = fileName(title), size = (text) => ['width', 'height'].map((side) => Number(new RegExp(`${side}="([\\d.]+)`).exec(text)[1]));
    const entry = (words, act) => element('button', { type: 'button', onclick: () => { details.open = false; act(); } }, words);
    const details = element('details', { class: 'menu' }, element('summary', { 'aria-label': `Save ${title}`, title: 'Save this view' }, '⋯'), element('div', {},
      svgText && entry('Save as SVG', () => Masseter.save(`${name}.svg`, 'image/svg+xml', svgText())),
      svgText && entry('Save as PNG', () => { const text = svgText(); savePng(`${name}.png`, text, size(text)); }),
      csvText && entry('Save as CSV', () => Masseter.save(`${name}.csv`, 'text/csv', csvText()))));
    details.addEventListener('focusout', (event) => { if (!details.contains(event.relatedTarget)) details.open = false; });
    return details;
  }

  // A drawing of curves over any two quantities: { title, across, up, isEqual, height, curves, band }. A curve is { name, xs,
  // ys, at (times, for the cursor), style, stroke }. `band` is { xs, low, high, stroke }.
  function plane(clock, { title, across, up, isEqual, height = 240, curves, band = null, isPlaced = false, note = '', csv: ownCsv = null }) {
    const drawing = svg('svg', { role: 'img', 'aria-label': `${title}: ${curves.map(({ name }) => name).filter(Boolean).join(', ')}. ${across} to the right, ${up} upwards.` });
    const named = curves.filter(({ name }) => name);
    const key = ({ name, style, stroke }) => element('span', {}, svg('svg', { width: 24, height: 10, 'aria-hidden': 'true', style: 'width:24px' },
      style === 'dots' ? svg('circle', { cx: 12, cy: 5, r: 3, style: `fill:${stroke}` }) : svg('path', { d: 'M1 5h22', class: `curve ${style}`, style: `--c:${stroke}` })), name);
    const zero = clock.time.motion_s || 0;
    const csv = ownCsv || (() => [['curve', 'time since the motion began, s', across, up].map((text) => `"${text}"`).join(','), ...curves.flatMap((curve) =>
      curve.xs.map((x, at) => [`"${curve.name || title}"`, curve.at ? (curve.at[at] - zero).toFixed(4) : '', x.toFixed(4), curve.ys[at].toFixed(4)].join(',')))].join('\n') + '\n');
    const figure = element('figure', { class: 'plane' }, element('figcaption', {}, element('h3', {}, title),
      menu(title, () => Masseter.svgText({ drawing, label: title, series: named.map((curve) => ({ ...curve, isShown: true })) }), csv)),
      element('p', { class: 'keys' }, ...named.map(key)), drawing, note ? element('p', { class: 'beyond' }, note) : null);
    const xs = span([...curves.flatMap((curve) => curve.xs), ...(band ? band.xs : [])]);
    const ys = span([...curves.flatMap((curve) => curve.ys), ...(band ? [...band.low, ...band.high] : [])]);
    if (!(xs[0] <= xs[1])) {
      drawing.setAttribute('viewBox', `0 0 ${WIDTH} 40`);
      drawing.append(svg('text', { x: 4, y: 24, class: 'empty' }, 'Nothing to be shown.'));
      return figure;
    }
    const box = [ROOM.left, WIDTH - ROOM.right, ROOM.top + height, ROOM.top];
    const widened = ([low, high], share) => { const more = Math.max(0.5 * share, share * (high - low)); return [low - more, high + more]; };
    let [wide, high] = [isEqual ? widened(xs, 0.08) : xs, widened(ys, 0.08)];
    if (isEqual) {
      const perMm = Math.max((wide[1] - wide[0]) / (box[1] - box[0]), (high[1] - high[0]) / height, 0.004);
      const about = ([low, top], pixels) => [(low + top - perMm * pixels) / 2, (low + top + perMm * pixels) / 2];
      [wide, high] = [about(wide, box[1] - box[0]), about(high, height)];
    }
    const x = Masseter.axis(false, wide, [box[0], box[1]]), y = Masseter.axis(false, high, [box[2], box[3]]);
    const d = (points) => points.map(([px, py], at) => `${at ? 'L' : 'M'}${px.toFixed(1)} ${py.toFixed(1)}`).join('');
    const ticks = [Masseter.linearTicks(wide, 6), Masseter.linearTicks(high, 6)];
    const clip = `plane-${plane.count = (plane.count || 0) + 1}`;
    drawing.setAttribute('viewBox', `0 0 ${WIDTH} ${height + ROOM.top + ROOM.below}`);
    drawing.append(svg('clipPath', { id: clip }, svg('rect', { x: box[0], y: box[3], width: box[1] - box[0], height })),
      ...ticks[0].map(({ value, text }) => svg('g', {}, svg('line', { class: 'mesh', x1: x.position(value), x2: x.position(value), y1: box[3], y2: box[2] }),
        svg('text', { class: 'tick', x: x.position(value), y: box[2] + 14, 'text-anchor': 'middle' }, text))),
      ...ticks[1].map(({ value, text }) => svg('g', {}, svg('line', { class: 'mesh', x1: box[0], x2: box[1], y1: y.position(value), y2: y.position(value) }),
        svg('text', { class: 'tick', x: box[0] - 5, y: y.position(value) + 4, 'text-anchor': 'end' }, text))),
      svg('rect', { class: 'frame', x: box[0], y: box[3], width: box[1] - box[0], height }),
      svg('text', { class: 'tick', x: box[1], y: box[2] + 30, 'text-anchor': 'end' }, across),
      svg('text', { class: 'tick', x: 11, y: box[3], 'text-anchor': 'end', transform: `rotate(-90 11 ${box[3]})` }, up));
    const inside = svg('g', { 'clip-path': `url(#${clip})` });
    if (band) {
      const edge = (values) => values.map((value, at) => [x.position(band.xs[at]), y.position(value)]);
      inside.append(svg('path', { class: 'band', style: `fill:${band.stroke}`, d: `${d([...edge(band.high), ...edge(band.low).toReversed()])}Z` }));
    }
    for (const curve of curves) {
      const { xs: along, ys: above, style, stroke } = curve, points = along.map((value, at) => [x.position(value), y.position(above[at])]);
      const drawn = style === 'dots' ? points.map(([cx, cy]) => svg('circle', { class: 'dot', cx: cx.toFixed(1), cy: cy.toFixed(1), r: points.length > 1 ? 1.9 : 4, style: `fill:${stroke};stroke:${stroke}` }))
        : [svg('path', { class: `curve ${style}`, style: `--c:${stroke}`, d: d(points) })];
      [curve.drawn] = drawn;
      inside.append(...drawn);
    }
    drawing.append(inside);
    if (isPlaced) cursors(clock, drawing, curves.filter(({ at }) => at), x, y);
    return figure;
  }

  // A dot on each curve at the time of the cursor; a click moves the cursor to the nearest point.
  function cursors(clock, drawing, curves, x, y) {
    const dots = curves.filter(({ style }) => style !== 'desired').map((curve) => {
      const dot = svg('circle', { class: 'place cursor', r: 4.5, style: `fill:${curve.stroke}` });
      drawing.append(dot);
      return [curve, dot];
    });
    const show = () => dots.forEach(([{ xs, ys, at }, dot]) => {
      const place = clock.cursor === null ? -1 : Math.min(at.length - 1, Masseter.placeOf(at, clock.cursor));
      const isIn = place >= 0 && Math.abs(at[place] - clock.cursor) < 0.1;
      dot.style.display = isIn ? '' : 'none';
      if (isIn) { dot.setAttribute('cx', x.position(xs[place])); dot.setAttribute('cy', y.position(ys[place])); }
    });
    followers.push(show);
    show();
    drawing.addEventListener('click', (event) => {
      const frame = drawing.getBoundingClientRect(), ratio = drawing.viewBox.baseVal.width / frame.width;
      const [px, py] = [(event.clientX - frame.left) * ratio, (event.clientY - frame.top) * ratio];
      let nearest = Infinity, time = null;
      for (const { xs, ys, at } of curves) {
        xs.forEach((value, place) => {
          const distance = Math.hypot(x.position(value) - px, y.position(ys[place]) - py);
          if (distance < nearest) { nearest = distance; time = at[place]; }
        });
      }
      if (nearest < 30) { clock.play(false); clock.seek(time); }
    });
  }

  // Curves of a point in a plane, desired below true. The right side is at the right of what is seen from above.
  const PLANES = {
    sagittal: ['Sagittal', 'forward, mm', 'up, mm', 0, 2], frontal: ['Frontal', 'to the left, mm', 'up, mm', 1, 2],
    horizontal: ['Horizontal', 'to the right, mm', 'forward, mm', 1, 0, -1],
  };
  const curve = (path, point, [, , , a, b, sign = 1], name, style, stroke) => ({ name, style, stroke, xs: path.map((frame) => sign * frame[point][a]), ys: path.map((frame) => frame[point][b]), at: path.map(({ at }) => at) });

  const chartData = (title, unit, series) => ({ title, unit, across: 'time', scale: 'linear', height: 130, otherwise: 'Nothing moved.',
    series: series.map(([name, style, points]) => ({ name, style, points: points.flat() })) });

  // The velocity of a component in mm/s or degrees a second.
  function rates(path, of) {
    return path.slice(AROUND, -AROUND).map((frame, at) => {
      const [before, after] = [path[at], path[at + 2 * AROUND]];
      return [frame.at, (of(after) - of(before)) / (after.at - before.at)];
    });
  }

  function tableOf(label, head, rows, csvName) {
    const cell = (text, at) => element(at ? 'td' : 'th', { class: at ? 'number' : '', scope: at ? null : 'row' }, text);
    const csv = () => [head, ...rows].map((row) => row.map((text) => `"${String(text).replace(/"/g, '""').replace(/[\u202f]/g, '').replace(/\u2212/g, '-')}"`).join(',')).join('\n') + '\n';
    return element('div', {}, element('div', { class: 'chart' }, element('figcaption', { style: 'display:flex;justify-content:space-between' }, element('h3', {}, label), menu(csvName, null, csv))),
      element('div', { class: 'table', tabindex: 0, role: 'region', 'aria-label': label }, element('table', {},
        element('thead', {}, element('tr', {}, ...head.map((text, at) => element('th', { class: at ? 'number' : '', scope: 'col' }, text)))),
        element('tbody', {}, ...rows.map((row) => element('tr', {}, ...row.map(cell)))))));
  }

  const DECIMALS = { s: 3, mm: 2, 'mm/s': 1, N: 1 };
  const counted = (count, noun) => `${count} ${noun}${count === 1 ? '' : 's'}`;
  const number = (value, decimals) => (value === null || value === undefined ? '–' : Masseter.fixed(value, decimals));

  function cycles(holder, data, clock) {
    holder.append(element('h3', { class: 'part' }, 'Cycles'));
    if (!data.count) {
      holder.append(element('p', {}, 'No cycle was found: the incisal point never went 3 mm away from the closed jaw and came back.'));
      return;
    }
    const hasOcclusion = data.groups.some(({ quantities }) => quantities.some(({ name }) => name === 'occlusal_s'));
    holder.append(element('p', {}, `${counted(data.count, 'cycle')} found; ${data.left_out} left out, ${data.unclear} of unclear kind. Only cycles of one kind and side are pooled. `
      + (hasOcclusion || data.most_closed_mm <= 1 ? '' : `No occlusal phase: the jaw stays at least ${number(data.most_closed_mm, 1)} mm open. `) + 'masseter report RUN --set study.leave_out=[2] or --set study.window_s=[1,5] chooses cycles.'));
    data.groups.forEach((group, at) => groupOf(holder, { ...group, ...data.drawn[at] }, data.has_force, clock));
    const { motion_s: zero } = clock.time;
    const head = ['cycle', 'kind', 'counts', 'begins', 'duration, s', 'opening, mm', 'lateral, mm', 'forward, mm', 'opening, mm/s', 'closing, mm/s', 'hold, s', 'occlusal phase, s', ...(data.has_force ? ['force, N'] : [])];
    const rows = data.cycles.map((row) => [String(row.number), [row.kind, row.side].filter(Boolean).join(' '), row.left_out ? `no: ${row.left_out.replace('_', ' ')}` : 'yes', clock.text(row.began_s + (zero || 0)),
      number(row.duration_s, 3), number(row.opening_mm, 2), number(row.lateral_mm, 2), number(row.forward_mm, 2), number(row.opening_mm_s, 1), number(row.closing_mm_s, 1), number(row.hold_s, 3), number(row.occlusal_s, 3),
      ...(data.has_force ? [number(row.force_n, 1)] : [])]);
    holder.append(element('details', {}, element('summary', {}, `Each of ${rows.length === data.count ? 'the' : 'the first'} ${rows.length} cycles`), withChoice(tableOf('Cycles', head, rows, 'cycles'), data)));
  }

  // A box in each row of the table; the keys of the scenario follow from the boxes.
  function withChoice(table, { cycles: found, count }) {
    const boxes = found.map(({ number: cycle, left_out: why }) => element('input', { type: 'checkbox', 'aria-label': `leave out cycle ${cycle}`, checked: why === 'by_hand' ? '' : null }));
    const text = element('pre', { class: 'choice', tabindex: 0, 'aria-label': 'Keys of the chosen cycles', 'aria-live': 'polite' });
    const write = () => { text.textContent = `[study]\nleave_out = [${found.filter((_, at) => boxes[at].checked).map(({ number: cycle }) => cycle).join(', ')}]`; };
    table.querySelector('thead tr').append(element('th', { scope: 'col' }, 'leave out'));
    table.querySelectorAll('tbody tr').forEach((row, at) => row.append(element('td', {}, boxes[at])));
    boxes.forEach((box) => box.addEventListener('change', write));
    write();
    const rest = found.length < count ? ` Add the numbers of cycles beyond ${found.length} by hand.` : '';
    return element('div', {}, table, element('p', {}, `The boxes write these lines for the scenario, or for --set of masseter report and masseter compare.${rest}`), text);
  }

  // The cycles of one kind and side: their statistics, and their courses one over the other.
  function groupOf(holder, { name, count, quantities, mean: points, courses }, hasForce, clock) {
    holder.append(tableOf(`${name}: ${counted(count, 'cycle')}`, ['quantity', 'mean', 'SD', 'median', 'CV, %', 'mean, 95 % from', 'to', 'unit', 'cycles'],
      quantities.map(({ about, unit, mean, sd, median, cv, mean_low: low, mean_high: high, count: n }) => {
        const decimals = DECIMALS[unit];
        return [about, number(mean, decimals), number(sd, decimals), number(median, decimals), number(cv === null ? null : 100 * cv, 1), number(low, decimals), number(high, decimals), unit, String(n)];
      }), `statistics of ${name}`));
    if (!points.length) return;
    const share = points.map((_, at) => 100 * at / Math.max(1, points.length - 1));
    const overlay = (title, up, part, stroke) => {
      const single = courses.map(([cycle, course], at) => ({ name: at ? '' : 'each cycle', cycle, style: 'raw', stroke, xs: share, ys: share.map((_, point) => course[3 * point + part]) }));
      const mean = points.map((point) => point[part]), sd = points.map((point) => point[3 + part]);
      const rows = share.map((at, point) => [at, mean[point], sd[point], ...single.map(({ ys }) => ys[point])].map((value) => value.toFixed(4)).join(','));
      return plane(clock, { title: `${title}, ${name}`, across: 'share of the cycle, %', up, height: 190, curves: [...single, { name: 'mean ± SD', style: 'smoothed', stroke, xs: share, ys: mean }],
        csv: () => `${['share of the cycle, %', `mean, ${up}`, `SD, ${up}`, ...single.map(({ cycle }) => `cycle ${cycle}, ${up}`)].map((text) => `"${text}"`).join(',')}\n${rows.join('\n')}\n`,
        band: { xs: share, low: mean.map((value, at) => (part === 2 ? Math.max(0, value - sd[at]) : value - sd[at])), high: mean.map((value, at) => value + sd[at]), stroke } });
    };
    holder.append(element('div', { class: 'planes' }, overlay('Opening over the cycle', 'down, mm', 0, 'var(--c0)'), overlay('Lateral path over the cycle', 'to the left, mm', 1, 'var(--c2)'),
      hasForce ? overlay('Bite force over the cycle', 'bite force, N', 2, 'var(--c1)') : null));
  }

  // What the motion reached at each opening, in the planes with the vertical.
  function borderOf(border, plan) {
    const [low, high] = plan === PLANES.sagittal ? ['back_mm', 'front_mm'] : ['right_mm', 'left_mm'];
    if (plan === PLANES.horizontal || border.length < 2) return [];
    const back = border.toReversed();
    return [{ name: 'border', style: 'estimated', stroke: 'var(--jaw)', xs: [...border.map((step) => step[low]), ...back.map((step) => step[high])], ys: [...border, ...back].map((step) => -step.opening_mm) }];
  }

  function planes(clock, scene, path, desired, border) {
    const isTrue = scene.actual_name === 'true', own = isTrue ? 'var(--true)' : 'var(--estimated)', style = styleOf(scene);
    const incisal = Object.values(PLANES).map((plan) => plane(clock, { title: `Incisal point: ${plan[0].toLowerCase()}`, across: plan[1], up: plan[2], isEqual: true, isPlaced: true, curves: [
      curve(desired, 'incisal', plan, 'desired', 'desired', 'var(--desired)'), curve(path, 'incisal', plan, scene.actual_name, style, own), ...borderOf(border, plan)] }));
    const condyles = [PLANES.sagittal, PLANES.horizontal].map((plan) => plane(clock, { title: `Condyles: ${plan[0].toLowerCase()}`, across: plan[1], up: plan[2], isEqual: true, isPlaced: true, curves: [
      curve(desired, 'right', plan, '', 'desired', 'var(--desired)'), curve(desired, 'left', plan, 'desired', 'desired', 'var(--desired)'),
      curve(path, 'right', plan, 'right', style, 'var(--c1)'), curve(path, 'left', plan, 'left', style, 'var(--c3)')] }));
    return [...incisal, ...condyles, hinges(clock, scene, path)];
  }

  const styleOf = (scene) => (scene.actual_name === 'true' ? 'true' : 'smoothed');

  function courses(path) {
    const over = (frames, of) => frames.map((frame) => [frame.at, of(frame)]);
    const parts = ['roll to the right', 'opening', 'yaw to the left'], order = [1, 2, 0];
    return [
      chartData('Rotation of the jaw from the closed jaw', '°', order.map((axis) => [parts[axis], 'plain', over(path, ({ turn }) => turn[axis])])),
      chartData('Velocity of the incisal point', 'mm/s', ['forward', 'to the left', 'up'].map((name, axis) => [name, 'plain', rates(path, ({ incisal }) => incisal[axis])])),
      chartData('Velocity of the rotation', '°/s', order.map((axis) => [parts[axis], 'plain', rates(path, ({ turn }) => turn[axis])])),
    ];
  }

  // A drawing for print, shown as large as it is.
  Masseter.block('figure', (holder, text) => {
    const title = holder.id.replace(/\.svg$/, '');
    const picture = element('img', { alt: title, src: `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}` });
    holder.append(element('figure', { class: 'chart' }, element('figcaption', { style: 'display:flex;justify-content:space-between' }, element('h3', {}, title), menu(title, () => text, null)), picture));
  });

  Masseter.block('jaw', (holder, data, clock) => {
    const { scene } = Masseter;
    const words = element('p', {}), views = element('div', { class: 'planes' }), found = element('div', {});
    const isPlayed = (running) => ({ at }) => !running.length || running.some(({ from_s: from, to_s: to }, place) =>
      at >= from && (at <= to || (Masseter.page.life === 'live' && place === running.length - 1)));
    let charts = null;

    function update(now) {
      const running = Masseter.phases.filter(({ name }) => name === 'running');
      const [path, desired] = [ACTUAL, DESIRED].map((offset) => pathOf(scene, offset).filter(isPlayed(running)));
      followers = [];
      found.replaceChildren();
      if (path.length < 2 * AROUND + 1) {
        words.textContent = 'The motion did not begin.';
        return;
      }
      const lasts = path[path.length - 1].at - path[0].at;
      words.textContent = `${Masseter.fixed(lasts, 1)} s of the motion at ${Masseter.fixed((path.length - 1) / (lasts || 1), 0)} poses a second`
        + `${running.length && running[running.length - 1].to_s - path[path.length - 1].at > 0.1 ? '; the recording goes on' : ''}. Displacements count from the closed jaw. A click on a path moves the cursor there.`;
      views.replaceChildren(...planes(clock, scene, path, desired, now.border));
      const next = courses(path);
      charts ||= next.map((course) => Masseter.chart(drawn.appendChild(element('div', { class: 'block chart' })), course, clock));
      charts.forEach((chart, at) => chart.update(next[at]));
      cycles(found, now, clock);
    }

    const drawn = element('div', {});
    holder.append(words, views, drawn, found);
    clock.on('cursor', () => followers.forEach((follow) => follow()));
    update(data);
    // Out of sight nothing is drawn anew.
    let isSeen = true, waiting = null;
    new IntersectionObserver(([entry]) => {
      isSeen = entry.isIntersecting;
      if (!isSeen || !waiting) return;
      update(waiting);
      waiting = null;
    }).observe(holder);
    return { update(now) { if (isSeen) update(now); else waiting = now; } };
  });

  // Where the hinge axis meets the midsagittal plane, beside the closed jaw.
  function hinges(clock, scene, path) {
    const { closed, jaw } = scene, home = jaw.map((point) => placed(closed, point));
    const [, left, right] = home.map((point) => scaled(less(point, home[0]), 1000));
    const found = path.map((frame) => ({ time: frame.at, axis: hinge(frame) })).filter(({ axis }) => axis && space.length(axis.at) < 300);
    const middle = scaled(add(left, right), 0.5);
    const tilt = span(found.map(({ axis }) => axis.tilt));
    return plane(clock, { title: 'Hinge axis: sagittal', across: 'forward, mm', up: 'up, mm', isEqual: true, isPlaced: true, curves: [
      { name: 'Bonwill triangle', style: 'estimated', stroke: 'var(--jaw)', xs: [middle[0], 0], ys: [middle[2], 0] },
      { name: 'axis', style: 'dots', stroke: 'var(--c0)', xs: found.map(({ axis }) => axis.at[0]), ys: found.map(({ axis }) => axis.at[2]), at: found.map(({ time }) => time) },
      { name: 'condyles', style: 'dots', stroke: 'var(--jaw)', xs: [middle[0]], ys: [middle[2]] }],
    note: found.length ? `Finite helical axis from the closed jaw, where it meets the midsagittal plane, for turns above ${LEAST_TURN}°. Tilt to the left–right axis: ${Masseter.fixed(tilt[0], 1)} to ${Masseter.fixed(tilt[1], 1)}°.` : `No axis: the jaw turns by less than ${LEAST_TURN}°, or about an axis that lies along the midsagittal plane.` });
  }
}
