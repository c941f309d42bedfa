#include "cli/avatar/training.h"

#include <chrono>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

#include "core/error.h"
#include "core/format.h"

namespace mvstudio::cli {
namespace {

using avatar::AvatarPack;
using Clock = std::chrono::steady_clock;

/// Trains to the end with checkpoints on the way. A request to stop saves first. `files`: null for ranks that write nothing.
avatar::TrainReport TrainAndSave(avatar::Trainer& trainer, stages::AvatarRun* files, const stages::RunPacks& packs,
                                 const avatar::TrainOptions& options, double earlier_s, CommandContext& context) {
  const Clock::time_point start = Clock::now();
  const auto wall_s = [&] { return earlier_s + std::chrono::duration<double>(Clock::now() - start).count(); };
  const AvatarPack* watched = packs.watched ? &*packs.watched : nullptr;
  const AvatarPack& samples = watched ? *watched : packs.train;
  ProgressStage stage(context.run, "training", trainer.total_steps() - trainer.model().step);
  bool stopped = false;
  bool begun = false;
  const auto callback = [&](int64_t step, const avatar::HistoryRow* row) {
    if (files && !std::exchange(begun, true)) files->ForgetScores();
    if (row && files) files->AddRow(*row, wall_s());
    if (row && row->phase == "validation") return true;
    if (files && step % options.save_every == 0) files->Save(trainer, samples);
    if (files && options.picture_every > 0 && step % options.picture_every == 0) files->SavePicture(trainer, samples);
    stopped = context.run.progress && context.run.progress->Cancelled();
    if (!stopped) stage.Advance(1, row ? row->phase + " loss " + std::to_string((*row)["total"]) : "");
    return !stopped;
  };
  const avatar::TrainReport report = trainer.Run(watched, callback);
  if (files) files->Save(trainer, samples);
  if (report.stopped) {
    throw CancelledError("interrupted after step " + std::to_string(trainer.model().step) +
                         ": the checkpoint is saved, `mvstudio avatar resume` goes on");
  }
  return report;
}

CommandResult ResultOf(const avatar::TrainReport& report, avatar::Trainer& trainer, const stages::AvatarRun& files,
                       double seconds, double wall_s) {
  CommandResult result;
  auto& m = result.metrics;
  m["method"] = ToString(trainer.model().options.method);
  m["steps"] = trainer.model().step;
  if (trainer.model().step > 0) m["num_parameters"] = avatar::NumParameters(trainer.model().options);  // else textures alone
  if (report.best_step >= 0) m["best_step"] = report.best_step;
  m["ended_early"] = report.ended_early;
  m["device"] = trainer.device();
  std::map<std::string, avatar::HistoryRow> last;
  for (const avatar::HistoryRow& row : report.history) last[row.phase] = row;
  for (const auto& [phase, row] : last) {
    m["final"][phase]["step"] = row.step;
    for (size_t i = 0; i < row.values.size(); ++i) m["final"][phase][avatar::kLossColumns[i]] = row.values[i];
  }
  m["it_per_s"] = report.steps_done > 0 ? static_cast<double>(report.steps_done) / seconds : std::nan("");
  m["wall_s"] = wall_s;
  result.outputs = files.Outputs();
  if (report.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back(
        {"AVA-NONFINITE", report.message, "look at these images; train again without them or with a smaller --learning-rate"});
  }
  return result;
}

/// What the network was worth over the fitted body that it began with.
void TellGain(const avatar::TrainReport& report, double least, CommandResult* result) {
  if (!std::isfinite(report.gain)) return;
  result->metrics["network"] = {{"gain_ssim", report.gain}, {"kept", !report.network_off}};
  result->text += Format("on the validation images the network adds %.4f of SSIM to the fitted body", report.gain) +
                  (report.network_off ? Format(", less than %.4g: left out (--least-gain 0 keeps it)\n", least) : "\n");
}

/// What the dataset does not hold; missing pictures alone are no failure.
void TellMissing(const stages::RunPacks& packs, CommandResult* result) {
  result->metrics["missing"] = nlohmann::ordered_json::parse(dataset::MissingToJsonText(packs.missing));
  result->metrics["frames_without_person"] = packs.frames_without_person;
  const auto warn = [&](const std::string& kind, const dataset::MissingPictures& missing) {
    result->warnings.push_back({"AVA-MISSING", kind + ": " + dataset::MissingText(missing), dataset::MissingHint(missing)});
  };
  if (packs.missing.missing() > 0) warn("training", packs.missing);
  for (const auto& [kind, missing] : packs.missing_scored) warn(kind, missing);
}

}  // namespace

CommandResult TrainHere(avatar::Trainer& trainer, stages::AvatarRun& files, const stages::RunPacks& packs,
                        const avatar::TrainOptions& options, double earlier_s, RankProcesses& ranks, CommandContext& context,
                        const std::function<void()>& begin) {
  const Clock::time_point start = Clock::now();
  if (const auto joined = ranks.Join()) trainer.Join(joined);
  if (begin && ranks.first()) begin();
  const avatar::TrainReport report =
      TrainAndSave(trainer, ranks.first() ? &files : nullptr, packs, options, earlier_s, context);
  if (!ranks.first()) return {};
  ranks.Finish();
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  CommandResult result = ResultOf(report, trainer, files, seconds, earlier_s + seconds);
  result.metrics["ranks"] = ranks.place().size;
  if (report.ended_early) result.text = report.message + "\n";
  TellGain(report, options.least_gain, &result);
  return result;
}

void FillCommon(const avatar::RunConfig& config, const stages::RunPacks& packs, const std::string& folder, double whole_s,
                CommandResult* result) {
  result->folder = folder;
  result->inputs = {config.dataset};
  result->metrics["train"] = {{"cameras", config.split.train_cameras.size()},
                              {"frames", config.split.train_frames.size()},
                              {"images", packs.train.size()},
                              {"template_iou", config.template_iou}};
  TellMissing(packs, result);
  if (!packs.skipped.empty()) {
    result->warnings.push_back(
        {"AVA-SKIPPED", std::to_string(packs.skipped.size()) + " images were left out; the first: " + packs.skipped.front(),
         "check these images, masks and joints"});
    if (result->exit == kExitOk) result->exit = kExitPartial;
  }
  std::ostringstream text;
  const auto& m = result->metrics;
  text << "avatar (" << m["method"].get<std::string>();
  if (m["steps"] != 0) text << ", " << m["num_parameters"] << " parameters";
  text << ") " << (m["steps"] == 0 ? "made of " : "trained on ") << packs.train.size() << " images of "
       << config.split.train_cameras.size() << " cameras";
  if (m["steps"] != 0) text << ": " << m["steps"] << " steps in " << std::llround(m["wall_s"].get<double>()) << " s";
  text << ", " << std::llround(whole_s) << " s in all\n  " << folder << "\n";
  result->text = text.str() + result->text;
}

}  // namespace mvstudio::cli
