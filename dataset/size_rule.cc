#include "dataset/size_rule.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "dataset/mask_internal.h"

namespace mvstudio::dataset {
namespace {

constexpr double kMostDifference = 0.02;

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

}  // namespace

std::vector<SizeRule> SizeRules(int calibrated_width, int calibrated_height, int width, int height) {
  const double fx = double(width) / calibrated_width, fy = double(height) / calibrated_height;
  if (width == calibrated_width && height == calibrated_height) return {{"same"}};
  if (std::abs(fx - 1) > kMostDifference || std::abs(fy - 1) > kMostDifference) return {};
  const int cut_x = calibrated_width - width, cut_y = calibrated_height - height;
  const double uniform = cut_x != 0 ? fx : fy;
  const SizeRule fill{"fill", uniform, uniform, 0.5 * (width - uniform * calibrated_width), 0.5 * (height - uniform * calibrated_height)};
  return {fill, {"stretch", fx, fy, 0, 0}, Crop("crop-right", cut_x, cut_y, 0), Crop("crop-centre", cut_x, cut_y, 0.5),
          Crop("crop-left", cut_x, cut_y, 1)};
}

geometry::RigCamera ApplySizeRule(const geometry::RigCamera& camera, const SizeRule& rule, int width, int height) {
  geometry::RigCamera out = camera;
  out.camera.width_px = width;
  out.camera.height_px = height;
  Eigen::VectorXd& p = out.camera.params;
  p[0] *= rule.scale_x;
  p[1] *= rule.scale_y;
  p[2] = rule.scale_x * (p[2] + 0.5) + rule.offset_x_px - 0.5;
  p[3] = rule.scale_y * (p[3] + 0.5) + rule.offset_y_px - 0.5;
  if (out.params_covariance) {
    Eigen::VectorXd scale = Eigen::VectorXd::Ones(p.size());
    scale.head<4>() << rule.scale_x, rule.scale_y, rule.scale_x, rule.scale_y;
    *out.params_covariance = scale.asDiagonal() * *out.params_covariance * scale.asDiagonal();
  }
  return out;
}

SizeDecision DecideSizeRule(const std::vector<SizeRule>& rules, const geometry::RigCamera& camera, const std::vector<Image>& frames,
                            const std::vector<std::map<int, Coco19Pose>>& people, const MaskOptions& options) {
  MVS_CHECK(!rules.empty() && !frames.empty() && frames.size() == people.size(), "nothing to decide with");
  if (rules.size() == 1) return {rules[0], true, {0}};
  const int w = frames[0].width, h = frames[0].height;
  const auto bodies_under = [&](const SizeRule& rule) {
    std::vector<ProjectedBody> bodies;
    for (const auto& p : people) bodies.push_back(ProjectBody(p, ApplySizeRule(camera, rule, w, h), options));
    return bodies;
  };
  const CameraMaskModel model = LearnCamera(frames, bodies_under(rules[0]), nullptr, options);
  std::vector<std::vector<double>> scores;
  SizeDecision decision;
  for (const SizeRule& rule : rules) {
    std::vector<double> by_frame;
    const auto bodies = bodies_under(rule);
    for (size_t f = 0; f < frames.size(); ++f) by_frame.push_back(FrameScore(frames[f], bodies[f], model));
    double sum = 0;
    for (const double s : by_frame) sum += s;
    decision.scores.push_back(sum / double(by_frame.size()));
    scores.push_back(by_frame);
  }
  const size_t best = std::max_element(decision.scores.begin(), decision.scores.end()) - decision.scores.begin();
  for (size_t r = 0; r < rules.size(); ++r) {
    if (r == best) continue;
    const double mean = decision.scores[best] - decision.scores[r];
    double squares = 0;
    for (size_t f = 0; f < frames.size(); ++f) squares += std::pow(scores[best][f] - scores[r][f] - mean, 2);
    const double n = double(frames.size());
    const double error = n > 1 ? std::sqrt(squares / (n - 1) / n) : mean;
    if (mean < 3 * error) decision.decisive = false;
  }
  decision.rule = decision.decisive ? rules[best] : rules[0];
  return decision;
}

}  // namespace mvstudio::dataset
