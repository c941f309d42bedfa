#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "calib/bundle/view.h"
#include "calib/check/check_steps.h"
#include "core/statistics.h"

namespace mvstudio::calib::internal {
namespace {

constexpr double kStep = 0.25;        // frames, either way
constexpr double kLeastMotionPx = 1;  // per frame, rms over a view

using ViewKey = std::tuple<int, int, int>;  // camera of the input, frame's index, board

/// Places by corner in every view when all cameras are later than `late` by `more`.
std::map<ViewKey, std::map<int, Eigen::Vector2d>> PlacesAt(const CalibrateInput& seen, std::vector<geometry::TimeOffset> late,
                                                           double more) {
  for (geometry::TimeOffset& offset : late) offset.frames += more;
  std::vector<int64_t> frames;
  MakeViews(seen.boards, seen.detections, &frames);
  std::map<ViewKey, std::map<int, Eigen::Vector2d>> places;
  for (const Detection& d : AtFrameTimes(seen, late).detections) {
    const int frame = static_cast<int>(std::lower_bound(frames.begin(), frames.end(), d.frame_idx) - frames.begin());
    auto& of_view = places[{d.camera_idx, frame, d.board_idx}];
    for (int i = 0; i < d.num_corners(); ++i) of_view[d.corner_ids[static_cast<size_t>(i)]] = d.points_px.col(i);
  }
  return places;
}

/// How much later each camera of the rig is than `late` says, where `work` is made of the corners at these times: the median
/// over its views; 0 for cameras whose boards hardly move.
std::vector<double> TimeOffsetsLeft(const CheckWork& work, const CalibrateInput& seen,
                                    const std::vector<geometry::TimeOffset>& late) {
  const auto before = PlacesAt(seen, late, kStep), after = PlacesAt(seen, late, -kStep);
  std::vector<int> of_rig(work.checks.size(), -1);
  for (size_t c = 0; c < seen.cameras.size(); ++c)
    of_rig[static_cast<size_t>(work.rig.Find(seen.cameras[c].name))] = static_cast<int>(c);
  std::vector<std::vector<double>> found(work.checks.size());
  for (size_t v = 0; v < work.problem.views.size(); ++v) {
    const View& view = work.problem.views[v];
    const auto c = static_cast<size_t>(view.camera_idx);
    const geometry::Rigid3& board = work.state.world_from_board[static_cast<size_t>(work.problem.board_of_view[v])];
    const auto residuals = ResidualsOf(view, work.problem.cameras[c], work.state.cam_from_world[c] * board);
    const ViewKey key{of_rig[c], view.frame, view.board};
    if (!residuals || before.count(key) == 0) continue;
    double along = 0, squares = 0;
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      if (view.weights[i] <= 0) continue;
      const int corner = view.corner_ids[static_cast<size_t>(i)];
      const Eigen::Vector2d motion = (after.at(key).at(corner) - before.at(key).at(corner)) / (2 * kStep);  // px per frame
      along += motion.dot(residuals->col(i)), squares += motion.squaredNorm();
    }
    if (squares > kLeastMotionPx * kLeastMotionPx * static_cast<double>(view.size())) found[c].push_back(-along / squares);
  }
  std::vector<double> left;
  for (std::vector<double>& of_camera : found) left.push_back(of_camera.empty() ? 0 : UpperMedian(std::move(of_camera)));
  return left;
}

}  // namespace

std::vector<geometry::TimeOffset> FindTimeOffsets(
    const CalibrateInput& seen, const std::function<CheckWork(const std::vector<geometry::TimeOffset>&)>& place) {
  constexpr int kMaxSteps = 10;
  constexpr double kSettled = 0.002, kLeast = 0.02, kMost = 1;  // frames
  std::vector<geometry::TimeOffset> late(seen.cameras.size());
  for (int step = 0; step < kMaxSteps; ++step) {
    const CheckWork work = place(late);
    const std::vector<double> left = TimeOffsetsLeft(work, seen, late);
    double largest = 0;
    for (size_t c = 0; c < late.size(); ++c) {
      const double more = left[static_cast<size_t>(work.rig.Find(seen.cameras[c].name))];
      late[c].frames += more, largest = std::max(largest, std::abs(more));
    }
    if (largest < kSettled) break;
  }
  std::vector<double> frames;
  for (const geometry::TimeOffset& offset : late) frames.push_back(offset.frames);
  const double on_time =
      frames.size() == 2 ? frames[0] : *std::min_element(frames.begin(), frames.end(), [&](double a, double b) {
        const double middle = UpperMedian(frames);
        return std::abs(a - middle) < std::abs(b - middle);
      });
  bool any = false;
  for (geometry::TimeOffset& offset : late) {
    offset.frames -= on_time;
    if (std::abs(offset.frames) < kLeast) offset.frames = 0;
    if (std::abs(offset.frames) > kMost) return {};
    any |= offset.frames != 0;
  }
  return any ? late : std::vector<geometry::TimeOffset>();
}

}  // namespace mvstudio::calib::internal
