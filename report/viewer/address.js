// The state of the view in the address: #frame=120&camera=cam_03

function triple(text) {
  const numbers = (text || '').split(',').map(Number);
  return text && numbers.length === 3 && numbers.every(Number.isFinite) ? numbers : null;
}

/** Nothing for the address of a section. */
export function readState(hash) {
  if (!hash.includes('=')) return null;
  const given = new URLSearchParams(hash.slice(1)), frame = given.get('frame');
  return { frame: frame !== null && frame !== '' && Number.isFinite(Number(frame)) ? Number(frame) : null, camera: given.get('camera'), show: given.get('show'), joint: given.get('joint'), eye: triple(given.get('eye')), look: triple(given.get('look')) };
}

export function writeState(state) {
  const kept = new URLSearchParams();
  for (const key of ['frame', 'camera', 'joint', 'show']) if (state[key] !== null) kept.set(key, String(state[key]));
  for (const key of ['eye', 'look']) kept.set(key, state[key].map((v) => Number(v.toPrecision(4))).join(','));
  try {
    history.replaceState(null, '', '#' + kept.toString().replace(/%2C/g, ','));
  } catch (error) {
    // a page inside another one may not change its address; the view works all the same
  }
}
