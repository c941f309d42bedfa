#include "dataset/views/split.h"

#include <cmath>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/frame_notice.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct Arguments {
  std::string folder, out, from, test_frames, validation_frames;
  dataset::SplitOptions options;
};

ordered_json PartJson(const dataset::SplitPart& part, int pictures) {
  return {{"cameras", part.cameras.size()}, {"frames", part.frames.size()}, {"pictures", pictures}};
}

ordered_json ReportJson(const dataset::Split& split, const dataset::SplitReport& report) {
  ordered_json json{{"rule", split.rule},
                    {"train", PartJson(split.train, report.train_pictures)},
                    {"validation", PartJson(split.validation, report.validation_pictures)},
                    {"test", PartJson(split.test, report.test_pictures)},
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

std::string ReportText(const dataset::Split& split, const dataset::SplitReport& report) {
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

dataset::Split Make(Arguments& arguments, const dataset::PanopticDataset& data, CommandResult* result) {
  if (!arguments.from.empty()) {
    const dataset::Split split = dataset::ReadSplit(arguments.from);
    dataset::RequireSplitOf(split, data, arguments.from);
    result->inputs.push_back(arguments.from);
    return split;
  }
  if (arguments.out.empty()) throw UsageError("--out is needed: the file for the split (or --describe an existing one)");
  const auto choose = [&](const char* flag, const std::string& ranges) {
    const FrameChoice choice = KnownFrames(flag, ParseRanges(flag, ranges), data.frames, data.root);
    stages::TellFrames(choice.beyond, result);
    return choice.frames;
  };
  arguments.options.test_frames = choose("--holdout-frames", arguments.test_frames);
  arguments.options.validation_frames = choose("--validation-frames", arguments.validation_frames);
  return dataset::MakeSplit(data, arguments.options);
}

CommandResult Run(Arguments& arguments) {
  CommandResult result;
  result.inputs = {arguments.folder};
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(arguments.folder);
  const dataset::Split split = Make(arguments, data, &result);
  const dataset::SplitReport report = dataset::DescribeSplit(data, split);
  if (!arguments.out.empty()) {
    const OutputFiles place({arguments.out}, Joined(result.inputs, {arguments.from}));
    dataset::WriteSplit(split, arguments.out);
    result.outputs.push_back({arguments.out, "split"});
  }
  result.metrics = ReportJson(split, report);
  result.text = ReportText(split, report);
  if (!std::isfinite(report.median_novelty_m)) {
    result.exit = kExitQualityGate;
    result.errors.push_back({"SPL-NOBODY",
                             "nobody has joints in both the training and the test frames: the split has no distance",
                             "triangulate the take again, or choose other frames"});
  } else if (report.median_novelty_m < 2 * report.usual_step_m) {
    result.warnings.push_back({"SPL-NEAR", "half of the test poses are as near to a training pose as neighbouring frames are",
                               "hold out another motion, or widen --guard"});
  }
  return result;
}

}  // namespace

void RegisterDatasetSplit(CLI::App& dataset, Registry& registry) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = dataset.add_subcommand("split",
                                         "Choose cameras and frames for training and test that share neither, write them to a "
                                         "file, and measure how far the test is from the training");
  dataset::SplitOptions& o = arguments->options;
  const std::string presets =
      Join(dataset::SplitPresets(), "; ", [](const dataset::SplitPreset& preset) { return preset.name + ": " + preset.what; });
  AddOption(sub, "folder", arguments->folder, "dataset folder")->required();
  AddOutput(sub, "--out", arguments->out, OutputKind::kFile, "file for the split (JSON)");
  AddOption(sub, "--describe", arguments->from, "check and describe this split instead of making one");
  AddOption(sub, "--preset", o.preset, presets);
  AddOption(sub, "--holdout-cameras,--test-cameras", o.test_cameras, "names, separated by commas: those that test")
      ->delimiter(',');
  AddOption(sub, "--train-cameras", o.train_cameras, "names; default: all that are not for test")->delimiter(',');
  AddOption(sub, "--validation-cameras", o.validation_cameras, "names; default: the training cameras")->delimiter(',');
  AddOption(sub, "--train-count", o.num_train_cameras,
            "number of training cameras, spread evenly around the people; the others are for test; --seed gives other choices");
  AddOption(sub, "--every-camera", o.every_camera, "every k-th camera is for test");
  AddOption(sub, "--holdout-frames,--test-frames", arguments->test_frames, "such as 90-119 or 0-9,50-59");
  AddOption(sub, "--validation-frames", arguments->validation_frames, "likewise");
  AddOption(sub, "--test-share", o.test_share, "share of the frames, the last ones, when none are named")
      ->capture_default_str();
  AddOption(sub, "--guard", o.guard_frames, "frames left out on either side of test and validation frames")
      ->capture_default_str();
  registry.Add(sub, "dataset split", [arguments](CommandContext& context) {
    arguments->options.seed = context.run.seed;
    return Run(*arguments);
  });
}

}  // namespace mvstudio::cli
