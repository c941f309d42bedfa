#include "calib/pipeline/solvable.h"

#include <algorithm>

#include "calib/pipeline/calibrate_steps.h"
#include "core/error.h"
#include "core/join.h"

namespace mvstudio::calib {
namespace {

/// Cameras with corners; the others are left out.
SolvableCalibration WithCorners(const CalibrateInput& input) {
  std::vector<bool> seen(input.cameras.size(), false);
  for (const Detection& d : input.detections) seen[static_cast<size_t>(d.camera_idx)] = true;
  SolvableCalibration start;
  for (size_t c = 0; c < seen.size(); ++c) {
    if (seen[c]) start.kept.push_back(static_cast<int>(c));
    if (!seen[c]) start.left_out.push_back({input.cameras[c].name, "no corners: no board was found in its images"});
  }
  return start;
}

/// `solvable` without the suspects of its report; false when nothing would be left, or when they are not known.
bool DropSuspects(const CalibrateInput& input, SolvableCalibration* solvable) {
  const std::vector<int>& suspects = solvable->report.suspects;
  std::vector<int> kept;
  for (size_t k = 0; k < solvable->kept.size(); ++k) {
    const bool bad = std::find(suspects.begin(), suspects.end(), static_cast<int>(k)) != suspects.end();
    if (!bad) kept.push_back(solvable->kept[k]);
    if (bad)
      solvable->left_out.push_back({input.cameras[static_cast<size_t>(solvable->kept[k])].name, solvable->report.message});
  }
  const bool fewer = kept.size() < solvable->kept.size() && !kept.empty();
  if (fewer) solvable->kept = kept;
  return fewer;
}

}  // namespace

namespace internal {

std::vector<int> CamerasBesideMost(const std::vector<std::vector<int>>& groups) {
  size_t total = 0, largest = 0;
  for (size_t g = 0; g < groups.size(); ++g) {
    total += groups[g].size();
    if (groups[g].size() > groups[largest].size()) largest = g;
  }
  std::vector<int> beside;
  if (groups.empty() || 2 * groups[largest].size() <= total) return beside;
  for (size_t g = 0; g < groups.size(); ++g) {
    if (g != largest) beside.insert(beside.end(), groups[g].begin(), groups[g].end());
  }
  return beside;
}

}  // namespace internal

void NameLeftOut(const std::vector<LeftOutCamera>& left_out, Verdict* verdict) {
  if (left_out.empty()) return;
  std::vector<std::string> names;
  for (const LeftOutCamera& camera : left_out) names.push_back(camera.name);
  const std::string what = left_out.size() == 1 ? "camera " + names[0] + " is" : "cameras " + Join(names, ", ") + " are";
  verdict->reasons.insert(verdict->reasons.begin(), {"CAL-LEFTOUT", what + " left out: the verdict is of the others", ""});
}

SolvableCalibration CalibrateSolvable(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run) {
  SolvableCalibration found = WithCorners(input);
  if (found.kept.empty()) {
    for (size_t c = 0; c < input.cameras.size(); ++c) found.kept.push_back(static_cast<int>(c));
    found.left_out.clear();
  }
  found.report = Calibrate(InputOf(input, found.kept), options, run);
  if (found.report.status == Status::kOk) return found;
  SolvableCalibration all = found;
  all.left_out.clear();
  while (found.report.status != Status::kOk) {
    if (!DropSuspects(input, &found)) return all;
    try {
      found.report = Calibrate(InputOf(input, found.kept), options, run);
    } catch (const UsageError&) {  // an option names a camera that was left out
      return all;
    }
  }
  return found;
}

}  // namespace mvstudio::calib
