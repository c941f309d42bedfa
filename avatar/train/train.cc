#include "avatar/train/train.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>

#include "avatar/nets/sequence.h"
#include "avatar/train/batch.h"
#include "avatar/train/train_state.h"
#include "core/check.h"
#include "core/join.h"

namespace mvstudio::avatar {
namespace {

std::string NamesOfBatch(const AvatarPack& pack, const std::vector<int64_t>& images) {
  return Join(images, "; ", [&pack](int64_t i) { return ImageName(pack, i); });
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

Trainer::Trainer(const AvatarPack& pack, StartNetwork start, const TrainOptions& options, const RunContext& run,
                 std::shared_ptr<const FeatureNet> perceptual)
    : state_(std::make_unique<State>()) {
  state_->perceptual = std::move(perceptual);
  state_->options = options;
  state_->seed = run.seed;
  state_->model = std::move(start.model);
  state_->Prepare(pack, run, start.initialised);
}

void Trainer::ReplaceImages(const AvatarPack& pack) {
  State& s = *state_;
  Validate(pack);
  MVS_CHECK(pack.size() == s.pack.size() && pack.size_px == s.pack.size_px &&
                pack.joint_valid.size(1) == s.pack.joint_valid.size(1) &&
                pack.template_maps.defined() == s.pack.template_maps.defined(),
            "images of another kind or number than those trained on");
  s.pack = pack;
  if (s.tna()) FitLabelsToMasks(s.pack, at::get_num_threads());
  if (s.v2v()) s.previous_rows = PreviousRows(s.pack);
}

void Trainer::SetBodyTextures(const at::Tensor& textures) { avatar::SetBodyTextures(state_->model, textures); }

void Trainer::TakeNetwork(const Trainer& other) {
  const Adam &own = state_->network, &theirs = other.state_->network;
  const auto same = [](const Adam::Slot& a, const Adam::Slot& b) {
    return a.name == b.name && a.value.sizes() == b.value.sizes();
  };
  MVS_CHECK(std::equal(own.slots.begin(), own.slots.end(), theirs.slots.begin(), theirs.slots.end(), same),
            "networks of other shapes");
  state_->model.generator = other.state_->model.generator;
  state_->network = theirs;
}

Trainer::~Trainer() = default;
Trainer::Trainer(Trainer&&) noexcept = default;

AvatarModel& Trainer::model() { return state_->model; }

int64_t Trainer::total_steps() const { return state_->total_steps(); }

const std::string& Trainer::device() const { return state_->options.device; }

TrainReport Trainer::Run(const AvatarPack* validation, const StepCallback& callback, int64_t until_step) {
  State& s = *state_;
  s.RequireSameBatches();
  const int64_t goal = until_step >= 0 ? std::min(until_step, s.total_steps()) : s.total_steps();
  TrainReport report;
  RowMean mean;
  if (validation) s.ScoreStart(*validation);
  while (s.model.step < goal && !s.Exhausted()) {
    if (s.tna() && !s.InInit() && !s.textures_ready) s.AverageTextures();
    const int64_t step = s.model.step;
    const std::string phase = s.InInit() ? "init" : "train";
    const bool last_of_phase = step + 1 == goal || (s.tna() && step + 1 == s.options.init_steps);
    const StepInput input = s.MakeInput(s.pack, s.previous_rows, s.RowsOfStep(step, false), true, step);
    LossTerms terms;
    if (!s.Step(input, &terms)) {
      report.status = Status::kNonFiniteInput;
      report.best_step = s.best_step;
      report.message = "step " + std::to_string(step + 1) + ": the loss or a gradient is not finite (" +
                       NamesOfBatch(s.pack, s.RowsOfStep(step, true)) +
                       "); weights kept as they were; try a smaller option 'learning-rate'";
      return report;
    }
    if (s.tna() && !s.InInit() && !s.textures_ready) s.AverageTextures();  // before a check or a checkpoint of this step
    mean.Add(terms);
    ++report.steps_done;
    const bool due = last_of_phase || (step + 1) % s.options.report_every == 0;
    HistoryRow row;
    if (due) report.history.push_back(row = s.MeanOverRanks(mean.Take(step + 1, phase)));
    const bool check = validation && s.CheckDue();
    if (check) report.history.push_back(s.Check(*validation));
    if (check && callback) callback(step + 1, &report.history.back());  // before the step's own, which may save
    bool go_on = !callback || callback(step + 1, due ? &row : nullptr);
    if (s.ranks) s.stop_wanted = !go_on, go_on = !s.stop_agreed;
    if (!go_on) {
      report.stopped = true;
      break;
    }
  }
  const bool without_steps = s.model.step == s.total_steps() && !s.textures_ready;
  if (s.tna() && without_steps) s.AverageTextures();
  report.best_step = s.best_step;
  report.gain = s.Gain();
  report.network_off = s.NetworkIsOff();
  report.ended_early = s.Exhausted();
  if (report.ended_early) report.message = s.WhyEndedEarly();
  return report;
}

TrainReport TrainTna(const AvatarPack& pack, const AvatarPack* validation, const ModelOptions& model,
                     const TrainOptions& options, const RunContext& run, const StepCallback& callback, AvatarModel* result) {
  Trainer trainer(pack, model, options, run);
  ProgressStage stage(run, "training", trainer.total_steps());
  const TrainReport report = trainer.Run(validation, [&](int64_t step, const HistoryRow* row) {
    if (!row || row->phase != "validation") stage.Advance(1, row ? row->phase : "");
    return !callback || callback(step, row);
  });
  if (result) *result = ModelFromTensors(trainer.Checkpoint(), "training");
  return report;
}

}  // namespace mvstudio::avatar
