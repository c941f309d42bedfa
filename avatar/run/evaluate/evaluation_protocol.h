#pragma once

#include <string>
#include <utility>
#include <vector>

#include "avatar/run/pack/run_config.h"
#include "dataset/panoptic/panoptic.h"

/// The conditions that must be equal for two scores to be comparable: method, nets and images of the evaluation. The
/// training of the avatar is not part of it.
namespace mvstudio::avatar {

inline constexpr char kProtocolSchema[] = "mvstudio.avatar-protocol/1";
inline constexpr char kProtocolFile[] = "protocol.json";

/// A net that scores depend on; sha256 empty where it has no weights, name empty for none.
struct ProtocolNet {
  std::string name, sha256;
};

/// Scored images of one split: (camera, frame) in order.
struct ProtocolSplit {
  std::string kind;  ///< "held-out cameras in held-out frames", …
  std::vector<std::pair<std::string, int>> images;
};

struct ProtocolInput {
  const dataset::PanopticDataset* data = nullptr;
  RunConfig config;  ///< crop and person
  int size_px = 0;   ///< of the crops that are compared
  ProtocolSplit holdout;
  std::vector<ProtocolSplit> other_splits;
  ProtocolNet features, lpips;
};

struct EvaluationProtocol {
  std::string sha256;     ///< of the canonical JSON (sorted keys, no blanks) of the member `protocol`
  std::string json_text;  ///< {"schema", "sha256", "protocol": {…}, "splits": {kind: {"pictures", "sha256"}}}
};

/// The dataset is represented by names and contents of the scored images and masks, the joints of their frames and the
/// calibration file, independent of its folder. `splits` is outside the protocol: training cameras are images of those
/// splits, so runs that share the protocol may differ there. Throws IoError when an image is missing.
EvaluationProtocol MakeProtocol(const ProtocolInput& input);

}  // namespace mvstudio::avatar
