// Points of curves: unpacked, found by x, and thinned for the pixels of a screen.
{
  // The points of a series as two lists. The packed form is described beside `Points` in the crate.
  Masseter.points = (source) => {
    const xs = [], ys = [];
    if (Array.isArray(source)) {
      for (let at = 0; at < source.length; at += 2) { xs.push(source[at]); ys.push(source[at + 1]); }
      return { xs, ys };
    }
    const bytes = atob(source.packed);
    let number = 0, weight = 1, x = 0, y = 0, isX = true;
    for (let at = 0; at < bytes.length; at += 1) {
      const byte = bytes.charCodeAt(at);
      number += (byte & 0x7f) * weight;
      weight *= 128;
      if (byte & 0x80) continue;
      const difference = number % 2 ? -(number + 1) / 2 : number / 2;
      if (isX) { x += difference; } else { y += difference; xs.push(x * source.x_step); ys.push(source.y_from + y * source.y_step); }
      isX = !isX;
      number = 0;
      weight = 1;
    }
    return { xs, ys };
  };

  // The first place whose x is at least this one.
  Masseter.placeOf = (xs, x) => {
    let low = 0, high = xs.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (xs[middle] < x) low = middle + 1; else high = middle;
    }
    return low;
  };

  // The longest step of x that is no gap: points further apart than six usual steps are not joined.
  Masseter.longestStep = (xs) => {
    const every = Math.max(1, Math.floor(xs.length / 200)), steps = [];
    for (let at = every; at < xs.length; at += every) steps.push(xs[at] - xs[at - 1]);
    return steps.length < 8 ? Infinity : 6 * steps.sort((a, b) => a - b)[steps.length >> 1];
  };

  // The value at x, on the line between two points; none outside the curve and in its gaps.
  Masseter.valueAt = ({ xs, ys, step = Infinity }, x) => {
    if (!xs.length || x < xs[0] || x > xs[xs.length - 1]) return null;
    const after = Math.max(1, Masseter.placeOf(xs, x)), before = after - 1;
    if (after >= xs.length) return ys[xs.length - 1];
    if (xs[after] - xs[before] > step) return null;
    const share = xs[after] > xs[before] ? (x - xs[before]) / (xs[after] - xs[before]) : 1;
    return ys[before] + share * (ys[after] - ys[before]);
  };

  // Places of the points between two values of x, and of one point on either side.
  Masseter.within = (xs, [from, to]) => [
    Math.max(0, Masseter.placeOf(xs, from) - 1), Math.min(xs.length, Masseter.placeOf(xs, to) + 1)];

  // The points to draw between two values of x on so many pixels: all, or of each pixel the first, the lowest, the highest
  // and the last. Drawn with lines, both look alike: no extreme is lost, and flanks stay flanks.
  Masseter.thinned = ({ xs, ys }, window, position, pixels) => {
    const [first, end] = Masseter.within(xs, window);
    const places = [];
    if (end - first <= 4 * pixels) {
      for (let at = first; at < end; at += 1) places.push(at);
      return places;
    }
    for (let at = first; at < end;) {
      const pixel = Math.floor(position(xs[at]));
      let lowest = at, highest = at, last = at;
      const begin = at;
      for (; at < end && Math.floor(position(xs[at])) === pixel; at += 1) {
        if (ys[at] < ys[lowest]) lowest = at;
        if (ys[at] > ys[highest]) highest = at;
        last = at;
      }
      places.push(...[...new Set([begin, lowest, highest, last])].sort((a, b) => a - b));
    }
    return places;
  };
}
