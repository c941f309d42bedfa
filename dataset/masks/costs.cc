#include "dataset/masks/costs.h"

#include <algorithm>
#include <cmath>

#include "dataset/masks/cut.h"
#include "dataset/masks/limbs.h"
#include "dataset/masks/patch.h"

namespace mvstudio::dataset::internal {
namespace {

/// -log density of a colour when its pixel shows the known background, lit as in the model, or less in a shadow.
double KnownBackgroundCost(const Eigen::Vector3d& rgb, const Eigen::Vector3d& background, double sigma, double darkest) {
  constexpr double kForeignShare = 0.01;
  const double norm2 = std::max(background.squaredNorm(), 1.0);
  const double shade = std::clamp(rgb.dot(background) / norm2, darkest, 1.08);
  const double log_norm = 3 * std::log(sigma * std::sqrt(2 * M_PI));
  const double lit = (rgb - background).squaredNorm() / (2 * sigma * sigma);
  // A shadow is rarer than the plain background and rarer the darker it is.
  const double shadow = (rgb - shade * background).squaredNorm() / (2 * sigma * sigma) + 1.5 + 8.0 * std::abs(1 - shade);
  const double best = std::min(lit, shadow) + log_norm;
  return -std::log(kForeignShare / (256.0 * 256.0 * 256.0) + std::exp(-best));
}

double BackgroundCost(const Eigen::Vector3d& rgb, const Eigen::Vector3d& background, double sigma, bool known,
                      const CameraMaskModel& model, double darkest) {
  return known ? KnownBackgroundCost(rgb, background, sigma, darkest) : model.surroundings.Cost(rgb);
}

/// Squared colour step between neighbours that is not a step of the background itself.
float Contrast2(const Patch& patch, int x0, int y0, int x1, int y1) {
  const cv::Vec3f step = patch.rgb.at<cv::Vec3f>(y0, x0) - patch.rgb.at<cv::Vec3f>(y1, x1);
  float contrast2 = step.dot(step);
  if (patch.known.at<float>(y0, x0) > 0.99f && patch.known.at<float>(y1, x1) > 0.99f) {
    const cv::Vec3f own = step - (patch.background.at<cv::Vec3f>(y0, x0) - patch.background.at<cv::Vec3f>(y1, x1));
    contrast2 = std::min(contrast2, own.dot(own));
  }
  return contrast2;
}

/// Scale at which a step counts as an edge: the mean over a coarse grid of the whole patch. Boykov and Jolly, ICCV 2001.
double MeanContrast2(const Patch& patch) {
  double sum = 0, count = 1e-9;
  const int step = std::max(1, int(std::lround(2 * std::sqrt(patch.width() * patch.height() / 2e5))));
  for (int y = 0; y + 1 < patch.height(); y += step) {
    for (int x = 0; x + 1 < patch.width(); x += step) {
      sum += Contrast2(patch, x, y, x + 1, y) + Contrast2(patch, x, y, x, y + 1);
      count += 2;
    }
  }
  return std::max(sum / count, 4.0);
}

/// Nats for a person by the distance to the skeleton; -infinity out of reach.
double SkeletonEvidence(const ProjectedBody& body, const Eigen::Vector2d& px, const MaskOptions& options) {
  const LimbDistance d = DistanceToBody(body, px);
  if (d.outside_m > options.reach_m) return -std::numeric_limits<double>::infinity();
  return d.outside_m < 0 ? options.prior * (1 - d.relative) : -2 * options.prior * d.outside_m / options.reach_m;
}

}  // namespace

PixelCosts ColourCosts(const Patch& patch, int x, int y, const CameraMaskModel& model, const MaskOptions& options) {
  const cv::Vec3f& c = patch.rgb.at<cv::Vec3f>(y, x);
  const cv::Vec3f& b = patch.background.at<cv::Vec3f>(y, x);
  const Eigen::Vector3d rgb(c[0], c[1], c[2]);
  return {model.person.Cost(rgb), BackgroundCost(rgb, Eigen::Vector3d(b[0], b[1], b[2]), patch.sigma.at<float>(y, x),
                                                 patch.known.at<float>(y, x) > 0.99f, model, options.shadow_strength)};
}

double PersonEvidence(const Image& rgb, int x, int y, const CameraMaskModel& model) {
  const size_t i = size_t(y) * rgb.width + x;
  const uint8_t *c = rgb.Pixel(x, y), *b = model.background.colour.Pixel(x, y);
  const Eigen::Vector3d colour(c[0], c[1], c[2]);
  const double background = BackgroundCost(colour, Eigen::Vector3d(b[0], b[1], b[2]), model.background.sigma[i],
                                           model.background.known[i] != 0, model, 0.5);
  return std::clamp(background - model.person.Cost(colour), -8.0, 8.0);
}

void FillContrast(const Patch& patch, CutProblem* p) {
  const size_t n = size_t(p->width) * p->height;
  for (auto* c : {&p->contrast2_x, &p->contrast2_y, &p->contrast2_d, &p->contrast2_u}) c->assign(n, 0.f);
  p->mean_contrast2 = MeanContrast2(patch);
  for (int y = 0; y < p->height; ++y) {
    for (int x = 0; x < p->width; ++x) {
      const size_t i = size_t(y) * p->width + x;
      const auto set = [&](std::vector<float>* contrast2, int u, int v) {
        if (u < 0 || u >= p->width || v >= p->height) return;
        if (p->label[i] == Label::kFree || p->label[size_t(v) * p->width + u] == Label::kFree)
          (*contrast2)[i] = Contrast2(patch, x, y, u, v);
      };
      set(&p->contrast2_x, x + 1, y);
      set(&p->contrast2_y, x, y + 1);
      set(&p->contrast2_d, x + 1, y + 1);
      set(&p->contrast2_u, x - 1, y + 1);
    }
  }
}

void FillCosts(const Patch& patch, const ProjectedBody* body, const CameraMaskModel& model, const MaskOptions& options,
               CutProblem* p) {
  constexpr double kMostColour = 12.0;  // nats; one pixel's colour is never proof
  constexpr double kRare = 0.5;         // nats against a person where nothing but colour is known
  const size_t n = size_t(p->width) * p->height;
  p->person_cost.assign(n, 0.f), p->background_cost.assign(n, 0.f);
  for (int y = 0; y < p->height; ++y) {
    for (int x = 0; x < p->width; ++x) {
      const size_t i = size_t(y) * p->width + x;
      if (p->label[i] != Label::kFree) continue;
      double evidence = body ? SkeletonEvidence(*body, patch.FramePixel(x, y), options) : -kRare;
      if (!std::isfinite(evidence)) {
        p->label[i] = Label::kBackground;
        continue;
      }
      const PixelCosts colour = ColourCosts(patch, x, y, model, options);
      evidence += std::clamp(colour.background - colour.person, -kMostColour, kMostColour);
      if (!patch.hint.empty()) evidence += patch.hint.at<float>(y, x);
      p->background_cost[i] = static_cast<float>(std::max(evidence, 0.0));
      p->person_cost[i] = static_cast<float>(std::max(-evidence, 0.0));
    }
  }
}

cv::Mat LabelMat(const CutProblem& p) {
  cv::Mat mask(p.height, p.width, CV_8U);
  for (int y = 0; y < p.height; ++y) {
    for (int x = 0; x < p.width; ++x) mask.at<uint8_t>(y, x) = p.label[size_t(y) * p.width + x] == Label::kPerson ? 255 : 0;
  }
  return mask;
}

}  // namespace mvstudio::dataset::internal
