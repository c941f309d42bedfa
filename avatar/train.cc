#include "avatar/train.h"

#include <ATen/ATen.h>

#include <algorithm>

#include "avatar/batch.h"
#include "avatar/train_state.h"

namespace mvstudio::avatar {
namespace {

std::string NamesOfBatch(const AvatarPack& pack, const std::vector<int64_t>& pictures) {
  std::string names;
  for (const int64_t i : pictures) names += (names.empty() ? "" : "; ") + PictureName(pack, i);
  return names;
}

}  // namespace

Trainer::Trainer(const AvatarPack& pack, const ModelOptions& model, const TrainOptions& options, const RunContext& run,
                 std::shared_ptr<const FeatureNet> perceptual)
    : state_(std::make_unique<State>()) {
  Validate(pack);
  state_->perceptual = std::move(perceptual);
  state_->options = options;
  state_->seed = run.seed;
  const at::Tensor depth = BoneDepth(pack.joints_in_cam, pack.joint_valid, model.relative_depth);
  state_->model = MakeModel(model, pack.size_px, ChooseDepthRange(depth, pack.joint_valid), run.seed);
  state_->Prepare(pack, run);
}

Trainer::~Trainer() = default;

AvatarModel& Trainer::model() { return state_->model; }

TrainReport Trainer::Run(const AvatarPack* validation, const StepCallback& callback, int64_t until_step) {
  State& s = *state_;
  const int64_t goal = until_step >= 0 ? std::min(until_step, s.total_steps()) : s.total_steps();
  TrainReport report;
  RowMean mean;
  while (s.model.step < goal) {
    if (s.tna() && !s.InInit() && !s.textures_ready) s.AverageTextures();
    const int64_t step = s.model.step;
    const std::string phase = s.InInit() ? "init" : "train";
    const bool last_of_phase = step + 1 == goal || (s.tna() && step + 1 == InitSteps(s.options));
    const StepInput input =
        s.MakeInput(s.pack, s.previous_rows, PicturesOfStep(s.pack.size(), s.options.batch, s.seed, step), true, step);
    LossTerms terms;
    if (!s.Step(input, &terms)) {
      report.status = Status::kNonFiniteInput;
      report.message = "step " + std::to_string(step + 1) + ": the loss or a gradient is not finite (" +
                       NamesOfBatch(s.pack, input.batch.pictures) +
                       "); weights kept as they were; try a smaller --learning-rate";
      return report;
    }
    mean.Add(terms);
    ++report.steps_done;
    const bool due = last_of_phase || (step + 1) % s.options.report_every == 0;
    if (due) report.history.push_back(mean.Take(step + 1, phase));
    const bool go_on = !callback || callback(step + 1, due ? &report.history.back() : nullptr);
    if (validation && !s.InInit() && s.options.validate_pictures > 0 &&
        (step + 1 == goal || (step + 1) % s.options.save_every == 0)) {
      report.history.push_back(s.ScoreHeldOut(*validation));
      if (callback) callback(step + 1, &report.history.back());
    }
    if (!go_on) break;
  }
  return report;
}

TrainReport TrainTna(const AvatarPack& pack, const AvatarPack* validation, const ModelOptions& model,
                     const TrainOptions& options, const RunContext& run, const StepCallback& callback, AvatarModel* result) {
  Trainer trainer(pack, model, options, run);
  ProgressStage stage(run, "training", int64_t{InitSteps(options)} + options.steps);
  const TrainReport report = trainer.Run(validation, [&](int64_t step, const HistoryRow* row) {
    if (!row || row->phase != "validation") stage.Advance(1, row ? row->phase : "");
    return !callback || callback(step, row);
  });
  if (result) *result = trainer.model();
  return report;
}

}  // namespace mvstudio::avatar
