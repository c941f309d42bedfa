#pragma once

#include <string>

#include "dataset/panoptic/panoptic.h"

namespace mvstudio::dataset {

/// Why no joint of a dataset lies in any camera's image.
struct NotInView {
  bool is_units = false;  ///< the cameras are so close together that their unit must be another than the joints'
  std::string text;  ///< begins with a code: "DAT-UNITS: …", "DAT-VIEW: …"; empty: some joint is in view, or there is none
};
/// Looks at `rig` and at up to 32 frames of `poses` with joints.
NotInView WhyNotInView(const geometry::Rig& rig, const std::map<int, std::map<int, Coco19Pose>>& poses);

/// Throws FormatError that names the calibration where the text above is not empty; with `units_only`, where its unit is wrong.
void RequireInView(const PanopticDataset& dataset, bool units_only);

/// What speaks for metres where Panoptic's files have centimetres: three cameras or more, all within 20 cm of their middle.
/// Else empty.
std::string MetresConflict(const geometry::Rig& rig);

/// Distance of the farthest camera from the middle of all, metres.
double RigRadiusM(const geometry::Rig& rig);

}  // namespace mvstudio::dataset
