#include "stages/view/view_page.h"

namespace mvstudio::stages {

const char* ViewPageHtml() {
  return R"html(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>mvstudio view</title>
<link rel="icon" href="icon.svg">
<link rel="stylesheet" href="view.css">
</head>
<body>
<header>
<h1 id="title">Frames</h1>
<p id="where" role="status">Loading</p>
<p id="tabs" hidden><button id="tab-report" type="button">Report</button> <button id="tab-frames" type="button">Frames</button></p>
</header>
<iframe id="report" title="Report" sandbox="allow-scripts allow-downloads" hidden></iframe>
<main id="frames">
<form id="controls">
<button id="before" type="button" aria-label="Step back">&#9664;</button>
<button id="play" type="button" aria-pressed="false">Play</button>
<button id="after" type="button" aria-label="Step on">&#9654;</button>
<label>Step <input id="step" type="number" inputmode="numeric"></label>
<label>Show <select id="filter"><option value="all">all in time</option><option value="worst">the worst first</option>
<option value="missing">the most missing first</option><option value="heldout" hidden>held out, the worst first</option></select></label>
<label>Camera <select id="camera"><option value="">all side by side</option></select></label>
<label><input id="show3d" type="checkbox" checked> 3D joints</label>
<label><input id="show2d" type="checkbox" checked> 2D joints</label>
<label><input id="arrows" type="checkbox" checked> residuals</label>
<label hidden><input id="masks" type="checkbox" checked> masks</label>
<label hidden><input id="body" type="checkbox" checked> fitted body</label>
<label hidden><input id="boards" type="checkbox" checked> boards</label>
<label hidden>Avatar <select id="avatar"><option value="">not drawn</option><option value="over">over the image</option>
<option value="beside">beside it</option></select></label>
<label hidden>its opacity <input id="opacity" type="range" min="5" max="100" value="100"></label>
</form>
<canvas id="time" height="44" tabindex="0" aria-label="Error over time; click to go there"></canvas>
<p id="scale" hidden></p>
<nav id="strip" aria-label="Frames over time"></nav>
<div id="views"></div>
<details><summary>Keys</summary><p>Arrow keys: one step back or on; with Shift ten. Home, End: the first and the last. Space: play.
Click an image, or Enter on it: that camera alone; Escape: all of them. The address holds what you see: send it to point at a
frame.</p></details>
</main>
<script src="view.js"></script>
</body>
</html>
)html";
}

const char* ViewPageStyle() {
  return R"css(:root { color-scheme: light dark; font: 15px/1.4 system-ui, sans-serif; }
* { box-sizing: border-box; }
body { margin: 0; padding: 0.8rem 1rem 2rem; }
header { display: flex; flex-wrap: wrap; gap: 0.2rem 1rem; align-items: baseline; }
h1 { font-size: 1.25rem; margin: 0; overflow-wrap: anywhere; }
header p { margin: 0; }
iframe { width: 100%; height: 88vh; border: 1px solid #8886; margin-top: 0.5rem; background: Canvas; }
[hidden] { display: none !important; }
button[aria-pressed="true"] { outline: 2px solid #2a7de1; }
#controls { display: flex; flex-wrap: wrap; gap: 0.4rem 0.9rem; align-items: center; margin: 0.6rem 0; }
#controls input[type="number"] { width: 6rem; }
button, select, input { font: inherit; }
button { min-width: 2.4rem; min-height: 2.2rem; }
#time { display: block; width: 100%; height: 44px; border: 1px solid #8886; cursor: pointer; touch-action: none; }
#scale { margin: 0.1rem 0; font-size: 0.8rem; }
#strip { display: flex; gap: 4px; overflow: hidden; margin: 0.4rem 0; height: 78px; }
#strip button { flex: 0 0 auto; width: 100px; height: 76px; padding: 0; border: 2px solid transparent; background: #8883; position: relative;
  font-size: 0.75rem; overflow: hidden; cursor: pointer; }
#strip button[aria-current="true"] { border-color: #2a7de1; }
#strip img { position: absolute; inset: 0; width: 100%; height: 100%; object-fit: cover; }
#strip span { position: absolute; left: 0; bottom: 0; right: 0; background: #000b; color: #fff; padding: 0 4px; text-align: left; }
#strip i { position: absolute; left: 0; top: 0; right: 0; height: 5px; }
#views { display: grid; gap: 0.6rem; grid-template-columns: repeat(auto-fill, minmax(min(100%, 19rem), 1fr)); }
#views.one { grid-template-columns: 1fr; }
figure { margin: 0; min-width: 0; }
figure div { position: relative; background: #222; overflow: hidden; cursor: zoom-in; }
.one figure div { cursor: zoom-out; max-height: 82vh; margin: 0 auto; }
figure img, figure svg { position: absolute; inset: 0; width: 100%; height: 100%; }
figure > img { position: static; height: auto; }
figure.two { display: grid; grid-template-columns: 1fr 1fr; gap: 2px; }
.two div { width: 100%; } .two figcaption, .two > img { grid-column: 1 / -1; }
figcaption { font-size: 0.85rem; overflow-wrap: anywhere; padding: 0.15rem 0; }
.none { position: absolute; inset: 0; display: grid; place-items: center; color: #bbb; }
.under { fill: none; stroke: #000; stroke-opacity: 0.6; vector-effect: non-scaling-stroke; stroke-width: 4; }
.bone { fill: none; stroke: #35a7ff; vector-effect: non-scaling-stroke; stroke-width: 2; }
.other { stroke: #ffb52e; }
.dot { stroke: #35a7ff; vector-effect: non-scaling-stroke; stroke-width: 5; stroke-linecap: round; fill: none; }
.found { fill: none; stroke: #6dff8a; vector-effect: non-scaling-stroke; stroke-width: 1.4; }
.ring { stroke: #6dff8a; vector-effect: non-scaling-stroke; stroke-width: 6; stroke-linecap: round; fill: none; }
.arrow { fill: none; stroke: #ff4d3a; vector-effect: non-scaling-stroke; stroke-width: 2; }
.mask { fill: none; stroke: #fff; vector-effect: non-scaling-stroke; stroke-width: 1.6; }
.body { fill: #c480ff; fill-opacity: 0.22; fill-rule: evenodd; stroke: #c480ff; vector-effect: non-scaling-stroke; stroke-width: 1.6; }
.clear .body { fill: none; }
.board { fill: none; stroke: #ffd23f; vector-effect: non-scaling-stroke; stroke-width: 2; }
.x-axis { stroke: #ff4d3a; } .y-axis { stroke: #6dff8a; }
summary { cursor: pointer; margin-top: 0.8rem; }
)css";
}

const char* ViewPageIcon() {
  return R"svg(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><rect width="16" height="16" rx="3" fill="#0072b2"/>
<path d="M8 3v5l-4 5M8 8l4 5M4 6h8" stroke="#fff" stroke-width="1.6" fill="none"/></svg>
)svg";
}

}  // namespace mvstudio::stages
