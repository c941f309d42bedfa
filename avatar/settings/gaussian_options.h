#pragma once

#include <string>
#include <string_view>

#include "core/choice/option_group.h"
#include "core/fields.h"

namespace mvstudio::avatar {

/// Degree of the harmonics of colour.
enum class ColourDegree { kAuto, kZero, kOne, kTwo };
std::string_view ToString(ColourDegree degree);  ///< "auto", "0", "1", "2"
/// Throws UsageError.
void FromString(const std::string& text, ColourDegree* degree);

/// Gaussians on the fitted body, `--method gaussians`. Steps, batch and weights are those of TrainOptions where they are given.
struct GaussianOptions {
  int gaussians = 0;
  ColourDegree colour_degree = ColourDegree::kAuto;
  bool densify = true;
  bool mip_filter = true;
  bool pose_corrective = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, GaussianOptions& o) {
  StartGroup(visit, "Method gaussians");
  visit("gaussians", o.gaussians,
        "gaussians: their number to begin with; 0: four on each pixel of the body's surface, at most 40000");
  visit("colour-degree", o.colour_degree,
        "gaussians: degree of the spherical harmonics of colour, 0 to 2; auto: the lowest that validation images, or else a "
        "training camera left out of short trainings, do not show to be worse");
  visit("densify", o.densify, "gaussians: divide those that the images pull at most, remove transparent ones");
  visit("pose-corrective", o.pose_corrective,
        "gaussians: each changes its height, opacity and colour linearly with the turns of the two bones that it hangs on");
  visit("mip-filter", o.mip_filter,
        "gaussians: none finer than the training images can show, and each keeps its light in small ones");
}

/// Throws UsageError naming the field that is out of range.
void Validate(const GaussianOptions& options);

}  // namespace mvstudio::avatar
