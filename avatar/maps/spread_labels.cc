#include "avatar/maps/spread_labels.h"

namespace mvstudio::avatar {

std::vector<int64_t> NearestPixels(int64_t height, int64_t width, const uint8_t* mask, const uint8_t* from) {
  const int64_t area = height * width;
  const auto inside = [mask](int64_t p) { return !mask || mask[p] != 0; };
  std::vector<int64_t> nearest(area, -1), queue;
  queue.reserve(area);
  for (int64_t p = 0; p < area; ++p) {
    if (!inside(p) || from[p] == 0) continue;
    nearest[p] = p;
    queue.push_back(p);
  }
  for (size_t head = 0; head < queue.size(); ++head) {
    const int64_t p = queue[head], x = p % width, y = p / width;
    const int64_t neighbours[4] = {x > 0 ? p - 1 : -1, x + 1 < width ? p + 1 : -1, y > 0 ? p - width : -1,
                                   y + 1 < height ? p + width : -1};
    for (const int64_t q : neighbours) {
      if (q < 0 || !inside(q) || nearest[q] >= 0) continue;
      nearest[q] = nearest[p];
      queue.push_back(q);
    }
  }
  return nearest;
}

void SpreadLabels(int64_t size_px, const uint8_t* mask, uint8_t* part, float* uv) {
  const int64_t area = size_px * size_px;
  const std::vector<int64_t> nearest = NearestPixels(size_px, size_px, mask, part);
  for (int64_t p = 0; p < area; ++p) {
    const int64_t from = nearest[p];
    if (from == p) continue;  // labels that others take are not touched
    part[p] = from < 0 ? 0 : part[from];
    for (float* channel : {uv, uv + area}) channel[p] = from < 0 ? 0 : channel[from];
  }
}

}  // namespace mvstudio::avatar
