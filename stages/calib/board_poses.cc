#include "stages/calib/board_poses.h"

#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <utility>

#include "core/format.h"

namespace mvstudio::stages {
namespace {

struct Seen {
  std::set<int> cameras;
  int num_corners = 0;
  double squares = 0;
};

using Place = std::pair<int64_t, int>;  // frame, board

std::map<Place, Seen> SeenBoards(const calib::CalibrateReport& report) {
  std::map<Place, Seen> all;
  for (const calib::CornerResidual& corner : report.residuals) {
    Seen& seen = all[{corner.frame_idx, corner.board_idx}];
    if (corner.rejected) continue;
    seen.cameras.insert(corner.camera_idx), ++seen.num_corners, seen.squares += corner.residual_px.squaredNorm();
  }
  return all;
}

/// The poses by frame and board. Boards of their own (SeparateBoards) stand board by board.
std::map<Place, geometry::Rigid3> PosesOf(const calib::CalibrateReport& report, const std::map<Place, Seen>& seen) {
  std::map<Place, geometry::Rigid3> poses;
  if (report.free_boards) {
    std::set<std::pair<int, int64_t>> order;
    for (const auto& [place, unused] : seen) order.insert({place.second, place.first});
    if (order.size() != report.world_from_board.size()) return poses;
    size_t at = 0;
    for (const auto& [board, frame] : order) poses[{frame, board}] = report.world_from_board[at++];
    return poses;
  }
  std::map<int64_t, size_t> index;
  for (size_t f = 0; f < report.frames.size() && f < report.world_from_board.size(); ++f) index[report.frames[f]] = f;
  for (const auto& [place, unused] : seen) {
    const auto found = index.find(place.first);
    const auto board = static_cast<size_t>(place.second);
    if (found == index.end()) continue;
    const geometry::Rigid3& world_from_first = report.world_from_board[found->second];
    poses[place] = board < report.rig_from_board.size() ? world_from_first * report.rig_from_board[board] : world_from_first;
  }
  return poses;
}

}  // namespace

std::string BoardPosesCsv(const calib::CalibrateReport& report) {
  if (report.components.empty()) return "";
  const std::map<Place, Seen> all = SeenBoards(report);
  std::string rows;
  for (const auto& [place, pose] : PosesOf(report, all)) {
    const Seen& seen = all.at(place);
    if (seen.num_corners == 0) continue;
    const Eigen::Vector3d& t = pose.translation;
    const Eigen::Quaterniond& q = pose.rotation;
    rows += Format("%lld,%d,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%zu,%d,%.4f\n", static_cast<long long>(place.first),
                   place.second, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w(), seen.cameras.size(), seen.num_corners,
                   std::sqrt(seen.squares / seen.num_corners));
  }
  return rows.empty() ? "" : "frame,board,x_m,y_m,z_m,qx,qy,qz,qw,num_cameras,num_corners,rms_px\n" + rows;
}

}  // namespace mvstudio::stages
