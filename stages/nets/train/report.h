#pragma once

#include <optional>
#include <string>
#include <vector>

#include "avatar/run/gaussians/gaussian_training.h"
#include "avatar/run/pack/person_fit.h"
#include "avatar/train/train.h"
#include "stages/budget/report.h"
#include "stages/nets/avatar_train_data.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Of a network.
struct NetworkTrained {
  avatar::TrainReport report;
  std::string device;
  double seconds = 0;  ///< that the steps of this time took
  int ranks = 1;
  double least_gain = 0;  ///< of SSIM, asked for
};

/// Which layers of a new network are another run's.
struct NetworkStart {
  std::string run;
  avatar::Method method = avatar::Method::kTna;  ///< of that run
  std::vector<std::string> taken, partly, fresh;
};

/// What a training came to.
struct AvatarTrainReport {
  InputNotes notes;
  int rank = 0;                 ///< processes but the first report nothing more
  std::string dataset, folder;  ///< as given
  avatar::Method method = avatar::Method::kTna;
  int64_t steps = 0, num_parameters = 0;
  double wall_s = 0, whole_s = 0;  ///< of the training, earlier times included; of this call, body and crops included
  avatar::RunConfig config;
  int64_t images = 0;  ///< trained on
  PackNotes packs;
  std::optional<NetworkTrained> network;  ///< this or the next
  std::optional<avatar::GaussianTraining> gaussians;
  std::optional<NetworkStart> start;
  std::optional<Notice> seen;            ///< SeenPoses
  bool body_alone = false;               ///< no network was trained, since nobody asked for one and nothing could judge it
  std::vector<Notice> conflicts;         ///< CheckTrainingImages
  std::optional<avatar::PersonFit> fit;  ///< where the body was fitted here
  std::optional<dataset::MaskMeaning> masks;
  std::optional<int64_t> resumed_from;  ///< step
  std::vector<double> judged_ssim;      ///< with a budget: of each validation image
  std::optional<BudgetReport> budget;
  std::vector<CommandResult::Output> outputs;
};

}  // namespace mvstudio::stages
