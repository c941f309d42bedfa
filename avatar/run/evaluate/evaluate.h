#pragma once

#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "avatar/metrics/scores.h"
#include "avatar/run/evaluate/evaluation_protocol.h"
#include "avatar/run/pack/run_config.h"
#include "avatar/scores/set_distance.h"
#include "core/fields.h"
#include "core/progress.h"
#include "dataset/panoptic/missing.h"

namespace mvstudio::avatar {

struct EvaluateOptions {
  std::string dataset;
  std::string cameras;
  int images = 4;
  int other_images = 24;
  int renders = 40;
  int batch = 8;
  int score_size = 0;
  std::string motions;
  std::string features = "auto";
  std::string lpips;
};

template <class Visitor>
void VisitFields(Visitor&& visit, EvaluateOptions& o) {
  visit("dataset", o.dataset, "dataset folder, when it is no longer where the training found it");
  visit("cameras", o.cameras,
        "cameras scored instead of those that the run held out, e.g. cam_02,cam_03: for a run that was trained on another "
        "dataset of the same take");
  visit("pictures", o.images, "image strips kept for each held-out camera");
  visit("other-pictures", o.other_images,
        "images scored of each other split (held-out cameras in training frames and the reverse); 0: none");
  visit("renders", o.renders,
        "held-out renders kept as PNG in eval/render beside their truths in eval/truth, evenly over the frames, for "
        "user studies and other programs; -1: all, 0: none");
  visit("batch", o.batch, "images rendered at a time");
  visit("score-size", o.score_size,
        "edge of the crops that are compared, px: renders are scaled to it, so that avatars of several image sizes meet the "
        "same truth; 0: the training's");
  visit("motions", o.motions,
        "held-out motions scored one by one, e.g. walk=90-104,turn=105-119; runs of consecutive held-out frames unless given");
  visit("features", o.features,
        "net of the Frechet distance: gabor, posenet (mvstudio models fetch), a TorchScript file that gives (N, d), e.g. "
        "inception-2015-12-05.pt for the FID, or auto: posenet when it is installed");
  visit("lpips", o.lpips, "TorchScript file that takes two images in [-1, 1] and gives their LPIPS; no such score without it");
}

/// Scores of one set of images; `fd` is missing below 4 images, `lpips` (mean, of whole crops) is NaN without a net.
struct Scored {
  metrics::MeanScore mean;
  std::optional<SetDistance> fd;
  double lpips = std::nan("");
};

/// Scores of the held-out images of one camera, or of one motion.
struct GroupScore {
  std::string name;  ///< "00_03"; "90-119" or the given name
  metrics::MeanScore mean;
  double lpips = 0, flicker = 0;  ///< NaN where there is none
  metrics::Interval ssim_interval;
};

/// A strip truth | render | error | nearest pose, PNG.
struct ImageStrip {
  std::string path, camera;
  int frame = 0;
  double ssim = 0, psnr_db = 0;
};

struct Evaluation {
  RunConfig config;
  int size_px = 0;           ///< of the crops that were compared
  std::string holdout_kind;  ///< content of `holdout`: "held-out cameras in held-out frames", …
  Scored holdout;
  /// 95 %, of the primary scores: "ssim", "psnr_db", "full.ssim", "masked.psnr_db", "mask_iou", "boundary_f", "lpips", …
  std::map<std::string, metrics::Interval> intervals;
  Scored mean_image, nearest_pose;                    ///< baselines, on the same images
  std::optional<Scored> template_alone;               ///< textured avatars with a template: its textures on the template,
                                                      ///< without the network
  std::optional<Scored> body_alone;                   ///< runs with a fitted body: that in its averaged colours
  std::optional<Scored> body_by_joints;               ///< the same, posed by joints alone where images posed it above
  std::map<std::string, std::string> nearest_camera;  ///< held-out camera -> camera whose images the baselines show
  std::vector<GroupScore> per_camera, per_motion;
  double flicker = 0;  ///< mean over neighbouring frames of each camera; NaN when there are none (avatar/metrics/masks.h)
  std::map<std::string, Scored> other_splits;
  std::vector<ImageStrip> strips;
  std::vector<std::string> skipped;                 ///< images that could not be used, with the reason
  dataset::MissingImages missing;                   ///< of the held-out images: those that the dataset does not hold
  int frames_without_person = 0;                    ///< of the dataset; they are in no split
  std::map<std::string, std::string> training;      ///< fields of the checkpoint: "seed", "model.width", "train.steps", …
  int64_t checkpoint_step = 0, num_parameters = 0;  ///< 0 and 0: no network was trained
  double seconds_per_image = 0;                     ///< rendering alone; NaN without a clock
  std::string convention;                           ///< explanation of the numbers
  ProtocolNet features, lpips;
  std::string distance_name;  ///< "FID", or "FD (posenet)"
  EvaluationProtocol protocol;
};

/// Scores the checkpoint of a training run (a folder with config.json and checkpoint.safetensors) on images it never saw:
/// held-out cameras in held-out frames, or, if only one of the two was held out, that one. Writes image strips and renders
/// to `run_folder`/eval and the protocol to `run_folder`/protocol.json. `clock_s` returns seconds for the timing. Throws
/// IoError when the run, its checkpoint or the dataset is missing, UsageError when nothing was held out, FormatError when
/// the dataset holds no image of a held-out camera. Held-out images that it does not hold are counted, and not scored.
Evaluation Evaluate(const std::string& run_folder, const EvaluateOptions& options, const RunContext& run,
                    const std::function<double()>& clock_s = {});

/// The metrics of an evaluation as JSON: holdout, baselines, per_camera, per_motion, other_splits, split, training,
/// protocol_sha256, convention. One JSON object.
std::string ToJsonText(const Evaluation& evaluation);
/// Same as a table for the terminal.
std::string ToTable(const Evaluation& evaluation);

}  // namespace mvstudio::avatar
