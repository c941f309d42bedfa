#include "stages/nets/trials/run.h"

#include <algorithm>
#include <limits>

#include "avatar/run/pack/training_set.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/studio_names.h"
#include "geometry/rig/rig_io.h"
#include "stages/nets/trials/train_and_score.h"
#include "stages/report_fields.h"
#include "stages/study/tradeoff.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

/// Resolved names; every fifth camera unless given.
std::vector<std::string> HeldOutCameras(const dataset::PanopticDataset& data, const std::string& text) {
  std::vector<std::string> names;
  if (text.empty()) {
    for (size_t i = 3; i < data.rig.cameras.size(); i += 5) names.push_back(data.rig.cameras[i].camera.name);
    if (names.empty()) throw UsageError(data.root + ": has too few cameras to hold one out; give option 'holdout-cameras'");
    return names;
  }
  size_t begin = 0;
  while (begin <= text.size()) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    names.push_back(data.Resolve(name));
    if (names.back().empty()) {
      const auto known = [&](const std::string& camera) { return dataset::StudioName(data, camera); };
      throw UsageError("option 'holdout-cameras': " + data.root + " has no camera '" + name + "'; it has " +
                       Join(geometry::CameraNames(data.rig), ", ", known));
    }
    begin = end + 1;
  }
  return names;
}

/// What each trial would refuse, before the first of them.
void RequireFrames(const dataset::PanopticDataset& data, const std::string& text) {
  for (const int frame : ParseRanges("option 'holdout-frames'", text)) {
    if (data.poses.count(frame) > 0) continue;
    const std::string there = data.frames.empty() ? "none" : Format("%d to %d", data.frames.front(), data.frames.back());
    throw UsageError("option 'holdout-frames': " + data.root + Format(" has no joints in frame %d; its frames: ", frame) +
                     there);
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
int64_t RunAll(const AvatarTradeoffOptions& options, const ChildCall& call, const RunContext& run,
               std::vector<AvatarTrial>* trials) {
  const double begin_s = NowSeconds();
  ProgressStage stage(run, "tradeoff avatar", static_cast<int64_t>(trials->size()));
  int64_t left_out = 0;
  for (AvatarTrial& trial : *trials) {
    if (options.limit_minutes > 0 && NowSeconds() - begin_s > 60 * options.limit_minutes) {
      ++left_out;
      continue;
    }
    const std::string name = std::to_string(trial.cameras.size()) + " cameras, " + trial.Name();
    RunTrial(
        options, call, run, [&] { stage.Advance(0, name); }, &trial);
    stage.Advance(1, name);
  }
  return left_out;
}

void ChooseQuickGrid(AvatarGrid* grid) {
  grid->widths = {8, 16}, grid->sizes = {64}, grid->steps = {0, 60, 180}, grid->losses = {"l1+ssim"};
  grid->cameras = {std::numeric_limits<int>::max(), 3};
}

void Complete(const dataset::PanopticDataset& data, AvatarTradeoffOptions* options) {
  if (options->quick) ChooseQuickGrid(&options->grid);
  options->holdout_cameras = HeldOutCameras(data, options->camera_words);
  if (options->holdout_frames.empty()) options->holdout_frames = LastFrames(data);
  RequireFrames(data, options->holdout_frames);
  const std::vector<int>& sizes = options->grid.sizes;
  if (options->score_size_px == 0) options->score_size_px = *std::max_element(sizes.begin(), sizes.end());
  for (const std::string& method : options->grid.methods)
    for (const std::string& loss : options->grid.losses) LossFlags(loss, method);
}

}  // namespace

AvatarTradeoffReport RunAvatarTradeoff(AvatarTradeoffOptions options, const ChildCall& call, const RunContext& run) {
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(options.dataset);
  Complete(data, &options);
  AvatarTradeoffReport report;
  report.trials = MakeTrials(options.grid, SpreadOut(data, options.holdout_cameras));
  const OutputFolder place(options.out, {options.dataset}, {"tradeoff-avatar.html"});
  MakeFolder(options.out);
  report.left_out = RunAll(options, call, run, &report.trials);
  report.trials.erase(
      std::remove_if(report.trials.begin(), report.trials.end(), [](const AvatarTrial& trial) { return !trial.done; }),
      report.trials.end());
  MarkFronts(&report.trials);
  report.page = options.out + "/tradeoff-avatar.html";
  WriteFileAtomic(report.page, TrialsPage(report.trials, options));
  report.options = std::move(options);
  return report;
}

CommandResult Describe(const AvatarTradeoffReport& report) {
  CommandResult result;
  if (report.left_out > 0) {
    result.exit = kExitPartial;
    result.warnings.push_back({"TRD-LIMIT",
                               std::to_string(report.left_out) + " trials were not begun within option 'limit-minutes'",
                               "run the same line again: what is finished is kept"});
  }
  result.metrics["holdout_cameras"] = report.options.holdout_cameras;
  result.metrics["holdout_frames"] = report.options.holdout_frames;
  result.metrics["score_size_px"] = report.options.score_size_px;
  result.metrics["trials"] = RowsJson(report.trials);
  result.text = TrialsText(report.trials, "FD");
  result.outputs.push_back({report.page, "figure"});
  result.folder = report.options.out;
  return result;
}

}  // namespace mvstudio::stages
