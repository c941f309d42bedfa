#include "avatar/body/dynamic/dynamic_fit.h"

#include <cmath>
#include <limits>
#include <numeric>

#include "core/fields.h"
#include "core/format.h"
#include "core/stopwatch.h"

namespace mvstudio::body {
namespace {

constexpr ChoiceWords<DynamicMode, 4> kModes = {{{DynamicMode::kAuto, "auto"},
                                                 {DynamicMode::kOff, "off"},
                                                 {DynamicMode::kLinear, "linear"},
                                                 {DynamicMode::kNetwork, "network"}}};

constexpr double kOffsetSigmasM[] = {0.005, 0.01, 0.02, 0.05};  // of which the judge chooses

double MeanGain(const std::vector<BlockGain>& gains) {
  double sum = 0;
  for (const BlockGain& gain : gains) sum += gain.gain.num_units > 0 ? gain.gain.mean : std::nan("");
  return sum / static_cast<double>(gains.size());
}

DynamicCandidate Judge(const TakeOutlines& take, const std::vector<PoseBlock>& blocks, const OffsetTrainer& trainer,
                       const RunContext& run, ProgressStage* stage) {
  const Stopwatch watch;
  const TrainOffsets train = [&](const std::vector<int>& indices) -> std::optional<PoseOffsets> {
    const std::optional<TrainedOffsets> offsets = trainer.train(indices);
    stage->Advance();
    if (!offsets) return std::nullopt;
    return [offsets, &take](const ArticulatedPose& pose) { return offsets->At(take.body, pose); };
  };
  DynamicCandidate candidate{trainer.name, JudgeOffsets(take, blocks, train, run)};
  candidate.mean_gain = MeanGain(candidate.gains);
  candidate.beats = BeatsEverywhere(candidate.gains);
  candidate.seconds = watch.Seconds();
  return candidate;
}

/// The best of those that beat skinning everywhere; of none, of all that could be trained. -1: there is none.
int Best(const std::vector<DynamicCandidate>& candidates) {
  int best = -1;
  const auto better = [&](const DynamicCandidate& a, const DynamicCandidate& b) {
    return a.beats != b.beats ? a.beats : a.mean_gain > b.mean_gain;
  };
  for (int i = 0; i < static_cast<int>(candidates.size()); ++i) {
    if (std::isnan(candidates[i].mean_gain)) continue;
    if (best < 0 || better(candidates[i], candidates[best])) best = i;
  }
  return best;
}

std::string ReasonOf(const DynamicCandidate& best, bool always) {
  std::string weak;
  for (const BlockGain& gain : best.gains) {
    if (gain.beats) continue;
    weak = Format("%s: in the block \"%s\" it changes the IoU by %+.4f +- %.4f", best.name.c_str(), gain.name.c_str(),
                  gain.gain.mean, gain.gain.standard_error);
    break;
  }
  if (weak.empty())
    return Format("%s beats skinning in every block left out, by %.4f of IoU in the mean", best.name.c_str(), best.mean_gain);
  return always ? "asked for; " + weak : "off; the best was " + weak;
}

void MeasureOffsets(const TakeOutlines& take, DynamicFit* fit) {
  double squares = 0;
  for (const PosedStep& step : take.steps) {
    const Eigen::Matrix3Xf offsets = fit->offsets->At(take.body, step.seen);
    squares += static_cast<double>(offsets.squaredNorm() / static_cast<float>(offsets.cols()));
    fit->most_m = std::max(fit->most_m, static_cast<double>(offsets.colwise().norm().maxCoeff()));
  }
  fit->rms_m = std::sqrt(squares / static_cast<double>(take.steps.size()));
}

}  // namespace

std::string_view ToString(DynamicMode mode) { return WordOf(kModes, mode); }
void FromString(const std::string& text, DynamicMode* mode) {
  *mode = KnownChoice(kModes, text, "option 'dynamic' must be auto, off, linear or network");
}

Eigen::Matrix3Xf TrainedOffsets::At(const BodyTemplate& body, const ArticulatedPose& pose) const {
  return network ? network->At(PosedAboutRoot(body, ToBodyPose(body, pose))) : linear->At(pose);
}

void AddOffsets(const TrainedOffsets& offsets, BodyTemplate* body) {
  if (offsets.network) {
    body->moving_offsets = offsets.network;
  } else {
    AddLinearOffsets(*offsets.linear, body);
  }
}

std::vector<OffsetTrainer> LinearTrainers(LinearTraining* training) {
  std::vector<OffsetTrainer> trainers;
  for (const double sigma_m : kOffsetSigmasM) {
    LinearTrainingOptions options;
    options.stiffness.offset_sigma_m = sigma_m;
    trainers.push_back({Format("linear offsets of %.1f mm", 1e3 * sigma_m),
                        [training, options](const std::vector<int>& indices) -> std::optional<TrainedOffsets> {
                          auto linear = training->Train(indices, options);
                          return linear ? std::optional(TrainedOffsets{std::move(linear), nullptr}) : std::nullopt;
                        }});
  }
  return trainers;
}

DynamicFit FitDynamic(const TakeOutlines& take, const std::vector<OffsetTrainer>& trainers, bool always,
                      const RunContext& run) {
  DynamicFit fit;
  const std::vector<PoseBlock> blocks = FarBlocks(take);
  if (blocks.empty()) {
    fit.reason = "off; fewer than 15 time steps, or their poses hardly vary";
    return fit;
  }
  ProgressStage stage(run, "a surface that moves with the pose", static_cast<int64_t>(trainers.size() * blocks.size()) + 1);
  for (const OffsetTrainer& trainer : trainers) fit.candidates.push_back(Judge(take, blocks, trainer, run, &stage));
  const int best = Best(fit.candidates);
  if (best < 0) {
    fit.reason = "off; the outlines say nothing of it";
    return fit;
  }
  DynamicCandidate& kept = fit.candidates[best];
  fit.reason = ReasonOf(kept, always);
  if (!kept.beats && !always) return fit;
  std::vector<int> all(take.steps.size());
  std::iota(all.begin(), all.end(), 0);
  fit.offsets = trainers[best].train(all);
  kept.kept = fit.offsets.has_value();
  if (fit.offsets) MeasureOffsets(take, &fit);
  stage.Advance();
  return fit;
}

DynamicFit FitMovingSurface(const std::vector<FitStep>& steps, const std::vector<RejectedView>& rejected, DynamicMode mode,
                            const MakeNetworkTrainer& network, const RunContext& run, PersonBody* person) {
  if (mode == DynamicMode::kOff) return {};
  const TakeOutlines take = TakeOutlinesOf(*person, steps, rejected, run);
  LinearTraining training(take, run);
  std::vector<OffsetTrainer> trainers;
  if (mode != DynamicMode::kNetwork) trainers = LinearTrainers(&training);
  if (mode != DynamicMode::kLinear && network) trainers.push_back(network(take));
  DynamicFit fit = FitDynamic(take, trainers, mode != DynamicMode::kAuto, run);
  if (fit.offsets) AddOffsets(*fit.offsets, &person->body);
  return fit;
}

}  // namespace mvstudio::body
