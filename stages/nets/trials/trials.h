#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stages/result.h"

/// Cost and quality of training over a grid of settings. Each trial is a run of this program's own `avatar train` and
/// `avatar eval`, so it can be repeated manually.
namespace mvstudio::stages {

struct AvatarGrid {
  std::vector<int> widths{8, 16}, sizes{64, 128}, steps{0, 300, 600}, cameras{16, 6, 3};
  std::vector<std::string> losses{"l1", "l1+ssim"};
  std::vector<std::string> methods{"tna"};  ///< tna, direct, v2v, gaussians
  std::vector<int> gaussians{0};            ///< takes the place of the width with Gaussians; 0: automatic
};

/// One point of the grid.
struct AvatarTrial {
  std::string method = "tna";
  int width = 0, size_px = 0, steps = 0;  ///< 0 steps: the posed template in averaged colours, without a network
  int gaussians = 0;                      ///< in place of the width with method gaussians: to begin with; 0: automatic
  std::string loss;
  std::vector<std::string> cameras;  ///< used for training
  /// Results; NaN before it has run.
  double ssim = 0, psnr_db = 0, mask_iou = 0, fd = 0, train_s = 0, s_per_step = 0, ms_per_frame = 0, parameters = 0,
         peak_rss_mb = 0, kid = 0;
  bool done = false;
  bool train_front = false, render_front = false;  ///< among the trials with as many cameras
  std::string Name() const;                        ///< "width 8, 64 px, 300 steps, l1+ssim"
};

template <class Visitor>
void VisitFields(Visitor&& visit, const AvatarTrial& r) {
  visit("method", r.method);
  visit("cameras", r.cameras.size());
  visit("size_px", r.size_px);
  visit("width", r.width);
  visit("gaussians", r.gaussians);
  visit("steps", r.steps);
  visit("loss", r.loss);
  visit("done", r.done);
  visit("ssim", r.ssim);
  visit("psnr_db", r.psnr_db);
  visit("mask_iou", r.mask_iou);
  visit("fd", r.fd);
  visit("kid", r.kid);
  visit("train_s", r.train_s);
  visit("s_per_step", r.s_per_step);
  visit("ms_per_frame", r.ms_per_frame);
  visit("num_parameters", r.parameters);
  visit("peak_rss_mb", r.peak_rss_mb);
  visit("train_cameras", r.cameras);
  visit("on_front", r.train_front);
  visit("on_render_front", r.render_front);
}

struct AvatarTradeoffOptions {
  std::string dataset, out, features = "auto";
  std::string train_flags, gaussian_flags;   ///< further flags of trainings: of networks, of Gaussians
  std::string camera_words;                  ///< names of cameras that are held out, with commas; empty: every fifth
  std::vector<std::string> holdout_cameras;  ///< as the dataset calls them; set by the run
  std::string holdout_frames;                ///< empty: the last quarter
  bool quick = false;                        ///< a grid of a few minutes
  AvatarGrid grid;
  int score_size_px = 0;     ///< all trials are scored at this size
  double limit_minutes = 0;  ///< no further trial starts after this time; 0: no limit
};

/// Every combination, cheapest first; without steps, one for each method, size and number of cameras, and of Gaussians.
/// `cameras`: candidate names, ordered so that every prefix is well spread. Throws UsageError for a method that does not exist.
std::vector<AvatarTrial> MakeTrials(const AvatarGrid& grid, const std::vector<std::string>& cameras);

/// Marks the Pareto fronts within each number of cameras: seconds of training, and ms per frame, against 1 - SSIM.
void MarkFronts(std::vector<AvatarTrial>* trials);

std::string TrialsText(const std::vector<AvatarTrial>& trials, const std::string& distance);
std::string TrialsPage(const std::vector<AvatarTrial>& trials, const AvatarTradeoffOptions& options);

}  // namespace mvstudio::stages
