#pragma once

#include <memory>
#include <vector>

#include "core/progress.h"
#include "triangulate/take/take.h"

/// TriangulateTake block by block, for points that are written and not kept.
namespace mvstudio::triangulate {

inline constexpr size_t kTakeBlockFrames = 500;

class TakeBlocks {
 public:
  /// Settles people, noise and method. Arguments and errors as of TriangulateTake; keeps references to `rig` and `frames`.
  /// `max_kept_frames`: at most so many, spread over the take, keep their points; at least 1.
  TakeBlocks(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
             const TakeOptions& options, const RunContext& run, size_t max_kept_frames);
  ~TakeBlocks();
  TakeBlocks(const TakeBlocks&) = delete;
  TakeBlocks& operator=(const TakeBlocks&) = delete;

  /// Points, observations, solve_s and num_persons of the frames that follow; false at the end.
  bool Next(TakeResult* block);
  /// What TriangulateTake gives, with the points of the kept frames; these judge the cameras.
  TakeResult Finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mvstudio::triangulate
