#include "avatar/io/surface/moving_surface.h"

#include "avatar/io/surface/network_training.h"

namespace mvstudio::avatar {

body::DynamicFit FitMovingSurface(const std::vector<body::FitStep>& steps, const std::vector<body::RejectedView>& rejected,
                                  body::DynamicMode mode, const RunContext& run, body::PersonBody* person) {
  if (mode == body::DynamicMode::kOff) return {};
  const body::TakeOutlines take = TakeOutlinesOf(*person, steps, rejected, run);
  const bool always = mode != body::DynamicMode::kAuto;
  body::DynamicFit fit;
  if (mode == body::DynamicMode::kNetwork) {
    const NetworkTraining training(take, {}, run);
    fit = FitDynamic(take, {NetworkTrainer(&training)}, always, run);
  } else {
    body::LinearTraining training(take, run);
    fit = FitDynamic(take, LinearTrainers(&training), always, run);
  }
  if (fit.offsets) AddLinearOffsets(*fit.offsets, &person->body);
  return fit;
}

}  // namespace mvstudio::avatar
