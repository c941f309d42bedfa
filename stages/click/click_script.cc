#include "stages/click/click_page.h"

namespace mvstudio::stages {
namespace {

constexpr char kScript[] = R"js('use strict';
(function () {
  const el = function (id) { return document.getElementById(id); };
  const canvas = el('image'), draw2d = canvas.getContext('2d');
  let scene = null, fits = [], images = [], views = [], clicks = {}, camera = 0, point = 0, drag = null, sending = false, again = false;
  let known = {}, revision = 0, merged = false;  // what is saved, as this page saw it last

  const key = function (c, p) { return c + ':' + p; };
  const clickOf = function (p) { return clicks[key(camera, p)]; };
  const text = function (node, words) { node.textContent = words; return node; };
  const metres = function (value) { return String(Math.round(value * 1e4) / 1e4); };

  // A view maps the edge coordinates of the image (pixel centre + 0.5) to the canvas: shown = scale * u + shift.
  function wholeImage(c) {
    const info = scene.cameras[c], scale = Math.min(canvas.width / info.width, canvas.height / info.height);
    return {scale: scale, x: (canvas.width - scale * info.width) / 2, y: (canvas.height - scale * info.height) / 2};
  }
  function shown(px) {
    const v = views[camera];
    return [v.scale * (px[0] + 0.5) + v.x, v.scale * (px[1] + 0.5) + v.y];
  }
  function pixelAt(event) {
    const box = canvas.getBoundingClientRect(), v = views[camera], ratio = canvas.width / box.width;
    return [((event.clientX - box.left) * ratio - v.x) / v.scale - 0.5, ((event.clientY - box.top) * ratio - v.y) / v.scale - 0.5];
  }
  function inside(px) {
    const info = scene.cameras[camera];
    return px[0] >= -0.5 && px[1] >= -0.5 && px[0] <= info.width - 0.5 && px[1] <= info.height - 0.5;
  }

  function ring(px, radius, colour) {
    const at = shown(px);
    draw2d.strokeStyle = colour;
    draw2d.beginPath();
    draw2d.arc(at[0], at[1], radius, 0, 2 * Math.PI);
    draw2d.stroke();
    return at;
  }
  function cross(px, colour, label) {
    const at = shown(px), arm = 9, gap = 2;
    draw2d.strokeStyle = draw2d.fillStyle = colour;
    draw2d.beginPath();
    for (const d of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      draw2d.moveTo(at[0] + gap * d[0], at[1] + gap * d[1]);
      draw2d.lineTo(at[0] + arm * d[0], at[1] + arm * d[1]);
    }
    draw2d.stroke();
    draw2d.fillText(label, at[0] + arm, at[1] - arm);
  }
  function draw() {
    const v = views[camera], info = scene.cameras[camera], fit = fits[camera];
    draw2d.setTransform(1, 0, 0, 1, 0, 0);
    draw2d.clearRect(0, 0, canvas.width, canvas.height);
    draw2d.imageSmoothingEnabled = v.scale < 3;
    if (images[camera].naturalWidth > 0) draw2d.drawImage(images[camera], v.x, v.y, v.scale * info.width, v.scale * info.height);
    draw2d.lineWidth = 1.5;
    draw2d.font = '13px sans-serif';
    scene.points.forEach(function (info_of_point, p) {
      const click = clickOf(p), expected = fit.predicted[p], number = String(p + 1);
      const colour = fit.rejected.indexOf(p) >= 0 ? '#ff5040' : p === point ? '#40c0ff' : '#ffe040';
      if (click) cross(click, colour, number);
      if (expected && !click) {
        const at = ring(expected, 8, '#80ff80');
        draw2d.fillStyle = '#80ff80';
        draw2d.fillText(number, at[0] + 9, at[1] - 9);
      }
    });
  }

  function list() {
    const fit = fits[camera], items = el('points');
    items.replaceChildren();
    scene.points.forEach(function (info, p) {
      const item = document.createElement('li'), residual = fit.residuals[p], click = clickOf(p);
      let words = info.name;
      if (residual && residual[0] !== null) words += ': ' + Math.hypot(residual[0], residual[1]).toFixed(2) + ' px';
      else if (click) words += ': clicked';
      item.textContent = words;
      if (info.x !== null) item.appendChild(text(document.createElement('small'), [info.x, info.y, info.z].map(metres).join(', ') + ' m'));
      item.className = (p === point ? 'chosen ' : '') + (click ? 'clicked ' : '') + (fit.rejected.indexOf(p) >= 0 ? 'off' : '');
      item.addEventListener('click', function () { point = p; show(); });
      items.appendChild(item);
    });
  }
  function tabs() {
    const nav = el('cameras');
    nav.replaceChildren();
    scene.cameras.forEach(function (info, c) {
      const tab = text(document.createElement('button'), info.name + ' (' + fits[c].num_clicks + ')');
      tab.type = 'button';
      tab.setAttribute('aria-pressed', String(c === camera));
      tab.addEventListener('click', function () { camera = c; show(); });
      nav.appendChild(tab);
    });
  }
  function show() {
    const fit = fits[camera];
    let words = fit.message;
    if (fit.rms_px !== null) words = 'rms ' + fit.rms_px.toFixed(2) + ' px';
    if (fit.leave_one_out_px !== null) words += ', left-out points ' + fit.leave_one_out_px.toFixed(2) + ' px';
    text(el('fit'), words);
    tabs();
    list();
    draw();
  }

  // Takes over what is saved; what was changed here since `base` stays.
  function take(saved, base) {
    const own = clicks, same = function (a, b) { return a === b || (a && b && a[0] === b[0] && a[1] === b[1]); };
    known = {};
    for (const click of saved.clicks) known[key(click.camera, click.point)] = [click.x, click.y];
    clicks = Object.assign({}, known);
    for (const name of Object.keys(Object.assign({}, base, own))) {
      if (same(own[name], base[name])) continue;
      if (own[name]) clicks[name] = own[name]; else delete clicks[name];
    }
    revision = saved.revision;
    fits = saved.fits;
  }
  function countOf(n) { return n === 1 ? '1 click is' : n + ' clicks are'; }

  async function send() {
    if (sending) { again = true; return; }
    sending = true;
    const sent = Object.assign({}, clicks);
    const body = {revision: revision, clicks: Object.keys(sent).map(function (name) {
      const at = name.split(':').map(Number);
      return {camera: at[0], point: at[1], x: sent[name][0], y: sent[name][1]};
    })};
    try {
      const answer = await fetch('clicks.json', {method: 'POST', body: JSON.stringify(body), headers: {'Content-Type': 'application/json'}});
      if (answer.status === 409) merged = again = true;
      else if (!answer.ok) throw new Error(await answer.text());
      take(await answer.json(), answer.ok ? sent : known);
      if (answer.ok) {
        text(el('saved'), countOf(body.clicks.length) + ' saved.' + (merged ? ' Another page saved meanwhile: its clicks are here now.' : ''));
        merged = false;
      }
    } catch (error) {
      text(el('saved'), 'Not saved: ' + error.message);
    }
    sending = false;
    show();
    if (again) { again = false; send(); }
  }
  function set(px) {
    if (!inside(px)) return;
    clicks[key(camera, point)] = [Math.round(px[0] * 1000) / 1000, Math.round(px[1] * 1000) / 1000];
    show();
    send();
  }
  function nextFree() {
    for (let step = 1; step < scene.points.length; ++step) {
      const p = (point + step) % scene.points.length;
      if (!clickOf(p)) { point = p; return; }
    }
  }

  canvas.addEventListener('pointerdown', function (event) {
    drag = {x: event.clientX, y: event.clientY, moved: false};
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', function (event) {
    if (!drag) return;
    const ratio = canvas.width / canvas.getBoundingClientRect().width, dx = event.clientX - drag.x, dy = event.clientY - drag.y;
    if (!drag.moved && Math.hypot(dx, dy) < 4) return;
    drag = {x: event.clientX, y: event.clientY, moved: true};
    views[camera].x += ratio * dx;
    views[camera].y += ratio * dy;
    draw();
  });
  canvas.addEventListener('pointerup', function (event) {
    const moved = drag && drag.moved;
    drag = null;
    if (moved || event.button !== 0) return;
    set(pixelAt(event));
    nextFree();
    show();
  });
  canvas.addEventListener('wheel', function (event) {
    event.preventDefault();
    const at = pixelAt(event), v = views[camera], before = shown(at);
    v.scale = Math.min(Math.max(v.scale * Math.exp(-0.0015 * event.deltaY), 0.02), 80);
    const after = shown(at);
    v.x += before[0] - after[0];
    v.y += before[1] - after[1];
    draw();
  }, {passive: false});
  document.addEventListener('keydown', function (event) {
    if (!scene || event.ctrlKey || event.metaKey || event.altKey) return;
    const arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}, click = clickOf(point);
    const count = scene.points.length, name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (arrows[name] && click) {
      const step = event.shiftKey ? 1 : 0.1;
      set([click[0] + step * arrows[name][0], click[1] + step * arrows[name][1]]);
    } else if ((name === 'Delete' || name === 'Backspace') && click) {
      delete clicks[key(camera, point)];
      send();
    } else if (name === 'n') point = (point + 1) % count;
    else if (name === 'p') point = (point + count - 1) % count;
    else if (name === 'c') camera = (camera + 1) % scene.cameras.length;
    else if (name === 'f') views[camera] = wholeImage(camera);
    else return;
    event.preventDefault();
    show();
  });
  el('finish').addEventListener('click', async function () {
    try {
      await fetch('finish', {method: 'POST'});
      text(el('saved'), 'Finished: this page may be closed.');
      el('finish').disabled = true;
    } catch (error) {
      text(el('saved'), 'Not finished: ' + error.message);
    }
  });
  function fitCanvas() {
    const box = canvas.parentElement.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(box.width * ratio));
    canvas.height = Math.max(1, Math.round(box.height * ratio));
    views = scene.cameras.map(function (info, c) { return wholeImage(c); });
    show();
  }

  (async function () {
    scene = await (await fetch('scene.json')).json();
    take(scene, {});
    images = scene.cameras.map(function (info, c) {
      const image = new Image();
      image.addEventListener('load', draw);
      image.src = 'image/' + c + '.jpg';
      return image;
    });
    window.addEventListener('resize', fitCanvas);
    fitCanvas();
    document.body.setAttribute('data-ready', 'yes');
  })().catch(function (error) { text(el('saved'), 'The page cannot be filled: ' + error.message); });
})();
)js";

}  // namespace

const char* ClickPageScript() { return kScript; }

}  // namespace mvstudio::stages
