#include "avatar/nets/sequence.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <map>
#include <numeric>

#include "avatar/nets/generator.h"
#include "core/statistics.h"

namespace mvstudio::avatar {
namespace {

/// Rows of each camera by frame number.
std::map<int64_t, std::map<int64_t, int64_t>> RowsByCamera(const AvatarPack& pack) {
  std::map<int64_t, std::map<int64_t, int64_t>> rows;
  const int64_t *camera = pack.camera_idx.data_ptr<int64_t>(), *frame = pack.frame.data_ptr<int64_t>();
  for (int64_t i = 0; i < pack.size(); ++i) rows[camera[i]][frame[i]] = i;
  return rows;
}

int64_t UsualStep(const std::map<int64_t, std::map<int64_t, int64_t>>& cameras) {
  std::vector<int64_t> steps;
  for (const auto& [camera, rows] : cameras) {
    for (auto it = rows.begin(); it != rows.end() && std::next(it) != rows.end(); ++it)
      steps.push_back(std::next(it)->first - it->first);
  }
  return UpperMedian(std::move(steps), 1);
}

Rendering RenderRows(AvatarModel& model, const AvatarPack& pack, const std::vector<int64_t>& rows, const at::Tensor& previous) {
  return Render(model, PosesOf(pack, at::tensor(rows, at::kLong)), pack.size_px, pack.size_px, {}, previous);
}

/// Groups of rows in the order in which they can be rendered: every row's past is in an earlier group.
std::vector<std::vector<int64_t>> Waves(const std::vector<int64_t>& previous, int64_t batch) {
  std::vector<int64_t> depth(previous.size(), -1);
  const std::function<int64_t(int64_t)> depth_of = [&](int64_t row) {
    std::vector<int64_t> chain;
    while (row >= 0 && depth[row] < 0) chain.push_back(row), row = previous[row];
    int64_t d = row < 0 ? -1 : depth[row];
    for (size_t i = chain.size(); i-- > 0;) depth[chain[i]] = ++d;
    return d;
  };
  std::map<int64_t, std::vector<int64_t>> by_depth;
  for (size_t i = 0; i < previous.size(); ++i) {
    depth_of(static_cast<int64_t>(i));
    by_depth[depth[i]].push_back(static_cast<int64_t>(i));
  }
  std::vector<std::vector<int64_t>> waves;
  for (const auto& [d, rows] : by_depth) {
    for (size_t first = 0; first < rows.size(); first += static_cast<size_t>(batch))
      waves.emplace_back(rows.begin() + static_cast<int64_t>(first),
                         rows.begin() + static_cast<int64_t>(std::min(rows.size(), first + static_cast<size_t>(batch))));
  }
  return waves;
}

/// (B, 3 kNumPrevious, H, W) from what was rendered so far; black where there is no past.
at::Tensor PastOf(const std::vector<int64_t>& rows, const std::vector<int64_t>& previous, const at::Tensor& images) {
  std::vector<at::Tensor> batch;
  for (const int64_t row : rows) {
    std::vector<at::Tensor> past;
    int64_t before = row;
    for (int k = 0; k < kNumPrevious; ++k) {
      before = before < 0 ? -1 : previous[before];
      past.push_back(before < 0 ? at::zeros_like(images[0]) : images[before]);
    }
    batch.push_back(at::cat(past, 0));
  }
  return at::stack(batch);
}

/// True when another clip begins after frame `before` and not after frame `frame`.
bool CutBetween(const std::vector<int64_t>& cuts, int64_t before, int64_t frame) {
  const auto next = std::upper_bound(cuts.begin(), cuts.end(), before);
  return next != cuts.end() && *next <= frame;
}

}  // namespace

std::vector<int64_t> PreviousRows(const AvatarPack& pack) {
  const auto cameras = RowsByCamera(pack);
  const int64_t step = pack.frame_step > 0 ? pack.frame_step : UsualStep(cameras);
  std::vector<int64_t> previous(pack.size(), -1);
  for (const auto& [camera, rows] : cameras) {
    for (const auto& [frame, row] : rows) {
      const auto before = rows.find(frame - step);
      if (before != rows.end() && !CutBetween(pack.cuts, frame - step, frame)) previous[row] = before->second;
    }
  }
  return previous;
}

RenderedPack RenderPack(AvatarModel& model, const AvatarPack& pack, int64_t batch,
                        const std::function<void(int64_t)>& on_rendered) {
  const bool memory = NumPreviousChannels(model.options) > 0;
  const std::vector<int64_t> previous = memory ? PreviousRows(pack) : std::vector<int64_t>(pack.size(), -1);
  const int64_t n = pack.size(), size = pack.size_px;
  RenderedPack out{at::zeros({n, 3, size, size}), at::zeros({n, size, size})};
  for (const std::vector<int64_t>& rows : Waves(previous, std::max<int64_t>(1, batch))) {
    const Rendering rendering = RenderRows(model, pack, rows, memory ? PastOf(rows, previous, out.images) : at::Tensor());
    const at::Tensor index = at::tensor(rows, at::kLong);
    out.images.index_copy_(0, index, rendering.image);
    out.masks.index_copy_(0, index, rendering.mask_prob);
    if (on_rendered) on_rendered(static_cast<int64_t>(rows.size()));
  }
  return out;
}

}  // namespace mvstudio::avatar
