#pragma once

#include <string>
#include <vector>

#include "stages/view/mask_files.h"
#include "stages/view/scene.h"
#include "stages/view/solids.h"

/// The avatar as the cameras of a scene see it.
namespace mvstudio::stages {

/// Of each camera its images below a folder that `avatar render` with option 'frame' camera wrote, by time step; none of all
/// without a folder. Throws IoError, and UsageError that names `option` for a folder without images of any camera.
std::vector<FilesByNumber> ReadRenders(const Scene& scene, const std::string& folder, const std::string& option);

/// Renders where a folder of them is given, else the fitted body in its colours.
class AvatarView {
 public:
  /// `scene` and `solids` outlive it. `renders`: a folder, or empty. Throws as ReadRenders.
  AvatarView(const Scene& scene, const OverlaySolids& solids, const std::string& renders)
      : scene_(scene), solids_(solids), renders_(ReadRenders(scene, renders, "avatar")), has_renders_(!renders.empty()) {}

  bool any() const { return has_renders_ || solids_.colours.has_value(); }
  /// PNG; empty where there is none. Throws IoError, FormatError.
  std::string At(size_t camera_idx, int step) const;

 private:
  const Scene& scene_;
  const OverlaySolids& solids_;
  std::vector<FilesByNumber> renders_;  ///< of each camera
  bool has_renders_;
};

}  // namespace mvstudio::stages
