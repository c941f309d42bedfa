#pragma once

#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/body/fit/pose_solver.h"

namespace mvstudio::body {

/// The template with its bones as long as the joints say: medians over the time steps, thickness by the median limb. Without a
/// time step whose trunk is known: the template.
BodyTemplate WithLengthsOf(const BodyTemplate& body, const std::vector<JointObservation>& steps);

/// Moves the template's Panoptic joints, each on its bone, to where the posed bones see the observed ones: medians over the
/// time steps, drawn towards the template where there are few.
void MoveJointsToObserved(const std::vector<JointObservation>& steps, const std::vector<ArticulatedPose>& poses,
                          BodyTemplate* body);

/// Rest distances of the joints from the observed ones: median over time steps and joints of the distance in metres; NaN of
/// none.
double MedianJointError(const BodyTemplate& body, const std::vector<JointObservation>& steps,
                        const std::vector<ArticulatedPose>& poses);

}  // namespace mvstudio::body
