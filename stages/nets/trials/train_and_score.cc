#include "stages/nets/trials/train_and_score.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "report/page/value.h"

namespace mvstudio::stages {
namespace {

using report::Value;

std::vector<std::string> Words(const std::string& text, char between = ' ') {
  std::vector<std::string> words;
  std::istringstream in(text);
  for (std::string word; std::getline(in, word, between);) {
    if (!word.empty()) words.push_back(word);
  }
  return words;
}

/// Fields of the result of a command of this program, which runs as a child.
struct Called {
  Value metrics, timing;
};

struct TrialCall {
  const ChildCall& call;
  const RunContext& run;
  const std::string folder;
  const std::function<void()>& poll;

  Called Do(const CommandLine& line) const {
    const CallOutcome outcome = call(line, folder, poll);
    const int exit = outcome.result.exit;
    if (exit != kExitOk && exit != kExitPartial) {
      const std::string why = outcome.result.errors.empty() ? "" : outcome.result.errors.front().text;
      throw IoError(folder, "`" + line.Text() + "` ended with " + std::to_string(exit) + ": " + why);
    }
    return {Value::Parse(outcome.result.metrics.dump(), folder), Value::Object().Set("peak_rss_mb", outcome.peak_rss_mb)};
  }
};

CommandLine TrainLine(const AvatarTradeoffOptions& options, const RunContext& run, const AvatarTrial& trial,
                      const std::string& folder) {
  CommandLine line = {{"avatar", "train", options.dataset}, {{"out", {folder}}, {"overwrite", {}}}};
  const auto add = [&line](const std::string& name, const std::string& value) { line.options.push_back({name, {value}}); };
  const bool gaussians = trial.method == "gaussians";
  if (trial.method != "tna") add("method", trial.method);
  add(gaussians ? "gaussians" : "width", std::to_string(gaussians ? trial.gaussians : trial.width));
  add("size", std::to_string(trial.size_px));
  add("steps", std::to_string(trial.steps));
  add("train-cameras", Join(trial.cameras, ","));
  add("holdout-cameras", Join(options.holdout_cameras, ",")), add("holdout-frames", options.holdout_frames);
  add("seed", std::to_string(run.seed)), add("threads", std::to_string(run.num_threads));
  for (const LineOption& option : LossFlags(trial.loss, trial.method)) line.options.push_back(option);
  line.typed = Words(gaussians ? options.gaussian_flags : options.train_flags);
  return line;
}

CommandLine EvalLine(const AvatarTradeoffOptions& options, const RunContext& run, const std::string& folder) {
  return {{"avatar", "eval", folder},
          {{"overwrite", {}},
           {"score-size", {std::to_string(options.score_size_px)}},
           {"other-pictures", {"0"}},
           {"renders", {"0"}},
           {"pictures", {"1"}},
           {"features", {options.features}},
           {"threads", {std::to_string(run.num_threads)}}}};
}

/// One after the other; what an earlier call finished with the same words is read from `folder`/trial.json.
Value TrainAndScore(const AvatarTradeoffOptions& options, const AvatarTrial& trial, const TrialCall& call) {
  const std::string& folder = call.folder;
  const CommandLine train = TrainLine(options, call.run, trial, folder), eval = EvalLine(options, call.run, folder);
  const std::string train_words = Join(train.Words(), " "), eval_words = Join(eval.Words(), " ");
  const std::string kept = folder + "/trial.json";
  Value record = std::filesystem::exists(kept) ? Value::Parse(ReadFile(kept), kept) : Value();
  const bool same = record["train_words"].Text() == train_words;
  if (!same) record = Value::Object().Set("train_words", train_words);
  if (same && record["eval_words"].Text() == eval_words && record["eval"].IsObject()) return record;
  const auto keep = [&] { WriteFileAtomic(kept, record.Dump(1) + "\n"); };
  if (!record["train"].IsObject()) {
    const bool resume = same && std::filesystem::exists(folder + "/checkpoint.safetensors");
    if (!resume) RemoveOurs({folder});
    MakeFolder(folder);
    keep();
    const CommandLine go_on = {{"avatar", "resume", folder}, {{"threads", {std::to_string(call.run.num_threads)}}}};
    const Called result = call.Do(resume ? go_on : train);
    record.Set("train", result.metrics).Set("train_timing", result.timing);
    keep();
  }
  record.Set("eval", call.Do(eval).metrics).Set("eval_words", eval_words);
  keep();
  return record;
}

/// "c6-s64-w8-n300-l1-1": cameras, size, width, steps, loss, seed. Other methods than tna begin with their names, and Gaussians
/// have "g" and their number in place of the width.
std::string FolderOf(const AvatarTrial& trial, uint64_t seed) {
  const bool gaussians = trial.method == "gaussians";
  return (trial.method == "tna" ? "" : trial.method + "-") + Format("c%zu-s%d-%s%d-n%d-%s-%llu", trial.cameras.size(),
                                                                    trial.size_px, gaussians ? "g" : "w",
                                                                    gaussians ? trial.gaussians : trial.width, trial.steps,
                                                                    trial.loss.c_str(), static_cast<unsigned long long>(seed));
}

}  // namespace

std::vector<LineOption> LossFlags(const std::string& loss, const std::string& method) {
  const std::vector<std::string> asked = Words(loss, '+'), known = {"l1", "ssim", "gradient", "posenet"};
  for (const std::string& term : asked) {
    if (std::find(known.begin(), known.end(), term) == known.end())
      throw UsageError("option 'losses': '" + term + "' of '" + loss + "' is none of l1, ssim, gradient, posenet");
  }
  if (asked.empty()) throw UsageError("option 'losses': a loss needs at least one term");
  const auto has = [&](const std::string& term) { return std::find(asked.begin(), asked.end(), term) != asked.end(); };
  if (method == "gaussians") {
    if (has("gradient") || has("posenet"))
      throw UsageError("option 'losses': Gaussians have the terms l1 and ssim alone, '" + loss + "' asks for another");
    return {{"weight-l1", {has("l1") ? "1" : "0"}}, {"weight-ssim", {has("ssim") ? "0.5" : "0"}}};
  }
  return {{"weight-l1", {has("l1") ? "1" : "0"}},
          {"weight-ssim", {has("ssim") ? "0.5" : "0"}},
          {"weight-gradient", {has("gradient") ? "0.5" : "0"}},
          {"perceptual", {has("posenet") ? "posenet" : "none"}}};
}

void RunTrial(const AvatarTradeoffOptions& options, const ChildCall& call, const RunContext& run,
              const std::function<void()>& poll, AvatarTrial* trial) {
  const std::string folder = options.out + "/" + FolderOf(*trial, run.seed);
  const Value record = TrainAndScore(options, *trial, {call, run, folder, poll});
  const Value &holdout = record["eval"]["holdout"], &train = record["train"];
  trial->ssim = holdout["ssim"].Number(), trial->psnr_db = holdout["psnr_db"].Number();
  trial->mask_iou = holdout["mask_iou"].Number(), trial->fd = holdout["fd"]["value"].Number();
  trial->kid = holdout["fd"]["kid"].Number();
  trial->train_s = train["wall_s"].Number(), trial->s_per_step = 1 / train["it_per_s"].Number();
  trial->ms_per_frame = 1000 * record["eval"]["seconds_per_frame"].Number();
  trial->parameters = train["num_parameters"].Number();
  trial->peak_rss_mb = record["train_timing"]["peak_rss_mb"].Number();
  trial->done = true;
}

}  // namespace mvstudio::stages
