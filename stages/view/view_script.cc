#include "stages/view/view_page.h"

namespace mvstudio::stages {
namespace {

constexpr char kViewScript[] = R"js('use strict';
(function () {
  const el = function (id) { return document.getElementById(id); };
  const svgns = 'http://www.w3.org/2000/svg', strip = el('strip'), time = el('time');
  let scene = null, order = [], at = 0, camera = '', playing = null, asked = 0;

  const make = function (tag, words) { const e = document.createElement(tag); e.textContent = words || ''; return e; };
  const stepAt = function (i) { return scene.steps[order[i]]; };
  const most = function () { return scene.steps.reduce(function (m, s) { return Math.max(m, s[2]); }, 0); };

  // Median errors in px that are good and bad in every take: green up to the first, red from the second.
  const GOOD_PX = 2, BAD_PX = 10;

  // Grey where nothing is known.
  function colour(step) {
    if (step[1] === null) return step[2] > 0 || !scene.most ? '#8a939d' : '#00000000';
    const bad = Math.min(1, Math.max(0, (step[1] - GOOD_PX) / (BAD_PX - GOOD_PX)));
    return 'hsl(' + Math.round(130 * (1 - bad)) + ' 75% 45%)';
  }

  function sorted(how) {
    const all = scene.steps.map(function (s, i) { return i; }), key = function (i) { return scene.steps[i]; };
    if (how === 'worst') {
      return all.filter(function (i) { return key(i)[1] !== null; }).sort(function (a, b) { return key(b)[1] - key(a)[1] || a - b; });
    }
    if (how === 'missing') {
      return all.filter(function (i) { return key(i)[2] < scene.most; }).sort(function (a, b) { return key(a)[2] - key(b)[2] || a - b; });
    }
    if (how === 'heldout') {  // [3]: lowest SSIM, null: not known, -1: not held out
      const rank = function (i) { return key(i)[3] === null ? 2 : key(i)[3]; };
      return all.filter(function (i) { return key(i)[3] !== -1; }).sort(function (a, b) { return rank(a) - rank(b) || a - b; });
    }
    return all;
  }
  const FILTERS = ['worst', 'missing', 'heldout'];
  const MARKS = ['masks', 'body', 'boards'];

  function path(points, bones) {
    let d = '';
    bones.forEach(function (b) {
      const a = [points[2 * b[0]], points[2 * b[0] + 1]], c = [points[2 * b[1]], points[2 * b[1] + 1]];
      if (a[0] !== null && c[0] !== null && a[0] !== undefined && c[0] !== undefined)
        d += 'M' + (a[0] + 0.5) + ' ' + (a[1] + 0.5) + 'L' + (c[0] + 0.5) + ' ' + (c[1] + 0.5);
    });
    return d;
  }
  function dots(points) {
    let d = '';
    for (let j = 0; j + 1 < points.length; j += 2)
      if (points[j] !== null) d += 'M' + (points[j] + 0.5) + ' ' + (points[j + 1] + 0.5) + 'h0';
    return d;
  }
  function line(svg, cls, d) {
    if (!d) return;
    const p = document.createElementNS(svgns, 'path');
    p.setAttribute('class', cls);
    p.setAttribute('d', d);
    svg.appendChild(p);
  }
  // Lines of [x, y, x, y, …]; a corner that is not there parts them.
  function outline(lines, closed) {
    let d = '';
    lines.forEach(function (p) {
      let apart = true;
      for (let k = 0; k + 1 < p.length; k += 2) {
        if (p[k] === null) { apart = true; continue; }
        d += (apart ? 'M' : 'L') + (p[k] + 0.5) + ' ' + (p[k + 1] + 0.5);
        apart = false;
      }
      if (closed && p.length) d += 'Z';
    });
    return d;
  }
  function drawMarks(svg, marks) {
    if (el('body').checked) line(svg, 'body', outline(marks.body, true));
    if (el('masks').checked) line(svg, 'mask', outline(marks.mask, true));
    if (!el('boards').checked) return;
    line(svg, 'board', outline(marks.boards, false));
    line(svg, 'board x-axis', outline(marks.x_axes, false));
    line(svg, 'board y-axis', outline(marks.y_axes, false));
  }
  function drawing(view, info) {
    const svg = document.createElementNS(svgns, 'svg');
    svg.setAttribute('viewBox', '0 0 ' + info.width + ' ' + info.height);
    svg.setAttribute('aria-hidden', 'true');
    if (el('avatar').value === 'over') svg.setAttribute('class', 'clear');
    if (view.marks) drawMarks(svg, view.marks);
    if (el('show3d').checked) view.projected.forEach(function (p, i) {
      const d = path(p, scene.bones);
      line(svg, 'under', d);
      line(svg, 'bone' + (view.people[i] % 2 ? ' other' : ''), d);
      line(svg, 'dot' + (view.people[i] % 2 ? ' other' : ''), dots(p));
    });
    if (el('show2d').checked) view.detected.forEach(function (p) {
      line(svg, 'found', path(p, scene.detected_bones));
      line(svg, 'ring', dots(p));
    });
    if (el('arrows').checked) line(svg, 'arrow', view.residuals.map(function (r) { return path(r, [[0, 1]]); }).join(''));
    return svg;
  }
  function figure(view, c, step) {
    const info = scene.cameras[c], fig = make('figure'), box = make('div'), img = make('img');
    const how = el('avatar').value, second = how === 'beside' ? make('div') : null;
    const size = function () {
      [box].concat(second || []).forEach(function (b) {
        b.style.aspectRatio = info.width + ' / ' + info.height;
        if (camera) b.style.maxWidth = 'calc(82vh * ' + info.width / info.height + ')';
      });
    };
    box.tabIndex = 0;
    box.setAttribute('role', 'button');
    box.setAttribute('aria-label', info.name + (camera ? ': back to all cameras' : ': this camera alone'));
    const toggle = function () { camera = camera ? '' : info.name; go(at, true); };
    box.onclick = toggle;
    box.onkeydown = function (e) { if (e.key === 'Enter') { e.stopPropagation(); toggle(); } };
    const draw = function () {
      size();
      const old = box.querySelector('svg');
      if (old) old.remove();
      box.appendChild(drawing(view, info));
    };
    if (info.has_footage && view.frame !== null) {
      img.alt = '';
      img.onload = function () {
        if (!info.width) { info.width = img.naturalWidth; info.height = img.naturalHeight; }
        draw();
      };
      img.onerror = function () { img.remove(); box.appendChild(make('span', 'no image')).className = 'none'; };
      img.src = 'image/' + c + '/' + step + '.jpg';
      box.appendChild(img);
    } else if (info.has_footage) {
      box.appendChild(make('span', 'no frame of this time step')).className = 'none';
    }
    if (!info.width && !info.has_footage) { info.width = 16; info.height = 9; }
    if (info.width) draw();
    else [box].concat(second || []).forEach(function (b) { b.style.aspectRatio = '16 / 9'; });
    const words = [info.name];
    if (view.frame !== null && info.has_footage) words.push('frame ' + view.frame);
    if (view.median_px !== null) words.push('median residual ' + view.median_px.toFixed(1) + ' px');
    if (scene.joints.length && info.has_footage && view.projected.length === 0) words.push('nobody in 3D');
    const held = scene.held_out[step];
    if (held && held[info.name] !== undefined) words.push('held out' + (held[info.name] === null ? '' : ', SSIM ' + held[info.name].toFixed(3)));
    fig.append(box, make('figcaption', words.join(', ')));
    if (second) { fig.className = 'two'; fig.insertBefore(second, box.nextSibling); }
    fig.waits = [];
    if ((scene.scored[step] || []).indexOf(info.name) >= 0) {
      const scored = make('img');
      scored.alt = 'Scored: truth, render, error, nearest pose';
      scored.src = 'scored/' + c + '/' + step + '.jpg';
      scored.onerror = function () { scored.remove(); };
      fig.appendChild(scored);
      fig.waits.push(scored.decode().catch(function () {}));
    }
    if (how) fig.waits.push(addAvatar(second || box, c, step, how === 'over'));
    if (info.has_footage && view.frame !== null) fig.waits.push(img.decode().catch(function () {}));
    if (wantsMarks()) fig.waits.push(fetch('marks/' + c + '/' + step + '.json').then(function (r) {
      if (!r.ok) return r.text().then(function (words) { fig.querySelector('figcaption').textContent += ': ' + words; });
      return r.json().then(function (marks) { view.marks = marks; if (info.width) draw(); });
    }).catch(function () {}));
    return fig;
  }
  // Below the lines of the box.
  function addAvatar(box, c, step, over) {
    const img = make('img');
    img.alt = '';
    img.className = 'avatar';
    img.style.opacity = over ? el('opacity').value / 100 : 1;
    img.onerror = function () { img.remove(); };
    img.src = 'avatar/' + c + '/' + step + '.png';
    box.insertBefore(img, box.querySelector('svg'));
    return img.decode().catch(function () {});
  }
  function wantsMarks() {
    return MARKS.some(function (id) { return !el(id).parentElement.hidden && el(id).checked; });
  }

  function drawTime() {
    const width = time.clientWidth, height = 44, ratio = window.devicePixelRatio || 1, n = order.length;
    time.width = width * ratio;
    time.height = height * ratio;
    const g = time.getContext('2d');
    g.scale(ratio, ratio);
    const columns = Math.min(n, Math.max(1, Math.floor(width)));
    for (let x = 0; x < columns; ++x) {  // of the steps that share a column the worst
      let shown = null;
      for (let i = Math.floor(x * n / columns); i < Math.floor((x + 1) * n / columns); ++i)
        if (!shown || (stepAt(i)[1] || 0) > (shown[1] || 0)) shown = stepAt(i);
      const tall = shown[1] === null ? 0.25 : 0.15 + 0.85 * Math.min(1, shown[1] / scene.worst);
      g.fillStyle = colour(shown);
      g.fillRect(x * width / columns, height * (1 - tall), Math.max(1, width / columns - (columns < width / 3 ? 1 : 0)), height * tall);
    }
    g.fillStyle = '#2a7de1';
    g.fillRect((at + 0.5) * width / n - 1.5, 0, 3, height);
  }
  function drawStrip() {
    const room = Math.max(1, Math.floor((strip.clientWidth + 4) / 104)), n = order.length;
    const first = Math.max(0, Math.min(at - Math.floor(room / 2), n - room));
    let c = scene.cameras.findIndex(function (info) { return info.name === camera && info.has_footage; });
    if (c < 0) c = scene.cameras.findIndex(function (info) { return info.has_footage; });
    const kept = {};  // images that are there already stay, so that nothing flickers
    strip.querySelectorAll('img').forEach(function (img) { kept[img.getAttribute('src')] = img; });
    strip.replaceChildren();
    for (let i = first; i < Math.min(n, first + room); ++i) {
      const b = make('button'), step = stepAt(i), bar = make('i'), src = 'thumb/' + c + '/' + step[0] + '.jpg';
      const img = kept[src] || make('img');
      if (c >= 0) {
        img.alt = '';
        if (!kept[src]) img.src = src;
        img.onerror = function () { img.remove(); };
        b.appendChild(img);
      }
      bar.style.background = colour(step);
      const scored = el('filter').value === 'heldout' && step[3] !== null;
      const words = scored ? ': SSIM ' + step[3].toFixed(2) : step[1] === null ? '' : ': ' + step[1].toFixed(1) + ' px';
      b.append(bar, make('span', step[0] + words));
      b.type = 'button';
      if (i === at) b.setAttribute('aria-current', 'true');
      b.onclick = function () { go(i); };
      strip.appendChild(b);
    }
  }
  function describe(step) {
    const words = ['time step ' + step[0]];
    if (scene.fps_hz > 0) words.push((step[0] / scene.fps_hz).toFixed(2) + ' s');
    if (step[1] !== null) words.push('median error ' + step[1].toFixed(1) + ' px');
    if (scene.most) words.push(step[2] + ' of at most ' + scene.most + ' joints');
    if (step[3] !== -1) words.push(step[3] === null ? 'held out' : 'held out, SSIM from ' + step[3].toFixed(3));
    el('where').textContent = words.join(', ');
  }

  function go(i, anew) {
    if (!order.length) return;
    at = Math.max(0, Math.min(order.length - 1, i));
    const step = stepAt(at), ticket = ++asked, views = el('views');
    views.removeAttribute('data-step');  // there again once images and marks of a time step are all shown
    el('step').value = step[0];
    el('camera').value = camera;
    describe(step);
    drawTime();
    drawStrip();
    const hash = '#frame=' + step[0] + (camera ? '&camera=' + encodeURIComponent(camera) : '') +
      (el('filter').value === 'all' ? '' : '&show=' + el('filter').value);
    if (location.hash !== hash) history.replaceState(null, '', hash);
    return fetch('step/' + step[0] + '.json').then(function (r) { return r.json(); }).then(function (data) {
      if (ticket !== asked) return;
      views.className = camera ? 'one' : '';
      const shown = [];
      data.cameras.forEach(function (view, c) {
        if (!camera || scene.cameras[c].name === camera) shown.push(figure(view, c, step[0]));
      });
      const waits = [].concat.apply([], shown.map(function (f) { return f.waits; }));
      const swap = function () { if (ticket === asked) views.replaceChildren.apply(views, shown); };
      const soon = anew || !views.children.length;  // else the images before stay until these are there
      if (soon) swap();
      const all = Promise.all(waits).then(function () {
        if (!soon) swap();
        if (ticket === asked) views.setAttribute('data-step', step[0]);
      });
      if (!soon) return all;
    });
  }

  function tab(name) {
    const report = name === 'report';
    if (report && !el('report').src) el('report').src = 'report';
    el('report').hidden = !report;
    el('frames').hidden = report;
    el('where').hidden = report;
    el('tab-report').setAttribute('aria-pressed', String(report));
    el('tab-frames').setAttribute('aria-pressed', String(!report));
    if (report && playing) play();
  }
  function read() {
    const wants = location.hash === '#report' || (location.hash === '' && scene.has_report) || !scene.steps.length;
    tab(wants && scene.has_report ? 'report' : 'frames');
    if (wants && scene.has_report || !scene.steps.length) return;
    const words = new URLSearchParams(location.hash.slice(1)), step = Number(words.get('frame')), named = words.get('camera') || '';
    el('filter').value = FILTERS.indexOf(words.get('show')) < 0 ? 'all' : words.get('show');
    camera = scene.cameras.some(function (c) { return c.name === named; }) ? named : '';
    order = sorted(el('filter').value);
    if (!order.length) { el('filter').value = 'all'; order = sorted('all'); }
    const found = order.findIndex(function (i) { return scene.steps[i][0] >= step; });
    const exact = order.findIndex(function (i) { return scene.steps[i][0] === step; });
    go(words.has('frame') ? Math.max(0, exact >= 0 ? exact : el('filter').value === 'all' ? found : 0) : 0, true);
  }
  function play() {
    if (playing) { window.clearTimeout(playing); playing = null; }
    else {
      const next = function () {
        const begun = performance.now();
        Promise.resolve(go((at + 1) % order.length)).then(function () {
          if (playing) playing = window.setTimeout(next, Math.max(0, 1000 / (scene.fps_hz || 25) - (performance.now() - begun)));
        });
      };
      playing = window.setTimeout(next, 0);
    }
    el('play').setAttribute('aria-pressed', String(playing !== null));
    el('play').textContent = playing ? 'Stop' : 'Play';
  }

  document.addEventListener('keydown', function (e) {
    if (el('frames').hidden || !order.length) return;
    if (/^(INPUT|SELECT)$/.test(e.target.tagName) && e.target.type !== 'checkbox') return;
    if (e.key === ' ' && e.target.tagName === 'BUTTON') return;
    const far = e.shiftKey ? 10 : 1;
    if (e.key === 'ArrowLeft') go(at - far);
    else if (e.key === 'ArrowRight') go(at + far);
    else if (e.key === 'Home') go(0);
    else if (e.key === 'End') go(order.length - 1);
    else if (e.key === ' ') play();
    else if (e.key === 'Escape' && camera) { camera = ''; go(at, true); }
    else return;
    e.preventDefault();
  });
  const jump = function (e) {
    const box = time.getBoundingClientRect();
    go(Math.floor((e.clientX - box.left) / box.width * order.length));
  };
  time.onpointerdown = function (e) { time.setPointerCapture(e.pointerId); jump(e); };
  time.onpointermove = function (e) { if (e.buttons) jump(e); };
  el('before').onclick = function () { go(at - 1); };
  el('after').onclick = function () { go(at + 1); };
  el('play').onclick = play;
  el('controls').onsubmit = function (e) { e.preventDefault(); };
  el('step').onchange = function () {
    const wanted = Number(el('step').value);
    const i = order.findIndex(function (k) { return scene.steps[k][0] >= wanted; });
    go(i < 0 ? order.length - 1 : i);
  };
  el('camera').onchange = function () { camera = el('camera').value; go(at, true); };
  el('filter').onchange = function () {
    order = sorted(el('filter').value);
    if (!order.length) { el('filter').value = 'all'; order = sorted('all'); }
    go(0, true);
  };
  const showAvatar = function () {
    el('avatar').parentElement.hidden = !scene.has_avatar;
    el('opacity').parentElement.hidden = el('avatar').value !== 'over';
  };
  el('avatar').onchange = function () { showAvatar(); go(at, true); };
  el('opacity').oninput = function () {
    document.querySelectorAll('.avatar').forEach(function (img) { img.style.opacity = el('opacity').value / 100; });
  };
  ['show3d', 'show2d', 'arrows'].concat(MARKS).forEach(function (id) { el(id).onchange = function () { go(at, true); }; });
  window.addEventListener('hashchange', read);
  window.addEventListener('resize', function () { if (order.length) { drawTime(); drawStrip(); } });
  window.setInterval(function () { fetch('alive').catch(function () { el('where').textContent = 'mvstudio view has ended'; }); }, 2000);
  window.addEventListener('pagehide', function () { fetch('bye', {keepalive: true}); });

  fetch('scene.json').then(function (r) { return r.json(); }).then(function (data) {
    scene = data;
    scene.most = most();
    const errors = scene.steps.map(function (s) { return s[1]; }).filter(function (e) { return e !== null; }).sort(function (a, b) { return a - b; });
    scene.worst = errors.length ? Math.max(GOOD_PX, errors[Math.min(errors.length - 1, Math.floor(errors.length * 0.98))]) : 1;
    el('scale').textContent = 'Green: a median error up to ' + GOOD_PX + ' px. Red: from ' + BAD_PX + ' px. Grey: none known.';
    el('scale').hidden = !errors.length;
    el('title').textContent = document.title = scene.title;
    el('tabs').hidden = !scene.has_report;
    el('tab-report').onclick = function () { location.hash = '#report'; };
    el('tab-frames').onclick = function () { location.hash = scene.steps.length ? '#frame=' + scene.steps[0][0] : '#frames'; };
    el('tab-frames').disabled = !scene.steps.length;
    scene.cameras.forEach(function (info) { const o = make('option', info.name); o.value = info.name; el('camera').appendChild(o); });
    if (!scene.detected_joints.length) { ['show2d', 'arrows'].forEach(function (id) { el(id).parentElement.hidden = true; }); }
    MARKS.forEach(function (id) { el(id).parentElement.hidden = !scene['has_' + id]; });
    showAvatar();
    el('show3d').parentElement.hidden = !scene.joints.length;
    el('filter').querySelector('[value=worst]').hidden = !errors.length;
    el('filter').querySelector('[value=missing]').hidden = scene.steps.every(function (s) { return s[2] >= scene.most; });
    el('filter').querySelector('[value=heldout]').hidden = !Object.keys(scene.held_out).length;
    el('filter').parentElement.hidden = !el('filter').querySelector('option:not([value=all]):not([hidden])');
    if (!scene.steps.length) { el('where').textContent = 'No footage and no joints: nothing over time.'; el('controls').hidden = time.hidden = strip.hidden = true; }
    read();
  });
})();
)js";

}  // namespace

const char* ViewPageScript() { return kViewScript; }

}  // namespace mvstudio::stages
