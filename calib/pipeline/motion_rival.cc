#include "calib/pipeline/motion_rival.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/pipeline/split_trial.h"

namespace mvstudio::calib {
namespace {

constexpr size_t kMinFrames = 4;  // of either part
constexpr int kNearCuts = 2;      // tried on either side: the cameras do not see boards in the same frames

/// One camera split at one of its frames, and what that leaves unexplained.
struct Trial {
  int camera = -1;
  size_t cut = 0;
  std::vector<int64_t> frames;
  CalibrateReport report;
  int lost_views = 0;
  double squares = 0;

  bool Beats(const Trial& other) const { return lost_views < other.lost_views && squares < other.squares; }
};

std::optional<Trial> TryCamera(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                               const RunContext& run, int camera, size_t cut, const std::vector<int64_t>& frames) {
  if (cut < kMinFrames || cut + kMinFrames > frames.size()) return std::nullopt;
  Trial trial{camera, cut, frames, {}, 0, 0};
  const std::string& name = solved.cameras[static_cast<size_t>(camera)].name;
  trial.report = AdjustSplit(input, solved, options, {name, frames[cut], false}, run);
  if (trial.report.status != Status::kOk) return std::nullopt;
  for (const CameraReport& c : trial.report.cameras) trial.lost_views += c.num_lost_views;
  trial.squares = CappedSquares(trial.report, solved, static_cast<size_t>(camera));
  return trial;
}

std::optional<Trial> TryAt(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                           const RunContext& run, int camera, int64_t frame_idx) {
  const std::vector<int64_t> frames = FramesWithBoards(input, camera);
  const auto at = std::lower_bound(frames.begin(), frames.end(), frame_idx);
  return TryCamera(input, solved, options, run, camera, static_cast<size_t>(at - frames.begin()), frames);
}

/// The camera split at its frames nearby, where that leaves less.
void RefineCut(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
               const RunContext& run, Trial* best) {
  const size_t cut = best->cut;
  for (int step = -kNearCuts; step <= kNearCuts && best->lost_views > 0; ++step) {
    if (step == 0 || (step < 0 && cut < static_cast<size_t>(-step))) continue;
    auto trial = TryCamera(input, solved, options, run, best->camera, cut + static_cast<size_t>(step), best->frames);
    if (trial && trial->Beats(*best)) *best = std::move(*trial);
  }
}

void Describe(const Trial& trial, CameraMotion* motion) {
  const auto camera = static_cast<size_t>(trial.camera);
  const geometry::RigCamera &before = trial.report.rig.cameras[camera], &after = trial.report.rig.cameras.back();
  const Eigen::Vector3d turn =
      geometry::RotationLog(after.cam_from_world.rotation * before.cam_from_world.rotation.conjugate());
  motion->cameras = {before.camera.name};
  motion->frame_idx = trial.frames[trial.cut], motion->last_before = trial.frames[trial.cut - 1];
  motion->rotation_rad = turn.norm();
  motion->translation_m = (after.cam_from_world.translation - before.cam_from_world.translation).norm();
  if (!before.cam_from_world_covariance || !after.cam_from_world_covariance) return;
  const Eigen::Matrix3d covariance =
      (*before.cam_from_world_covariance + *after.cam_from_world_covariance).topLeftCorner<3, 3>();
  motion->rotation_sigma_rad = std::sqrt(turn.normalized().dot(covariance * turn.normalized()));
}

int LostByOthers(const Trial& trial) {
  int lost = 0;
  for (size_t c = 0; c + 1 < trial.report.cameras.size(); ++c) {
    if (static_cast<int>(c) != trial.camera) lost += trial.report.cameras[c].num_lost_views;
  }
  return lost;
}

}  // namespace

void NameCameraThatMoved(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                         const RunContext& run, CameraMotion* motion) {
  if (motion->kind != CameraMotion::Kind::kMoved || motion->cameras.size() != 1) return;
  const int named = solved.rig.Find(motion->cameras[0]);
  auto best = named < 0 ? std::nullopt : TryAt(input, solved, options, run, named, motion->frame_idx);
  if (!best || LostByOthers(*best) == 0) return;
  for (int c = 0; c < static_cast<int>(solved.rig.cameras.size()); ++c) {
    if (c == named) continue;
    auto trial = TryAt(input, solved, options, run, c, motion->frame_idx);
    if (trial && trial->Beats(*best)) best = std::move(trial);
  }
  if (best->camera == named) return;
  RefineCut(input, solved, options, run, &*best);
  Describe(*best, motion);
}

}  // namespace mvstudio::calib
