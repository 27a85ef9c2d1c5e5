// A chart as a file: the drawing as SVG with its colours, the values as CSV.
{
  const { element, svg } = Masseter;
  const SAVED = ['stroke', 'stroke-width', 'stroke-dasharray', 'stroke-linejoin', 'stroke-linecap', 'opacity', 'fill', 'fill-opacity', 'font-family',
    'font-size', 'font-weight'];

  // Offers a text as a file.
  Masseter.save = (name, type, text) => {
    const address = URL.createObjectURL(new Blob([text], { type }));
    element('a', { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  };

  const fileName = (text) => text.toLowerCase().replace(/[^a-z0-9]+/g, '-').replace(/^-|-$/g, '');

  // A drawing that needs no style sheet, with a heading and a legend.
  Masseter.svgText = (chart) => {
    const { drawing, label, series } = chart;
    const copy = drawing.cloneNode(true);
    const from = [...drawing.querySelectorAll('*')], to = [...copy.querySelectorAll('*')];
    to.forEach((element, at) => {
      const style = getComputedStyle(from[at]);
      element.removeAttribute('style');
      SAVED.forEach((name) => element.setAttribute(name, style.getPropertyValue(name)));
    });
    copy.querySelector('.cursor')?.remove();
    const [width, height] = ['width', 'height'].map((side) => drawing.viewBox.baseVal[side]);
    const page = getComputedStyle(document.body);
    const text = (x, y, content, size, weight) => svg('text', {
      x, y, fill: page.color, 'font-family': 'sans-serif', 'font-size': size, 'font-weight': weight }, content);
    let x = 10, row = 0;
    const shown = series.filter(({ isShown }) => isShown), keys = [];
    shown.forEach((one) => {
      const room = 40 + Masseter.textWidth(one.name);
      if (x + room > width && x > 10) { x = 10; row += 1; }
      const line = svg('path', { d: `M${x} ${36 + row * 18}h24` });
      const drawn = getComputedStyle(one.drawn || drawing.querySelectorAll('path.curve')[keys.length / 2] || drawing);
      SAVED.slice(0, 6).forEach((name) => line.setAttribute(name, drawn.getPropertyValue(name)));
      line.setAttribute('fill', 'none');
      keys.push(line, text(x + 30, 40 + row * 18, one.name, 12, 'normal'));
      x += room;
    });
    const top = 50 + row * 18;
    const whole = svg('svg', { xmlns: 'http://www.w3.org/2000/svg', width, height: height + top, viewBox: `0 0 ${width} ${height + top}` },
      svg('rect', { width, height: height + top, fill: page.backgroundColor }), text(10, 20, label, 15, 'bold'), ...keys);
    const inner = svg('g', { transform: `translate(0 ${top})` }, ...copy.childNodes);
    whole.append(inner);
    return new XMLSerializer().serializeToString(whole);
  };

  // The points in the window, a row for each x, a column for each curve that is shown.
  Masseter.csvText = ({ series, isTime, view, data, plot }) => {
    const shown = series.filter(({ isShown }) => isShown);
    const window = plot ? plot.window : [-Infinity, Infinity], rows = [], byX = new Map();
    shown.forEach((one, column) => one.xs.forEach((x, at) => {
      if (x < window[0] || x > window[1]) return;
      // Each dot has a row of its own.
      let cells = one.style === 'dots' ? null : byX.get(x);
      if (!cells) { byX.set(x, cells = Array(shown.length).fill('')); rows.push([x, cells]); }
      cells[column] = Number(one.ys[at].toPrecision(9));
    }));
    const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text);
    const names = shown.map(({ name }) => quoted(data.unit ? `${name} (${data.unit})` : name));
    const first = isTime ? view.label : data.across.quantity?.label ?? '1/(1 - quantile)';
    const lines = rows.sort(([a], [b]) => a - b).map(([x, cells]) => [Number((isTime ? view.shown(x) : x).toFixed(9)), ...cells].join(','));
    return `${[quoted(first), ...names].join(',')}\n${lines.join('\n')}\n`;
  };

  Masseter.chartMenu = (chart) => {
    const name = fileName(chart.data.title);
    const entry = (text, act) => element('button', { type: 'button', onclick: () => { menu.open = false; act(); } }, text);
    const menu = element('details', { class: 'menu' }, element('summary', { 'aria-label': `Save ${chart.data.title}`, title: 'Save this chart' }, '⋯'),
      element('div', {}, entry('Save as SVG', () => Masseter.save(`${name}.svg`, 'image/svg+xml', Masseter.svgText(chart))),
        entry('Save as CSV', () => Masseter.save(`${name}.csv`, 'text/csv', Masseter.csvText(chart)))));
    menu.addEventListener('focusout', (event) => { if (!menu.contains(event.relatedTarget)) menu.open = false; });
    return menu;
  };
}
