// Elements with plain texts: names of cameras and joints never become markup.
export function element(tag, attributes, ...content) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name.startsWith('on')) made.addEventListener(name.slice(2), value); else made.setAttribute(name, value);
  }
  made.append(...content);
  return made;
}

export function terms(pairs) {
  const list = element('dl');
  for (const [term, text] of pairs) if (text) list.append(element('dt', {}, term), element('dd', {}, text));
  return list;
}

const isNumber = (value) => typeof value === 'number' && Number.isFinite(value);
export const figure = (value, digits, unit) => (isNumber(value) ? value.toFixed(digits) + (unit ? '\u2009' + unit : '') : '');
/** Three significant digits. */
export const rounded = (value, unit) => (isNumber(value) ? Number(value.toPrecision(3)) + (unit ? '\u2009' + unit : '') : '');
