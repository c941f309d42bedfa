#pragma once

#include <string>

#include "avatar/body/body_template.h"

namespace mvstudio::body {

/// The body of a MakeHuman folder (hm08, makehumancommunity.org): base.obj, rig.RIG.json, weights.RIG.json, rig.openpose.json
/// for the face, and targets/*.target.gz. `rig` is "cmu_mb" or "game_engine".
///
/// Only the group `body` is kept; the joints come from the groups around it. The template is the mean of the young adults of
/// the targets of ethnicity and gender, as far as they are there. Each target that moves anything is a shape, named like its
/// file; its coefficient is added to what the mean already has of it.
///
/// Throws IoError, FormatError with the place.
BodyTemplate ReadMakeHuman(const std::string& folder, const std::string& rig = "cmu_mb");

}  // namespace mvstudio::body
