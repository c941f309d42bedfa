#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/fields.h"
#include "core/image.h"
#include "dataset/masks/masks.h"
#include "geometry/rig/rig.h"

namespace mvstudio::dataset {

/// The rule that is asked for; kAuto: the one that fits the joints best.
enum class SizeRuleChoice { kAuto, kFill, kStretch, kCropRight, kCropCentre, kCropLeft };
std::string_view ToString(SizeRuleChoice choice);  ///< "auto", or the name of a SizeRule
/// Throws UsageError.
void FromString(const std::string& text, SizeRuleChoice* choice);

/// How footage with a size other than the calibrated one may have been made. Along each axis, with pixel edges at -0.5:
/// u_footage + 0.5 = scale (u_calibrated + 0.5) + offset.
struct SizeRule {
  std::string name;  ///< "same", "crop-right", "crop-centre", "crop-left", "stretch", "fill"
  double scale_x = 1, scale_y = 1;
  double offset_x_px = 0, offset_y_px = 0;
};

/// The rules that lead from the calibrated size to the footage's. Only "same" when they are equal. Empty when the sizes
/// differ by more than 2 % along an axis: the footage is then unrelated. The crops keep pixels and cut (or pad) columns
/// and rows. "stretch" scales each axis by its own factor. "fill" scales both by the width's factor (or the height's, when
/// only that changed) and cuts or pads the other axis about its centre. Most likely first: cameras and converters keep
/// pixels square.
std::vector<SizeRule> SizeRules(int calibrated_width, int calibrated_height, int width, int height);

/// The camera for the footage: size, focal lengths and principal point follow the rule, and so does their covariance.
geometry::RigCamera ApplySizeRule(const geometry::RigCamera& camera, const SizeRule& rule, int width, int height);

struct SizeDecision {
  SizeRule rule;
  bool decisive = true;        ///< no other rule is left
  std::vector<double> scores;  ///< one per rule in the given order: mean evidence in nats, larger is better
};

/// Chooses the rule under which the projected limbs best cover what looks like people: the mean over frames of (evidence
/// for a person inside the limbs) - (evidence in a rim around them). A rule is excluded when its evidence is 3 standard
/// errors below the best and its joints are farther from the best rule's than twice `joint_rms_px`, the reprojection error
/// of the joints. A rig with errors as large as the rules' differences cannot decide. Of the remaining rules the first is
/// taken. `people[i]` belongs to `frames[i]`.
SizeDecision DecideSizeRule(const std::vector<SizeRule>& rules, const geometry::RigCamera& camera,
                            const std::vector<Image>& frames, const std::vector<std::map<int, Coco19Pose>>& people,
                            double joint_rms_px, const MaskOptions& options);

}  // namespace mvstudio::dataset
