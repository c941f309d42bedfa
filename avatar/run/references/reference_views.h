#pragma once

#include <memory>
#include <string>
#include <vector>

#include "avatar/run/pack/training_set.h"
#include "core/image.h"
#include "geometry/rig/rig.h"

/// Training images whose details others take, warped over the body's surface (method `hf`).
namespace mvstudio::avatar {

struct ReferenceView {
  std::string camera;
  int frame = 0;
  geometry::RigCamera crop;                          ///< a pinhole
  std::shared_ptr<const Eigen::Matrix3Xf> vertices;  ///< (3, V) metres, world: the body in this image
  Image image;                                       ///< (H, W, 3)
  Image mask;                                        ///< (H, W, 1) 255: person
};

inline constexpr int kMostReferenceViews = 32;

/// At most kMostReferenceViews of a pack's images, spread evenly over cameras and frames. `views` as in TrainingSet. The pack
/// must hold training images alone.
std::vector<ReferenceView> SpreadReferenceViews(const AvatarPack& pack, const std::vector<RowView>& views);

/// `references.safetensors` (docs/formats.md). Reading throws IoError, or FormatError: for tensors that are missing, of other
/// sizes or not finite, for bodies of other than `num_vertices`, and for images of a camera or frame that `split` did not
/// train on.
void WriteReferenceViews(const std::vector<ReferenceView>& views, const std::string& path);
std::vector<ReferenceView> ReadReferenceViews(const std::string& path, const DatasetSplit& split, int64_t num_vertices);

}  // namespace mvstudio::avatar
