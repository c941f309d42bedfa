#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "calib/board/board.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {

/// Board poses of a camera, cam_from_board, by (frame, board).
using BoardPoses = std::map<std::pair<int64_t, int>, geometry::Rigid3>;

/// The ways in which a board's corners may be numbered. Where there are several, its place is that of its middle, about which a
/// turned numbering turns its pose.
struct BoardTurns {
  int num = 1;                         ///< 1, 2 or 4 turns after which the board looks the same
  geometry::Rigid3 board_from_middle;  ///< identity for 1

  /// a_from_b by one observation in both cameras (cam_from_middle), if b numbers the board by turn k otherwise than a.
  geometry::Rigid3 RelativePose(const geometry::Rigid3& in_a, const geometry::Rigid3& in_b, int k) const;
};

/// The turns in which a detector may number these boards.
BoardTurns TurnsOf(const std::vector<Board>& boards);

/// From this frame of camera b on, frame f of b was taken with frame f + shift of camera a.
struct FrameStep {
  int64_t frame = 0, shift = 0;
  int64_t last_before = 0;  ///< the last frame of b that surely came before; frames in between may belong to either side
  int num_frames = 0;       ///< of b, from `frame` to the next step
  int num_agreeing = 0;     ///< those whose board is where the shift puts it
};

struct FrameSteps {
  std::vector<FrameStep> steps;  ///< the first of them at b's first frame; empty: none
  double most = 0;               ///< what nine of ten frames keep: the board's distance from its place over its distance

  /// Whether the frames of every step bear it out, most of them and six or more.
  bool Supported() const;
};

constexpr int kNearShifts = 6, kFarShifts = 60;  ///< frames

/// Detects frame numbers of b that drift against a's along the recording, as with dropped or repeated frames or a drifting
/// clock. Searches all sequences of shifts within `reach` frames of `base_shift` by dynamic programming, with all relative
/// poses of the two cameras that single frames give. Each change of the shift costs 8 nats. Returns the steps of the
/// sequence that explains the board positions best. None unless it gains 15 nats over one constant shift.
FrameSteps FindFrameSteps(const BoardPoses& a, const BoardPoses& b, int64_t base_shift, const BoardTurns& turns, int reach);

}  // namespace mvstudio::calib
