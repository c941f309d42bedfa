#pragma once

#include <ATen/core/Tensor.h>

#include <functional>
#include <vector>

#include "avatar/data/pack.h"
#include "avatar/nets/model.h"

/// Pictures of one camera in the order of time, for methods that look at what they rendered before.
namespace mvstudio::avatar {

/// For each row of the pack the row of the same camera's frame before; -1 where there is none. Frames follow one another when
/// their numbers differ by the pack's usual step (the median).
std::vector<int64_t> PreviousRows(const AvatarPack& pack);

/// Renders every row of the pack, `batch` at a time: (N, 3, H, W) and (N, H, W) float32. Methods without memory take the
/// rows as they come; `v2v` goes from frame to frame, several cameras at a time, each beginning without a past.
struct RenderedPack {
  at::Tensor images, masks;
};
RenderedPack RenderPack(AvatarModel& model, const AvatarPack& pack, int64_t batch,
                        const std::function<void(int64_t)>& on_rendered = {});

}  // namespace mvstudio::avatar
