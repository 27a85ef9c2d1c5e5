// Blocks that are no charts: text, the verdict, tables, events.
{
  const { element, svg, rich } = Masseter;

  Masseter.block('text', (holder, data) => {
    const update = (text) => holder.replaceChildren(element('p', {}, ...rich(text)));
    update(data);
    return { update };
  });

  Masseter.block('verdict', (holder, data) => {
    const panel = (name, tone, word, reason, next) => element('div', { class: `panel ${tone}` },
      element('span', { class: 'name' }, name), element('strong', {}, word), reason ? element('p', {}, ...rich(reason)) : null,
      next ? element('p', { class: 'next' }, element('b', {}, 'Next: '), ...rich(next)) : null);
    const update = (now) => {
      const figures = now.figures.map(([name, value]) => [element('dt', {}, name), element('dd', {}, value)]);
      // Simulated time is no result: the line below the title names the clock.
      holder.replaceChildren(element('div', { class: 'panels' }, panel('function', now.tone, now.word, now.reason, now.next),
        now.timing === 'simulated' ? null : panel('timing', now.timing_tone, now.timing, now.timing_reason)),
      figures.length ? element('dl', { class: 'figures' }, ...figures.map((pair) => element('div', {}, ...pair))) : '');
    };
    update(data);
    return { update };
  });

  // A button that shows a time, and what was around it.
  const timeButton = (at, clock) => element('button', { type: 'button', class: 'time', 'data-at': at, title: 'Show what was around it', onclick: () => clock.look(at) }, clock.text(at));
  const retell = (holder, clock) => holder.querySelectorAll('[data-at]').forEach((button) => { button.textContent = clock.text(Number(button.dataset.at)); });

  Masseter.block('table', (holder, data, clock) => {
    const cell = (content, { title, is_number: isNumber }, isFirst) => {
      const td = element(isFirst ? 'th' : 'td', { class: isNumber ? 'number' : '', scope: isFirst ? 'row' : null, 'data-title': title });
      if (typeof content === 'string') td.append(...rich(isNumber ? content.replace(/-(?=[\d.])/g, '\u2212') : content));
      else if (content.href !== undefined) td.append(element('a', { href: content.href }, content.text));
      else if (content.mark !== undefined) td.append(element('span', { class: `mark ${content.tone}` }, content.mark));
      else td.append(timeButton(content.at_s, clock));
      return td;
    };
    const update = (now) => {
      const head = now.columns.map((column) => element('th', { class: column.is_number ? 'number' : '', scope: 'col' }, column.title));
      const rows = now.rows.map((row) => element('tr', {}, ...row.map((content, at) => cell(content, now.columns[at], at === 0))));
      holder.replaceChildren(element('div', { class: 'table', tabindex: 0, role: 'region', 'aria-label': now.label },
        element('table', {}, element('thead', {}, element('tr', {}, ...head)), element('tbody', {}, ...rows))));
    };
    update(data);
    clock.on('mode', () => retell(holder, clock));
    return { update };
  });

  Masseter.block('events', (holder, data, clock) => {
    const item = (event) => element('li', { class: event.is_fault ? 'fault' : '' },
timeButton(event.at_s, clock), ` ${event.source}: `, ...rich(event.text));
    const list = (events) => element('ul', { class: 'events' }, ...events.map(item));
    const count = (events) => `${events.length} event${events.length === 1 ? '' : 's'}`;
    const start = element('details', {}), rest = element('div', {});
    const update = (now) => {
      data = now;
      start.replaceChildren(element('summary', {}, `Start of the drives: ${count(data.start)}`), list(data.start));
      start.hidden = data.start.length === 0;
      rest.replaceChildren(data.rest.length ? list(data.rest) : element('p', {}, 'There were no other events.'));
    };
    const lanes = element('div', {});
    Masseter.lanes(lanes, () => [...data.start, ...data.rest], clock);
    holder.append(lanes, start, rest);
    update(data);
    clock.on('mode', () => retell(holder, clock));
    return {
      update,
      // Adds events to those after the start.
      append(_, events) { update({ ...data, rest: [...data.rest, ...events] }); lanes.dispatchEvent(new Event('changed')); },
    };
  });

  // Events over time: the controller's states, and a row of marks for each source.
  Masseter.lanes = (holder, events, clock) => {
    const ROW = 24, LEFT = 90, RIGHT = 16;
    const drawing = svg('svg', { role: 'img', 'aria-label': 'Events over time, a row for each source; the list below has them in words.' });
    holder.append(drawing);
    function draw() {
      const sources = [...new Set(events().map(({ source }) => source))].sort();
      const width = Math.max(LEFT + RIGHT + 1, Math.round(holder.clientWidth) || 640), bottom = ROW * (sources.length + 1);
      const x = Masseter.axis(false, clock.window, [LEFT, width - RIGHT]);
      const clamp = (at) => Math.min(width - RIGHT, Math.max(LEFT, x.position(at)));
      const isIn = (at) => at >= clock.window[0] && at <= clock.window[1];
      drawing.setAttribute('viewBox', `0 0 ${width} ${bottom + 40}`);
      drawing.setAttribute('height', bottom + 40);
      const phases = Masseter.phases.filter(({ from_s: from, to_s: to }) => to > clock.window[0] && from < clock.window[1]).map((phase, at) => {
        const [from, to] = [clamp(phase.from_s), clamp(phase.to_s)];
        return svg('g', { class: `phase ${phase.name.replace(/\W+/g, '-')}` }, svg('title', {}, phase.name), svg('rect', { x: from, y: 3, width: Math.max(0.5, to - from), height: ROW - 6 }),
          to - from > Masseter.textWidth(phase.name) + 6 ? svg('text', { x: (from + to) / 2, y: 16, 'text-anchor': 'middle' }, phase.name) : null);
      });
      const rows = sources.map((source, row) => {
        const y = ROW * (row + 1.5);
        const marks = events().filter((event) => event.source === source && isIn(event.at_s))
          .map((event) => svg('circle', { cx: x.position(event.at_s).toFixed(1), cy: y, r: 4, class: event.is_fault ? 'fault' : 'event' }, svg('title', {}, `${clock.text(event.at_s)} ${event.text}`)));
        return svg('g', {}, svg('line', { x1: LEFT, x2: width - RIGHT, y1: y, y2: y, class: 'mesh' }), svg('text', { x: LEFT - 8, y: y + 4, class: 'tick', 'text-anchor': 'end' }, source), ...marks);
      });
      const ticks = clock.ticks(clock.window, Math.max(3, Math.floor((width - LEFT) / clock.tickRoom)))
        .map(({ value, text }) => svg('text', { x: x.position(value), y: bottom + 16, class: 'tick', 'text-anchor': 'middle' }, text));
      drawing.replaceChildren(svg('text', { x: LEFT - 8, y: 16, class: 'tick', 'text-anchor': 'end' }, 'state'), ...phases, ...rows, ...ticks,
        svg('text', { x: width - RIGHT, y: bottom + 32, class: 'tick', 'text-anchor': 'end' }, clock.label), svg('line', { class: 'cursor-line', y1: 0, y2: bottom }));
      cursor();
    }
    function cursor() {
      const line = drawing.querySelector('.cursor-line'), at = clock.cursor;
      const isIn = line && at !== null && at >= clock.window[0] && at <= clock.window[1];
      if (!line) return;
      line.style.display = isIn ? '' : 'none';
      if (!isIn) return;
      const x = LEFT + (at - clock.window[0]) / (clock.window[1] - clock.window[0]) * (drawing.viewBox.baseVal.width - LEFT - RIGHT);
      line.setAttribute('x1', x);
      line.setAttribute('x2', x);
    }
    ['window', 'mode'].forEach((what) => clock.on(what, draw));
    clock.on('cursor', cursor);
    holder.addEventListener('changed', draw);
    new ResizeObserver(draw).observe(holder);
    Promise.resolve().then(draw);
  };
}
