#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "calib/bundle/board_shape.h"
#include "calib/check/check_steps.h"
#include "calib/check/pose_problem.h"
#include "calib/lens/resection.h"
#include "core/statistics.h"

namespace mvstudio::calib::internal {
namespace {

using geometry::Rigid3;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kDistanceToSigma = 0.8493218;  // median 2-D distance to standard deviation per coordinate
constexpr double kMinSigmaPx = 0.01;            // a smaller one is rounding, not noise
constexpr size_t kMinCorners = 6;

/// A view with the pose that it gives by itself.
struct OwnView {
  View view;
  Rigid3 cam_from_board;
  double rms_px = 0;
};

/// Pose of a view and its corners that fit; nothing when there is no pose.
std::optional<OwnView> FitOwn(View view, const geometry::Camera& camera, double reject_sigmas, int* num_rejected) {
  Resection resection = ResectPlane(camera, view);
  for (int round = 0; round < 3 && resection.status == Status::kOk; ++round) {
    const Eigen::VectorXd distances = CornerDistances(view, camera, resection.cam_from_board);
    std::vector<double> kept;
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      if (view.weights[i] > 0) kept.push_back(distances[i]);
    }
    const double limit = reject_sigmas * std::max(kDistanceToSigma * UpperMedian(kept), kMinSigmaPx);
    const int before = static_cast<int>(kept.size());
    for (Eigen::Index i = 0; i < view.size(); ++i) view.weights[i] *= distances[i] > limit ? 0 : 1;
    const int after = static_cast<int>((view.weights.array() > 0).count());
    if (after < static_cast<int>(kMinCorners)) return std::nullopt;
    if (after == before) {
      double sum = 0;
      for (Eigen::Index i = 0; i < view.size(); ++i) sum += view.weights[i] > 0 ? distances[i] * distances[i] : 0;
      *num_rejected += static_cast<int>(view.size()) - after;
      return OwnView{view, resection.cam_from_board, std::sqrt(sum / after)};
    }
    resection = RefinePose(camera, view, resection.cam_from_board);
  }
  return std::nullopt;
}

/// Views with poses of their own, by camera of the rig. Views far worse than their camera's others are left out.
std::vector<OwnView> OwnViews(const CalibrateInput& input, const std::vector<int64_t>& frames, CheckWork* work) {
  std::vector<OwnView> views;
  std::vector<Eigen::Matrix3Xd> shaped;
  for (const Board& board : input.boards) shaped.push_back(ShapedCorners(board, work->rig.boards));
  for (const Detection& detection : input.detections) {
    const int camera = work->rig.Find(input.cameras.at(static_cast<size_t>(detection.camera_idx)).name);
    CameraCheck& check = work->checks[static_cast<size_t>(camera)];
    if (detection.corner_ids.size() < kMinCorners) continue;
    View view = MakeView(input.boards, detection, frames);
    view.camera_idx = camera;
    view.x_in_board = shaped[static_cast<size_t>(view.board)](Eigen::all, view.corner_ids);
    auto own =
        FitOwn(view, work->problem.cameras[static_cast<size_t>(camera)], work->options.reject_sigmas, &check.num_rejected);
    if (own) {
      views.push_back(std::move(*own));
    } else {
      ++check.num_bad_views;
    }
  }
  std::vector<OwnView> kept;
  for (size_t c = 0; c < work->checks.size(); ++c) {
    std::vector<double> all;
    for (const OwnView& own : views) {
      if (own.view.camera_idx == static_cast<int>(c)) all.push_back(own.rms_px);
    }
    const double limit = 4 * std::max(UpperMedian(all), kMinSigmaPx);
    for (const OwnView& own : views) {
      if (own.view.camera_idx != static_cast<int>(c)) continue;
      if (own.rms_px <= limit) {
        kept.push_back(own);
      } else {
        ++work->checks[c].num_bad_views;
      }
    }
  }
  return kept;
}

/// Noise per coordinate of every camera, from the fits of its views by themselves (6 numbers each).
std::vector<double> OwnSigmas(const std::vector<OwnView>& views, CheckWork* work) {
  std::vector<double> squares(work->checks.size()), freedom(work->checks.size()), corners(work->checks.size());
  for (const OwnView& own : views) {
    const size_t c = static_cast<size_t>(own.view.camera_idx);
    const double count = static_cast<double>((own.view.weights.array() > 0).count());
    squares[c] += count * own.rms_px * own.rms_px;
    corners[c] += count;
    freedom[c] += 2 * count - 6;
  }
  std::vector<double> sigmas;
  for (size_t c = 0; c < work->checks.size(); ++c) {
    work->checks[c].own_rms_px = corners[c] > 0 ? std::sqrt(squares[c] / corners[c]) : kNaN;
    sigmas.push_back(freedom[c] > 0 ? std::max(kMinSigmaPx, std::sqrt(squares[c] / freedom[c])) : 1);
  }
  return sigmas;
}

/// Views of boards that two cameras share, with weights in px^-2.
void FillProblem(std::vector<OwnView> views, CheckWork* work) {
  const std::vector<double> sigmas = OwnSigmas(views, work);
  std::map<std::pair<int, int>, std::vector<size_t>> time_steps;
  for (size_t i = 0; i < views.size(); ++i) time_steps[{views[i].view.frame, views[i].view.board}].push_back(i);
  PoseProblem& problem = work->problem;
  work->boards_of.resize(work->checks.size());
  work->views_alone.resize(work->checks.size());
  for (const auto& [key, members] : time_steps) {
    if (members.size() < 2) {
      const View& view = views[members[0]].view;
      work->views_alone[static_cast<size_t>(view.camera_idx)].push_back(view);
      continue;
    }
    const int board = static_cast<int>(problem.views_of_board.size());
    problem.views_of_board.emplace_back();
    for (const size_t i : members) {
      OwnView& own = views[i];
      const size_t camera = static_cast<size_t>(own.view.camera_idx);
      own.view.weights =
          (own.view.weights.array() > 0).select(1 / (sigmas[camera] * sigmas[camera]), Eigen::ArrayXd::Zero(own.view.size()));
      problem.views_of_board.back().push_back(static_cast<int>(problem.views.size()));
      problem.board_of_view.push_back(board);
      work->boards_of[camera].push_back(board);
      work->checks[camera].num_corners += static_cast<int>((own.view.weights.array() > 0).count());
      work->own_pose.push_back(own.cam_from_board);
      problem.views.push_back(own.view);
    }
  }
  for (size_t c = 0; c < work->checks.size(); ++c) work->checks[c].num_views = static_cast<int>(work->boards_of[c].size());
}

}  // namespace

Eigen::VectorXd CornerDistances(const View& view, const geometry::Camera& camera, const Rigid3& pose) {
  const auto residuals = ResidualsOf(view, camera, pose);
  if (!residuals) return Eigen::VectorXd::Constant(view.size(), kInfinity);
  return residuals->colwise().norm();
}

CheckWork PrepareCheck(const geometry::Rig& rig, const RigCheckOptions& options, const CalibrateInput& input) {
  CheckWork work{rig, options, {}, {}, {}, {}, {}, {}, {}, {}, {}};
  for (const geometry::RigCamera& camera : rig.cameras) {
    work.problem.cameras.push_back(camera.camera);
    work.state.cam_from_world.push_back(camera.cam_from_world);
    work.checks.emplace_back();
    work.checks.back().name = camera.camera.name;
    work.checks.back().cam_from_world = camera.cam_from_world;
  }
  work.moved.assign(rig.cameras.size(), false);
  std::vector<int64_t> frames;
  MakeViews(input.boards, input.detections, &frames);
  FillProblem(OwnViews(input, frames, &work), &work);
  return work;
}

void HearVoters(int camera, CheckWork* work) {
  work->problem.views_of_board = work->all_views_of_board;
  for (auto& views : work->problem.views_of_board) {
    const auto is_mute = [&](int v) {
      const int seer = work->problem.views[static_cast<size_t>(v)].camera_idx;
      return seer != camera && work->moved[static_cast<size_t>(seer)];
    };
    views.erase(std::remove_if(views.begin(), views.end(), is_mute), views.end());
  }
}

}  // namespace mvstudio::calib::internal
