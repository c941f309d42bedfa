#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/body/texture/bake.h"
#include "avatar/splats/train/density.h"
#include "avatar/splats/train/loss.h"
#include "core/progress.h"

namespace mvstudio::splats {

/// One image of the person: a pinhole crop, and the body as posed in it.
struct TrainView {
  geometry::RigCamera camera;
  Image image;                                       ///< (H, W, 3)
  Image mask;                                        ///< (H, W, 1), 255: person
  std::shared_ptr<const Eigen::Matrix3Xf> vertices;  ///< (3, V) metres, world
  std::string name;                                  ///< "camera 00_03, frame 17", for messages
};

struct TrainOptions {
  int64_t count = 0;  ///< Gaussians to begin with; 0: as many as pixels show of the body (AutomaticCount)
  int degree = 0;     ///< of the colour
  int steps = 1500;
  int batch = 2;  ///< images a step
  bool densify = true;
  bool smooth = true;        ///< the 3D filter, and the 2D Mip filter in images
  int check_every = 150;     ///< steps between looks at the validation images
  bool bends = false;        ///< with a corrective of poses (bend.h)
  double bend_decay = 0.02;  ///< its coefficients shrink by this share of their rate in each step
  double decay = 0.05;       ///< rates at the end, in parts of those at the beginning; exponential
  AdamRates rates;
  LossWeights weights;
  DensityOptions density;
};

/// Gaussians such that four lie on each pixel of the surface, 2000 to 40000.
int64_t AutomaticCount(const body::BodyTemplate& body, const std::vector<TrainView>& views);

/// One look at the training.
struct TrainRow {
  int step = 0;
  LossTerms loss;                                      ///< mean over the steps since the last row
  double validation_ssim = 0, validation_psnr_db = 0;  ///< means over the validation images, in their boxes; NaN without any
  int64_t gaussians = 0;
};

struct TrainResult {
  /// kNotConverged: a loss is not finite, and `trouble` names its images; the cloud is that of the last row.
  Status status = Status::kOk;
  std::string trouble;
  Cloud cloud;  ///< that of the best row by validation images, or of the last one without any
  int best_step = 0;
  std::vector<double> validation_ssim;  ///< of the cloud, an image each
  std::vector<TrainRow> rows;
  DensityReport density;  ///< sums
  SkippedSplats skipped;  ///< in the last training image
};

/// Scores of a cloud on views: SSIM (Wang 2004, RGB) and PSNR in the box around the mask, 8-bit images on black, as `avatar
/// eval`.
struct ViewScores {
  std::vector<double> ssim, psnr_db;
};
ViewScores ScoreViews(const Cloud& cloud, const body::BodyTemplate& body, const std::vector<TrainView>& views, bool mip,
                      const RunContext& run);

/// Learns Gaussians on the body from `views`, beginning at its textures. The same seed gives the same bytes with any number of
/// threads. `on_row` is told of each look. Throws CancelledError through `run`, ContractViolation for views that do not fit the
/// body, without a person, or none at all.
TrainResult TrainCloud(const body::BodyTemplate& body, const body::Textures& textures, const std::vector<TrainView>& views,
                       const std::vector<TrainView>& validation, const TrainOptions& options, const RunContext& run,
                       const std::function<void(const TrainRow&, const Cloud&)>& on_row = {});

}  // namespace mvstudio::splats
