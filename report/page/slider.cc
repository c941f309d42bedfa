#include "report/page/slider.h"

namespace mvstudio::report {
namespace {

constexpr std::string_view kSliderScript = R"js((function () {
  'use strict';
  function part(image, name, width, left) {
    const frame = document.createElement('div'), copy = image.cloneNode();
    copy.alt = name;
    copy.style.width = 100 * width + '%';
    copy.style.left = -100 * left + '%';
    frame.append(copy);
    return frame;
  }
  // Square images have a narrow gap between them: what is left of the strip's width.
  function gapOf(width, height, count) {
    const gap = (width - count * height) / (count - 1);
    return gap >= 0 && gap < height / 8 ? gap : 0;
  }
  function put(before, left, right, names, aspect) {
    const box = document.createElement('div'), slider = document.createElement('input');
    box.className = 'compared';
    box.style.aspectRatio = aspect;
    box.append(left, right);
    slider.type = 'range';
    slider.min = '0';
    slider.max = '100';
    slider.value = '50';
    slider.setAttribute('aria-label', names[0] + ' left of the border, ' + names[1] + ' right of it');
    function move() { right.style.clipPath = 'inset(0 0 0 ' + slider.value + '%)'; }
    slider.addEventListener('input', move);
    move();
    before.before(box, slider);
  }
  for (const strip of document.querySelectorAll('.strip[data-compared]')) {
    const image = strip.querySelector('img'), names = Array.from(strip.querySelectorAll('.legend span'), function (name) { return name.textContent; });
    const width = Number(image.getAttribute('width')), height = Number(image.getAttribute('height'));
    const gap = gapOf(width, height, names.length), one = (width - gap * (names.length - 1)) / names.length;
    put(strip, part(image, names[0], width / one, 0), part(image, names[1], width / one, (one + gap) / one), names, one + ' / ' + height);
  }
  // Two images of two runs.
  for (const pair of document.querySelectorAll('.beside')) {
    const images = pair.querySelectorAll('img'), names = [pair.dataset.left, pair.dataset.right];
    const aspect = (images[0].getAttribute('width') || 1) + ' / ' + (images[0].getAttribute('height') || 1);
    put(pair, part(images[0], names[0], 1, 0), part(images[1], names[1], 1, 0), names, aspect);
  }
})();
)js";

}  // namespace

std::string_view SliderScript() { return kSliderScript; }

}  // namespace mvstudio::report
