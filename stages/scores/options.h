#pragma once

#include <string>

#include "core/choice/option_style.h"

/// Two sets of images or features that are compared: what a caller gives.
namespace mvstudio::stages {

struct ScoresOptions {
  std::string reference, other;     ///< folders, images or files of features; other: empty for statistics of one
  std::string masks;                ///< folder; empty: none
  std::string features = "auto";    ///< net of the Frechet distance
  std::string background = "auto";  ///< behind images with opacity
  bool distance_only = false;
  std::string write_statistics;  ///< file; empty: none
  bool per_image = false;
};

/// Without the two sets.
template <class Visitor>
void VisitFields(Visitor&& visit, ScoresOptions& o) {
  visit("masks", o.masks, "folder of masks of the same names: scores of their box and of their pixels, too");
  visit("features", o.features,
        "net of the Frechet distance: gabor, posenet (mvstudio models fetch), a TorchScript file that gives (N, d) for "
        "images in [0, 1], inception-2015-12-05.pt for the FID, or auto: posenet when it is installed");
  visit("background", o.background,
        "what is behind images with opacity: black, white, R,G,B, or auto: the colour that the opaque images have there, "
        "else black");
  VisitStyled(visit, OptionStyle::kSwitch, "distance-only", o.distance_only,
              "the Frechet and the kernel distance alone: the sets need no pairs and no equal counts");
  VisitStyled(visit, OptionStyle::kFile, "write-statistics", o.write_statistics,
              "new .npz of the mean `mu` and the covariance `sigma` of the one set's features, as pytorch-fid keeps them");
  VisitStyled(visit, OptionStyle::kSwitch, "per-picture", o.per_image, "list every pair in the metrics");
}

}  // namespace mvstudio::stages
