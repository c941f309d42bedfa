#pragma once

#include <ATen/core/Tensor.h>

#include <functional>
#include <vector>

#include "avatar/data/pack.h"
#include "avatar/nets/model.h"

/// Images of one camera in temporal order, for methods that use their previous renderings.
namespace mvstudio::avatar {

/// For each row of the pack, the row of the same camera's previous frame; -1 where there is none. Frames are consecutive
/// when their numbers differ by the pack's frame_step (0: by the usual step of its rows, the median) and no cut lies
/// between them.
std::vector<int64_t> PreviousRows(const AvatarPack& pack);

/// Renders every row of the pack, `batch` at a time: (N, 3, H, W) and (N, H, W) float32. Methods without memory take the
/// rows in order; `v2v` goes from frame to frame, several cameras at a time, each starting without previous images.
struct RenderedPack {
  at::Tensor images, masks;
};
RenderedPack RenderPack(AvatarModel& model, const AvatarPack& pack, int64_t batch,
                        const std::function<void(int64_t)>& on_rendered = {});

}  // namespace mvstudio::avatar
