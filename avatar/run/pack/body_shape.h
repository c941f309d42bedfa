#pragma once

#include <array>

#include "avatar/body/body_template.h"

namespace mvstudio::avatar {

enum GirthGroup { kTrunkGirth, kHeadGirth, kArmGirth, kLegGirth, kNumGirthGroups };

/// Thickness of a person around the bones relative to the template: 1 keeps the template. Lengths come from the joints.
struct BodyShape {
  std::array<double, kNumGirthGroups> girth = {1, 1, 1, 1};
};

/// Group of a part of the atlas (1..24).
GirthGroup GroupOfPart(int part);

/// The template with each vertex moved away from (or towards) its bones in the rest pose. A vertex between two groups gets
/// the mean of its faces' girths, so that the surface stays closed.
body::BodyTemplate ScaleGirth(const body::BodyTemplate& body, const BodyShape& shape);

}  // namespace mvstudio::avatar
