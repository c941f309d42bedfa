#include "stages/dataset_split/describe.h"

#include <cmath>

#include "core/format.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json SplitPartJson(const dataset::SplitPart& part, int images) {
  return {{"cameras", part.cameras.size()}, {"frames", part.frames.size()}, {"pictures", images}};
}

ordered_json SplitJson(const dataset::Split& split, const dataset::SplitReport& report) {
  ordered_json json{{"rule", split.rule},
                    {"train", SplitPartJson(split.train, report.train_images)},
                    {"validation", SplitPartJson(split.validation, report.validation_images)},
                    {"test", SplitPartJson(split.test, report.test_images)},
                    {"guard_frames", split.guard_frames},
                    {"unused_frames", split.unused_frames.size()},
                    {"motion_blocks", ordered_json::array()},
                    {"median_angle_deg", FiniteOrNull(report.median_angle_deg)},
                    {"max_angle_deg", FiniteOrNull(report.max_angle_deg)},
                    {"median_novelty_mm", FiniteOrNull(1000 * report.median_novelty_m)},
                    {"p90_novelty_mm", FiniteOrNull(1000 * report.p90_novelty_m)},
                    {"max_novelty_mm", FiniteOrNull(1000 * report.max_novelty_m)},
                    {"usual_step_mm", FiniteOrNull(1000 * report.usual_step_m)},
                    {"test_cameras", ordered_json::array()}};
  for (const dataset::MotionBlock& block : split.blocks) json["motion_blocks"].push_back({block.first, block.last});
  for (const auto& camera : report.test_cameras) {
    json["test_cameras"].push_back(
        {{"name", camera.name}, {"nearest_train", camera.nearest_train}, {"angle_deg", FiniteOrNull(camera.angle_deg)}});
  }
  return json;
}

std::string SplitText(const dataset::Split& split, const dataset::SplitReport& report) {
  std::string text = split.rule + "\n";
  const std::pair<const char*, const dataset::SplitPart*> parts[] = {
      {"train", &split.train}, {"validation", &split.validation}, {"test", &split.test}};
  for (const auto& [name, part] : parts) {
    if (part->empty()) continue;
    text += Format("  %-10s %3zu cameras, %5zu frames (%d to %d)\n", name, part->cameras.size(), part->frames.size(),
                   part->frames.front(), part->frames.back());
  }
  text += Format("  %zu frames in no part; %zu uninterrupted motions\n", split.unused_frames.size(), split.blocks.size());
  text += Format("  test cameras are %.1f degrees from a training camera (median; at most %.1f)\n", report.median_angle_deg,
                 report.max_angle_deg);
  if (!std::isfinite(report.median_novelty_m)) return text;
  text += Format(
      "  test poses are %.0f mm a joint from the most similar training pose (median; 90 %%: %.0f); "
      "neighbouring frames: %.0f mm\n",
      1000 * report.median_novelty_m, 1000 * report.p90_novelty_m, 1000 * report.usual_step_m);
  return text;
}

}  // namespace

CommandResult Describe(const DatasetSplitReport& report) {
  const dataset::SplitReport& distance = report.distance;
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (!report.options.out.empty()) result.outputs.push_back({report.options.out, "split"});
  result.metrics = SplitJson(report.split, distance);
  result.text = SplitText(report.split, distance);
  if (!std::isfinite(distance.median_novelty_m)) {
    result.exit = kExitQualityGate;
    result.errors.push_back({"SPL-NOBODY",
                             "nobody has joints in both the training and the test frames: the split has no distance",
                             "triangulate the take again, or choose other frames"});
  } else if (distance.median_novelty_m < 2 * distance.usual_step_m) {
    result.warnings.push_back({"SPL-NEAR", "half of the test poses are as near to a training pose as neighbouring frames are",
                               "hold out another motion, or widen option 'guard'"});
  }
  return result;
}

}  // namespace mvstudio::stages
