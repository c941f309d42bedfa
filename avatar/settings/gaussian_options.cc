#include "avatar/settings/gaussian_options.h"

namespace mvstudio::avatar {
namespace {

constexpr ChoiceWords<ColourDegree, 4> kDegrees = {
    {{ColourDegree::kAuto, "auto"}, {ColourDegree::kZero, "0"}, {ColourDegree::kOne, "1"}, {ColourDegree::kTwo, "2"}}};

}  // namespace

std::string_view ToString(ColourDegree degree) { return WordOf(kDegrees, degree); }
void FromString(const std::string& text, ColourDegree* degree) {
  *degree = KnownChoice(kDegrees, text, "option 'colour-degree' must be auto, 0, 1 or 2");
}

void Validate(const GaussianOptions& o) {
  if (o.gaussians < 0 || o.gaussians > 1000000)
    throw UsageError("option 'gaussians' must be in 0..1000000, it is " + std::to_string(o.gaussians));
}

}  // namespace mvstudio::avatar
