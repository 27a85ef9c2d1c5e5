// Builds the page from its data, and lets a run that goes on add to it.
{
  const { element } = Masseter;
  const page = JSON.parse(document.getElementById('data').textContent);
  const clock = Masseter.clock(page.time, page.window);
  const MODES = { motion: 'motion time', cycle: 'cycle', wall: 'wall time' };
  const spoken = element('p', { class: 'spoken', 'aria-live': 'polite' });

  Masseter.time = clock;
  Masseter.page = page;
  Masseter.moments = page.moments;
  Masseter.phases = page.phases;
  // What a screen reader says.
  Masseter.say = (text) => { spoken.textContent = text; };

  // The four ways in which a run that goes on changes the page. Unknown ids and contents without the method are left alone.
  // Adds points to a series of a chart, or whatever the block's content takes.
  Masseter.append = (id, series, points) => Masseter.handles.get(id)?.append?.(series, points);
  // Replaces the content of a block.
  Masseter.update = (id, data) => Masseter.handles.get(id)?.update?.(data);
  // Adds a moment, which all charts over time mark.
  Masseter.mark = (moment) => { Masseter.moments.push(moment); clock.setMode(clock.mode); };
  // The controller enters a state.
  Masseter.enter = (name, at) => {
    const last = Masseter.phases[Masseter.phases.length - 1];
    if (last) last.to_s = at;
    Masseter.phases.push({ name, from_s: at, to_s: at });
  };

  function build({ id, kind, data, folded, is_half: isHalf }) {
    const holder = element('div', { id, class: `block block-${kind}${isHalf ? ' half' : ''}` });
    const whole = folded ? element('details', { class: 'block' }, element('summary', {}, folded), holder) : holder;
    return [whole, () => {
      const handle = Masseter.builders[kind]?.(holder, data, clock);
      if (handle) Masseter.handles.set(id, handle);
    }];
  }

  // The section as an element, and what draws its blocks once the element is in the page.
  function section({ id, title, blocks }) {
    const built = blocks.map(build);
    const whole = element('section', { id: `section-${id}`, 'aria-labelledby': `title-${id}` },
      element('h2', { id: `title-${id}` }, title), ...built.map(([holder]) => holder));
    return [whole, () => built.forEach(([, start]) => start())];
  }

  // Takes the place of a section, or adds the section below another one.
  Masseter.section = (data, above) => {
    const [whole, start] = section(data);
    const earlier = document.getElementById(`section-${data.id}`);
    if (earlier) earlier.replaceWith(whole);
    else if (above) document.getElementById(`section-${above}`).after(whole);
    else document.getElementById('sections').prepend(whole);
    start();
    links();
  };

  function links() {
    const found = [...document.querySelectorAll('#sections > section')];
    document.querySelector('nav').replaceChildren(...found.slice(1).map((each) => element('a', { href: `#${each.id}` }, each.querySelector('h2').textContent)));
  }

  function timeBar() {
    const play = element('button', { type: 'button', class: 'play', 'aria-label': 'play', onclick: () => clock.play(!clock.isPlaying) }, '▶');
    const slider = element('input', { type: 'range', min: 0, max: 1, step: 'any', value: 0, 'aria-label': 'time', oninput: () => {
      clock.play(false);
      const [from, to] = clock.window;
      clock.seek(from + Number(slider.value) * (to - from));
    } });
    const now = element('output', {}, '–');
    const mode = element('select', { 'aria-label': 'how times are shown', onchange: () => clock.setMode(mode.value) },
      ...clock.modes.map((name) => element('option', { value: name }, MODES[name])));
    const whole = element('button', { type: 'button', class: 'whole', onclick: () => clock.reset() }, 'whole run');
    const moment = clock.moment && element('button', { type: 'button', class: 'moment', onclick: () => clock.zoom(...clock.moment) }, 'the moment');
    const show = () => {
      const [from, to] = clock.window, at = clock.cursor;
      slider.value = at === null ? 0 : (at - from) / (to - from);
      now.textContent = at === null ? '–' : clock.text(at);
      slider.setAttribute('aria-valuetext', now.textContent);
      whole.disabled = !clock.isZoomed;
    };
    ['cursor', 'window', 'mode', 'range'].forEach((what) => clock.on(what, show));
    clock.on('play', () => {
      play.textContent = clock.isPlaying ? '❚❚' : '▶';
      play.setAttribute('aria-label', clock.isPlaying ? 'pause' : 'play');
    });
    document.getElementById('time-bar').append(play, slider, now, mode, ...[moment, whole].filter(Boolean));
    show();
  }

  document.getElementById('top').append(element('h1', {}, page.title), element('p', { class: 'about' }, page.about), spoken);
  document.getElementById('sections').replaceChildren();
  const built = page.sections.map(section);
  document.getElementById('sections').append(...built.map(([whole]) => whole));
  const first = document.querySelector('#sections > section');
  if (first) first.append(element('nav', { 'aria-label': 'Sections' }));
  links();
  // A page without times, such as a suite's, has no bar.
  if (page.time.end_s > 0 || page.life === 'live') timeBar();
  built.forEach(([, start]) => start());
  // Paper shows also the blocks that are folded.
  addEventListener('beforeprint', () => {
    document.querySelectorAll('details.block').forEach((details) => { details.dataset.was = details.open; details.open = true; });
    Masseter.drawAll();
  });
  addEventListener('afterprint', () => {
    document.querySelectorAll('details[data-was]').forEach((details) => { details.open = details.dataset.was === 'true'; });
    Masseter.drawAll();
  });
  // The address has the window as times of the motion, so that a link opens the same view.
  const zero = () => page.time.motion_s || 0;
  function openView() {
    const view = /^#t=(-?[\d.]+),(-?[\d.]+)$/.exec(location.hash);
    if (view) clock.zoom(...view.slice(1).map((text) => Number(text) + zero()));
    return Boolean(view);
  }
  let naming = null;
  clock.on('window', () => {
    clearTimeout(naming);
    naming = setTimeout(() => {
      const view = clock.isZoomed ? `#t=${clock.window.map((at) => (at - zero()).toFixed(4)).join()}` : '';
      if (page.life !== 'live' && (view || location.hash.startsWith('#t='))) history.replaceState(null, '', location.href.split('#')[0] + view);
    }, 300);
  });
  addEventListener('hashchange', openView);
  if (!openView() && clock.moment) clock.zoom(...clock.moment);
  document.documentElement.dataset.ready = 'yes';
  if (page.life === 'live') Masseter.connect();
}
