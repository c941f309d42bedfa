#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/bundle/view.h"
#include "calib/rig/frame_steps.h"

namespace mvstudio::calib {

struct FrameOffsetOptions {
  BoardTurns turns;      ///< views may be numbered from any end of the board, each by itself
  int max_shift = 60;    ///< frames; larger offsets between two cameras are not searched
  int min_shared = 8;    ///< minimum number of shared frames to judge a pair of cameras
  int max_frames = 120;  ///< maximum number of shared frames compared per pair
};

/// Two cameras whose relative pose was compared over the frames they share.
struct FramePair {
  enum class Kind { kConsistent, kShifted, kInconsistent, kUndecided };
  Kind kind = Kind::kUndecided;
  int a = 0, b = 0;         ///< cameras, a < b
  int64_t shift = 0;        ///< b's frame f was taken with a's frame f + shift
  int num_shared = 0;       ///< frames compared at that shift
  double given_spread = 0;  ///< spread with the frames as given, see FindFrameOffsets
  double best_spread = 0;   ///< spread with `shift`
  double most = 0;          ///< what nine of ten frames keep with `shift`
  double other_spread = 0;  ///< median spread over the other shifts: the level of unrelated frames
  bool moved = false;       ///< one of the cameras moved: up to three relative poses, one after the other, explain the frames
  std::vector<FrameStep> steps;  ///< of kInconsistent: drift of the numbers, see FindFrameSteps; empty: unknown
  bool steps_supported = false;  ///< FrameSteps::Supported
};

struct FrameOffsets {
  enum class Kind {
    kConsistent,    ///< frames with the same number agree
    kShifted,       ///< `shift` makes them agree
    kInconsistent,  ///< no constant shift does: frames are missing or not numbered by time
    kUndecided,     ///< too few shared frames, or the board hardly moves
  };
  Kind kind = Kind::kUndecided;
  std::vector<int64_t> shift;    ///< per camera: frame_idx + shift is the time step; 0 for most cameras
  std::vector<FramePair> pairs;  ///< pairs that were compared
  std::string text, hint;        ///< one line each, empty for kConsistent and kUndecided
};

/// Tests whether frames with the same number were taken at the same time. A moving board gives every pair of cameras the
/// same relative pose in every frame, but only if the two images were taken together.
///
/// The measure is the spread of the relative pose. It compares the board's position in camera a with the one predicted
/// from camera b by the pair's most central relative pose: the median of their distance, divided by the board's distance.
/// It is computed for every pair and every shift up to max_shift frames; the shifts per camera minimise the product of the
/// spreads.
///
/// Where one relative pose does not make a pair agree, up to three in a row are tried: a camera that moved while the boards
/// were filmed is no matter of time. Numbers that drift along the recording (FindFrameSteps) are inconsistent. Shifts other
/// than 0 are accepted if they make the spreads of the affected pairs at least 1.35 times smaller. A pair agrees when nine of
/// ten of its frames stay within half of the spread of unrelated frames.
///
/// With `turns` the numbering of the corners does not matter. `cam_from_board[v]` belongs to views[v] and comes from that view
/// alone; `frames` are the frame numbers of View::frame.
FrameOffsets FindFrameOffsets(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board,
                              const std::vector<int64_t>& frames, const std::vector<std::string>& camera_names,
                              const FrameOffsetOptions& options = {});

/// Revises kInconsistent after a joint adjustment, because lenses from a few views of a single camera may be too poor for
/// the measure above. A pair is consistent after all if both cameras are `explained` and, in nineteen of twenty views of
/// shared boards, neither has lost more than half of the corners. A lost corner has weight 0 in `views`, a positive one in the
/// initial weights `prior`, and lies 0.25 px or more from its projection (`residuals_px`, 2 x N a view): below that, corners
/// were rejected because the others are nearly perfect, and not for their time.
void Reconsider(const std::vector<View>& views, const std::vector<Eigen::VectorXd>& prior,
                const std::vector<Eigen::Matrix2Xd>& residuals_px, const std::vector<std::string>& camera_names,
                const std::vector<bool>& explained, FrameOffsets* offsets);

/// Adds the shifts to the frame numbers.
void ApplyFrameOffsets(const FrameOffsets& offsets, std::vector<Detection>* detections);

}  // namespace mvstudio::calib
