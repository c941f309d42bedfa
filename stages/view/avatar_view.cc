#include "stages/view/avatar_view.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/session/session.h"

namespace mvstudio::stages {
namespace {

constexpr int kLongerSidePx = 1280;  // of a body in its colours

}  // namespace

std::vector<FilesByNumber> ReadRenders(const Scene& scene, const std::string& folder, const std::string& option) {
  std::vector<FilesByNumber> renders(scene.cameras.size());
  if (folder.empty()) return renders;
  std::error_code none;
  if (!std::filesystem::is_directory(folder, none)) throw IoError(folder, "is no folder that is there");
  for (size_t c = 0; c < renders.size(); ++c) {
    const std::string of_camera = folder + "/" + dataset::Slug(scene.cameras[c].name);
    if (std::filesystem::is_directory(of_camera, none)) renders[c] = NumberedFiles(dataset::ListFootage(of_camera));
  }
  if (std::all_of(renders.begin(), renders.end(), [](const auto& files) { return files.empty(); }))
    throw UsageError("option '" + option + "' " + folder + ": has no folder CAMERA of images for any of " +
                     std::to_string(scene.cameras.size()) +
                     " cameras; make one by mvstudio avatar render with option 'frame' camera");
  return renders;
}

std::string AvatarView::At(size_t camera_idx, int step) const {
  const SceneCamera& camera = scene_.cameras.at(camera_idx);
  Image image;
  if (has_renders_) {
    const auto render = renders_[camera_idx].find(step);
    if (render != renders_[camera_idx].end()) image = dataset::ReadImageWithAlpha(render->second);
  } else if (solids_.colours && camera.rig_idx >= 0) {
    const geometry::RigCamera& placed = scene_.rig.cameras[static_cast<size_t>(camera.rig_idx)];
    image = BodyInColours(*solids_.colours, SolidsAt(solids_, step).vertices, placed, kLongerSidePx);
  }
  return image.empty() ? "" : dataset::EncodeImage(image, "avatar.png");
}

}  // namespace mvstudio::stages
