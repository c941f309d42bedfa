// Colours of the page, light or dark, for what is drawn in 3D.
export function readTheme(root) {
  const style = getComputedStyle(root), colour = (name, other) => style.getPropertyValue(name).trim() || other;
  return {
    good: colour('--c2', '#009e73'), ground: colour('--card', '#f6f8fa'), camera: colour('--c0', '#0072b2'), chosen: colour('--c1', '#d55e00'), board: colour('--c4', '#c98500'), grid: colour('--rule', '#d8dee5'), missing: colour('--c6', '#6b7480'),
    people: ['--c2', '--c3', '--c5', '--c7', '--c4'].map((name) => colour(name, '#009e73')),
  };
}
