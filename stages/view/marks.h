#pragma once

#include <map>
#include <string>
#include <vector>

#include "stages/view/mask_files.h"
#include "stages/view/outline.h"
#include "stages/view/scene.h"
#include "stages/view/solids.h"

namespace mvstudio::stages {

/// What is drawn over one camera's image beside its joints; px of the image.
struct ViewMarks {
  std::vector<OutlinePx> mask, body;              ///< closed lines
  std::vector<OutlinePx> boards, x_axes, y_axes;  ///< open lines; NaN where the lens does not see them
};

/// Masks, boards and bodies of a scene, read when they are asked for.
class MarksReader {
 public:
  /// `scene` outlives it.
  MarksReader(const Scene& scene, OverlaySolids solids) : scene_(scene), solids_(std::move(solids)) {}

  bool has_masks() const;
  bool has_body() const { return solids_.body.has_value(); }
  const OverlaySolids& solids() const { return solids_; }
  bool has_boards() const { return !solids_.boards.empty(); }
  /// Throws IoError, FormatError, UsageError.
  ViewMarks At(size_t camera_idx, int step);

 private:
  Image MaskAt(size_t camera_idx, int64_t frame);

  const Scene& scene_;
  OverlaySolids solids_;
  std::map<size_t, MaskFiles> masks_;  ///< of cameras that were asked for
};

}  // namespace mvstudio::stages
