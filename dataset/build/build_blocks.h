// Private: BuildCamera's images by blocks, which a build that was cut goes on with.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/image.h"
#include "dataset/build/build_camera.h"

namespace mvstudio::dataset::internal {

/// Frames of a camera that are kept together.
inline constexpr int64_t kBuildBlock = 300;

struct BuiltBlock {
  BuiltCamera built;   ///< counts of this block; mean_area_fraction is a sum
  bool ended = false;  ///< the footage holds no later frame
};

/// What the first pass over a camera's footage gives.
struct FootageSamples {
  std::vector<Image> frames;    ///< to learn the background from
  std::vector<int> time_steps;  ///< of each of them
  int width = 0, height = 0;
  std::vector<int> gaps;  ///< time steps with joints and no image, ascending
};

/// Kept beside the camera's blocks; nothing where there are none.
std::optional<FootageSamples> ReadKeptSamples(const CameraJob& job);
void KeepSamples(const FootageSamples& samples, const CameraJob& job);

/// KEPT/CAMERA-000012; empty where nothing is kept.
std::string BuiltBlockFolder(const CameraJob& job, int64_t block);

/// A block of an earlier build; nothing where there is none or where its files are not what was written.
std::optional<BuiltBlock> ReadBuiltBlock(const std::string& folder);

/// FOLDER/block.json.
void WriteBuiltBlock(const BuiltBlock& block, const std::string& folder);

/// Links the block's images and masks into the dataset that is being built; copies where the file system has no links.
void TakeBuiltBlock(const std::string& folder, const std::string& dataset);

/// What is kept of one build, while that has its output's lock.
class BlockKeeper {
 public:
  /// See BuildInputs::kept. Removes what a hidden `place` holds of other builds.
  BlockKeeper(const std::string& place, const std::string& key);

  /// What `build` returns. Where the build cannot be, nothing is kept; where it was cut, or the disk is full, all is.
  template <class Build>
  auto During(const Build& build) -> decltype(build()) {
    try {
      return build();
    } catch (const CancelledError&) {
      throw;
    } catch (const ResourceError&) {
      throw;
    } catch (const Error&) {
      Forget();
      throw;
    }
  }

  void Forget();

 private:
  std::string place_, key_;
  bool hidden_ = false;  ///< the place is of this output alone
};

void AddBlock(const BuiltCamera& block, BuiltCamera* built);

}  // namespace mvstudio::dataset::internal
