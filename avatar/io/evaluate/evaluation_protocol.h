#pragma once

#include <string>
#include <utility>
#include <vector>

#include "avatar/io/pack/run_config.h"
#include "dataset/panoptic/panoptic.h"

/// What must be equal before two scores may be compared: how, with what and on which pictures they were taken. How the avatar
/// was trained is no part of it.
namespace mvstudio::avatar {

inline constexpr char kProtocolSchema[] = "mvstudio.avatar-protocol/1";
inline constexpr char kProtocolFile[] = "protocol.json";

/// A net that scores depend on; sha256 empty where it has no weights, name empty for none.
struct ProtocolNet {
  std::string name, sha256;
};

/// Pictures of one split as they were scored: (camera, frame) in order.
struct ProtocolSplit {
  std::string kind;  ///< "held-out cameras in held-out frames", …
  std::vector<std::pair<std::string, int>> pictures;
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

/// Names and contents of the scored pictures and masks, the joints of their frames and the calibration file stand for the
/// dataset, wherever it lies. `splits` is beside the protocol: training cameras are pictures of those splits, so runs that
/// share the protocol may differ there. Throws IoError when a picture is missing.
EvaluationProtocol MakeProtocol(const ProtocolInput& input);

}  // namespace mvstudio::avatar
