// Draws a chart as SVG: axes, curves, limits, moments, cursor and legend. Colours and strokes are those of the style sheet.
{
  const { element, svg } = Masseter;
  const ROOM = { left: 62, right: 16, top: 8, below: 38 };
  // On a phone every pixel counts.
  const NARROW = { width: 500, left: 46, right: 10 };
  // Height of a row of names above the plot, px.
  const ROW = 16;
  // A limit further from the curves than this many times their height is written, not drawn.
  const FAR = 0.6;
  // A curve that turns more often than every so many pixels is drawn as the band between its ends in columns of twice the width.
  const DENSE = 8;
  // A click opens the file of a dot within this distance, px.
  const NEAR = 10;
  const BANDED = ['desired', 'true', 'estimated'];
  const PALETTE = 8;
  const OWN_COLOUR = { desired: 'desired', true: 'true', estimated: 'estimated' };
  const all = new Set();
  let clips = 0;

  // A value along an axis in words.
  const placeText = (scale, value) => (scale.names ? scale.names[Math.round(value)] ?? '' : Masseter.significant(value));

  // A view of another quantity than time: it has a cursor of its own and no zoom.
  function ownView(across, changed) {
    return {
      window: [0, 1],
      cursor: null,
      isPlaying: false,
      seek(at) { this.cursor = at === null ? null : Math.min(this.window[1], Math.max(this.window[0], at)); changed(); },
      zoom() {}, zoomAbout() {}, pan() {}, reset() {}, play() {},
      text: (at) => (across.quantity ? placeText(across.quantity.scale, at) : across === 'percentile' ? `${Masseter.significant(100 - 100 / at, 6)} %` : `${Masseter.significant(at)} µs`),
    };
  }

  function prepared(series, place, plainBefore) {
    const { xs, ys } = Masseter.points(series.points || []);
    const number = series.colour ?? plainBefore;
    const own = series.colour === undefined && OWN_COLOUR[series.style];
    const stroke = own ? `var(--${own})` : `var(--c${number % PALETTE})`;
    const isSecond = !own && number >= PALETTE;
    return { name: series.name, style: series.style, xs, ys, step: Infinity, stroke, isSecond, isShown: !series.is_hidden, place, names: series.names || [], links: series.links || [] };
  }

  function preparedAll(data) {
    let plain = 0;
    return data.series.map((series, place) => {
      const next = prepared(series, place, plain);
      if (series.style === 'plain' && series.colour === undefined) plain += 1;
      return next;
    });
  }

  const strokeOf = (series) => ({ class: `curve ${series.style}${series.isSecond ? ' second' : ''}`, style: `--c:${series.stroke}` });

  // The lowest and the highest value of shown curves in a window.
  function extremes(shown, window, isLog) {
    let low = Infinity, high = -Infinity;
    const take = (value) => {
      if (value === null || (isLog && value <= 0)) return;
      low = Math.min(low, value);
      high = Math.max(high, value);
    };
    for (const series of shown) {
      const [first, end] = [Masseter.placeOf(series.xs, window[0]), Masseter.placeOf(series.xs, window[1])];
      for (let at = first; at < end; at += 1) take(series.ys[at]);
      window.forEach((x) => take(Masseter.valueAt(series, x)));
    }
    return low <= high ? [low, high] : null;
  }

  // The ends of the vertical axis, and the limits that lie near enough.
  function fitted(found, limits, isLog) {
    let [low, high] = found;
    const far = FAR * Math.max(high - low, 1e-9 * Math.abs(high));
    const isNear = (value) => isLog || (value >= low - far && value <= high + far);
    const near = limits.flatMap(({ name, kind, values }) => values.filter(isNear).map((value, at) => ({ name: at ? '' : name, kind, value })));
    const beyond = limits.map(({ name, values }) => ({ name, values: values.filter((value) => !isNear(value)) }))
      .filter(({ values }) => values.length);
    for (const { value } of near) { low = Math.min(low, value); high = Math.max(high, value); }
    if (isLog) return { ends: [low / 1.3, high * 1.3], near, beyond };
    const margin = high > low ? Math.max(0.06 * (high - low), 1e-9 * Math.abs(high)) : Math.max(0.05 * Math.abs(high), 1e-6);
    return { ends: [low - margin, high + margin], near, beyond };
  }

  // Moments closer together than this share a name, px.
  const CLOSE = 14;

  // Gives the moments in the window names and rows above the plot, so that no two names cover each other.
  function placed(moments, window, axis, right) {
    const ends = [], joined = [];
    for (const moment of moments.filter(({ at_s: at }) => at >= window[0] && at <= window[1]).sort((a, b) => a.at_s - b.at_s)) {
      const x = axis.position(moment.at_s), last = joined[joined.length - 1];
      if (last && x - last.marks[last.marks.length - 1].x < CLOSE) last.marks.push({ ...moment, x });
      else joined.push({ marks: [{ ...moment, x }] });
    }
    return joined.map(({ marks }) => {
      const name = marks.map((one) => one.name).join(', '), width = Masseter.textWidth(name, 11.5) + 10;
      const isLeft = marks[marks.length - 1].x + width > right;
      const x = marks[isLeft ? 0 : marks.length - 1].x;
      const from = isLeft ? x - width : x;
      let row = ends.findIndex((end) => end <= from);
      if (row < 0) row = ends.push(0) - 1;
      ends[row] = from + width;
      return { marks, name, x, row, isLeft };
    });
  }

  Masseter.chart = (holder, data, clock) => {
    const isTime = data.across === 'time', isLog = data.scale === 'log', names = data.scale.names;
    const other = data.across.quantity, isBars = data.series.some(({ style }) => style === 'bars');
    const isDots = isBars || data.series.some(({ style }) => style === 'dots'), hasLinks = data.series.some(({ links }) => links);
    const view = isTime ? clock : ownView(data.across, () => moveCursor());
    const clip = `clip-${clips += 1}`;
    let series = preparedAll(data), plot = null, isDirty = true, isVisible = true, isWaiting = false, isUnderPointer = false, isBanded = false, pointerY = null;

    const label = data.unit ? `${data.title}, ${data.unit}` : data.title;
    const drawing = svg('svg', { tabindex: 0, role: 'application', 'aria-roledescription': 'chart' });
    const legend = element('div', { class: 'legend' }), words = element('p', { class: 'beyond' });
    const chart = {
      data, view, drawing, label, isTime,
      get series() { return series; },
      get plot() { return plot; },
      get isShowing() { return series.some(({ xs }) => xs.length); },
      // The values under the cursor in a sentence.
      spoken() {
        if (isDots) return dotLines(nearestDot()).join(', ');
        const values = series.filter(({ isShown }) => isShown).map((one) => [one.name, Masseter.valueAt(one, view.cursor)]);
        return [view.text(view.cursor), ...values.filter(([, value]) => value !== null).map(([name, value]) => `${name} ${valueText(value)}`)].join(', ');
      },
      // Opens the file of the dot under the pointer, or of the chosen one.
      open(isChosen) {
        const dot = isDots && plot && view.cursor !== null ? nearestDot() : null;
        if (dot && (isChosen || dot.way < NEAR) && dot.one.links[dot.place]) location.href = dot.one.links[dot.place];
      },
      setPointer(is, y = null) { isUnderPointer = is; pointerY = y; moveCursor(); },
      redraw,
      draw,
    };

    function summary() {
      const ranges = series.filter(({ ys }) => ys.length).map(({ name, ys }) => {
        const [low, high] = ys.reduce(([least, most], y) => [Math.min(least, y), Math.max(most, y)], [Infinity, -Infinity]);
        return `${name} from ${Masseter.significant(low)} to ${Masseter.significant(high)} ${data.unit}`;
      });
      return ranges.length ? `${data.title}. ${ranges.join('; ')}. Arrow keys move the cursor.${hasLinks ? ' Enter opens the case.' : ''}` : `${data.title}. ${data.otherwise}`;
    }

    // Draws in the next frame, or once the chart is seen.
    function redraw() {
      isDirty = true;
      if (isWaiting || !isVisible) return;
      isWaiting = true;
      requestAnimationFrame(() => { isWaiting = false; if (isDirty && isVisible) draw(); });
    }

    function draw() {
      isDirty = false;
      if (isTime) series.forEach((one) => { one.step = Masseter.longestStep(one.xs); });
      const width = Math.round(holder.clientWidth) || 640;
      const window = isTime ? clock.window : ownWindow();
      const shown = series.filter(({ isShown }) => isShown);
      const found = extremes(shown, window, isLog);
      if (!isTime) view.window = window;
      drawing.replaceChildren();
      words.textContent = '';
      if (!found) {
        size(width, 48);
        plot = null;
        drawing.append(svg('text', { x: ROOM.left, y: 28, class: 'empty' }, chart.isShowing ? 'Nothing in this stretch.' : data.otherwise));
        return;
      }
      const room = { ...ROOM, ...(width < NARROW.width ? NARROW : {}) };
      if (names) room.left = Math.min(0.4 * width, Math.max(room.left, 12 + Math.max(...names.map((name) => Masseter.textWidth(name, 11.5)))));
      // A share is drawn from nothing on.
      if (data.unit === '%' || isBars) found[0] = Math.min(found[0], 0);
      const { ends, near, beyond } = names ? { ends: [-0.5, names.length - 0.5], near: [], beyond: [] } : fitted(found, data.limits || [], isLog);
      const right = Math.max(room.left + 1, width - room.right);
      const x = Masseter.axis(other ? other.scale === 'log' : !isTime, window, [room.left, right]);
      const moments = isTime ? placed([...Masseter.moments, ...(data.moments || [])], window, x, right) : [];
      const top = room.top + ROW * Math.max(0, ...moments.map(({ row }) => row + 1));
      const bottom = top + data.height;
      const y = Masseter.axis(isLog, ends, [bottom, top]);
      plot = { x, y, left: room.left, right, top, bottom, window };
      size(width, bottom + room.below);
      drawing.append(svg('clipPath', { id: clip }, svg('rect', { x: room.left, y: top, width: right - room.left, height: data.height })));
      isBanded = false;
      drawing.append(...grid(), svg('g', { 'clip-path': `url(#${clip})` }, ...shades(), ...near.map(level), ...shown.map(curve)), ...near.map(levelName));
      drawing.append(...moments.map(mark), svg('g', { class: 'cursor' }));
      words.textContent = [beyond.length ? `Not in the picture: ${beyond.map(inWords).join('; ')}.` : '',
        data.is_shaded ? 'Judged: the shaded stretches.' : '', isBanded ? 'Too dense for lines: bands from the lowest to the highest values. Zoom in for the curves.' : ''].filter(Boolean).join(' ');
      moveCursor();
    }

    function ownWindow() {
      if (other?.scale.names) return [-0.5, other.scale.names.length - 0.5];
      const xs = series.flatMap((one) => [one.xs[0], one.xs[one.xs.length - 1]]).filter((x) => x !== undefined);
      const [low, high] = xs.length ? [Math.min(...xs), Math.max(...xs)] : [0, 1];
      if (!other) return [low, high];
      if (isBars) return [low - barWidth() / 2, high + barWidth() / 2];
      if (series.every(({ style }) => style !== 'dots')) return [low, high];
      // Dots at the ends are whole.
      const room = other.scale === 'log' ? (high / low) ** 0.03 : 0.03 * (high - low || Math.abs(high) || 1);
      return other.scale === 'log' ? [low / room, high * room] : [low - room, high + room];
    }

    function size(width, height) {
      drawing.setAttribute('viewBox', `0 0 ${width} ${height}`);
      drawing.setAttribute('width', width);
      drawing.setAttribute('height', height);
    }

    function grid() {
      const { x, y, left, right, top, bottom, window } = plot;
      const many = Math.max(3, Math.floor((right - left) / (isTime ? clock.tickRoom : 64))), few = isBars ? Math.min(5, Math.ceil(y.ends[1])) : Math.max(4, Math.floor(data.height / 27));
      const apart = (ticks) => ticks.reduce((kept, tick) => (kept.length && x.position(tick.value) - x.position(kept[kept.length - 1].value) < 52 ? kept : [...kept, tick]), []);
      const across = isTime ? clock.ticks(window, many) : other ? otherTicks(window, many)
        : data.across === 'percentile' ? apart(Masseter.percentileTicks(window)) : Masseter.logTicks(window, many);
      const up = names ? nameTicks(names) : isLog ? Masseter.logTicks(y.ends, few) : Masseter.linearTicks(y.ends, few);
      const vertical = across.map(({ value, text }) => [
        svg('line', { x1: x.position(value), x2: x.position(value), y1: top, y2: bottom, class: 'mesh' }),
        svg('text', { x: x.position(value), y: bottom + 16, class: 'tick', 'text-anchor': 'middle' }, text)]);
      const horizontal = up.map(({ value, text }) => [
        svg('line', { x1: left, x2: right, y1: y.position(value), y2: y.position(value), class: 'mesh' }),
        svg('text', { x: left - 6, y: y.position(value) + 4, class: 'tick', 'text-anchor': 'end' }, text)]);
      const name = isTime ? clock.label : other ? other.label : data.across === 'percentile' ? 'percentile' : 'µs';
      return [...vertical.flat(), ...horizontal.flat(), svg('rect', { x: left, y: top, width: right - left, height: bottom - top, class: 'frame' }),
        svg('text', { x: right, y: bottom + 32, class: 'tick', 'text-anchor': 'end' }, name)];
    }

    const nameTicks = (all) => all.map((text, value) => ({ value, text }));
    // Names that would cover the one before are left out: dots have them under the pointer.
    const clear = (ticks) => ticks.reduce((kept, tick) => {
      const last = kept[kept.length - 1], half = ({ text }) => Masseter.textWidth(text, 11.5) / 2 + 4;
      return last && plot.x.position(tick.value) - half(tick) < plot.x.position(last.value) + half(last) ? kept : [...kept, tick];
    }, []);
    const otherTicks = (window, many) => (other.scale.names ? clear(nameTicks(other.scale.names)) : (other.scale === 'log' ? Masseter.logTicks : Masseter.linearTicks)(window, many));

    // Whether the curve goes up and down over the whole height more often than the pixels show.
    function isDense({ ys }, places) {
      const way = places.reduce((sum, at, place) => sum + (place ? Math.abs(plot.y.position(ys[at]) - plot.y.position(ys[places[place - 1]])) : 0), 0);
      return way > 0.5 * (plot.right - plot.left) * data.height / DENSE;
    }

    // Buckets as stairs: each point is the end of its bucket.
    function stairs({ xs, ys }) {
      const { x, y, left, bottom } = plot, height = (at) => (ys[at] > 0 ? y.position(ys[at]) : bottom).toFixed(1);
      return `M${left} ${bottom}${xs.map((to, at) => `V${height(at)}H${x.position(to).toFixed(1)}`).join('')}V${bottom}`;
    }

    // Bars are evenly apart, those of all series together.
    function barWidth() {
      const [first, second] = series.flatMap(({ xs }) => xs).sort((a, b) => a - b);
      return second - first;
    }

    function bars({ xs, ys }) {
      const { x, y } = plot, half = 0.45 * barWidth(), nothing = y.position(0).toFixed(1);
      return xs.map((at, place) => (ys[place] > 0 ? `M${x.position(at - half).toFixed(1)} ${nothing}V${y.position(ys[place]).toFixed(1)}H${x.position(at + half).toFixed(1)}V${nothing}Z` : '')).join('');
    }

    function curve(one) {
      if (one.style === 'bars') return svg('path', { ...strokeOf(one), d: bars(one) });
      if (data.across === 'duration') return svg('path', { ...strokeOf(one), d: stairs(one) });
      const { x, y, window } = plot;
      if (one.style === 'dots') return svg('path', { ...strokeOf(one), d: one.xs.map((at, place) => `M${x.position(at).toFixed(1)} ${y.position(one.ys[place]).toFixed(1)}h0`).join('') });
      const places = Masseter.thinned(one, window, x.position, plot.right - plot.left).filter((at) => !isLog || one.ys[at] > 0);
      if (isTime && BANDED.includes(one.style) && isDense(one, places)) return band(one, places);
      const joins = (at, before) => before !== undefined && one.xs[at] - one.xs[at - 1] <= one.step;
      const points = places.map((at, place) => `${joins(at, places[place - 1]) ? 'L' : 'M'}${x.position(one.xs[at]).toFixed(1)} ${y.position(one.ys[at]).toFixed(1)}`);
      return svg('path', { ...strokeOf(one), d: points.join('') });
    }

    // Where a curve turns too often for lines, the band between its lowest and highest values.
    function band(one, places) {
      const { x, y } = plot, columns = new Map();
      for (const at of places) {
        const column = Math.floor(x.position(one.xs[at]) / (2 * DENSE)), [low, high] = columns.get(column) || [Infinity, -Infinity];
        columns.set(column, [Math.min(low, one.ys[at]), Math.max(high, one.ys[at])]);
      }
      const edge = (end) => [...columns].map(([column, ends]) => `${((column + 0.5) * 2 * DENSE).toFixed(1)} ${y.position(ends[end]).toFixed(1)}`);
      isBanded = true;
      return svg('path', { class: `curve banded ${one.style}`, style: `--c:${one.stroke}`, d: `M${[...edge(1), ...edge(0).reverse()].join('L')}Z` });
    }

    // The stretches in which the first curve has points.
    function shades() {
      const one = series[0];
      if (!data.is_shaded || !one?.xs.length) return [];
      const ends = one.xs.flatMap((x, at) => (at === 0 ? [x] : x - one.xs[at - 1] > one.step ? [one.xs[at - 1], x] : [])).concat(one.xs[one.xs.length - 1]);
      const shade = (from, to) => svg('rect', { class: 'shade', x: from, y: plot.top, width: Math.max(1, to - from), height: data.height });
      return ends.flatMap((from, at) => (at % 2 ? [] : [shade(plot.x.position(from), plot.x.position(ends[at + 1]))]));
    }

    function level({ kind, value }) {
      const at = plot.y.position(value);
      return svg('line', { x1: plot.left, x2: plot.right, y1: at, y2: at, class: kind });
    }

    // Curves of percentiles rise at the right, where they would strike a name.
    function levelName({ name, kind, value }) {
      const at = plot.y.position(value), isHigh = at - plot.top < 18, isLeft = data.across === 'percentile';
      return name && svg('text', { x: isLeft ? plot.left + 4 : plot.right - 4, y: at + (isHigh ? 13 : -4), class: `${kind}-name`, 'text-anchor': isLeft ? 'start' : 'end' },
        `${name} ${kind === 'found' ? Masseter.significant(value) : Masseter.short(value)} ${data.unit}`);
    }

    const inWords = ({ name, values }) => `${name} ${values.map(Masseter.short).join(' and ')} ${data.unit}`.trim();

    function mark({ marks, name, x, row, isLeft }) {
      const from = ROOM.top + ROW * row;
      const lines = marks.map((one) => svg('g', { class: `moment ${one.kind}` }, svg('title', {}, `${one.text}, ${clock.text(one.at_s)}`),
        svg('line', { x1: one.x, x2: one.x, y1: from, y2: plot.bottom })));
      const kind = marks.every((one) => one.kind === 'note') ? 'note' : 'fault';
      return svg('g', {}, ...lines, svg('g', { class: `moment ${kind}` },
        svg('text', { x: x + (isLeft ? -5 : 5), y: from + 11, 'text-anchor': isLeft ? 'end' : 'start' }, name)));
    }

    // The dot that lies nearest to pointer or cursor, px.
    function nearestDot() {
      const from = plot.x.position(view.cursor);
      let found = null, least = Infinity;
      series.filter(({ isShown }) => isShown).forEach((one) => one.xs.forEach((at, place) => {
        const x = plot.x.position(at), y = plot.y.position(one.ys[place]);
        const way = Math.hypot(x - from, pointerY === null || isBars ? 0 : y - pointerY);
        if (way < least) { least = way; found = { one, place, x, y, way }; }
      }));
      return found;
    }

    const dotLines = (dot) => (dot && isBars ? [dot.one.names[dot.place]] : dot ? [dot.one.names[dot.place] || dot.one.name, `${other.label}  ${placeText(other.scale, dot.one.xs[dot.place])}`,
      `${data.title}  ${names ? placeText(data.scale, dot.one.ys[dot.place]) : valueText(dot.one.ys[dot.place])}`] : []);

    function markDot(group) {
      const dot = nearestDot();
      if (!dot) return;
      drawing.style.cursor = dot.one.links[dot.place] && dot.way < NEAR ? 'pointer' : '';
      group.append(svg('circle', { cx: dot.x, cy: dot.y, r: 6, class: 'ring', style: `stroke:${dot.one.stroke}` }));
      if (isUnderPointer) group.append(box(dot.x, dotLines(dot)));
    }

    // The line of the cursor, a dot on each curve, the values in the legend and, under the pointer, in a box.
    function moveCursor() {
      const group = drawing.querySelector('.cursor');
      const at = view.cursor;
      const isInside = plot && group && at !== null && at >= plot.window[0] && at <= plot.window[1];
      if (group) group.replaceChildren();
      if (isDots) {
        if (isInside) markDot(group);
        return;
      }
      const shown = series.filter(({ isShown }) => isShown);
      const values = shown.map((one) => (isInside ? Masseter.valueAt(one, at) : null));
      writeLegendValues(shown, values);
      if (!isInside) return;
      const x = plot.x.position(at);
      group.append(svg('line', { x1: x, x2: x, y1: plot.top, y2: plot.bottom }));
      values.forEach((value, place) => {
        if (value === null || (isLog && value <= 0)) return;
        group.append(svg('circle', { cx: x, cy: plot.y.position(value), r: 3, style: `fill:${shown[place].stroke}` }));
      });
      const line = (one, place) => (values[place] === null ? null : `${one.name}  ${valueText(values[place])}`);
      if (isUnderPointer) group.append(box(x, [view.text(at), ...shown.map(line).filter((text) => text !== null)]));
    }

    const decimals = () => (plot ? Math.max(0, 3 - Math.floor(Math.log10(plot.y.ends[1] - plot.y.ends[0]))) : 3);
    const valueText = (value) => `${isLog ? Masseter.significant(value) : Masseter.fixed(value, Math.min(6, decimals()))} ${data.unit}`.trim();

    function box(x, lines) {
      const width = Math.max(...lines.map((line) => Masseter.textWidth(line))) + 16, height = lines.length * 15 + 8;
      const left = x + 10 + width > plot.right ? x - 10 - width : x + 10;
      const top = plot.top + 4;
      return svg('g', { class: 'box' }, svg('rect', { x: left, y: top, width, height, rx: 4 }),
        ...lines.map((line, at) => svg('text', { x: left + 7, y: top + 16 + at * 15, class: at ? '' : 'time' }, line)));
    }

    function writeLegendValues(shown, values) {
      for (const entry of legend.querySelectorAll('[data-place]')) {
        const at = shown.findIndex(({ place }) => place === Number(entry.dataset.place));
        entry.querySelector('.value').textContent = at >= 0 && values[at] !== null && values[at] !== undefined ? valueText(values[at]) : '';
      }
    }

    function writeLegend() {
      legend.replaceChildren(...series.map((one) => element('button', {
        type: 'button', 'data-place': one.place, 'aria-pressed': String(one.isShown), title: `Show or hide ${one.name}`,
        onclick: () => { one.isShown = !one.isShown; writeLegend(); redraw(); },
      }, svg('svg', { width: 22, height: 12, 'aria-hidden': 'true' }, svg('path', { ...strokeOf(one), d: one.style === 'dots' ? 'M11 6h0' : 'M2 6H20' })),
      element('span', {}, one.name), element('span', { class: 'value' }))));
      drawing.setAttribute('aria-label', summary());
      moveCursor();
    }

    holder.append(element('figcaption', {}, element('h3', {}, label), Masseter.chartMenu(chart)), legend, drawing, words);
    writeLegend();
    Masseter.gestures(chart);
    if (isTime) {
      clock.on('window', redraw);
      clock.on('mode', redraw);
      clock.on('cursor', () => { if (isVisible) moveCursor(); });
    }
    new IntersectionObserver(([entry]) => {
      isVisible = entry.isIntersecting;
      if (isVisible && isDirty) redraw(); else if (isVisible) moveCursor();
    }, { rootMargin: '300px' })
      .observe(holder);
    new ResizeObserver(([entry]) => { if (plot === null || Math.abs(entry.contentRect.width - drawing.viewBox.baseVal.width) > 1) redraw(); })
      .observe(holder);
    all.add(chart);
    draw();

    return {
      chart,
      // Adds points to a curve, x, y, x, y …; a curve of a new name is a plain one.
      append(name, points) {
        let one = series.find((known) => known.name === name);
        if (!one) {
          data.series.push({ name, style: 'plain', points: [] });
          series.push(one = prepared({ name, style: 'plain' }, series.length, series.length));
          writeLegend();
        }
        const { xs, ys } = Masseter.points(points);
        // The page may have been made with some of them.
        const last = one.xs.length ? one.xs[one.xs.length - 1] : -Infinity;
        xs.forEach((x, at) => { if (x > last) { one.xs.push(x); one.ys.push(ys[at]); } });
        redraw();
      },
      // Takes the place of the whole chart.
      update(next) {
        Object.assign(data, next);
        const chosen = new Map(series.map(({ name, isShown }) => [name, isShown]));
        series = preparedAll(data);
        series.forEach((one) => { one.isShown = chosen.get(one.name) ?? one.isShown; });
        writeLegend();
        redraw();
      },
    };
  };

  Masseter.block('chart', (holder, data, clock) => {
    const figure = element('figure', { class: 'chart' });
    holder.append(figure);
    return Masseter.chart(figure, data, clock);
  });

  // Paper shows what no screen has shown yet, at its own width.
  Masseter.drawAll = () => all.forEach((chart) => chart.draw());
}
