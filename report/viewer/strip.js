// Residuals over time as coloured bars, in time or those first that ask for a look; each leads to a time step in it.
import { Color } from 'three/build/three.module.js';
import { element } from './element.js';

const HEIGHT = 26, GOOD_PX = 2, BAD_PX = 10;  // the same in every take, and on the page of `view`
const ORDERS = { all: 'all in time', worst: 'the worst first', missing: 'the most missing first', heldout: 'held out, the worst first' };  // as there

export class Strip {
  /** `heldOut`: [frame, SSIM] of what an avatar was scored on, the worst first. */
  constructor(people, heldOut, go) {
    this.people = people;
    this.go = go;
    const { spans } = people, known = spans.map((span) => span[2]).filter((v) => v !== null).sort((a, b) => a - b);
    this.most = Math.max(known.length > 0 ? known[Math.floor(0.98 * (known.length - 1))] : 0, GOOD_PX);
    this.ssim = new Map(heldOut.map(([frame, ssim]) => [people.stepOf(frame), ssim]).filter(([step], i) => people.frames[step] === heldOut[i][0]));
    this.canvas = element('canvas', { height: HEIGHT });
    this.here = element('i');
    const text = 'Residual over time: full height at ' + Number(this.most.toPrecision(2)) + '\u2009px; green up to ' + GOOD_PX + '\u2009px, orange from ' + BAD_PX + '\u2009px; grey from above: joints without a position. Click a bar to go there.';
    this.box = element('div', { class: 'timeline', role: 'slider', tabindex: '0', 'aria-label': 'Residual over time', 'aria-valuemin': '0', title: text, onclick: (event) => this.click(event), onkeydown: (event) => this.key(event) }, this.canvas, this.here);
    const orders = Object.keys(ORDERS).filter((how) => this.barsOf(how).length > 0);
    this.chooser = element('select', { onchange: () => { this.order(this.chooser.value); go(this.bars[0][1]); } }, ...orders.map((how) => element('option', { value: how }, ORDERS[how])));
    this.told = element('span');
    this.root = element('figure', {}, this.box, element('div', { class: 'bar' }, element('label', {}, 'Show ', this.chooser), this.told), element('figcaption', {}, text));
    this.order('all');
  }

  /** [place among the spans, time step that a click leads to] of each bar. */
  barsOf(how) {
    const { spans } = this.people, places = spans.map((span, i) => i), by = (k) => (a, b) => spans[b][k] - spans[a][k] || a - b;
    if (how === 'worst') return places.filter((i) => spans[i][2] !== null).sort(by(2)).map((i) => [i, spans[i][1]]);
    if (how === 'missing') return places.filter((i) => spans[i][3] > 0).sort(by(3)).map((i) => [i, spans[i][4]]);
    if (how === 'heldout') return Array.from(this.ssim.keys(), (step) => [this.spanOf(step), step]);
    return places.map((i) => [i, spans[i][1]]);
  }

  /** All in time where there is nothing of the asked kind. */
  order(how) {
    this.how = Array.from(this.chooser.options).some((option) => option.value === how) ? how : 'all';
    this.chooser.value = this.how;
    this.bars = this.barsOf(this.how);
    this.canvas.width = this.bars.length;
    this.box.setAttribute('aria-valuemax', String(this.bars.length - 1));
    if (this.theme) this.colour(this.theme);
  }

  spanOf(step) {
    let i = this.people.spans.length - 1;
    while (i > 0 && this.people.spans[i][0] > step) --i;
    return i;
  }

  /** The bar of a time step; -1: none. */
  barOf(step) {
    const exact = this.bars.findIndex((bar) => bar[1] === step);
    return exact >= 0 || this.how === 'heldout' ? exact : this.bars.findIndex((bar) => bar[0] === this.spanOf(step));
  }

  click(event) {
    const bounds = this.box.getBoundingClientRect(), count = this.bars.length;
    this.go(this.bars[Math.max(0, Math.min(count - 1, Math.floor((event.clientX - bounds.left) / bounds.width * count)))][1]);
  }

  key(event) {
    const by = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 }[event.key];
    if (!by) return;
    this.go(this.bars[Math.max(0, Math.min(this.bars.length - 1, this.barOf(this.step) + by))][1]);
    event.preventDefault();
    event.stopPropagation();
  }

  show(step) {
    this.step = step;
    const bar = this.barOf(step), [, , residual, missing] = this.people.spans[this.spanOf(step)], ssim = this.ssim.get(step);
    this.here.hidden = bar < 0;
    this.here.style.left = 100 * (this.how === 'all' ? (step + 0.5) / this.people.frames.length : (bar + 0.5) / this.bars.length) + '%';
    const words = 'frame ' + this.people.frames[step] + (residual === null ? '' : ', residual ' + residual + ' px') + ', ' + Math.round(100 * missing) + ' % missing' + (ssim === undefined ? '' : ', held out, SSIM ' + ssim.toFixed(3));
    this.told.textContent = words;
    this.box.setAttribute('aria-valuenow', String(Math.max(0, bar)));
    this.box.setAttribute('aria-valuetext', words);
  }

  colour(theme) {
    this.theme = theme;
    const draw = this.canvas.getContext('2d');
    draw.clearRect(0, 0, this.canvas.width, HEIGHT);
    this.bars.forEach(([place], i) => {
      const [, , residual, missing] = this.people.spans[place];
      const height = residual === null ? 0 : HEIGHT * (0.1 + 0.9 * Math.min(1, residual / this.most));
      draw.fillStyle = '#' + new Color(theme.good).lerp(new Color(theme.chosen), Math.max(0, Math.min(1, (residual - GOOD_PX) / (BAD_PX - GOOD_PX)))).getHexString();
      draw.fillRect(i, HEIGHT - height, 1, height);
      draw.fillStyle = theme.missing;
      draw.fillRect(i, 0, 1, HEIGHT * missing);
    });
  }
}
