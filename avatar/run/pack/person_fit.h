#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "avatar/body/dynamic/dynamic_fit.h"
#include "avatar/body/files/textured_person.h"
#include "avatar/body/fit/fit_body.h"
#include "core/progress.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::avatar {

struct PersonFitOptions {
  std::vector<std::string> cameras;  ///< Panoptic names
  std::vector<int> frames;
  std::vector<int> pose_frames;  ///< frames that are only posed, by the images of `cameras`: they tell nothing of the body
  int person = -1;
  /// As body::ReadTemplate takes them. Simplest first; held-out silhouettes choose.
  std::vector<std::string> templates = {""};
  int max_silhouettes = 600;  ///< time steps are thinned evenly until no more are used; one is kept whole
  int max_px = 512;           ///< longest edge of a person in the images that are fitted to
  int texture_px = 64;        ///< edge of each of the 24 charts
  int max_texture_views = 150;
  bool fit_surface = true;  ///< off: the lengths of the bones alone
  bool use_brightness = true;
  body::DynamicMode dynamic = body::DynamicMode::kOff;
  int network_steps = 500;  ///< of the training of each of its networks
};

/// One of several templates.
struct TemplateFit {
  std::string name;         ///< the path, or "mannequin"
  double held_out_iou = 0;  ///< NaN where nothing was held out
  double seconds = 0;
  bool kept = false;
};

/// How frames were posed by a body that was fitted to others.
struct TrackedFrames {
  int frames = 0;
  double iou_before = 0, iou = 0;  ///< mean over the frames: by joints alone, by images too
  std::vector<body::RejectedView> rejected;
};

struct PersonFit {
  body::TexturedPerson result;
  body::BodyFit fit;  ///< without `person`, which is in `result`
  std::vector<TemplateFit> templates;
  body::DynamicFit dynamic;
  TrackedFrames tracked;
  std::map<std::string, Eigen::Array3d> camera_gains;  ///< red, green, blue, by camera; taken out of the colours
  double texture_seen = 0;                             ///< share of the texels that some image showed
  std::vector<std::string> missing;                    ///< "camera 00_03, frame 17": no image or no mask
};

/// Fits a body to the person of a dataset, bakes its colours, and poses further frames. Images and masks that do not exist are
/// left out. Throws FormatError for damaged ones, UsageError when nothing can be fitted to.
PersonFit FitPerson(const dataset::PanopticDataset& data, const PersonFitOptions& options, const RunContext& run);

}  // namespace mvstudio::avatar
