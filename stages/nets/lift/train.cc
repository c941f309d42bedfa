#include <cmath>

#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/nets/lift/run.h"

namespace mvstudio::stages {
namespace {

/// The last `share` of the frames.
std::vector<int> LastFrames(const dataset::PanopticDataset& data, double share) {
  const auto count = static_cast<long>(std::lround(share * static_cast<double>(data.frames.size())));
  return {data.frames.end() - count, data.frames.end()};
}

struct LiftTrainingData {
  std::vector<dataset::PanopticDataset> datasets;
  std::vector<std::vector<int>> held_out;
  std::vector<avatar::LiftSequence> sequences;
  int frames = 0;
};

LiftTrainingData ReadTrainingData(const std::vector<std::string>& roots, double holdout_share) {
  LiftTrainingData data;
  for (const std::string& root : roots) {
    data.datasets.push_back(dataset::OpenPanopticDataset(root));
    data.held_out.push_back(LastFrames(data.datasets.back(), holdout_share));
    for (avatar::LiftSequence& s : avatar::LiftSequences(data.datasets.back(), data.held_out.back())) {
      data.frames += static_cast<int>(s.middle.size());
      data.sequences.push_back(std::move(s));
    }
  }
  if (data.sequences.empty()) {
    throw FormatError(roots[0], "hdPose3d_stage1_coco19",
                      "no frame shows the hips, neck, knees and ankles of a person: nothing to learn from");
  }
  return data;
}

double MeanSize(const std::vector<avatar::LiftSequence>& sequences) {
  double sum = 0, count = 0;
  for (const avatar::LiftSequence& s : sequences) {
    sum += s.size_m * static_cast<double>(s.middle.size()), count += static_cast<double>(s.middle.size());
  }
  return sum / count;
}

/// On all datasets together and, where there are several, on each.
LiftHeldOut ScoreHeldOut(const LiftTrainingData& data, const avatar::Lifter& lifter, const LiftTrainOptions& options,
                         uint64_t seed) {
  const avatar::LiftBaselines baselines(data.sequences, options.samples, options.baseline_poses, seed);
  std::vector<const dataset::PanopticDataset*> datasets;
  for (const dataset::PanopticDataset& d : data.datasets) datasets.push_back(&d);
  LiftHeldOut scores;
  scores.all = CompareOnHeldOut(lifter, baselines, datasets, data.held_out, options.holdout_noise_px, seed);
  for (size_t i = 0; i < datasets.size() && datasets.size() > 1; ++i)
    scores.per_dataset.push_back(
        CompareOnHeldOut(lifter, baselines, {datasets[i]}, {data.held_out[i]}, options.holdout_noise_px, seed));
  return scores;
}

}  // namespace

LiftTrainReport RunLiftTrain(const LiftTrainOptions& options, const RunContext& run) {
  Validate(options.net);
  Validate(options.samples);
  if (!(options.holdout_share >= 0 && options.holdout_share <= 0.9))
    throw UsageError("option 'holdout-share' must be 0 to 0.9");
  if (!(options.holdout_noise_px >= 0)) throw UsageError("option 'holdout-noise-px' must be 0 or more");
  const OutputFiles place({options.out}, options.datasets);
  const LiftTrainingData data = ReadTrainingData(options.datasets, options.holdout_share);
  avatar::Lifter lifter = avatar::MakeLifter(options.net, run.seed);
  lifter.size_m = MeanSize(data.sequences);
  LiftTrainReport report;
  report.datasets = options.datasets, report.out = options.out;
  report.people = static_cast<int>(data.sequences.size()), report.frames = data.frames, report.size_m = lifter.size_m;
  report.training = avatar::TrainLifter(avatar::SamplerOf(data.sequences, options.samples, run.seed), run, &lifter);
  if (options.holdout_share > 0) {
    report.holdout = ScoreHeldOut(data, lifter, options, run.seed);
    lifter.sigma_m = report.holdout->all.sigma_m;
  }
  avatar::SaveLifter(lifter, options.out);
  return report;
}

}  // namespace mvstudio::stages
