#include "stages/click/click_page.h"

namespace mvstudio::stages {

const char* ClickPageHtml() {
  return R"html(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>mvstudio calib click</title>
<link rel="stylesheet" href="click.css">
</head>
<body>
<aside>
<h1>Points with known places</h1>
<nav id="cameras" aria-label="Cameras"></nav>
<p id="fit" role="status"></p>
<ol id="points"></ol>
<p id="saved" role="status">Nothing to save.</p>
<button id="finish" type="button">Finish</button>
<details><summary>How</summary>
<p>Click a point in the image. Wheel: zoom; drag: move. Arrow keys move the chosen point by 0.1 px (with Shift 1 px), Delete takes
it back. N and P: next and previous point; C: next camera; F: the whole image. Rings show where the placed camera expects points
that are not clicked.</p></details>
</aside>
<main><canvas id="image" tabindex="0" aria-label="Image of the camera"></canvas></main>
<script src="click.js"></script>
</body>
</html>
)html";
}

const char* ClickPageStyle() {
  return R"css(:root { color-scheme: light dark; font: 15px/1.4 system-ui, sans-serif; }
body { margin: 0; display: flex; height: 100vh; }
aside { width: 19rem; padding: 0.8rem; overflow-y: auto; box-sizing: border-box; }
main { flex: 1; min-width: 0; background: #222; }
canvas { display: block; width: 100%; height: 100%; cursor: crosshair; touch-action: none; }
h1 { font-size: 1.05rem; margin: 0 0 0.6rem; }
nav { display: flex; flex-wrap: wrap; gap: 0.3rem; }
button { font: inherit; padding: 0.2rem 0.6rem; }
button[aria-pressed="true"] { outline: 2px solid #2a7de1; font-weight: 600; }
ol { padding-left: 2rem; }
li { cursor: pointer; padding: 0.1rem 0.3rem; }
li.chosen { outline: 2px solid #2a7de1; }
li.clicked::marker { font-weight: 700; }
li.off { color: #c22; }
li small { color: #777; display: block; }
)css";
}

}  // namespace mvstudio::stages
