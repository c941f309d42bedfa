#pragma once

#include <map>
#include <string>

#include "avatar/body/articulated_pose.h"
#include "avatar/body/body_template.h"
#include "avatar/body/files/atlas.h"

namespace mvstudio::body {

/// A textured, skinned and moving body as glTF 2.0 in one binary file (.glb): metres, y up (x, z, -y of world). The joints have
/// the bones' names, hierarchy and heads; they turn about the heads by the poses' local rotations, and the root also moves. The
/// first frame is at 0 s and frame f (f - first) / frame_rate_hz later: where frames are missing, viewers turn the joints
/// steadily from the one before to the one after. The file shows the first frame where nothing plays, and the rest pose when
/// there are no poses. Throws ContractViolation for poses of another number of bones and values that are not finite.
std::string GlbOfBody(const BodyTemplate& body, const AtlasPng& atlas, const std::map<int, ArticulatedPose>& pose_of_frame,
                      double frame_rate_hz);
void WriteBodyGlb(const std::string& path, const BodyTemplate& body, const AtlasPng& atlas,
                  const std::map<int, ArticulatedPose>& pose_of_frame, double frame_rate_hz);

}  // namespace mvstudio::body
