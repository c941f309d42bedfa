// Residuals over time as coloured bars; each leads to the worst time step in it.
import { Color } from 'three/build/three.module.js';
import { element } from './element.js';

const HEIGHT = 26, GOOD_PX = 2, BAD_PX = 10;  // the same in every take, and on the page of `view`

export class Strip {
  constructor(people, go) {
    this.people = people;
    this.go = go;
    const { spans } = people, known = spans.map((span) => span[2]).filter((v) => v !== null).sort((a, b) => a - b);
    this.most = Math.max(known.length > 0 ? known[Math.floor(0.98 * (known.length - 1))] : 0, GOOD_PX);
    this.canvas = element('canvas', { width: spans.length, height: HEIGHT });
    this.here = element('i');
    const text = 'Residual over time: full height at ' + Number(this.most.toPrecision(2)) + '\u2009px; green up to ' + GOOD_PX + '\u2009px, orange from ' + BAD_PX + '\u2009px; grey from above: share of joints without a position. A click shows the worst time step there.';
    this.box = element('div', { class: 'timeline', role: 'slider', tabindex: '0', 'aria-label': 'Residual over time', 'aria-valuemin': '0', 'aria-valuemax': String(spans.length - 1), title: text, onclick: (event) => this.click(event), onkeydown: (event) => this.key(event) }, this.canvas, this.here);
    this.root = element('figure', {}, this.box, element('figcaption', {}, text));
  }

  spanOf(step) {
    let i = this.people.spans.length - 1;
    while (i > 0 && this.people.spans[i][0] > step) --i;
    return i;
  }

  click(event) {
    const bounds = this.box.getBoundingClientRect(), count = this.people.spans.length;
    const i = Math.max(0, Math.min(count - 1, Math.floor((event.clientX - bounds.left) / bounds.width * count)));
    this.go(this.people.spans[i][1]);
  }

  key(event) {
    const by = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 }[event.key];
    if (!by) return;
    const i = Math.max(0, Math.min(this.people.spans.length - 1, this.spanOf(this.step) + by));
    this.go(this.people.spans[i][1]);
    event.preventDefault();
    event.stopPropagation();
  }

  show(step) {
    this.step = step;
    const i = this.spanOf(step), [, , residual, missing] = this.people.spans[i];
    this.here.style.left = 100 * (step + 0.5) / this.people.frames.length + '%';
    this.box.setAttribute('aria-valuenow', String(i));
    this.box.setAttribute('aria-valuetext', 'frame ' + this.people.frames[step] + (residual === null ? '' : ', residual ' + residual + ' px') + ', ' + Math.round(100 * missing) + ' % missing');
  }

  colour(theme) {
    const draw = this.canvas.getContext('2d');
    draw.clearRect(0, 0, this.canvas.width, HEIGHT);
    this.people.spans.forEach(([, , residual, missing], i) => {
      const height = residual === null ? 0 : HEIGHT * (0.1 + 0.9 * Math.min(1, residual / this.most));
      draw.fillStyle = '#' + new Color(theme.good).lerp(new Color(theme.chosen), Math.max(0, Math.min(1, (residual - GOOD_PX) / (BAD_PX - GOOD_PX)))).getHexString();
      draw.fillRect(i, HEIGHT - height, 1, height);
      draw.fillStyle = theme.missing;
      draw.fillRect(i, 0, 1, HEIGHT * missing);
    });
  }
}
