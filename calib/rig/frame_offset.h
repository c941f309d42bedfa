#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calib/bundle/view.h"
#include "calib/rig/frame_steps.h"

namespace mvstudio::calib {

struct FrameOffsetOptions {
  int max_shift = 60;    ///< frames; larger offsets between two cameras are not looked for
  int min_shared = 8;    ///< frames that two cameras must share for a verdict on them
  int max_frames = 120;  ///< at most so many shared frames of a pair are compared
};

/// Two cameras whose relative pose was compared over the frames they share.
struct FramePair {
  enum class Kind { kConsistent, kShifted, kInconsistent, kUndecided };
  Kind kind = Kind::kUndecided;
  int a = 0, b = 0;         ///< cameras, a < b
  int64_t shift = 0;        ///< b's frame f was taken with a's frame f + shift
  int num_shared = 0;       ///< frames compared at that shift
  double given_spread = 0;  ///< with the frames as given, see FindFrameOffsets
  double best_spread = 0;   ///< with `shift`
  double other_spread = 0;  ///< median over the other shifts: what unrelated frames give
  std::vector<FrameStep> steps;  ///< of kInconsistent: how the numbers run apart, see FindFrameSteps; empty: not known
};

struct FrameOffsets {
  enum class Kind {
    kConsistent,    ///< frames with the same number agree
    kShifted,       ///< `shift` makes them agree
    kInconsistent,  ///< no constant shift does: frames are missing or numbered by something else than time
    kUndecided,     ///< too few shared frames, or the board hardly moves
  };
  Kind kind = Kind::kUndecided;
  std::vector<int64_t> shift;    ///< per camera: frame_idx + shift is the instant; most cameras have 0
  std::vector<FramePair> pairs;  ///< that were compared
  std::string text, hint;        ///< one line each, empty for kConsistent and kUndecided
};

/// Were frames with the same number taken at the same time? A board that moves gives every pair of cameras the same relative
/// pose in every frame, but only when its two pictures belong together. The measure is the spread of the relative pose: the
/// median distance between the board's place in camera a, and where camera b and the pair's most central relative pose put it,
/// divided by the board's distance. It is found for every pair and shift of up to max_shift frames; the cameras' shifts make
/// the product of the spreads least. Numbers that run apart along the recording (FindFrameSteps) are inconsistent. Shifts other than 0 are believed when they make the spreads of the pairs that they change
/// at least 1.35 times smaller; a pair agrees when nine of ten of its frames keep within half of what unrelated frames give.
/// `cam_from_board[v]` belongs to views[v] and comes from that view alone; `frames` are the frame numbers of View::frame.
FrameOffsets FindFrameOffsets(const std::vector<View>& views, const std::vector<geometry::Rigid3>& cam_from_board,
                              const std::vector<int64_t>& frames, const std::vector<std::string>& camera_names,
                              const FrameOffsetOptions& options = {});

/// What a joint adjustment leaves of kInconsistent: lenses of a few views of one camera each may be too poor for the measure
/// above. A pair agrees after all when neither camera has lost more than half of a board (weight 0 in `views`, more in `prior`)
/// in nineteen of twenty that both see in a frame, and both are `explained` (per camera).
void Reconsider(const std::vector<View>& views, const std::vector<Eigen::VectorXd>& prior,
                const std::vector<std::string>& camera_names, const std::vector<bool>& explained, FrameOffsets* offsets);

/// Adds the shifts to the frame numbers.
void ApplyFrameOffsets(const FrameOffsets& offsets, std::vector<Detection>* detections);

}  // namespace mvstudio::calib
