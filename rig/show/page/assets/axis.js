// Axes: where a value lies, and which values are labelled how.
{
  const STEPS = [1, 2, 5];

  // The smallest of 1, 2, 5, 10 … that divides a length into at most so many parts.
  function stepOf(length, most) {
    const power = 10 ** Math.floor(Math.log10(length / most));
    return [...STEPS, 10].map((step) => step * power).find((step) => length / step <= most * 1.0001);
  }

  const decimalsOf = (step) => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));

  // Evenly spaced ticks, each with its value and its text.
  Masseter.linearTicks = ([low, high], most) => {
    const step = stepOf(high - low || 1, most), decimals = decimalsOf(step), ticks = [];
    for (let number = Math.ceil(low / step - 1e-9); number * step <= high + step * 1e-9; number += 1) {
      const value = number * step;
      ticks.push({ value, text: decimals > 9 ? value.toExponential(2) : Masseter.fixed(value, decimals) });
    }
    return ticks;
  };

  // Powers of ten, and between them their double and fivefold where there are few powers.
  Masseter.logTicks = ([low, high], most) => {
    const [from, to] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
    const every = Math.max(1, Math.ceil((to - from) / most));
    const factors = (to - from) * 3 <= most + 2 ? STEPS : [1];
    const ticks = [];
    for (let power = Math.ceil(from / every) * every; power <= to; power += every) {
      for (const factor of factors) {
        const value = factor * 10 ** power;
        if (value >= low * 0.9999 && value <= high * 1.0001) ticks.push({ value, text: Masseter.fixed(value, -power) });
      }
    }
    // Less than a step between the ends: even steps serve as well.
    return ticks.length > 1 ? ticks : Masseter.linearTicks([low, high], most);
  };

  // Values are 1/(1 − quantile).
  Masseter.percentileTicks = ([low, high]) => {
    const nines = [[1, '0'], [2, '50'], [10, '90'], [100, '99'], [1e3, '99.9'], [1e4, '99.99'], [1e5, '99.999'],
      [1e6, '99.9999'], [1e7, '99.99999']];
    return nines.filter(([value]) => value >= low * 0.999 && value <= high * 1.001)
      .map(([value, text]) => ({ value, text: `${text} %` }));
  };

  // An axis from `ends` to `pixels`.
  Masseter.axis = (isLog, ends, pixels) => {
    const at = isLog ? Math.log10 : (value) => value;
    const back = isLog ? (position) => 10 ** position : (position) => position;
    const [low, high] = ends.map(at), [from, to] = pixels;
    const perUnit = (to - from) / (high - low || 1);
    return {
      ends,
      position: (value) => from + (at(value) - low) * perUnit,
      value: (pixel) => back(low + (pixel - from) / perUnit),
    };
  };
}
