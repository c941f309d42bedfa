// Residuals over time as coloured cells; each leads to the worst time step in it.
import { element } from './element.js';

const HEIGHT = 26;

export class Strip {
  constructor(people, go) {
    this.people = people;
    this.go = go;
    const { spans } = people, known = spans.map((span) => span[2]).filter((v) => v !== null).sort((a, b) => a - b);
    const at = (share) => (known.length > 0 ? known[Math.floor(share * (known.length - 1))] : 0);
    this.least = at(0.02);
    this.most = Math.max(at(0.98), 1.2 * this.least, 1e-3);
    this.canvas = element('canvas', { width: spans.length, height: HEIGHT });
    this.here = element('i');
    const text = 'Residual over time: pale at ' + Number(this.least.toPrecision(2)) + '\u2009px, full at ' + Number(this.most.toPrecision(2)) + '\u2009px and above; grey from below: share of joints without a position. A click shows the worst time step there.';
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
      draw.globalAlpha = residual === null ? 0 : 0.08 + 0.92 * Math.max(0, Math.min(1, (residual - this.least) / (this.most - this.least)));
      draw.fillStyle = theme.chosen;
      draw.fillRect(i, 0, 1, HEIGHT);
      draw.globalAlpha = 1;
      draw.fillStyle = theme.missing;
      draw.fillRect(i, HEIGHT * (1 - missing), 1, HEIGHT * missing);
    });
  }
}
