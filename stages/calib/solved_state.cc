#include "stages/calib/solved_state.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace mvstudio::stages {

using Eigen::Index;
using geometry::Rigid3;

std::vector<calib::Detection> KeptCorners(const calib::CalibrateReport& report) {
  std::map<std::tuple<int64_t, int, int>, std::vector<const calib::CornerResidual*>> kept;
  for (const calib::CornerResidual& corner : report.residuals)
    if (!corner.rejected) kept[{corner.frame_idx, corner.camera_idx, corner.board_idx}].push_back(&corner);
  std::vector<calib::Detection> detections;
  for (const auto& [place, corners] : kept) {
    calib::Detection detection;
    std::tie(detection.frame_idx, detection.camera_idx, detection.board_idx) = place;
    detection.points_px.resize(2, static_cast<Index>(corners.size()));
    for (const calib::CornerResidual* corner : corners) {
      detection.points_px.col(detection.num_corners()) = corner->px;
      detection.corner_ids.push_back(corner->corner_id);
    }
    detections.push_back(std::move(detection));
  }
  return detections;
}

std::map<int64_t, Rigid3> BoardPoses(const calib::CalibrateReport& report) {
  std::map<int64_t, Rigid3> poses;
  for (size_t f = 0; f < report.frames.size(); ++f) poses[report.frames[f]] = report.world_from_board[f];
  return poses;
}

SolvedState StateOf(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards,
                    const std::vector<calib::Detection>& detections, std::map<int64_t, Rigid3> world_from_board) {
  SolvedState solved;
  calib::RigState& state = solved.state;
  solved.views = calib::MakeViews(boards, detections, &state.frames);
  for (const int64_t frame : state.frames) state.world_from_board.push_back(world_from_board[frame]);
  for (size_t c = 0; c < report.rig.cameras.size(); ++c) {
    const geometry::Camera& lens = report.rig.cameras[c].camera;
    state.cameras.push_back(lens), state.cam_from_world.push_back(report.rig.cameras[c].cam_from_world);
    solved.options.fix_lens.push_back(report.cameras[c].lens_held);
    int group = static_cast<int>(c);
    for (int other = group - 1; other >= 0; --other)
      if (state.cameras[static_cast<size_t>(other)].params == lens.params) group = other;
    state.lens_group.push_back(group);
  }
  state.rig_from_board = report.rig_from_board, state.board_warp_m = report.board_warp_m;
  state.board_stretch = report.board_stretch;
  solved.options.refine_warp =
      std::any_of(state.board_warp_m.begin(), state.board_warp_m.end(), [](const auto& w) { return w.norm() > 0; });
  solved.options.refine_stretch = !state.board_stretch.empty();
  return solved;
}

bool IsWholeState(const calib::CalibrateReport& report) {
  const bool late = std::any_of(report.cameras.begin(), report.cameras.end(),
                                [](const calib::CameraReport& c) { return c.time_offset_frames != 0 || c.time_rate != 0; });
  return !late && !report.free_boards;
}

}  // namespace mvstudio::stages
