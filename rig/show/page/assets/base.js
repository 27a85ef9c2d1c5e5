'use strict';
// What all scripts of the page share: the register of block builders, elements, and numbers as text.
const Masseter = { builders: {}, handles: new Map() };

// Registers how a kind of block is drawn: `build(element, data, clock)` fills the element and may return a handle with
// `append(series, points)` and `update(data)` for a run that goes on.
Masseter.block = (kind, build) => { Masseter.builders[kind] = build; };

{
  const SVG = 'http://www.w3.org/2000/svg';

  function fill(element, attributes, children) {
    for (const [name, value] of Object.entries(attributes || {})) {
      if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
      else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value === true ? '' : value);
    }
    element.append(...children.flat().filter((child) => child !== null && child !== undefined));
    return element;
  }

  // An HTML element with attributes, `on…` listeners and children.
  Masseter.element = (name, attributes, ...children) => fill(document.createElement(name), attributes, children);

  // The same in SVG.
  Masseter.svg = (name, attributes, ...children) => fill(document.createElementNS(SVG, name), attributes, children);

  // Text with `code` between backticks.
  Masseter.rich = (text) => String(text).split('`').map((part, at) => (at % 2 ? Masseter.element('code', {}, part) : part));

  // Thousands apart by a thin space, and a true minus.
  function grouped(digits) {
    const [, sign, whole, rest] = /^(-?)(\d+)(.*)$/.exec(digits) || [null, '', digits, ''];
    const groups = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, '\u202f') : whole;
    return (sign ? '\u2212' : '') + groups + rest;
  }

  // A number with so many decimals; never a negative zero.
  Masseter.fixed = (value, decimals) => {
    const text = value.toFixed(Math.max(0, Math.min(9, decimals)));
    return grouped(Number(text) === 0 ? text.replace('-', '') : text);
  };

  // A number with at most six significant digits, without zeros at its end.
  Masseter.short = (value) => grouped(String(Number(value.toPrecision(6))));

  const ruler = document.createElement('canvas').getContext('2d');
  // Width of a text in a drawing, px.
  Masseter.textWidth = (text, size = 12) => {
    ruler.font = `${size}px system-ui, sans-serif`;
    return ruler.measureText(text).width;
  };

  // A number with so many significant digits.
  Masseter.significant = (value, digits = 4) => {
    if (value === 0) return '0';
    const size = Math.floor(Math.log10(Math.abs(value)));
    if (size < -6 || size > 9) return value.toExponential(digits - 1);
    return Masseter.fixed(value, digits - 1 - size);
  };
}
