// The time that all parts of the page share: the moment under the cursor, the stretch that charts show, and how times read.
// Times are seconds since the run's first SYNC.
{
  const MODES = ['motion', 'cycle', 'wall'];
  // A time axis in wall time has steps that a clock has.
  const WALL_STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600];

  // `moment`: the window around the stop of the run; none without one.
  Masseter.clock = (time, moment = null) => {
    const listeners = { cursor: [], window: [], mode: [], play: [], range: [] };
    const tell = (what) => listeners[what].forEach((listener) => listener());
    const began = time.wall_s ?? null;
    // What is shown around a moment: from so long before, to so long after, s.
    const AROUND = [0.05, 0.5];
    let range = [0, Math.max(time.end_s, 1e-3)], window = [...range], before = null;

    const clock = {
      time,
      moment,
      // The moment under the cursor; null without one.
      cursor: null,
      mode: 'motion',
      isPlaying: false,
      // The whole run, and the part of it that charts show.
      get range() { return range; },
      get window() { return window; },
      get isZoomed() { return window[0] > range[0] || window[1] < range[1]; },
      get modes() { return MODES.filter((mode) => mode !== 'wall' || began !== null); },
      // Calls `listener()` when the cursor, the window, the mode, the range or playing changes.
      on(what, listener) { listeners[what].push(listener); },

      // Moves the cursor.
      seek(at) {
        clock.cursor = at === null ? null : Math.min(range[1], Math.max(range[0], at));
        tell('cursor');
      },
      // Shows a stretch of time, at least five cycles of it.
      zoom(from, to) {
        const least = 5 * time.period_s, middle = (from + to) / 2;
        const [low, high] = to - from < least ? [middle - least / 2, middle + least / 2] : [from, to];
        const length = Math.min(high - low, range[1] - range[0]);
        const begin = Math.min(Math.max(low, range[0]), range[1] - length);
        window = [begin, begin + length];
        tell('window');
      },
      // Moves the cursor to a moment, and shows what was around it.
      look(at) { clock.play(false); clock.zoom(at - AROUND[0], at + AROUND[1]); clock.seek(at); },
      // Shows an earlier (below 0) or later stretch of the same length, by a share of the window.
      pan(share) { const by = share * (window[1] - window[0]); clock.zoom(window[0] + by, window[1] + by); },
      // Zooms about a moment that stays where it is.
      zoomAbout(at, factor) { clock.zoom(at - (at - window[0]) * factor, at + (window[1] - at) * factor); },
      reset() { window = [...range]; tell('window'); },
      // The run has gone on until then.
      extend(end) {
        if (end <= range[1]) return;
        const isWhole = !clock.isZoomed, follows = window[1] === range[1], length = window[1] - window[0];
        range = [range[0], end];
        tell('range');
        if (isWhole) clock.reset(); else if (follows) clock.zoom(end - length, end);
      },
      play(isPlaying) {
        if (clock.isPlaying === isPlaying) return;
        clock.isPlaying = isPlaying;
        before = null;
        if (isPlaying) requestAnimationFrame(step);
        tell('play');
      },
      setMode(mode) { clock.mode = mode; tell('mode'); },
      // When the motion began becomes known in a run that goes on.
      setMotion(at) { time.motion_s = at; tell('mode'); },

      // A time in the present mode: as a number, and as text with its unit.
      shown(at) {
        if (clock.mode === 'cycle') return at / time.period_s + 1;
        if (clock.mode === 'wall') return began + at;
        return at - (time.motion_s || 0);
      },
      text(at) {
        if (clock.mode === 'cycle') return `cycle ${Masseter.fixed(Math.round(clock.shown(at)), 0)}`;
        if (clock.mode === 'wall') return `${clock.wallText(clock.shown(at), 3)} UTC`;
        return `${Masseter.fixed(clock.shown(at), 3)} s`;
      },
      wallText(seconds, decimals) {
        return new Date(Math.round(seconds * 1000)).toISOString().slice(11, decimals ? 20 + Math.min(3, decimals) : 19);
      },
      // What the axis of time says.
      get label() {
        if (clock.mode === 'cycle') return 'cycle';
        if (clock.mode === 'wall') return 'time, UTC';
        return time.motion_s === null ? 'time since the first SYNC, s' : 'motion time, s';
      },
      // Room that a tick's text needs, px.
      get tickRoom() { return clock.mode === 'wall' ? 100 : 64; },
      // Ticks between two times.
      ticks([from, to], most) {
        const shift = clock.shown(0), scale = clock.mode === 'cycle' ? 1 / time.period_s : 1;
        const ends = [clock.shown(from), clock.shown(to)];
        const back = (tick) => ({ ...tick, value: (tick.value - shift) / scale });
        if (clock.mode !== 'wall') return Masseter.linearTicks(ends, most).map(back);
        const step = WALL_STEPS.find((wall) => (to - from) / wall <= most);
        if (to - from < most || !step) {
          return Masseter.linearTicks(ends, most).map(back).map((tick) => ({ ...tick, text: clock.wallText(tick.value + shift, 3) }));
        }
        const ticks = [];
        for (let at = Math.ceil(ends[0] / step) * step; at <= ends[1]; at += step) ticks.push({ value: at - shift, text: clock.wallText(at, 0) });
        return ticks;
      },
    };

    function step(now) {
      if (!clock.isPlaying) return;
      const from = clock.cursor === null ? window[0] : clock.cursor;
      const next = from + (before === null ? 0 : (now - before) / 1000);
      before = now;
      clock.seek(next > window[1] || next < window[0] ? window[0] : next);
      requestAnimationFrame(step);
    }
    return clock;
  };
}
