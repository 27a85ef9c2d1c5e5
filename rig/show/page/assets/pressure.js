// The force on each lower tooth: the arch from above at the cursor, and all teeth over time.
{
  const { element, svg } = Masseter;
  // From little to much; their lightness rises evenly, so that they can be told apart without colours.
  const COLOURS = ['#46327e', '#3b528b', '#2f6c8e', '#24868e', '#1fa187', '#3fbc73', '#75d054', '#b8de29', '#fde725'];
  // What counts as no force, N.
  const NONE = 0.05;
  const ROW = 18, LEFT = 46, RIGHT = 16, BELOW = 38;
  // Room around the teeth, and the radius of the tooth that bears most, in units of the arch's drawing.
  const ROOM = 44, RADIUS = 22;

  Masseter.block('pressure', (holder, data, clock) => {
    const teeth = data.teeth.map((tooth) => ({ ...tooth, ...Masseter.points(tooth.points) }));
    // The left side of the jaw stands above.
    const rows = [...teeth].sort((a, b) => a.across_mm - b.across_mm);
    const arch = svg('svg', { role: 'img', class: 'arch' }), map = svg('svg', { role: 'img', class: 'map' }), words = element('p', {});
    const mapHolder = element('div', {}, map);
    holder.append(element('div', { class: 'pressure' }, element('div', {}, arch, scaleBar()), mapHolder), words);

    const colourOf = (force) => COLOURS[Math.max(0, Math.min(COLOURS.length - 1, Math.floor(force / data.most_n * COLOURS.length)))];

    function scaleBar() {
      const cells = COLOURS.map((colour, at) => svg('rect', { x: at * 20, y: 0, width: 20, height: 10, fill: colour }));
      return svg('svg', { viewBox: '0 0 240 30', class: 'scale', 'aria-hidden': 'true' }, ...cells, svg('text', { x: 0, y: 24, class: 'tick' }, '0'),
        svg('text', { x: COLOURS.length * 20, y: 24, class: 'tick', 'text-anchor': 'end' }, `${Masseter.significant(data.most_n, 3)} N`));
    }

    function drawArch() {
      const at = clock.cursor ?? data.at_s, forces = teeth.map((tooth) => Masseter.valueAt(tooth, at) ?? 0);
      const xs = teeth.map((tooth) => tooth.across_mm), ys = teeth.map((tooth) => -tooth.forward_mm);
      const [left, top] = [Math.min(...xs), Math.min(...ys)], size = 5;
      const width = (Math.max(...xs) - left) * size + 2 * ROOM, height = (Math.max(...ys) - top) * size + 2 * ROOM;
      const place = (tooth) => [(tooth.across_mm - left) * size + ROOM, (-tooth.forward_mm - top) * size + ROOM];
      arch.setAttribute('viewBox', `0 0 ${width} ${height}`);
      const marks = teeth.map((tooth, number) => {
        const [x, y] = place(tooth), force = forces[number], isLoaded = force >= NONE;
        const radius = isLoaded ? Math.max(4, RADIUS * Math.sqrt(force / data.most_n)) : 4;
        const away = Math.hypot(x - width / 2, y - height / 2) || 1, beyond = radius + 14;
        return svg('g', {}, svg('circle', { cx: x, cy: y, r: radius, class: 'tooth', style: isLoaded ? `fill:${colourOf(force)}` : '' }),
          svg('text', { x: x + (x - width / 2) / away * beyond, y: y + (y - height / 2) / away * beyond + 4, 'text-anchor': 'middle' }, String(tooth.number)));
      });
      const loaded = teeth.map((tooth, number) => [tooth.number, forces[number]]).filter(([, force]) => force >= NONE);
      arch.replaceChildren(...marks);
      const list = loaded.map(([number, force]) => `tooth ${number} ${Masseter.significant(force, 3)} N`).join(', ');
      arch.setAttribute('aria-label', `The lower arch from above, ${list || 'without force'}`);
      const total = loaded.reduce((sum, [, force]) => sum + force, 0);
      words.textContent = `${clock.text(at)}: ${loaded.length ? `${list}; together ${Masseter.significant(total, 3)} N` : 'no force on a tooth'}.`;
    }

    function drawMap() {
      const width = Math.max(LEFT + RIGHT + 1, Math.round(mapHolder.clientWidth) || 640), bottom = ROW * rows.length + 6, window = clock.window;
      const x = Masseter.axis(false, window, [LEFT, width - RIGHT]);
      map.setAttribute('viewBox', `0 0 ${width} ${bottom + BELOW}`);
      map.setAttribute('height', bottom + BELOW);
      map.setAttribute('aria-label', `The force on each lower tooth over time, at most ${Masseter.significant(data.most_n, 3)} N.`);
      const paths = COLOURS.map(() => []);
      rows.forEach((tooth, row) => columns(tooth, window, x, width).forEach(([from, to, force]) => {
        paths[COLOURS.indexOf(colourOf(force))].push(`M${from} ${row * ROW + 4}H${to}v${ROW - 4}H${from}z`);
      }));
      const names = rows.map((tooth, row) => svg('g', {}, svg('rect', { x: LEFT, y: row * ROW + 4, width: width - RIGHT - LEFT, height: ROW - 4, class: 'lane' }),
        svg('text', { x: LEFT - 6, y: row * ROW + 15, class: 'tick', 'text-anchor': 'end' }, String(tooth.number))));
      const ticks = clock.ticks(window, Math.max(3, Math.floor((width - LEFT) / clock.tickRoom)))
        .map(({ value, text }) => svg('text', { x: x.position(value), y: bottom + 16, class: 'tick', 'text-anchor': 'middle' }, text));
      map.replaceChildren(...names, ...paths.map((path, at) => svg('path', { d: path.join(''), fill: COLOURS[at] })), ...ticks,
        svg('text', { x: width - RIGHT, y: bottom + 32, class: 'tick', 'text-anchor': 'end' }, clock.label),
        svg('line', { class: 'cursor-line', y1: 2, y2: bottom, x1: LEFT, x2: LEFT }));
      moveCursor();
    }

    // The greatest force in each two pixels.
    function columns(tooth, window, x, width) {
      const found = new Map(), [first, end] = Masseter.within(tooth.xs, window);
      for (let at = first; at < end; at += 1) {
        if (tooth.ys[at] < NONE) continue;
        // A value stands for the time until the next one.
        const from = Math.max(LEFT, x.position(tooth.xs[at])), to = Math.min(width - RIGHT, x.position(tooth.xs[at + 1] ?? tooth.xs[at]));
        for (let column = Math.floor(from / 2); column <= Math.floor(to / 2); column += 1) found.set(column, Math.max(found.get(column) ?? 0, tooth.ys[at]));
      }
      return [...found].map(([column, force]) => [column * 2, column * 2 + 2, force]);
    }

    function moveCursor() {
      const line = map.querySelector('.cursor-line'), at = clock.cursor, [from, to] = clock.window;
      if (!line) return;
      line.style.display = at !== null && at >= from && at <= to ? '' : 'none';
      if (at === null) return;
      const x = LEFT + (at - from) / (to - from) * (map.viewBox.baseVal.width - LEFT - RIGHT);
      line.setAttribute('x1', x);
      line.setAttribute('x2', x);
    }

    map.addEventListener('pointermove', (event) => {
      if (clock.isPlaying) return;
      const box = map.getBoundingClientRect(), share = ((event.clientX - box.left) * map.viewBox.baseVal.width / box.width - LEFT) / (map.viewBox.baseVal.width - LEFT - RIGHT);
      clock.seek(clock.window[0] + Math.min(1, Math.max(0, share)) * (clock.window[1] - clock.window[0]));
    });
    ['window', 'mode'].forEach((what) => clock.on(what, drawMap));
    ['cursor', 'mode'].forEach((what) => clock.on(what, drawArch));
    clock.on('cursor', moveCursor);
    new ResizeObserver(drawMap).observe(mapHolder);
    drawArch();
    return {
      // Adds the forces of a tooth, flat times and newtons.
      append(number, points) {
        const tooth = teeth.find((known) => known.number === Number(number)), { xs, ys } = Masseter.points(points);
        if (!tooth) return;
        tooth.xs.push(...xs);
        tooth.ys.push(...ys);
        data.most_n = ys.reduce((most, force) => Math.max(most, force), data.most_n);
        drawMap();
        drawArch();
      },
    };
  });
}
