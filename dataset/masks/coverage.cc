#include "dataset/masks/coverage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "dataset/masks/costs.h"
#include "dataset/masks/cut.h"
#include "dataset/masks/patch.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr int kSteps = 12;           // coverages tried, 0 to 1
constexpr size_t kMostColours = 10;  // of the person beside a pixel
constexpr double kForeign = 1e-9;    // density of colours that no mixture explains, per level^3

/// sRGB (IEC 61966-2-1) and back; levels 0..255 to light 0..1.
double Light(double level) {
  const double v = level / 255;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

struct ToneCurve {
  std::array<float, 256> light;
  std::array<float, 4097> level;
  ToneCurve() {
    for (int i = 0; i < 256; ++i) light[i] = static_cast<float>(Light(i));
    for (int i = 0; i <= 4096; ++i) {
      const double v = i / 4096.0;
      level[i] = static_cast<float>(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055));
    }
  }
  cv::Vec3f ToLight(const cv::Vec3f& rgb) const {
    cv::Vec3f out;
    for (int k = 0; k < 3; ++k) out[k] = light[std::clamp(int(std::lround(rgb[k])), 0, 255)];
    return out;
  }
  cv::Vec3f ToLevels(const cv::Vec3f& linear) const {
    cv::Vec3f out;
    for (int k = 0; k < 3; ++k) out[k] = level[std::clamp(int(linear[k] * 4096 + 0.5f), 0, 4096)];
    return out;
  }
};

const ToneCurve& Curve() {
  static const ToneCurve curve;
  return curve;
}

/// The background as this frame's light shows it: by how much the sure background beside a pixel is brighter or darker than
/// learned (shadows, light thrown back by the person).
cv::Mat LitBackground(const Patch& patch, const cv::Mat& sure_background, double darkest) {
  cv::Mat lit = patch.background.clone();
  cv::Mat weight;
  sure_background.convertTo(weight, CV_32F, 1.0 / 255);
  weight = weight.mul(patch.known);
  std::array<cv::Mat, 3> now, then;
  cv::split(patch.rgb, now.data());
  cv::split(patch.background, then.data());
  for (int k = 0; k < 3; ++k) {
    cv::Mat products = now[k].mul(then[k]).mul(weight), squares = then[k].mul(then[k]).mul(weight);
    cv::GaussianBlur(products, products, cv::Size(), 2.5);
    cv::GaussianBlur(squares, squares, cv::Size(), 2.5);
    constexpr double kPrior = 30;  // levels^2: with little in reach the light is as learned
    cv::Mat ratio = (products + kPrior) / (squares + kPrior);
    cv::min(cv::max(ratio, darkest), 1.25, ratio);
    then[k] = then[k].mul(ratio);
  }
  cv::merge(then.data(), 3, lit);
  return lit;
}

struct PersonColour {
  cv::Vec3f light;
  double weight;
};

constexpr int kMostReach = 6;  // px

/// Steps to the pixels around one, nearest first.
const std::vector<cv::Point>& StepsOutwards() {
  static const std::vector<cv::Point> steps = [] {
    std::vector<cv::Point> all;
    for (int y = -kMostReach; y <= kMostReach; ++y) {
      for (int x = -kMostReach; x <= kMostReach; ++x) all.push_back({x, y});
    }
    std::stable_sort(all.begin(), all.end(), [](const cv::Point& a, const cv::Point& b) { return a.dot(a) < b.dot(b); });
    return all;
  }();
  return steps;
}

/// Colours of the sure person around a pixel, nearest first in weight; few when the person is thin there.
std::vector<PersonColour> ColoursBeside(const Patch& patch, const cv::Mat& sure_person, int x, int y, int reach) {
  std::vector<PersonColour> colours;
  colours.reserve(kMostColours);
  const cv::Rect inside(0, 0, patch.width(), patch.height());
  double nearest = 0;
  for (const cv::Point& step : StepsOutwards()) {
    const cv::Point at(x + step.x, y + step.y);
    if (std::max(std::abs(step.x), std::abs(step.y)) > reach || !inside.contains(at) || !sure_person.at<uint8_t>(at)) continue;
    const double distance2 = step.dot(step);
    if (colours.empty()) nearest = distance2;
    colours.push_back({Curve().ToLight(patch.rgb.at<cv::Vec3f>(at)), std::exp(-(distance2 - nearest) / 18.0)});
    if (colours.size() == kMostColours) break;
  }
  return colours;
}

struct Coverage {
  double evidence = 0;  ///< nats for "at least one half"
  double mean = 0;      ///< expected coverage
};

/// Density of a residual, per level^3, with heavy tails: a colour beside a pixel is rarely exactly the one in it. It must not
/// depend on the coverage, or the outline moves to the side whose colours are known better.
double ResidualDensity(double squared, double sigma) {
  const double wide = 3 * sigma;
  return 0.0635 * (0.7 * std::exp(-squared / (2 * sigma * sigma)) / (sigma * sigma * sigma) +
                   0.3 * std::exp(-squared / (2 * wide * wide)) / (wide * wide * wide));  // 0.0635: (2 pi)^-1.5
}

/// Posterior of the covered share of one pixel, with half of the prior on 0 and 1.
Coverage CoverageOf(const cv::Vec3f& rgb, const cv::Vec3f& background, double sigma, const std::vector<PersonColour>& person) {
  const cv::Vec3f behind = Curve().ToLight(background);
  double less = 0, more = 0, mean = 0;
  for (const PersonColour& colour : person) {
    for (int s = 0; s <= kSteps; ++s) {
      const float a = float(s) / kSteps;
      const cv::Vec3f off = rgb - Curve().ToLevels(a * colour.light + (1 - a) * behind);
      const double prior = s == 0 || s == kSteps ? 0.25 : 0.5 / (kSteps - 1);
      const double p = colour.weight * prior * (ResidualDensity(off.dot(off), sigma) + kForeign);
      if (2 * s >= kSteps) more += 2 * s == kSteps ? 0.5 * p : p;
      if (2 * s <= kSteps) less += 2 * s == kSteps ? 0.5 * p : p;
      mean += a * p;
    }
  }
  return {std::log(more / less), mean / (more + less)};
}

cv::Mat Disk(double radius) {
  const int half = std::max(1, int(std::ceil(radius)));
  cv::Mat disk(2 * half + 1, 2 * half + 1, CV_8U);
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x) disk.at<uint8_t>(y + half, x + half) = x * x + y * y <= radius * radius + 0.5;
  }
  return disk;
}

}  // namespace

void DecideByCoverage(const Patch& patch, const cv::Mat& bones, const MaskOptions& options, cv::Mat* mask, cv::Mat* coverage) {
  constexpr double kMost = 8.0;
  // Nats. The background's colour is known for each pixel, the person's only beside it, so the evidence is biased to the
  // background. With this value, excess and missing pixels balance on rendered people with exact masks.
  constexpr double kKnownBetter = 0.7;
  cv::Mat inner, outer, sure_background;
  const cv::Mat disk = Disk(options.outline_px);
  cv::erode(*mask, inner, disk, cv::Point(-1, -1), 1, cv::BORDER_REPLICATE);
  cv::dilate(*mask, outer, disk);
  sure_background = outer == 0;
  const cv::Mat lit = LitBackground(patch, sure_background, options.shadow_strength);
  cv::Mat soft = mask->clone();
  CutProblem p;
  p.width = patch.width(), p.height = patch.height();
  p.smoothness = options.outline_smoothness;
  const size_t n = size_t(p.width) * p.height;
  p.label.assign(n, Label::kBackground);
  p.person_cost.assign(n, 0.f), p.background_cost.assign(n, 0.f);
  for (int y = 0; y < p.height; ++y) {
    for (int x = 0; x < p.width; ++x) {
      const size_t i = size_t(y) * p.width + x;
      if (inner.at<uint8_t>(y, x)) p.label[i] = Label::kPerson;
      if (inner.at<uint8_t>(y, x) || !outer.at<uint8_t>(y, x)) continue;
      std::vector<PersonColour> person = ColoursBeside(patch, inner, x, y, kMostReach);
      if (person.empty()) person = ColoursBeside(patch, *mask, x, y, 2);
      const bool known = patch.known.at<float>(y, x) > 0.99f;
      if (bones.at<uint8_t>(y, x) || !known || person.empty()) {
        p.label[i] = mask->at<uint8_t>(y, x) ? Label::kPerson : Label::kBackground;
        continue;
      }
      p.label[i] = Label::kFree;
      const Coverage c = CoverageOf(patch.rgb.at<cv::Vec3f>(y, x), lit.at<cv::Vec3f>(y, x),
                                    std::max(4.0f, patch.sigma.at<float>(y, x)), person);
      const double evidence = std::clamp(c.evidence + kKnownBetter, -kMost, kMost);
      p.background_cost[i] = static_cast<float>(std::max(evidence, 0.0));
      p.person_cost[i] = static_cast<float>(std::max(-evidence, 0.0));
      soft.at<uint8_t>(y, x) = cv::saturate_cast<uint8_t>(255 * c.mean);
    }
  }
  FillContrast(patch, &p);
  SolveCut(&p);
  *mask = LabelMat(p);
  *coverage = OnTheRightSide(soft, *mask);
}

cv::Mat OnTheRightSide(const cv::Mat& soft, const cv::Mat& mask) {
  cv::Mat out, low;
  cv::max(soft, 128, out), cv::min(soft, 127, low);
  low.copyTo(out, mask == 0);
  return out;
}

}  // namespace mvstudio::dataset::internal
