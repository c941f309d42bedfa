#include "avatar/maps/spread_labels.h"

#include <vector>

namespace mvstudio::avatar {

void SpreadLabels(int64_t size_px, const uint8_t* mask, uint8_t* part, float* uv) {
  const int64_t size = size_px, area = size * size;
  const auto inside = [mask](int64_t p) { return !mask || mask[p] != 0; };
  std::vector<int64_t> queue;
  for (int64_t p = 0; p < area; ++p) {
    if (!inside(p)) part[p] = 0;
    if (part[p] != 0) queue.push_back(p);
    if (part[p] == 0) uv[p] = uv[area + p] = 0;
  }
  for (size_t head = 0; head < queue.size(); ++head) {
    const int64_t p = queue[head], x = p % size, y = p / size;
    const int64_t neighbours[4] = {x > 0 ? p - 1 : -1, x + 1 < size ? p + 1 : -1, y > 0 ? p - size : -1,
                                   y + 1 < size ? p + size : -1};
    for (const int64_t q : neighbours) {
      if (q < 0 || !inside(q) || part[q] != 0) continue;
      part[q] = part[p], uv[q] = uv[p], uv[area + q] = uv[area + p];
      queue.push_back(q);
    }
  }
}

}  // namespace mvstudio::avatar
