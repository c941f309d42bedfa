#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "avatar/run/pack/run_config.h"
#include "avatar/run/pretrain/pretrain_samples.h"
#include "stages/result.h"

/// The motions and bodies that a generic network learns from.
namespace mvstudio::stages {

/// A file or dataset whose poses are used.
struct MotionSource {
  std::string path;
  bool dataset = false;     ///< else an animation file
  std::vector<int> frames;  ///< used, learned from or held out
  int clips = 0, poses = 0, held_out = 0;
};

struct PretrainInput {
  avatar::PretrainSources sources;
  std::vector<MotionSource> motions;
  std::vector<std::string> templates;  ///< names
  /// Everything that is read, to be kept from being written to.
  std::vector<std::string> Paths() const;
};

/// `motion`: Biovision files and folders of them; `poses`: DATASET or DATASET:FRAMES, ranges of frames joined by a plus;
/// `templates`: as option 'template' of a fit. Lists with commas between. Throws UsageError, IoError, FormatError.
PretrainInput ReadPretrainInput(const std::string& motion, const std::string& poses, const std::string& templates,
                                int num_joints);

/// Path, frames and numbers of each source; paths are seen from `folder` where `relative`.
nlohmann::ordered_json ToJson(const std::vector<MotionSource>& motions, const std::string& folder, bool relative);

/// Digest of all poses and bodies.
std::string DigestOf(const avatar::PretrainSources& sources);

inline constexpr char kPretrainFile[] = "pretrain.json";

/// A warning where the network of a run was pretrained with poses of held-out or validation frames of the dataset that is now
/// trained on. Throws FormatError when kPretrainFile is damaged.
std::optional<Notice> SeenPoses(const std::string& run, const avatar::RunConfig& config);

}  // namespace mvstudio::stages
