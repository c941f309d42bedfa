#include <algorithm>
#include <atomic>
#include <filesystem>
#include <map>

#include "core/disk/files.h"
#include "core/error.h"
#include "stages/nets/evaluate/run.h"
#include "stages/nets/train/describe.h"
#include "stages/nets/train/run.h"
#include "stages/tradeoff/predictions.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/one_thread.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// `avatar train` with a budget or a target, on a small synthetic person.
namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

class AvatarBudget : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TempDir>();
    avatar::WriteMannequinDataset(*folder_ / "data", 6, 10, 96);
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static AvatarTrainOptions Options(const std::string& out) {
    AvatarTrainOptions options;
    options.dataset = *folder_ / "data", options.out = *folder_ / out;
    options.split.holdout_cameras = "00_03", options.split.holdout_frames = "8-9";
    options.pack.size_px = 48, options.model.width = 4, options.model.downs = 2;
    options.model.encoder_blocks = options.model.decoder_blocks = 1;
    options.train.device = "cpu", options.train.steps = 120;
    options.given = {"steps"};
    return options;
  }

  static std::unique_ptr<TempDir> folder_;
};

std::unique_ptr<TempDir> AvatarBudget::folder_;

std::string MethodOf(const SettingTrial& trial) { return trial.flags.at(1).second == "0" ? "body" : trial.flags.at(0).second; }

/// Scores of a run on the camera and the frames that nothing has seen.
double HeldOutSsim(const std::string& run) {
  AvatarEvalOptions options;
  options.run_folder = run;
  return RunAvatarEval(options, {}).evaluation.holdout.mean.bbox.ssim;
}

/// The budget's choice against full trainings of all kinds: its held-out score is the best, or the simplest of those within
/// what the validation images tell apart.
TEST_F(AvatarBudget, TheChoiceIsThatOfTheHeldOutImages) {
  AvatarTrainOptions options = Options("chosen");
  options.budget.budget = "10min";
  const AvatarTrainReport report = RunAvatarTrain(options, OneThread());
  ASSERT_TRUE(report.budget);
  const BudgetReport& budget = *report.budget;
  ASSERT_EQ(budget.trials.size(), 4u) << "body, gaussians, direct, hf";
  for (const SettingTrial& trial : budget.trials) EXPECT_TRUE(trial.IsTried()) << trial.why_not;
  EXPECT_EQ(report.config.split.validation_cameras, std::vector<std::string>{"00_02"}) << "the middle one of five";
  EXPECT_LT(budget.actual_s, 600);
  EXPECT_GE(budget.Chosen().predicted_sigma_s, 0.05 * budget.Chosen().predicted_s * (1 - 1e-9));
  EXPECT_NEAR(budget.actual_error, budget.Chosen().error, 0.2 * budget.Chosen().error);
  EXPECT_TRUE(fs::exists(*folder_ / "chosen/predictions.jsonl"));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.metrics["budget"]["error_unit"], "1 - SSIM");
  EXPECT_THAT(said.text, HasSubstr("came out"));

  std::map<std::string, double> held_out;
  double best = 0;
  for (const SettingTrial& trial : budget.trials) {
    const std::string name = MethodOf(trial);
    AvatarTrainOptions full = Options(name);
    full.split.validate_camera = "00_02", full.train.least_gain = 0;
    FromString(trial.flags[0].second, &full.model.method);
    full.train.steps = std::stoi(trial.flags[1].second);
    full.given.insert("method");
    RunAvatarTrain(full, OneThread());
    best = std::max(best, held_out[name] = HeldOutSsim(*folder_ / name));
  }
  const SettingTrial& chosen = budget.Chosen();
  EXPECT_GE(held_out[MethodOf(chosen)], best - std::max(0.005, 2 * chosen.error_sigma))
      << MethodOf(chosen) << " of " << ::testing::PrintToString(held_out);
}

TEST_F(AvatarBudget, ATargetTakesTheCheapestThatReachesIt) {
  AvatarTrainOptions options = Options("reached");
  options.budget.target = "0.2ssim";
  const AvatarTrainReport reached = RunAvatarTrain(options, OneThread());
  EXPECT_EQ(MethodOf(reached.budget->Chosen()), "body");
  EXPECT_EQ(reached.steps, 0);
  EXPECT_EQ(reached.budget->trials.at(1).why_not, kCheaperReaches);

  options.overwrite = true, options.budget.target = "0.9999ssim";
  options.model.method = avatar::Method::kGaussians, options.given.insert("method");
  const AvatarTrainReport missed = RunAvatarTrain(options, OneThread());
  EXPECT_EQ(missed.budget->choice.outcome, SettingChoice::Outcome::kBestWithinBudget);
  const std::vector<Notice> warnings = Describe(missed).warnings;
  const auto is_target = [](const Notice& warning) { return warning.code == "BUD-TARGET"; };
  EXPECT_TRUE(std::any_of(warnings.begin(), warnings.end(), is_target));
  const std::string kept = ReadFile(*folder_ / "reached/predictions.jsonl");
  EXPECT_EQ(std::count(kept.begin(), kept.end(), '\n'), 2) << "the older run's prediction stays";
  PredictionsOptions predictions;
  predictions.files = {*folder_ / "reached"};
  EXPECT_THAT(Describe(RunPredictions(predictions)).text, HasSubstr("avatar train"));
}

TEST_F(AvatarBudget, WhatCannotBeKeptIsRefusedBeforeAnythingIsWritten) {
  AvatarTrainOptions options = Options("refused");
  const auto message = [&] { return MessageOf<UsageError>([&] { RunAvatarTrain(options, OneThread()); }); };
  options.budget.budget = "10ms";
  EXPECT_THAT(message(), HasSubstr("give more time"));
  options.budget.budget = "", options.budget.target = "2px";
  EXPECT_THAT(message(), HasSubstr("SSIM"));
  options.budget.target = "0.9ssim", options.split.train_cameras = "00_00";
  EXPECT_THAT(message(), HasSubstr("there is one camera to train on"));
  options.split.train_cameras = "", options.given.insert("ranks");
  EXPECT_THAT(message(), HasSubstr("leave option 'ranks' out"));
  options.given = {"rendezvous"};
  EXPECT_THAT(message(), HasSubstr("leave option 'rendezvous' out"));
  options.given = {"width", "colour-degree"};
  EXPECT_THAT(message(), HasSubstr("option '")) << "no method takes both";
  EXPECT_FALSE(fs::exists(*folder_ / "refused/config.json"));
}

/// Is asked to stop as soon as a trial has begun; whatever stage comes next must heed it.
class StopInTheTrial : public ProgressSink {
 public:
  void Begin(const std::string& stage, int64_t) override {
    stages_.push_back(stage);
    stopped_ = stopped_ || stage == "trial for the budget";
  }
  void Advance(int64_t, const std::string&) override { advances_ += stopped_ ? 1 : 0; }
  bool Cancelled() const override { return stopped_ && ++asked_ > 1; }  // the first time only a kind's name was told
  std::vector<std::string> stages_;
  int advances_ = 0;  // of the trial's stage itself

 private:
  bool stopped_ = false;
  mutable std::atomic<int> asked_{0};
};

TEST_F(AvatarBudget, ATrialStopsWhereThatIsAskedFor) {
  AvatarTrainOptions options = Options("stopped");
  options.budget.budget = "10min", options.train.steps = 1000000;  // a trial of them takes days
  options.model.method = avatar::Method::kGaussians, options.given.insert("method");
  StopInTheTrial sink;
  RunContext run = OneThread();
  run.progress = &sink;
  EXPECT_THROW(RunAvatarTrain(options, run), CancelledError);
  EXPECT_EQ(sink.stages_.back(), "trial for the budget") << "what is tried shows no stages of its own";
  EXPECT_EQ(sink.advances_, 1) << "within the first kind";
}

}  // namespace
}  // namespace mvstudio::stages
