#include "calib/pipeline/motion_kind.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/lens/evidence.h"
#include "calib/pipeline/split_trial.h"
#include "calib/pipeline/view_squares.h"

namespace mvstudio::calib {
namespace {

constexpr double kMinStandardErrors = 2;  // a gain that four views share alike; a part of a recording has few

/// The two adjustments of one camera that was split.
struct Split {
  std::string before, after;  // names
  CalibrateReport one_lens, two_lenses;
};

std::optional<Split> SplitAt(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                             const std::string& camera, int64_t frame_idx, const RunContext& run) {
  Split split;
  split.before = camera;
  split.after = camera + "@" + std::to_string(frame_idx);
  split.one_lens = AdjustSplit(input, solved, options, {camera, frame_idx, false}, run);
  split.two_lenses = AdjustSplit(input, solved, options, {camera, frame_idx, true}, run);
  const bool ok = split.one_lens.status == Status::kOk && split.two_lenses.status == Status::kOk;
  return ok ? std::optional<Split>(std::move(split)) : std::nullopt;
}

/// By how much the second lens lowers chi-square beyond what it costs; nothing when that is in doubt.
std::optional<double> EvidenceForLens(const Split& split) {
  const CameraReport& later = split.two_lenses.cameras.back();
  const double cost = later.num_params * std::log(std::max(2, later.num_corners));
  return GainBeyondCost(ChiSquaredGain(split.one_lens, split.two_lenses), cost, kMinStandardErrors);
}

/// Index of the frame from which on a second lens explains most: at eighths of the camera's frames, then nearer and nearer.
std::optional<size_t> BestCut(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                              const RunContext& run, const std::string& camera, const std::vector<int64_t>& frames) {
  constexpr size_t kMinFrames = 4;  // on either side
  constexpr size_t kParts = 8;
  if (frames.size() < 2 * kMinFrames) return std::nullopt;
  std::optional<size_t> best;
  double least = std::numeric_limits<double>::infinity();
  const auto try_cut = [&](size_t cut) {
    if (cut < kMinFrames || cut > frames.size() - kMinFrames) return;
    const CalibrateReport two = AdjustSplit(input, solved, options, {camera, frames[cut], true}, run);
    const double squares = CappedSquares(two, solved, static_cast<size_t>(solved.rig.Find(camera)));
    if (squares < least) least = squares, best = cut;
  };
  for (size_t k = 1; k < kParts; ++k) try_cut(k * frames.size() / kParts);
  for (size_t step = (frames.size() + 2 * kParts - 1) / (2 * kParts); best && step > 0; step /= 2) {
    const size_t middle = *best;
    if (step < middle) try_cut(middle - step);
    try_cut(middle + step);
  }
  return best;
}

double FocalSigma(const CameraReport& camera) { return camera.focal_sigma_px / camera.focal_px; }

void Describe(const Split& split, CameraMotion* motion) {
  const geometry::Rig& rig = split.two_lenses.rig;
  const auto b = static_cast<size_t>(rig.Find(split.before)), a = static_cast<size_t>(rig.Find(split.after));
  const CameraReport &before = split.two_lenses.cameras[b], &after = split.two_lenses.cameras[a];
  motion->kind = CameraMotion::Kind::kLens;
  motion->cameras = {split.before};
  motion->focal_scale = after.focal_px / before.focal_px;
  motion->focal_scale_sigma = motion->focal_scale * std::hypot(FocalSigma(before), FocalSigma(after));
  motion->centre_shift_px = rig.cameras[a].camera.params.segment<2>(2) - rig.cameras[b].camera.params.segment<2>(2);
}

}  // namespace

void ExplainMotion(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                   const RunContext& run, CameraMotion* motion) {
  double most = 0;
  const std::vector<std::string> names = motion->cameras;
  for (const std::string& name : names) {
    if (solved.rig.Find(name) < 0) continue;
    const auto split = SplitAt(input, solved, options, name, motion->frame_idx, run);
    const auto evidence = split ? EvidenceForLens(*split) : std::nullopt;
    if (!evidence || *evidence <= most) continue;
    most = *evidence;
    Describe(*split, motion);
  }
}

std::optional<CameraMotion> FindLensChange(const CalibrateInput& input, const CalibrateReport& solved,
                                           const CalibrateOptions& options, const RunContext& run, const std::string& camera) {
  const int index = solved.rig.Find(camera);
  if (index < 0) return std::nullopt;
  const std::vector<int64_t> frames = FramesWithBoards(input, index);
  const auto cut = BestCut(input, solved, options, run, camera, frames);
  const auto split = cut ? SplitAt(input, solved, options, camera, frames[*cut], run) : std::nullopt;
  if (!split || !EvidenceForLens(*split)) return std::nullopt;
  CameraMotion motion;
  motion.frame_idx = frames[*cut], motion.last_before = frames[*cut - 1];
  Describe(*split, &motion);
  const CameraReport& report = solved.cameras[static_cast<size_t>(index)];
  motion.shift_px = std::sqrt(std::max(0.0, report.rms_px * report.rms_px - report.alone_rms_px * report.alone_rms_px));
  return motion;
}

}  // namespace mvstudio::calib
