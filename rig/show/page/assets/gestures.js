// What a hand does on a chart: hover moves the cursor, dragging chooses a stretch of time, dragging with Shift pans, the wheel
// (with Ctrl, or once the chart is clicked) and two fingers zoom, a double click shows everything, keys do the same.
{
  const { svg } = Masseter;
  // A drag shorter than this is a click, px.
  const SHORT = 5;
  const KEY_STEP = 1 / 200;

  Masseter.gestures = (chart) => {
    const { drawing, view } = chart;
    const fingers = new Map();
    let from = null, pinch = null, panned = null;

    // Where a pointer is, in the drawing's pixels.
    function pixel(event) {
      const box = drawing.getBoundingClientRect();
      return (event.clientX - box.left) * drawing.viewBox.baseVal.width / box.width;
    }

    const inside = (x) => Math.min(chart.plot.right, Math.max(chart.plot.left, x));
    const valueAt = (x) => chart.plot.x.value(inside(x));

    function chosen(x) {
      drawing.querySelector('.chosen')?.remove();
      if (from === null || Math.abs(x - from) < SHORT) return;
      const [left, right] = [inside(from), inside(x)].sort((a, b) => a - b);
      drawing.append(svg('rect', { class: 'chosen', x: left, y: chart.plot.top, width: right - left, height: chart.plot.bottom - chart.plot.top }));
    }

    drawing.addEventListener('pointerdown', (event) => {
      if (!chart.plot || event.button > 0) return;
      fingers.set(event.pointerId, pixel(event));
      if (event.pointerType === 'touch') {
        pinch = fingers.size === 2 ? [...fingers.values()].map((x) => chart.plot.x.value(x)) : null;
      } else {
        if (event.shiftKey && chart.isTime) panned = pixel(event); else from = pixel(event);
        drawing.setPointerCapture(event.pointerId);
      }
      view.play(false);
      view.seek(valueAt(pixel(event)));
    });
    drawing.addEventListener('pointermove', (event) => {
      if (!chart.plot) return;
      const x = pixel(event);
      if (fingers.has(event.pointerId)) fingers.set(event.pointerId, x);
      if (pinch && fingers.size === 2) {
        spread();
        return;
      }
      if (panned !== null) {
        view.pan((panned - x) / (chart.plot.right - chart.plot.left));
        panned = x;
        return;
      }
      if (from !== null) chosen(x);
      if (view.isPlaying) return;
      const box = drawing.getBoundingClientRect();
      chart.setPointer(true, (event.clientY - box.top) * drawing.viewBox.baseVal.height / box.height);
      view.seek(valueAt(x));
    });
    const end = (event) => {
      const x = pixel(event), began = from;
      fingers.delete(event.pointerId);
      if (fingers.size < 2) pinch = null;
      from = panned = null;
      drawing.querySelector('.chosen')?.remove();
      if (event.type === 'pointerup' && began !== null && Math.abs(x - began) < SHORT) chart.open(false);
      if (event.type !== 'pointerup' || began === null || !chart.isTime || Math.abs(x - began) < SHORT) return;
      const [low, high] = [valueAt(began), valueAt(x)].sort((a, b) => a - b);
      view.zoom(low, high);
    };
    drawing.addEventListener('pointerup', end);
    drawing.addEventListener('pointercancel', end);
    drawing.addEventListener('pointerleave', () => chart.setPointer(false));

    // Both values under the fingers stay under them.
    function spread() {
      const [a, b] = [...fingers.values()].map((x) => (x - chart.plot.left) / (chart.plot.right - chart.plot.left));
      if (Math.abs(b - a) < 0.02) return;
      const length = (pinch[1] - pinch[0]) / (b - a), low = pinch[0] - a * length;
      if (length > 0) view.zoom(low, low + length);
    }

    drawing.addEventListener('wheel', (event) => {
      const isMeant = event.ctrlKey || document.activeElement === drawing;
      if (!isMeant || !chart.plot || !chart.isTime) return;
      event.preventDefault();
      view.zoomAbout(valueAt(pixel(event)), Math.exp(Math.max(-100, Math.min(100, event.deltaY)) / 300));
    }, { passive: false });
    drawing.addEventListener('dblclick', () => view.reset());

    drawing.addEventListener('keydown', (event) => {
      if (!chart.plot) return;
      const { left, right, x } = chart.plot;
      const at = view.cursor ?? x.value((left + right) / 2);
      const step = (right - left) * KEY_STEP * (event.shiftKey ? 10 : 1);
      const to = (pixels) => view.seek(x.value(inside(pixels)));
      const actions = {
        ArrowLeft: () => to(x.position(at) - step),
        ArrowRight: () => to(x.position(at) + step),
        Home: () => to(left),
        End: () => to(right),
        '+': () => view.zoomAbout(at, 0.5),
        '=': () => view.zoomAbout(at, 0.5),
        '-': () => view.zoomAbout(at, 2),
        ',': () => view.pan(-0.25),
        '.': () => view.pan(0.25),
        0: () => view.reset(),
        Escape: () => view.reset(),
        Enter: () => chart.open(true),
      };
      const action = actions[event.key];
      if (!action || event.altKey || event.metaKey || event.ctrlKey) return;
      event.preventDefault();
      view.play(false);
      chart.setPointer(false);
      action();
      Masseter.say(chart.spoken());
    });
  };
}
