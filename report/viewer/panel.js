// What is known of the chosen camera or joint.
import { element, figure, rounded, terms } from './element.js';

const position = (at) => Array.from(at).map((v) => v.toFixed(3)).join(', ') + '\u2009m';

export function cameraPanel(camera, image, through) {
  const [fx, fy] = camera.lens, focal = (fx + fy) / 2, sigma = camera.focal_sigma_px;
  const parts = [element('h3', {}, camera.name)];
  if (image) parts.push(element('img', { alt: 'What ' + camera.name + ' saw', src: image }));
  parts.push(terms([
    ['lens', camera.model], ['image', camera.size.join(' \u00d7 ') + '\u2009px'],
    ['focal length', rounded(focal) && figure(focal, 1, '') + (sigma ? ' \u00b1 ' + rounded(sigma) : '') + '\u2009px'],
    ['field of view', rounded(camera.fov[0]) && figure(camera.fov[0], 0, '') + '\u00b0 \u00d7 ' + figure(camera.fov[1], 0, '') + '\u00b0'],
    ['reprojection RMS', rounded(camera.rms_px, 'px')], ['held-out RMS', rounded(camera.holdout_rms_px, 'px')],
    ['corners cover', camera.coverage === undefined ? '' : figure(100 * camera.coverage, 0, '%')], ['place', position(camera.at)],
  ]));
  for (const note of camera.notes || []) parts.push(element('p', { class: 'note' }, note));
  parts.push(element('button', { type: 'button', onclick: through }, 'Look through it'));
  return parts;
}

export function jointPanel(people, step, chosen, round) {
  const joint = people.joint(step, chosen.person, chosen.joint), name = people.joints[chosen.joint];
  const parts = [element('h3', {}, name + (people.ids.length > 1 ? ' of person ' + people.ids[chosen.person] : ''))];
  if (!joint) return parts.concat(element('p', {}, 'no position at frame ' + people.frames[step]));
  const mm = joint.sigma.map((s) => 1000 * s), all = Math.sqrt(mm.reduce((sum, s) => sum + s * s, 0) / 3);
  return parts.concat(terms([
    ['frame', String(people.frames[step])], ['\u03c3', rounded(all, 'mm')], ['\u03c3 along x, y, z', round ? '' : mm.map((s) => rounded(s)).join(', ') + '\u2009mm'],
    ['cameras', joint.views > 0 ? String(joint.views) : ''], ['residual', rounded(joint.residual, 'px')], ['place', position(joint.at)],
  ]));
}
