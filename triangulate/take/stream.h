#pragma once

#include <map>
#include <vector>

#include "triangulate/take/take.h"

/// For takes larger than memory: the same points, chunk by chunk.
namespace mvstudio::triangulate {

/// Determines from a sample of frames what TriangulateTake determines from the whole take (noise, method). `sample_result`
/// receives the result on the sample: its held-out figures and its judgement of the cameras represent the take.
TakeOptions SettleOptions(const geometry::Rig& rig, const std::vector<DetectedFrame>& sample, const TakeBody& body,
                          const TakeOptions& options, const RunContext& run, TakeResult* sample_result);

/// Triangulates a take in chunks of consecutive frames. Each chunk is solved together with the last frames of the previous
/// one, and persons are matched over these, so that they keep their numbers. A person who is out of view at the boundary
/// for longer than AssociationOptions::max_gap_frames gets a new number.
class TakeStream {
 public:
  /// `options` from SettleOptions.
  TakeStream(geometry::Rig rig, TakeBody body, TakeOptions options);

  /// Points of `frames`, which follow the frames pushed before. No held-out figures.
  TakeResult Push(const std::vector<DetectedFrame>& frames, const RunContext& run);

 private:
  using Joints = std::map<int, Eigen::Vector3d>;            // joint index -> position
  using Skeletons = std::map<std::pair<int, int>, Joints>;  // (frame, person)

  std::vector<int> NumberPersons(const TakeResult& result);
  void Remember(const std::vector<DetectedFrame>& frames, const TakeResult& result);

  geometry::Rig rig_;
  TakeBody body_;
  TakeOptions options_;
  std::vector<DetectedFrame> seam_;  ///< last frames of the previous chunk
  Skeletons seam_skeletons_;         ///< the people in them, by their final numbers
  int next_person_ = 0;
};

}  // namespace mvstudio::triangulate
