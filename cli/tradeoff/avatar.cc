#include <algorithm>
#include <filesystem>
#include <limits>

#include "avatar/run/pack/pack_builder.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/tradeoff/avatar_run.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/studio_names.h"
#include "geometry/rig/rig_io.h"
#include "stages/dataset/studio_names.h"
#include "stages/report_fields.h"
#include "stages/study/avatar_trials.h"
#include "stages/study/tradeoff.h"

namespace mvstudio::cli {
namespace {

struct Arguments {
  stages::AvatarTradeoffOptions options;
  stages::AvatarGrid grid;
  std::string holdout_cameras;
  bool quick = false;
};

/// Resolved names; every fifth camera unless given.
std::vector<std::string> HeldOutCameras(const dataset::PanopticDataset& data, const std::string& text) {
  std::vector<std::string> names;
  if (text.empty()) {
    for (size_t i = 3; i < data.rig.cameras.size(); i += 5) names.push_back(data.rig.cameras[i].camera.name);
    if (names.empty()) throw UsageError(data.root + ": has too few cameras to hold one out; give --holdout-cameras");
    return names;
  }
  size_t begin = 0;
  while (begin <= text.size()) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    names.push_back(data.Resolve(name));
    if (names.back().empty()) {
      const auto known = [&](const std::string& camera) { return dataset::StudioName(data, camera); };
      throw UsageError("--holdout-cameras: " + data.root + " has no camera '" + name + "'; it has " +
                       Join(geometry::CameraNames(data.rig), ", ", known));
    }
    begin = end + 1;
  }
  return names;
}

/// What each trial would refuse, before the first of them.
void RequireFrames(const dataset::PanopticDataset& data, const std::string& text) {
  for (const int frame : ParseRanges("--holdout-frames", text)) {
    if (data.poses.count(frame) > 0) continue;
    const std::string there = data.frames.empty() ? "none" : Format("%d to %d", data.frames.front(), data.frames.back());
    throw UsageError("--holdout-frames: " + data.root + Format(" has no joints in frame %d; its frames: ", frame) + there);
  }
}

/// The last quarter of the person's frames.
std::string LastFrames(const dataset::PanopticDataset& data) {
  const int person = avatar::ChoosePerson(data, -1);
  std::vector<int> frames;
  for (const auto& [frame, people] : data.poses) {
    if (people.count(person)) frames.push_back(frame);
  }
  if (frames.size() < 4) throw UsageError(data.root + ": has too few frames to hold some out");
  return RangesText({frames.begin() + static_cast<std::ptrdiff_t>(frames.size() * 3 / 4), frames.end()});
}

/// The others, each next one farthest from those before it.
std::vector<std::string> SpreadOut(const dataset::PanopticDataset& data, const std::vector<std::string>& held_out) {
  std::vector<const geometry::RigCamera*> left, chosen;
  for (const geometry::RigCamera& camera : data.rig.cameras) {
    if (std::find(held_out.begin(), held_out.end(), camera.camera.name) == held_out.end()) left.push_back(&camera);
  }
  if (left.empty()) throw UsageError("no camera is left to train on");
  while (!left.empty()) {
    const auto distance = [&](const geometry::RigCamera* camera) {
      double least = std::numeric_limits<double>::infinity();
      for (const geometry::RigCamera* other : chosen)
        least = std::min(least, (camera->CenterInWorld() - other->CenterInWorld()).norm());
      return least;
    };
    const auto next = std::max_element(left.begin(), left.end(), [&](auto* a, auto* b) { return distance(a) < distance(b); });
    chosen.push_back(*next);
    left.erase(next);
  }
  std::vector<std::string> names;
  for (const geometry::RigCamera* camera : chosen) names.push_back(camera->camera.name);
  return names;
}

/// Returns how many trials were left out, for the time was over.
int64_t RunAll(const stages::AvatarTradeoffOptions& options, CommandContext& context,
               std::vector<stages::AvatarTrial>* trials) {
  const double begin_s = stages::NowSeconds();
  ProgressStage stage(context.run, "tradeoff avatar", static_cast<int64_t>(trials->size()));
  int64_t left_out = 0;
  for (stages::AvatarTrial& trial : *trials) {
    if (options.limit_minutes > 0 && stages::NowSeconds() - begin_s > 60 * options.limit_minutes) {
      ++left_out;
      continue;
    }
    const std::string name = std::to_string(trial.cameras.size()) + " cameras, " + trial.Name();
    RunTrial(
        options, context, [&] { stage.Advance(0, name); }, &trial);
    stage.Advance(1, name);
  }
  return left_out;
}

CommandResult Run(const Arguments& arguments, CommandContext& context) {
  stages::AvatarTradeoffOptions options = arguments.options;
  stages::AvatarGrid grid = arguments.grid;
  if (arguments.quick) {
    grid.widths = {8, 16}, grid.sizes = {64}, grid.steps = {0, 60, 180}, grid.losses = {"l1+ssim"};
    grid.cameras = {std::numeric_limits<int>::max(), 3};
  }
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(options.dataset);
  options.holdout_cameras = HeldOutCameras(data, arguments.holdout_cameras);
  if (options.holdout_frames.empty()) options.holdout_frames = LastFrames(data);
  RequireFrames(data, options.holdout_frames);
  if (options.score_size_px == 0) options.score_size_px = *std::max_element(grid.sizes.begin(), grid.sizes.end());
  std::vector<stages::AvatarTrial> trials = stages::MakeTrials(grid, SpreadOut(data, options.holdout_cameras));
  for (const std::string& method : grid.methods)
    for (const std::string& loss : grid.losses) LossFlags(loss, method);
  const OutputFolder place(options.out, {options.dataset}, {"tradeoff-avatar.html"});
  MakeFolder(options.out);
  CommandResult result;
  if (const int64_t left_out = RunAll(options, context, &trials); left_out > 0) {
    result.exit = kExitPartial;
    result.warnings.push_back({"TRD-LIMIT", std::to_string(left_out) + " trials were not begun within --limit-minutes",
                               "run the same line again: what is finished is kept"});
  }
  context.camera_names = stages::StudioNames(options.dataset);
  trials.erase(std::remove_if(trials.begin(), trials.end(), [](const stages::AvatarTrial& t) { return !t.done; }),
               trials.end());
  stages::MarkFronts(&trials);
  result.metrics["holdout_cameras"] = options.holdout_cameras;
  result.metrics["holdout_frames"] = options.holdout_frames;
  result.metrics["score_size_px"] = options.score_size_px;
  result.metrics["trials"] = stages::RowsJson(trials);
  result.text = stages::TrialsText(trials, "FD");
  const std::string page = options.out + "/tradeoff-avatar.html";
  WriteFileAtomic(page, stages::TrialsPage(trials, options));
  result.outputs.push_back({page, "figure"});
  result.folder = options.out;
  return result;
}

}  // namespace

void RegisterTradeoffAvatar(CLI::App& tradeoff, Registry& registry) {
  const auto a = std::make_shared<Arguments>();
  CLI::App* sub = tradeoff.add_subcommand("avatar",
                                          "Method x width or Gaussians x image size x steps x losses x cameras: held-out SSIM "
                                          "and FD, s a step, ms a frame, and the Pareto front");
  AddOption(sub, "dataset", a->options.dataset, "dataset folder, as for `avatar train`")->required();
  AddOutput(sub, "--out", a->options.out, OutputKind::kFolder,
            "folder of the runs, the table and the figures; finished runs in it are kept")
      ->required();
  AddOption(sub, "--methods", a->grid.methods, "of tna, direct, v2v, gaussians")->delimiter(',')->capture_default_str();
  AddOption(sub, "--gaussians", a->grid.gaussians, "Gaussians to begin with, in place of the width; 0: automatic")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--widths", a->grid.widths, "channels of the first layer")->delimiter(',')->capture_default_str();
  AddOption(sub, "--sizes", a->grid.sizes, "edge of the crops, px")->delimiter(',')->capture_default_str();
  AddOption(sub, "--steps", a->grid.steps, "end-to-end steps; 0: the posed template in averaged colours, without a network")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--losses", a->grid.losses, "terms of l1, ssim, gradient, posenet joined by +; Gaussians have the first two")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--cameras", a->grid.cameras, "cameras trained on, as many as there are at most; spread out")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--holdout-cameras,--test-cameras", a->holdout_cameras,
            "cameras scored and never trained on; every fifth unless given");
  AddOption(sub, "--holdout-frames,--test-frames", a->options.holdout_frames,
            "frames scored and never trained on; the last quarter unless given");
  AddOption(sub, "--score-size", a->options.score_size_px, "edge of the crops that are compared, px; 0: the largest of --sizes")
      ->capture_default_str();
  AddOption(sub, "--features", a->options.features, "net of the Frechet distance, as for `avatar eval`")->capture_default_str();
  AddOption(sub, "--train", a->options.train_flags, "further flags of every training of a network, e.g. \"--batch 4\"");
  AddOption(sub, "--train-gaussians", a->options.gaussian_flags,
            "further flags of every training of Gaussians, e.g. \"--colour-degree 0\"");
  AddOption(sub, "--limit-minutes", a->options.limit_minutes, "begin no further trial after them; 0: no limit")
      ->capture_default_str();
  AddFlag(sub, "--quick", a->quick, "a grid of a few minutes: widths 8 16, 64 px, 0, 60 and 180 steps, all cameras and 3");
  registry.Add(sub, "tradeoff avatar", [a](CommandContext& context) { return Run(*a, context); });
}

}  // namespace mvstudio::cli
