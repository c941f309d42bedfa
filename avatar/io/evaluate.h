#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "avatar/io/run_config.h"
#include "avatar/set_distance.h"
#include "core/fields.h"
#include "core/progress.h"
#include "metrics/scores.h"

namespace mvstudio::avatar {

struct EvaluateOptions {
  std::string dataset;
  int pictures = 4;
  int other_pictures = 24;
  int batch = 8;
  std::string features = "auto";
};

template <class Visitor>
void VisitFields(Visitor&& visit, EvaluateOptions& o) {
  visit("dataset", o.dataset, "dataset folder, when it is no longer where the training found it");
  visit("pictures", o.pictures, "picture strips kept for each held-out camera");
  visit("other-pictures", o.other_pictures,
        "pictures scored of each other split (held-out cameras in training frames and the reverse); 0: none");
  visit("batch", o.batch, "pictures rendered at a time");
  visit("features", o.features,
        "net of the Frechet distance: gabor, posenet (mvstudio models fetch), a TorchScript file that gives (N, d), or auto: "
        "posenet "
        "when it is installed");
}

/// Scores of one set of pictures; `fd` is missing below 4 pictures.
struct Scored {
  metrics::MeanScore mean;
  std::optional<SetDistance> fd;
};

struct CameraScore {
  std::string name;
  std::string nearest_camera;  ///< whose pictures the baselines show
  metrics::MeanScore mean;
};

/// A strip truth | render | error | nearest pose, PNG.
struct PictureStrip {
  std::string path, camera;
  int frame = 0;
  double ssim = 0, psnr_db = 0;
};

struct Evaluation {
  RunConfig config;
  std::string holdout_kind;  ///< which pictures `holdout` are: "held-out cameras in held-out frames", …
  Scored holdout;
  metrics::Interval ssim_interval, psnr_interval;  ///< 95 %, of the primary scores
  Scored mean_image, nearest_pose;                 ///< baselines, on the same pictures
  std::vector<CameraScore> per_camera;
  double flicker = 0;  ///< mean over neighbouring frames of each camera; NaN when there are none (metrics/masks.h)
  std::map<std::string, Scored> other_splits;
  std::vector<PictureStrip> strips;
  std::vector<std::string> skipped;  ///< pictures that could not be used, with the reason
  int64_t checkpoint_step = 0;
  double seconds_per_picture = 0;  ///< rendering alone; NaN without a clock
  std::string convention;          ///< what the numbers mean, in words
};

/// Scores the checkpoint of a training run (a folder with config.json and checkpoint.safetensors) on pictures it never saw:
/// held-out cameras in held-out frames; when only one of the two was held out, that one. Writes picture strips to
/// `run_folder`/eval. `clock_s` gives seconds for the timing. Throws IoError when the run, its checkpoint or the dataset is
/// missing, UsageError when nothing was held out.
Evaluation Evaluate(const std::string& run_folder, const EvaluateOptions& options, const RunContext& run,
                    const std::function<double()>& clock_s = {});

/// The metrics of `mvstudio avatar eval --json`: holdout, baselines, per_camera, other_splits, split, convention. One JSON
/// object.
std::string ToJsonText(const Evaluation& evaluation);
/// The same as a table for people.
std::string ToTable(const Evaluation& evaluation);

}  // namespace mvstudio::avatar
