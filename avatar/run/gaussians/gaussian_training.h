#pragma once

#include <functional>
#include <string>
#include <vector>

#include "avatar/run/pack/training_set.h"
#include "avatar/settings/gaussian_options.h"
#include "avatar/settings/options.h"
#include "avatar/splats/train/train.h"
#include "core/choice/heldout_choice.h"

/// Gaussians on a fitted body, learned from the packs of a run.
namespace mvstudio::avatar {

/// The images of a pack as training takes them; `views` as in TrainingSet.
std::vector<splats::TrainView> TrainViewsOf(const AvatarPack& pack, const std::vector<RowView>& views);

/// Steps and weights from the networks' options where `given` says that they were asked for, else the Gaussians' own.
splats::TrainOptions TrainOptionsOf(const GaussianOptions& gaussians, const TrainOptions& networks,
                                    const std::function<bool(const std::string&)>& given);

/// A training with each degree of colour that came into question.
struct DegreeTrial {
  int degree = 0;
  double validation_ssim = 0;  ///< NaN without validation images
  int64_t gaussians = 0;
};

struct GaussianTraining {
  splats::TrainResult result;       ///< of the degree that was chosen
  splats::TrainOptions options;     ///< of that
  std::vector<DegreeTrial> trials;  ///< in the order of degrees
  std::string reason;               ///< why this degree, one line
};

/// What Gaussians are learned from.
struct GaussianImages {
  std::vector<splats::TrainView> train;
  std::vector<int64_t> camera;                ///< of each of them
  std::vector<splats::TrainView> validation;  ///< may be empty
};

/// One degree is trained unless it is kAuto. Then degrees 0, 1 and 2 are, and the lowest is taken whose SSIM on the validation
/// images is not shown to be worse by one standard error (core/choice). Without validation images one of at least three cameras
/// is left out of trainings of a third of the steps, which choose the degree for all images; with fewer cameras it is 0.
/// `on_row` is told of each look at a training that may be kept.
GaussianTraining TrainGaussians(
    const body::TexturedPerson& fitted, const GaussianImages& images, ColourDegree degree, const splats::TrainOptions& options,
    const RunContext& run, const std::function<void(int degree, const splats::TrainRow&, const splats::Cloud&)>& on_row = {});

/// Rows: truth, rendering, error; one column for each of up to six views, evenly spread.
Image GaussianSheet(const splats::Cloud& cloud, const body::BodyTemplate& body, const std::vector<splats::TrainView>& views,
                    bool mip, int num_threads);

}  // namespace mvstudio::avatar
