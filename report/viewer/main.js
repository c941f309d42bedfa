// The studio in 3D: brings every element of class `studio` to life. Without WebGL the text in it stays.
import { Studio } from './studio.js';

const contextOf = (canvas, options) => canvas.getContext('webgl2', options) || canvas.getContext('webgl', options);

/** Whether the processor draws: smoothed edges would then halve the rate. */
function isSoftware() {
  const probe = contextOf(document.createElement('canvas'), {}), told = probe && probe.getExtension('WEBGL_debug_renderer_info');
  const name = told ? String(probe.getParameter(told.UNMASKED_RENDERER_WEBGL)) : '';
  const lose = probe && probe.getExtension('WEBGL_lose_context');
  if (lose) lose.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

for (const root of document.querySelectorAll('.studio[data-scene]')) {
  const canvas = document.createElement('canvas'), context = contextOf(canvas, { antialias: !isSoftware(), alpha: false });
  if (!context) continue;
  new Studio(root, canvas, context);
  // Its drawings are for those who have no view in 3D, and for paper.
  for (const drawn of document.querySelectorAll('details.drawn')) {
    drawn.open = false;
    addEventListener('beforeprint', () => { drawn.open = true; });
  }
}
