#include "stages/nets/info/run.h"

#include "avatar/nets/model.h"
#include "core/error.h"
#include "stages/nets/avatar_run.h"

namespace mvstudio::stages {

NetworkInfo InfoOfNetwork(const std::string& run, const avatar::ModelOptions& asked) {
  if (!run.empty() && avatar::HoldsGaussians(run))
    throw UsageError(run + " holds Gaussians, not a network: their number is in avatar_train.result.json");
  NetworkInfo info;
  info.run = run, info.model = asked;
  if (!run.empty()) {
    const std::string checkpoint = AvatarRun(run).checkpoint_path();
    avatar::RequireCheckpoint(checkpoint);
    const avatar::AvatarModel model = avatar::LoadModel(checkpoint);
    info.model = model.options, info.step = model.step, info.size_px = model.size_px;
  }
  Validate(info.model);
  const avatar::Method method = info.model.method;
  const int channels = method == avatar::Method::kTna ? 3 : method == avatar::Method::kHf ? info.model.neural_channels : 0;
  info.num_texels = int64_t{24} * channels * info.model.texture_px * info.model.texture_px;
  info.num_parameters = avatar::NumParameters(info.model);
  return info;
}

}  // namespace mvstudio::stages
