// The studio in 3D: brings every element of class `studio` to life. Without WebGL the text in it stays.
import { Studio } from './studio.js';

for (const root of document.querySelectorAll('.studio[data-scene]')) {
  const canvas = document.createElement('canvas');
  const context = canvas.getContext('webgl2', { antialias: true }) || canvas.getContext('webgl', { antialias: true });
  if (context) new Studio(root, canvas, context);
}
