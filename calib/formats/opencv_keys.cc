#include "calib/formats/opencv_keys.h"

namespace mvstudio::calib::internal {
namespace {

/// A name with the side behind it (M1, cameraMatrixL, camera_matrix_left), or before it (left_camera_matrix).
struct Sides {
  const char *first, *second;
  bool before = false;

  std::string Name(const std::string& word, const char* side) const { return before ? side + word : word + side; }
};
constexpr Sides kSides[] = {{"1", "2"},
                            {"left", "right"},
                            {"l", "r"},
                            {"0", "1"},
                            {"left", "right", true},
                            {"cam1", "cam2", true},
                            {"cam0", "cam1", true},
                            {"camera1", "camera2", true}};

bool IsMatrix(const Entries& entries, const std::string& key) {
  const auto found = entries.find(key);
  return found != entries.end() &&
         (found->second.value.kind == Value::Kind::kTable || found->second.value.kind == Value::Kind::kList);
}

}  // namespace

std::optional<StereoKeys> StereoKeysOf(const Entries& entries) {
  std::optional<StereoKeys> found;
  for (const char* word : {"m", "k", "cameramatrix", "intrinsicmatrix", "mtx", "cm", "cammatrix"}) {
    for (const Sides& sides : kSides) {
      StereoKeys keys{sides.Name(word, sides.first), "", sides.Name(word, sides.second), ""};
      if (!IsMatrix(entries, keys.matrix1) || !IsMatrix(entries, keys.matrix2)) continue;
      for (const char* distortion : kDistortionKeys) {
        const std::string first = sides.Name(distortion, sides.first);
        if (!IsMatrix(entries, first)) continue;
        return StereoKeys{keys.matrix1, first, keys.matrix2, sides.Name(distortion, sides.second)};
      }
      if (!found) found = keys;
    }
  }
  return found;
}

}  // namespace mvstudio::calib::internal
