#include "report/page/slider.h"

namespace mvstudio::report {
namespace {

constexpr std::string_view kSliderScript = R"js((function () {
  'use strict';
  function part(image, name, index, count) {
    const frame = document.createElement('div'), copy = image.cloneNode();
    copy.alt = name;
    copy.style.width = 100 * count + '%';
    copy.style.left = -100 * index + '%';
    frame.append(copy);
    return frame;
  }
  for (const strip of document.querySelectorAll('.strip[data-compared]')) {
    const image = strip.querySelector('img'), names = Array.from(strip.querySelectorAll('.legend span'), function (name) { return name.textContent; });
    const box = document.createElement('div'), slider = document.createElement('input');
    box.className = 'compared';
    box.style.aspectRatio = image.getAttribute('width') / names.length + ' / ' + image.getAttribute('height');
    box.append(part(image, names[0], 0, names.length), part(image, names[1], 1, names.length));
    slider.type = 'range';
    slider.min = '0';
    slider.max = '100';
    slider.value = '50';
    slider.setAttribute('aria-label', names[0] + ' left of the border, ' + names[1] + ' right of it');
    function move() { box.lastChild.style.clipPath = 'inset(0 0 0 ' + slider.value + '%)'; }
    slider.addEventListener('input', move);
    move();
    strip.before(box, slider);
  }
})();
)js";

}  // namespace

std::string_view SliderScript() { return kSliderScript; }

}  // namespace mvstudio::report
