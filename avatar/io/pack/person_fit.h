#pragma once

#include <string>
#include <vector>

#include "body/files/textured_person.h"
#include "body/fit/fit_body.h"
#include "core/progress.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::avatar {

struct PersonFitOptions {
  std::vector<std::string> cameras;  ///< Panoptic names
  std::vector<int> frames;
  int person = -1;
  std::string body_template;  ///< a folder of MakeHuman, a file in SMPL's layout, or empty: the mannequin
  int max_silhouettes = 600;  ///< time steps are thinned evenly until no more are used
  int max_px = 512;           ///< longest edge of a person in the images that are fitted to
  int texture_px = 64;        ///< edge of each of the 24 charts
  int max_texture_views = 150;
  bool use_brightness = true;
};

struct PersonFit {
  body::TexturedPerson result;
  body::BodyFit fit;                 ///< without `person`, which is in `result`
  double texture_seen = 0;           ///< share of the texels that some image showed
  std::vector<std::string> missing;  ///< "camera 00_03, frame 17": no image or no mask
};

/// Fits the mannequin to the person of a dataset, and bakes its colours. Images and masks that do not exist are left out.
/// Throws FormatError for damaged ones, UsageError when nothing can be fitted to.
PersonFit FitPerson(const dataset::PanopticDataset& data, const PersonFitOptions& options, const RunContext& run);

}  // namespace mvstudio::avatar
