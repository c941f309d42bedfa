#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stages/input/pose_input.h"
#include "stages/result.h"
#include "triangulate/take/take.h"

/// Whether triangulated joints are those of people: lengths of limbs against each other, and which way is up.
namespace mvstudio::stages {

/// Mean lengths by limb, metres: "RHip-RKnee". At least two frames each.
using LimbMeans = std::map<std::string, double>;

/// What people's limbs cannot be, each as text with its lengths; empty where there is nothing to say. Left and right differ by
/// at most 1.35; thigh over shank is 0.7 to 1.6, upper arm over forearm 0.7 to 2, thigh over upper arm 0.9 to 2.5. These bounds
/// are wide, because detectors' joints are not anatomists' and children have other proportions. They are ratios, so a rig of
/// unknown scale is judged as well.
std::vector<std::string> ImpossibleLimbs(const LimbMeans& means);

/// Skeletons with the same number of joints, read into which the same points have limbs of people; the best measured first.
std::vector<std::string> SkeletonsThatFit(const std::vector<triangulate::TakePoint>& points,
                                          const geometry::Skeleton& skeleton);

/// Bones whose mean length lies outside the range that their skeleton states, each as text with its lengths.
std::vector<std::string> BonesOutOfRange(const std::vector<triangulate::TakePoint>& points, const geometry::Skeleton& skeleton);

/// What a take's limbs say against it.
struct LimbJudgement {
  std::vector<std::string> out_of_range;  ///< BonesOutOfRange
  /// Of people, and of joints without bones: ImpossibleLimbs of every person; then the skeletons that fit instead.
  std::vector<std::string> impossible, fitting;
  struct Thigh {
    int person = 0;
    std::string name;
    double length_m = 0;
  };
  std::optional<Thigh> wrong_size;  ///< of possible limbs: metres taken for other units

  /// The joints were read as those of another skeleton.
  bool WrongSkeleton() const { return !fitting.empty(); }
};
LimbJudgement JudgeLimbs(const triangulate::TakeResult& take, const PoseInput& input);

/// Warnings "TRI-LIMBS" of bones outside their stated range and of limbs that no person has, "TRI-SCALE" of the wrong size; the
/// wrong skeleton is an error "TRI-SKELETON", exit 4. `skeleton`: its name.
CommandResult DescribeLimbs(const LimbJudgement& limbs, const std::string& skeleton);

/// Angle between the mean direction that the skeleton calls up, else from hips to shoulders, and the world's z, degrees, over
/// all people and frames; NaN where fewer than ten frames show it.
double TrunkTiltDeg(const std::vector<triangulate::TakePoint>& points, const geometry::Skeleton& skeleton);

/// What points in this rig's world state of their axes.
std::string WorldText(const geometry::Rig& rig);

/// Metrics `world`; a warning "TRI-UP" where the trunks say that z is not up. `folder`: of the points.
CommandResult DescribeUp(double trunk_tilt_deg, const geometry::Rig& rig, const std::string& folder);

}  // namespace mvstudio::stages
