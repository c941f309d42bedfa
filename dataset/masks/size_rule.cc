#include "dataset/masks/size_rule.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/choice/heldout_choice.h"
#include "core/statistics.h"
#include "dataset/masks/costs.h"
#include "dataset/masks/limbs.h"
#include "geometry/rig/resize.h"

namespace mvstudio::dataset {
namespace {

constexpr double kMostDifference = 0.02;
constexpr ChoiceWords<SizeRuleChoice, 6> kSizeRules = {{{SizeRuleChoice::kAuto, "auto"},
                                                        {SizeRuleChoice::kFill, "fill"},
                                                        {SizeRuleChoice::kStretch, "stretch"},
                                                        {SizeRuleChoice::kCropRight, "crop-right"},
                                                        {SizeRuleChoice::kCropCentre, "crop-centre"},
                                                        {SizeRuleChoice::kCropLeft, "crop-left"}}};

SizeRule Crop(const std::string& name, int cut_x, int cut_y, double share) {
  return {name, 1, 1, -share * cut_x, -share * cut_y};
}

/// Evidence of one frame for one rule.
double FrameScore(const Image& frame, const ProjectedBody& body, const CameraMaskModel& model) {
  constexpr double kRimM = 0.04;
  const internal::PixelBox box = internal::BoxOfBody(body, frame.width, frame.height, kRimM);
  const int step = std::max(1, std::max(box.width(), box.height()) / 400);
  double inside = 0, rim = 0, num_inside = 0, num_rim = 0;
  for (int y = box.y0; y < box.y1; y += step) {
    for (int x = box.x0; x < box.x1; x += step) {
      const double outside_m = internal::DistanceToBody(body, {double(x), double(y)}).outside_m;
      if (outside_m > kRimM) continue;
      const double evidence = internal::PersonEvidence(frame, x, y, model);
      (outside_m < 0 ? inside : rim) += evidence;
      (outside_m < 0 ? num_inside : num_rim) += 1;
    }
  }
  return num_inside > 0 && num_rim > 0 ? inside / num_inside - rim / num_rim : 0;
}

struct RuleEvidence {
  std::vector<ProjectedBody> bodies;  ///< by frame
  std::vector<double> scores;         ///< by frame
};

std::vector<ProjectedBody> BodiesUnder(const SizeRule& rule, const geometry::RigCamera& camera, const Image& frame,
                                       const std::vector<std::map<int, Coco19Pose>>& people, const MaskOptions& options) {
  const geometry::RigCamera seen = ApplySizeRule(camera, rule, frame.width, frame.height);
  std::vector<ProjectedBody> bodies;
  for (const auto& p : people) bodies.push_back(ProjectBody(p, seen, options));
  return bodies;
}

/// By the evidence of the frames alone.
HeldOutChoice NotRuledOut(const std::vector<SizeRule>& rules, const std::vector<RuleEvidence>& evidence) {
  HeldOutRule rule;
  rule.standard_errors = 3, rule.min_units = 3;
  std::vector<HeldOutCandidate> candidates;
  for (size_t r = 0; r < rules.size(); ++r) {
    candidates.push_back({rules[r].name, {}});
    for (const double score : evidence[r].scores) candidates.back().units.push_back(-score);
  }
  return ChooseHeldOut(candidates, rule);
}

/// Root mean square distance of the ends of the bones.
double JointDistancePx(const std::vector<ProjectedBody>& a, const std::vector<ProjectedBody>& b) {
  double squares = 0, count = 0;
  for (size_t f = 0; f < a.size(); ++f) {
    for (size_t i = 0; i < std::min(a[f].bones.size(), b[f].bones.size()); ++i) {
      squares += (a[f].bones[i].first - b[f].bones[i].first).squaredNorm();
      count += 1;
    }
  }
  return count > 0 ? std::sqrt(squares / count) : 0;
}

}  // namespace

std::string_view ToString(SizeRuleChoice choice) { return WordOf(kSizeRules, choice); }

void FromString(const std::string& text, SizeRuleChoice* choice) {
  *choice = KnownChoice(kSizeRules, text,
                        "option 'size-rule' " + text + ": known are auto, fill, stretch, crop-right, crop-centre, crop-left");
}

std::vector<SizeRule> SizeRules(int calibrated_width, int calibrated_height, int width, int height) {
  const double fx = double(width) / calibrated_width, fy = double(height) / calibrated_height;
  if (width == calibrated_width && height == calibrated_height) return {{"same"}};
  if (std::abs(fx - 1) > kMostDifference || std::abs(fy - 1) > kMostDifference) return {};
  const int cut_x = calibrated_width - width, cut_y = calibrated_height - height;
  const double uniform = cut_x != 0 ? fx : fy;
  const SizeRule fill{"fill", uniform, uniform, 0.5 * (width - uniform * calibrated_width),
                      0.5 * (height - uniform * calibrated_height)};
  return {fill,
          Crop("crop-right", cut_x, cut_y, 0),
          Crop("crop-centre", cut_x, cut_y, 0.5),
          Crop("crop-left", cut_x, cut_y, 1),
          {"stretch", fx, fy, 0, 0}};
}

geometry::RigCamera ApplySizeRule(const geometry::RigCamera& camera, const SizeRule& rule, int width, int height) {
  return geometry::Resized(camera, {rule.scale_x, rule.scale_y, rule.offset_x_px, rule.offset_y_px}, width, height);
}

SizeDecision DecideSizeRule(const std::vector<SizeRule>& rules, const geometry::RigCamera& camera,
                            const std::vector<Image>& frames, const std::vector<std::map<int, Coco19Pose>>& people,
                            double joint_rms_px, const MaskOptions& options) {
  MVS_CHECK(!rules.empty() && !frames.empty() && frames.size() == people.size(), "nothing to decide with");
  if (rules.size() == 1) return {rules[0], true, {0}};
  std::vector<RuleEvidence> evidence;
  for (const SizeRule& rule : rules) evidence.push_back({BodiesUnder(rule, camera, frames[0], people, options), {}});
  const CameraMaskModel model = LearnCamera(frames, evidence[0].bodies, nullptr, options);
  SizeDecision decision;
  for (RuleEvidence& e : evidence) {
    for (size_t f = 0; f < frames.size(); ++f) e.scores.push_back(FrameScore(frames[f], e.bodies[f], model));
    decision.scores.push_back(Mean(e.scores));
  }
  const HeldOutChoice choice = NotRuledOut(rules, evidence);
  const auto best = static_cast<size_t>(choice.best);
  std::vector<size_t> left;
  for (size_t r = 0; r < rules.size(); ++r) {
    const bool apart = JointDistancePx(evidence[best].bodies, evidence[r].bodies) > 2 * joint_rms_px;
    if (choice.verdicts[r].as_good || !apart) left.push_back(r);
  }
  decision.decisive = left.size() == 1;
  decision.rule = rules[left[0]];
  return decision;
}

}  // namespace mvstudio::dataset
