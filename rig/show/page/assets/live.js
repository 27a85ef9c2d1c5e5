// The page of a run that goes on: its state, its parameters, and the connection that keeps it up to date.
{
  const { element, rich } = Masseter;
  // Time until a lost connection is tried again, ms.
  const AGAIN_MS = 1000;
  // How often the page asks for the report at its own address.
  const REPORT_TRIES = 10;
  let socket = null, isOver = false;

  const ask = (wish) => { if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(wish)); };

  Masseter.block('live', (holder, data) => {
    const word = element('strong', {}), progress = element('p', {}), figures = element('dl', { class: 'figures' });
    const panel = element('div', { class: 'panel' }, element('span', { class: 'name' }, 'state'), word, progress);
    const stop = element('button', { type: 'button', class: 'stop', onclick: () => {
      stop.disabled = true;
      stop.textContent = 'stopping …';
      ask({ op: 'stop' });
    } }, 'stop the run');
    const note = element('p', { class: 'note', role: 'status' });
    holder.append(element('div', { class: 'live' }, panel, stop), note, figures);
    const update = (now) => {
      if (word.textContent !== now.state) Masseter.say(now.state);
      panel.className = `panel ${now.tone}`;
      word.textContent = now.state;
      progress.textContent = now.progress;
      figures.replaceChildren(...now.figures.map(([name, value]) => element('div', {}, element('dt', {}, name), element('dd', {}, value))));
    };
    update(data);
    Masseter.live = { number: data.number, say: (text, isGood = false) => { note.textContent = text; note.classList.toggle('good', isGood); },
      end: () => { stop.disabled = true; stop.textContent = 'the run is over'; panel.className = 'panel'; } };
    return { update };
  });

  Masseter.block('parameters', (holder, data) => {
    const inputs = new Map();
    const row = ({ name, unit, about, last: value, range: [least, most] }) => {
      const input = element('input', { type: 'number', id: `parameter-${name}`, min: least, max: most, step: 'any', value,
        onchange: () => ask({ op: 'set', name, value: Number(input.value) }) });
      inputs.set(name, input);
      return element('tr', {}, element('th', { scope: 'row' }, element('label', { for: input.id }, name)), element('td', {}, input, unit ? ` ${unit}` : ''),
        element('td', {}, `${least} to ${most}`), element('td', {}, ...rich(about)));
    };
    const head = ['parameter', 'value', 'range', 'meaning'].map((title) => element('th', { scope: 'col' }, title));
    holder.append(element('div', { class: 'table', tabindex: 0, role: 'region', 'aria-label': 'Parameters' },
      element('table', {}, element('thead', {}, element('tr', {}, ...head)), element('tbody', {}, ...data.map(row)))));
    return {
      // Another value came from the controller; what the user types stays.
      update(now) {
        for (const { name, last: value } of now) {
          const input = inputs.get(name);
          if (input && input !== document.activeElement) input.value = value;
        }
      },
    };
  });

  // The address of the page has the report once the run is judged. A request waits until then.
  function showReport(left) {
    const request = new XMLHttpRequest();
    request.open('GET', location.pathname);
    request.onload = () => location.reload();
    request.onerror = () => {
      if (left) setTimeout(showReport, AGAIN_MS, left - 1);
      else Masseter.live.say('The run is over, and so is its server. The verdict is in report.html in the folder of the run.');
    };
    request.send();
  }

  function take(message) {
    if (message.reload) { location.reload(); return; }
    if (message.refused) Masseter.live.say(message.refused);
    if (message.set) Masseter.live.say('');
    if (message.over) {
      isOver = true;
      Masseter.live.end();
      Masseter.live.say('The run is over. The verdict follows.', true);
      setTimeout(showReport, AGAIN_MS, REPORT_TRIES);
    }
    if (message.end_s === undefined) return;
    Masseter.live.number += 1;
    if (message.motion_s !== undefined) Masseter.time.setMotion(message.motion_s);
    for (const { name, from_s: from } of message.enter || []) Masseter.enter(name, from);
    for (const [above, section] of message.sections || []) Masseter.section(section, above);
    for (const [id, series, points] of message.append) Masseter.append(id, series, points);
    for (const [id, data] of message.update) Masseter.update(id, data);
    for (const moment of message.mark || []) Masseter.mark(moment);
    if (Masseter.phases.length) Masseter.phases[Masseter.phases.length - 1].to_s = message.end_s;
    Masseter.time.extend(message.end_s);
  }

  // Called once the page is built.
  Masseter.connect = () => {
    const address = `${location.href.split(/[?#]/)[0].replace(/^http/, 'ws')}?after=${Masseter.live.number}`;
    socket = new WebSocket(address, 'masseter.page.v1');
    socket.onmessage = ({ data }) => take(JSON.parse(data));
    socket.onopen = () => { Masseter.live.say(''); document.documentElement.dataset.live = 'yes'; };
    socket.onclose = () => {
      document.documentElement.dataset.live = 'no';
      if (isOver) return;
      Masseter.live.say('The connection is lost.');
      setTimeout(Masseter.connect, AGAIN_MS);
    };
  };
}
