#include "calib/pipeline/held_conflict.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "calib/check/rig_compare.h"
#include "calib/lens/evidence.h"
#include "calib/pipeline/calibrate_steps.h"
#include "calib/pipeline/view_squares.h"
#include "core/format.h"

namespace mvstudio::calib {
namespace {

constexpr double kMinStandardErrors = 3;  // over the views
constexpr double kWorse = 1.1;            // ratio of errors below which nobody would act

CalibrateReport WithNothingHeld(const CalibrateInput& input, CalibrateOptions options, const RunContext& run) {
  options.fix.clear();
  options.split_at.clear();  // it has been done
  options.motions = false;
  options.holdout = {};
  return Calibrate(input, options, run);
}

/// How many numbers are held.
int NumHeld(const CalibrateReport& freed, const std::vector<bool>& poses, const std::vector<bool>& lenses) {
  int numbers = 0;
  for (size_t c = 0; c < freed.cameras.size(); ++c)
    numbers += (poses[c] ? 6 : 0) + (lenses[c] ? freed.cameras[c].num_params : 0);
  return numbers;
}

/// The camera whose error falls most, by a tenth or more; -1: none.
int Relieved(const CalibrateReport& held, const CalibrateReport& freed) {
  int best = -1;
  double most = kWorse;
  for (size_t c = 0; c < held.cameras.size(); ++c) {
    const double ratio = held.cameras[c].rms_px / freed.cameras[c].rms_px;
    if (ratio > most) most = ratio, best = static_cast<int>(c);
  }
  return best;
}

struct Change {
  size_t camera = 0;
  double amount = 0;
};

/// Radians by which camera `c` turned and moved (over the distance) as seen from `from`.
double RelativeChange(const geometry::Rig& given, const geometry::Rig& freed, const std::string& from, const std::string& c) {
  const auto relative = [&](const geometry::Rig& rig) {
    return rig.cameras[static_cast<size_t>(rig.Find(c))].cam_from_world *
           geometry::Inverse(rig.cameras[static_cast<size_t>(rig.Find(from))].cam_from_world);
  };
  const geometry::Rigid3 a = relative(given), b = relative(freed);
  const double distance = std::max(a.translation.norm(), 1e-12);
  return b.rotation.angularDistance(a.rotation) + (b.translation - a.translation).norm() / distance;
}

/// Of the held poses; an only pair of cameras changes alike.
Change MostChangedPose(const geometry::Rig& given, const CalibrateReport& freed, const std::vector<bool>& held) {
  Change most;
  for (size_t c = 0; c < held.size(); ++c) {
    double sum = 0;
    int others = 0;
    for (size_t other = 0; other < held.size(); ++other) {
      const std::string &from = freed.cameras[other].name, &to = freed.cameras[c].name;
      if (other != c && held[c] && given.Find(from) >= 0) sum += RelativeChange(given, freed.rig, from, to), ++others;
    }
    if (sum > others * most.amount) most = {c, sum / others};
  }
  return most;
}

/// Of the held lenses, px.
Change MostChangedLens(const geometry::Rig& given, const CalibrateReport& freed, const std::vector<bool>& held) {
  Change most;
  for (size_t c = 0; c < held.size(); ++c) {
    if (!held[c]) continue;
    ProjectionDiffOptions far;
    far.ranges_m = {std::numeric_limits<double>::infinity()};
    const auto diff =
        CompareProjection(given.cameras[static_cast<size_t>(given.Find(freed.cameras[c].name))].camera,
                          freed.rig.cameras[static_cast<size_t>(freed.rig.Find(freed.cameras[c].name))].camera, far);
    if (diff.status == Status::kOk && diff.ranges[0].rms_px > most.amount) most = {c, diff.ranges[0].rms_px};
  }
  return most;
}

std::string FallOf(const CameraReport& held, const CameraReport& freed) {
  return Format("the error of %s falls from %.2f to %.2f px", held.name.c_str(), held.rms_px, freed.rms_px);
}

}  // namespace

std::string FindHeldConflict(const CalibrateInput& input, const CalibrateReport& solved, const CalibrateOptions& options,
                             const RunContext& run) {
  if (options.fix.empty() || !input.start) return "";
  const CalibrateReport freed = WithNothingHeld(input, options, run);
  if (freed.status != Status::kOk || freed.cameras.size() != input.cameras.size()) return "";
  const bool refused = solved.status != Status::kOk;
  const std::vector<bool> poses = internal::HeldCameras(options.fix, HeldPart::What::kPoses, input.cameras);
  const std::vector<bool> lenses = internal::HeldCameras(options.fix, HeldPart::What::kLenses, input.cameras);
  const int relieved = refused ? -1 : Relieved(solved, freed);
  const double cost = NumHeld(freed, poses, lenses) * std::log(std::max(2, freed.num_corners));
  if (!refused && (relieved < 0 || !GainBeyondCost(ChiSquaredGain(solved, freed), cost, kMinStandardErrors))) return "";
  const Change pose = MostChangedPose(*input.start, freed, poses);
  const Change lens = MostChangedLens(*input.start, freed, lenses);
  if (pose.amount == 0 && lens.amount == 0) return "";
  const bool is_pose = pose.amount > 0 && (lens.amount == 0 || pose.amount * freed.cameras[pose.camera].focal_px > lens.amount);
  const std::string text =
      Format("the given %s of camera %s contradicts the boards: with nothing held it changes by %.3g %s, and ",
             is_pose ? "pose" : "lens", freed.cameras[is_pose ? pose.camera : lens.camera].name.c_str(),
             is_pose ? pose.amount * 180 / M_PI : lens.amount, is_pose ? "degrees" : "px");
  return text + (refused ? "there is a solution" : FallOf(solved.cameras[relieved], freed.cameras[relieved]));
}

}  // namespace mvstudio::calib
