#include "dataset/masks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "dataset/mask_internal.h"

namespace mvstudio::dataset {
namespace {

using internal::CutProblem;
using internal::Label;
using internal::PixelBox;

cv::Mat View(const Image& image) {
  return cv::Mat(image.height, image.width, CV_8UC(image.channels), const_cast<uint8_t*>(image.pixels.data()));
}

/// A part of the frame and of the background model at one resolution; pixel (x, y) of it is pixel offset + scale (x, y) of the
/// frame.
struct Patch {
  double scale = 1;
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
  cv::Mat rgb;         // CV_32FC3
  cv::Mat background;  // CV_32FC3, exposure of this frame
  cv::Mat sigma;       // CV_32F
  cv::Mat known;       // CV_32F, 1 where known
  int width() const { return rgb.cols; }
  int height() const { return rgb.rows; }
  Eigen::Vector2d FramePixel(int x, int y) const { return offset + scale * Eigen::Vector2d(x, y); }
};

/// How much brighter this frame is than the background model, by channel, from pixels away from people.
cv::Scalar ExposureGain(const Image& rgb, const ProjectedBody& body, const BackgroundModel& model, double margin_m) {
  std::array<std::vector<float>, 3> ratios;
  const int step = std::max(1, std::max(rgb.width, rgb.height) / 160);
  const PixelBox box = internal::BoxOfBody(body, rgb.width, rgb.height, margin_m);
  for (int y = step / 2; y < rgb.height; y += step) {
    for (int x = step / 2; x < rgb.width; x += step) {
      if (x >= box.x0 && x < box.x1 && y >= box.y0 && y < box.y1) continue;
      if (!model.known[size_t(y) * rgb.width + x]) continue;
      const uint8_t *now = rgb.Pixel(x, y), *then = model.colour.Pixel(x, y);
      for (int k = 0; k < 3; ++k) {
        if (then[k] > 30 && then[k] < 235 && now[k] < 250) ratios[k].push_back(float(now[k]) / float(then[k]));
      }
    }
  }
  cv::Scalar gain(1, 1, 1);
  for (int k = 0; k < 3; ++k) {
    auto& r = ratios[k];
    if (r.size() < 50) continue;
    std::nth_element(r.begin(), r.begin() + r.size() / 2, r.end());
    gain[k] = std::clamp(double(r[r.size() / 2]), 0.7, 1.4);
  }
  return gain;
}

Patch FullPatch(const Image& rgb, const PixelBox& box, const BackgroundModel& model, const cv::Scalar& gain) {
  const cv::Rect rect(box.x0, box.y0, box.width(), box.height());
  Patch patch;
  patch.offset = {double(box.x0), double(box.y0)};
  View(rgb)(rect).convertTo(patch.rgb, CV_32F);
  View(model.colour)(rect).convertTo(patch.background, CV_32F);
  cv::multiply(patch.background, gain, patch.background);
  patch.sigma = cv::Mat(rgb.height, rgb.width, CV_32F, const_cast<float*>(model.sigma.data()))(rect).clone();
  cv::Mat(rgb.height, rgb.width, CV_8U, const_cast<uint8_t*>(model.known.data()))(rect).convertTo(patch.known, CV_32F);
  return patch;
}

Patch Reduced(const Patch& full, int longer_side_px) {
  const double factor = std::max(full.width(), full.height()) / double(longer_side_px);
  if (factor <= 1.25) return full;
  const cv::Size size(std::max(1, int(std::lround(full.width() / factor))),
                      std::max(1, int(std::lround(full.height() / factor))));
  Patch patch;
  patch.scale = double(full.width()) / size.width;
  patch.offset = full.offset + Eigen::Vector2d::Constant(0.5 * (patch.scale - 1));
  const auto shrink = [&](const cv::Mat& from, cv::Mat* to) { cv::resize(from, *to, size, 0, 0, cv::INTER_AREA); };
  shrink(full.rgb, &patch.rgb), shrink(full.background, &patch.background);
  shrink(full.sigma, &patch.sigma), shrink(full.known, &patch.known);
  return patch;
}

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

struct PixelCosts {
  double person = 0, background = 0;
};

/// Costs by colour alone.
PixelCosts ColourCosts(const Patch& patch, int x, int y, const CameraMaskModel& model, const MaskOptions& options) {
  const cv::Vec3f& c = patch.rgb.at<cv::Vec3f>(y, x);
  const Eigen::Vector3d rgb(c[0], c[1], c[2]);
  PixelCosts costs;
  const cv::Vec3f& b = patch.background.at<cv::Vec3f>(y, x);
  costs.person = model.person.Cost(rgb);
  costs.background = BackgroundCost(rgb, Eigen::Vector3d(b[0], b[1], b[2]), patch.sigma.at<float>(y, x),
                                    patch.known.at<float>(y, x) > 0.99f, model, options.shadow_strength);
  return costs;
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

/// Steps between neighbours of which one is free.
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

void FillCosts(const Patch& patch, const ProjectedBody& body, const CameraMaskModel& model, const MaskOptions& options,
               CutProblem* p) {
  constexpr double kMostColour = 12.0;  // nats; one pixel's colour is never proof
  const size_t n = size_t(p->width) * p->height;
  p->person_cost.assign(n, 0.f), p->background_cost.assign(n, 0.f);
  for (int y = 0; y < p->height; ++y) {
    for (int x = 0; x < p->width; ++x) {
      const size_t i = size_t(y) * p->width + x;
      if (p->label[i] != Label::kFree) continue;
      const internal::LimbDistance d = internal::DistanceToBody(body, patch.FramePixel(x, y));
      if (d.outside_m > options.reach_m) {
        p->label[i] = Label::kBackground;
        continue;
      }
      const PixelCosts colour = ColourCosts(patch, x, y, model, options);
      double evidence = std::clamp(colour.background - colour.person, -kMostColour, kMostColour);  // for a person
      evidence += d.outside_m < 0 ? options.prior * (1 - d.relative) : -2 * options.prior * d.outside_m / options.reach_m;
      p->background_cost[i] = static_cast<float>(std::max(evidence, 0.0));
      p->person_cost[i] = static_cast<float>(std::max(-evidence, 0.0));
    }
  }
}

/// Marks the bone lines.
void DrawBones(const ProjectedBody& body, const Patch& patch, cv::Mat* lines) {
  constexpr int kShift = 4;
  const auto point = [&](const Eigen::Vector2d& px) {
    const Eigen::Vector2d at = ((px - patch.offset) / patch.scale).cwiseMax(-1e5).cwiseMin(1e5) * (1 << kShift);
    return cv::Point(int(std::lround(at.x())), int(std::lround(at.y())));
  };
  for (const auto& [a, b] : body.bones) cv::line(*lines, point(a), point(b), cv::Scalar(255), 1, cv::LINE_8, kShift);
}

CutProblem StartProblem(const Patch& patch, const cv::Mat& lines, const MaskOptions& options) {
  CutProblem p;
  p.width = patch.width(), p.height = patch.height();
  p.smoothness = options.smoothness;
  p.label.assign(size_t(p.width) * p.height, Label::kFree);
  for (int y = 0; y < p.height; ++y) {
    for (int x = 0; x < p.width; ++x) {
      if (lines.at<uint8_t>(y, x)) p.label[size_t(y) * p.width + x] = Label::kPerson;
    }
  }
  return p;
}

cv::Mat LabelMat(const CutProblem& p) {
  cv::Mat mask(p.height, p.width, CV_8U);
  for (int y = 0; y < p.height; ++y) {
    for (int x = 0; x < p.width; ++x) mask.at<uint8_t>(y, x) = p.label[size_t(y) * p.width + x] == Label::kPerson ? 255 : 0;
  }
  return mask;
}

cv::Mat BoneLines(const ProjectedBody& body, const Patch& patch) {
  cv::Mat lines = cv::Mat::zeros(patch.height(), patch.width(), CV_8U);
  DrawBones(body, patch, &lines);
  return lines;
}

cv::Mat CutPatch(const Patch& patch, const ProjectedBody& body, const CameraMaskModel& model, const MaskOptions& options) {
  CutProblem p = StartProblem(patch, BoneLines(body, patch), options);
  FillContrast(patch, &p);
  FillCosts(patch, body, model, options, &p);
  internal::SolveCut(&p);
  return LabelMat(p);
}

/// Decides the pixels near the outline of a reduced mask again, at full resolution.
cv::Mat RefineOutline(const cv::Mat& coarse, const Patch& full, double scale, const ProjectedBody& body,
                      const CameraMaskModel& model, const MaskOptions& options) {
  cv::Mat mask, inner, outer;
  cv::resize(coarse, mask, full.rgb.size(), 0, 0, cv::INTER_LINEAR);
  const int half = std::max(2, int(std::ceil(1.5 * scale)));
  const cv::Mat disk = cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * half + 1, 2 * half + 1));
  cv::erode(mask > 127, inner, disk);
  cv::dilate(mask > 127, outer, disk);
  CutProblem p = StartProblem(full, BoneLines(body, full), options);
  for (int y = 0; y < p.height; ++y) {
    for (int x = 0; x < p.width; ++x) {
      Label& label = p.label[size_t(y) * p.width + x];
      if (inner.at<uint8_t>(y, x)) label = Label::kPerson;
      if (!outer.at<uint8_t>(y, x) && label == Label::kFree) label = Label::kBackground;
    }
  }
  FillContrast(full, &p);
  FillCosts(full, body, model, options, &p);
  internal::SolveCut(&p);
  return LabelMat(p);
}

/// Keeps what hangs together with a bone, then fills small holes.
void CleanUp(const cv::Mat& lines, double largest_hole_px, cv::Mat* mask) {
  cv::Mat labels, stats, centroids;
  int count = cv::connectedComponentsWithStats(*mask, labels, stats, centroids, 8);
  std::vector<uint8_t> keep(count, 0);
  for (int y = 0; y < mask->rows; ++y) {
    for (int x = 0; x < mask->cols; ++x) {
      if (lines.at<uint8_t>(y, x)) keep[labels.at<int>(y, x)] = 1;
    }
  }
  keep[0] = 0;
  for (int y = 0; y < mask->rows; ++y) {
    for (int x = 0; x < mask->cols; ++x) {
      if (!keep[labels.at<int>(y, x)]) mask->at<uint8_t>(y, x) = 0;
    }
  }
  count = cv::connectedComponentsWithStats(*mask == 0, labels, stats, centroids, 4);
  std::vector<uint8_t> fill(count, 0);
  for (int c = 1; c < count; ++c) {
    const int* s = stats.ptr<int>(c);
    const bool at_border = s[cv::CC_STAT_LEFT] == 0 || s[cv::CC_STAT_TOP] == 0 ||
                           s[cv::CC_STAT_LEFT] + s[cv::CC_STAT_WIDTH] == mask->cols ||
                           s[cv::CC_STAT_TOP] + s[cv::CC_STAT_HEIGHT] == mask->rows;
    fill[c] = !at_border && s[cv::CC_STAT_AREA] <= largest_hole_px;
  }
  for (int y = 0; y < mask->rows; ++y) {
    for (int x = 0; x < mask->cols; ++x) {
      if (fill[labels.at<int>(y, x)]) mask->at<uint8_t>(y, x) = 255;
    }
  }
}

void CountJoints(const ProjectedBody& body, const Patch& full, const CameraMaskModel& model, const MaskOptions& options,
                 BodyMask* out) {
  for (const Eigen::Vector2d& px : body.joints_px) {
    const int x = std::clamp(int(std::lround(px.x())), 0, out->mask.width - 1);
    const int y = std::clamp(int(std::lround(px.y())), 0, out->mask.height - 1);
    ++out->joints;
    if (*out->mask.Pixel(x, y)) ++out->joints_on_mask;
    const int u = x - int(full.offset.x()), v = y - int(full.offset.y());
    if (u < 0 || v < 0 || u >= full.width() || v >= full.height()) continue;
    const PixelCosts costs = ColourCosts(full, u, v, model, options);
    if (costs.background > costs.person) ++out->joints_supported;
  }
}

}  // namespace

double internal::PersonEvidence(const Image& rgb, int x, int y, const CameraMaskModel& model) {
  const size_t i = size_t(y) * rgb.width + x;
  const uint8_t *c = rgb.Pixel(x, y), *b = model.background.colour.Pixel(x, y);
  const Eigen::Vector3d colour(c[0], c[1], c[2]);
  const double background = BackgroundCost(colour, Eigen::Vector3d(b[0], b[1], b[2]), model.background.sigma[i],
                                           model.background.known[i] != 0, model, 0.5);
  return std::clamp(background - model.person.Cost(colour), -8.0, 8.0);
}

BodyMask SegmentBody(const Image& rgb, const ProjectedBody& body, const CameraMaskModel& model, const MaskOptions& options) {
  MVS_CHECK(rgb.channels == 3 && rgb.width == model.background.colour.width && rgb.height == model.background.colour.height,
            "a frame of " << rgb.width << "x" << rgb.height << "x" << rgb.channels << " and a background of "
                          << model.background.colour.width << "x" << model.background.colour.height);
  BodyMask out;
  out.mask = Image(rgb.width, rgb.height, 1, 0);
  const PixelBox box = internal::BoxOfBody(body, rgb.width, rgb.height, options.reach_m + 0.05);
  if (box.empty()) return out;
  const cv::Scalar gain = ExposureGain(rgb, body, model.background, options.reach_m);
  const Patch full = FullPatch(rgb, box, model.background, gain);
  const Patch reduced = Reduced(full, options.coarse_side_px);
  cv::Mat mask = CutPatch(reduced, body, model, options);
  if (reduced.scale > 1) mask = RefineOutline(mask, full, reduced.scale, body, model, options);
  const double px_per_cm = internal::TypicalPxPerM(body) / 100;
  CleanUp(BoneLines(body, full), options.hole_cm2 * px_per_cm * px_per_cm, &mask);
  for (int y = 0; y < mask.rows; ++y) std::copy_n(mask.ptr(y), mask.cols, out.mask.Pixel(box.x0, box.y0 + y));
  out.area_fraction = double(cv::countNonZero(mask)) / (double(rgb.width) * rgb.height);
  CountJoints(body, full, model, options, &out);
  return out;
}

}  // namespace mvstudio::dataset
