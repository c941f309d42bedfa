#include "stages/people/human_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/format.h"
#include "core/join.h"
#include "core/text/shell_word.h"
#include "core/units.h"
#include "triangulate/take/limbs.h"

namespace mvstudio::stages {
namespace {

using triangulate::TakePoint;

struct Ratio {
  std::string over, under;
  double least, most;
};

std::vector<Ratio> Ratios() {
  std::vector<Ratio> ratios;
  for (const char* limb : {"Shoulder-%sElbow", "Elbow-%sWrist", "Hip-%sKnee", "Knee-%sAnkle"}) {
    ratios.push_back({"L" + Format(limb, "L"), "R" + Format(limb, "R"), 1 / 1.35, 1.35});
  }
  for (const std::string side : {"L", "R"}) {
    const std::string thigh = side + "Hip-" + side + "Knee", shank = side + "Knee-" + side + "Ankle";
    const std::string upper_arm = side + "Shoulder-" + side + "Elbow", forearm = side + "Elbow-" + side + "Wrist";
    ratios.push_back({thigh, shank, 0.7, 1.6});
    ratios.push_back({upper_arm, forearm, 0.7, 2});
    ratios.push_back({thigh, upper_arm, 0.9, 2.5});
  }
  return ratios;
}

std::map<int, LimbMeans> MeansOf(const std::vector<TakePoint>& points, const geometry::Skeleton& skeleton) {
  const auto limbs = LimbsOf(skeleton);
  std::map<int, LimbMeans> persons;
  for (const triangulate::LimbLength& length : triangulate::MeasureLimbs(points, limbs)) {
    const auto [a, b] = limbs[static_cast<size_t>(length.limb)];
    persons[length.person][skeleton.joints[static_cast<size_t>(a)] + "-" + skeleton.joints[static_cast<size_t>(b)]] =
        length.mean_m;
  }
  return persons;
}

std::vector<std::string> ImpossibleLimbsOf(const std::map<int, LimbMeans>& persons) {
  std::vector<std::string> all;
  for (const auto& [person, means] : persons) {
    for (const std::string& text : ImpossibleLimbs(means)) all.push_back(Format("person %d: %s", person, text.c_str()));
  }
  return all;
}

/// How much the limbs' lengths vary, over their mean; infinity without limbs.
double Variation(const std::vector<TakePoint>& points, const geometry::Skeleton& skeleton) {
  double sum = 0;
  int count = 0;
  for (const triangulate::LimbLength& length : triangulate::MeasureLimbs(points, LimbsOf(skeleton))) {
    sum += length.std_m / length.mean_m, ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
}

/// Some of a list, and how many more there are.
std::string Shown(const std::vector<std::string>& texts) {
  constexpr size_t kShown = 3;
  const std::vector<std::string> first(texts.begin(),
                                       texts.begin() + static_cast<std::ptrdiff_t>(std::min(kShown, texts.size())));
  const std::string rest = texts.size() > kShown ? Format("; and %zu more", texts.size() - kShown) : "";
  return Join(first, "; ") + rest;
}

/// Limbs of people, of another size: metres taken for other units.
std::optional<LimbJudgement::Thigh> ThighOfWrongSize(const std::map<int, LimbMeans>& persons) {
  constexpr double kLeastThighM = 0.12, kMostThighM = 0.75;  // an infant's, more than the tallest person's
  for (const auto& [person, means] : persons) {
    for (const char* thigh : {"RHip-RKnee", "LHip-LKnee"}) {
      const auto found = means.find(thigh);
      if (found == means.end() || (found->second > kLeastThighM && found->second < kMostThighM)) continue;
      return LimbJudgement::Thigh{person, thigh, found->second};
    }
  }
  return std::nullopt;
}

/// Positions of one person in one frame, by joint.
using Body = std::map<int, Eigen::Vector3d>;

/// Mean of some joints; NaN where one is missing.
Eigen::Vector3d MeanOf(const Body& body, const std::vector<int>& joints) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int joint : joints) {
    const auto found = body.find(joint);
    if (found == body.end()) return Eigen::Vector3d::Constant(std::nan(""));
    sum += found->second;
  }
  return sum / static_cast<double>(joints.size());
}

/// Joints between which the trunk rises: as the skeleton states, else the hips and the shoulders.
std::pair<std::vector<int>, std::vector<int>> TrunkOf(const geometry::Skeleton& skeleton) {
  if (!skeleton.up_from.empty()) return {skeleton.up_from, skeleton.up_to};
  if (!skeleton.human && !skeleton.bones.empty()) return {};
  return {{skeleton.Find("LHip"), skeleton.Find("RHip")}, {skeleton.Find("LShoulder"), skeleton.Find("RShoulder")}};
}

}  // namespace

std::vector<std::string> ImpossibleLimbs(const LimbMeans& means) {
  std::vector<std::string> impossible;
  for (const Ratio& ratio : Ratios()) {
    const auto over = means.find(ratio.over), under = means.find(ratio.under);
    if (over == means.end() || under == means.end()) continue;
    const double value = over->second / under->second;
    if (value >= ratio.least && value <= ratio.most) continue;
    impossible.push_back(Format("%s %.0f mm beside %s %.0f mm", ratio.over.c_str(), 1000 * over->second, ratio.under.c_str(),
                                1000 * under->second));
  }
  return impossible;
}

std::vector<std::string> SkeletonsThatFit(const std::vector<TakePoint>& points, const geometry::Skeleton& skeleton) {
  std::vector<std::pair<double, std::string>> fitting;
  for (const std::string& name : geometry::SkeletonsOfSize(skeleton.joints.size())) {
    const geometry::Skeleton& other = geometry::SkeletonByName(name);
    if (name == skeleton.name || LimbsOf(other).size() < LimbsOf(skeleton).size()) continue;
    if (ImpossibleLimbsOf(MeansOf(points, other)).empty()) fitting.emplace_back(Variation(points, other), name);
  }
  std::sort(fitting.begin(), fitting.end());
  std::vector<std::string> names;
  for (const auto& [variation, name] : fitting) names.push_back(name);
  return names;
}

std::vector<std::string> BonesOutOfRange(const std::vector<TakePoint>& points, const geometry::Skeleton& skeleton) {
  std::vector<std::string> texts;
  if (skeleton.lengths.empty()) return texts;
  for (const triangulate::LimbLength& length : triangulate::MeasureLimbs(points, skeleton.bones)) {
    const size_t bone = static_cast<size_t>(length.limb);
    const geometry::LengthRange& range = skeleton.lengths[bone];
    if (length.mean_m >= range.min_m && length.mean_m <= range.max_m) continue;
    texts.push_back(Format("person %d: %s is %.4g mm, not %.4g to %.4g mm", length.person,
                           BoneName(skeleton, skeleton.bones[bone]).c_str(), 1000 * length.mean_m, 1000 * range.min_m,
                           1000 * range.max_m));
  }
  return texts;
}

LimbJudgement JudgeLimbs(const triangulate::TakeResult& take, const PoseInput& input) {
  LimbJudgement judgement;
  judgement.out_of_range = BonesOutOfRange(take.points, input.skeleton);
  if (!input.skeleton.human && !input.skeleton.bones.empty()) return judgement;
  const std::map<int, LimbMeans> persons = MeansOf(take.points, input.skeleton);
  judgement.impossible = ImpossibleLimbsOf(persons);
  if (judgement.impossible.empty()) {
    judgement.wrong_size = ThighOfWrongSize(persons);
  } else {
    judgement.fitting = SkeletonsThatFit(take.points, input.skeleton);
  }
  return judgement;
}

CommandResult DescribeLimbs(const LimbJudgement& limbs, const std::string& skeleton) {
  CommandResult result;
  if (!limbs.out_of_range.empty()) {
    result.warnings.push_back({"TRI-LIMBS",
                               "bones outside the lengths of skeleton " + skeleton + ": " + Shown(limbs.out_of_range),
                               "check the joints' names, the order of the cameras and the calibration's unit; else the range"});
  }
  const std::string impossible = "no person has such limbs: " + Shown(limbs.impossible);
  if (limbs.WrongSkeleton()) {
    result.exit = kExitQualityGate;
    result.errors.push_back(
        {"TRI-SKELETON", impossible + "; read as " + Join(limbs.fitting, " or ") + ", the same points have limbs of people",
         "the joints are probably not those of " + skeleton + ": run again with option 'skeleton' " + limbs.fitting.front()});
  } else if (!limbs.impossible.empty()) {
    result.warnings.push_back(
        {"TRI-LIMBS", impossible, "check the skeleton of the detector, the order of the cameras and their calibration"});
  }
  if (limbs.wrong_size) {
    result.warnings.push_back(
        {"TRI-SCALE",
         Format("person %d: the thigh %s is %.4g m long, its proportions are those of a person", limbs.wrong_size->person,
                limbs.wrong_size->name.c_str(), limbs.wrong_size->length_m),
         "the calibration's unit is not the metre, or its board's size was wrong: scale the rig by a known "
         "length, or calibrate with the measured board"});
  }
  return result;
}

double TrunkTiltDeg(const std::vector<TakePoint>& points, const geometry::Skeleton& skeleton) {
  constexpr int kFewestFrames = 10;
  const auto [from, to] = TrunkOf(skeleton);
  std::map<std::pair<int, int>, Body> bodies;
  for (const TakePoint& entry : points) {
    if (entry.point.status == Status::kOk) bodies[{entry.person, entry.frame}][entry.joint_idx] = entry.point.x_in_world;
  }
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const auto& [who, body] : bodies) {
    const Eigen::Vector3d trunk = MeanOf(body, to) - MeanOf(body, from);
    if (!trunk.allFinite() || trunk.norm() == 0) continue;
    sum += trunk.normalized(), ++count;
  }
  if (count < kFewestFrames) return std::nan("");
  return RadToDeg(std::atan2(sum.head<2>().norm(), sum.z()));
}

std::string WorldText(const geometry::Rig& rig) {
  using geometry::RigGauge;
  const std::string gauge = GaugeText(rig.gauge);
  if (gauge.empty()) return "right-handed; the calibration does not say what fixes it";
  if (rig.gauge == RigGauge{RigGauge::Kind::kImported}) return "right-handed, axes of the imported calibration";
  if (rig.gauge.IsUpright()) return "right-handed, z up; fixed by " + gauge;
  const bool camera = rig.gauge.kind == RigGauge::Kind::kCamera;
  return "right-handed, axes of " + gauge + (camera ? ": x right, y down, z forward" : "");
}

CommandResult DescribeUp(double tilt, const geometry::Rig& rig, const std::string& folder) {
  constexpr double kMostTiltDeg = 45, kOnTheirHeadsDeg = 150;
  const std::string gauge = GaugeText(rig.gauge), fixed_by = gauge.empty() ? "not said" : gauge;
  CommandResult result;
  result.metrics["world"] = {{"fixed_by", fixed_by}, {"trunk_tilt_deg", FiniteOrNull(tilt)}};
  if (!(tilt > kMostTiltDeg)) return result;
  std::string hint =
      "files that say z or y up show people lying: move the rig onto the floor they walked on (mvstudio calib align "
      "CALIB option 'floor-joints' " +
      ShellWord(folder.empty() ? "FOLDER" : folder) +
      ") and triangulate again, or calibrate with option 'world' board:FRAME; ignore this where people did lie";
  // Cameras of one height see a world that is turned over as well as the true one.
  if (tilt > kOnTheirHeadsDeg)
    hint =
        "does y count from the images' lower edge (option 'flip-y'), or is the calibration left-handed (option 'mirror')? "
        "else " +
        hint;
  result.warnings.push_back(
      {"TRI-UP",
       Format("the world's z is not up: people's trunks lean %.0f degrees from it; what fixes the world: %s", tilt,
              fixed_by.c_str()),
       hint});
  return result;
}

}  // namespace mvstudio::stages
