#include "dataset/masks/masks.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "dataset/masks/costs.h"
#include "dataset/masks/coverage.h"
#include "dataset/masks/cut.h"
#include "dataset/masks/limbs.h"
#include "dataset/masks/patch.h"

namespace mvstudio::dataset {
namespace {

using internal::CutProblem;
using internal::Label;
using internal::Patch;
using internal::PixelBox;

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

cv::Mat BoneLines(const ProjectedBody* body, const Patch& patch) {
  cv::Mat lines = cv::Mat::zeros(patch.height(), patch.width(), CV_8U);
  if (body) DrawBones(*body, patch, &lines);
  return lines;
}

cv::Mat CutPatch(const Patch& patch, const ProjectedBody* body, const CameraMaskModel& model, const MaskOptions& options) {
  CutProblem p = StartProblem(patch, BoneLines(body, patch), options);
  FillContrast(patch, &p);
  FillCosts(patch, body, model, options, &p);
  internal::SolveCut(&p);
  return LabelMat(p);
}

/// Decides the pixels near the outline of a reduced mask again, at full resolution.
cv::Mat RefineOutline(const cv::Mat& coarse, const Patch& full, double scale, const ProjectedBody* body,
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

/// Removes parts of which `keep(label, stats)` does not hold.
template <class Keep>
void KeepParts(const Keep& keep_part, cv::Mat* mask) {
  cv::Mat labels, stats, centroids;
  const int count = cv::connectedComponentsWithStats(*mask, labels, stats, centroids, 8);
  std::vector<uint8_t> keep(count, 0);
  keep_part(labels, stats, &keep);
  keep[0] = 0;
  for (int y = 0; y < mask->rows; ++y) {
    for (int x = 0; x < mask->cols; ++x) {
      if (!keep[labels.at<int>(y, x)]) mask->at<uint8_t>(y, x) = 0;
    }
  }
}

/// Parts on a bone line; also those that lie within a limb for the most part: shoes and hands that a cuff or a bracelet of the
/// background's colour cuts off.
void KeepPartsOfBody(const ProjectedBody& body, const Patch& full, const cv::Mat& lines, cv::Mat* mask) {
  constexpr double kLeastInside = 0.7, kLeastCm2 = 15;
  const double px_per_cm = internal::TypicalPxPerM(body) / 100;
  KeepParts(
      [&](const cv::Mat& labels, const cv::Mat& stats, std::vector<uint8_t>* keep) {
        for (int y = 0; y < labels.rows; ++y) {
          for (int x = 0; x < labels.cols; ++x) {
            if (lines.at<uint8_t>(y, x)) (*keep)[labels.at<int>(y, x)] = 1;
          }
        }
        for (int c = 1; c < stats.rows; ++c) {
          const int* s = stats.ptr<int>(c);
          const double area = s[cv::CC_STAT_AREA];
          if ((*keep)[c] || area < kLeastCm2 * px_per_cm * px_per_cm) continue;
          double inside = 0;
          for (int y = s[cv::CC_STAT_TOP]; y < s[cv::CC_STAT_TOP] + s[cv::CC_STAT_HEIGHT]; ++y) {
            for (int x = s[cv::CC_STAT_LEFT]; x < s[cv::CC_STAT_LEFT] + s[cv::CC_STAT_WIDTH]; ++x) {
              inside += labels.at<int>(y, x) == c && internal::DistanceToBody(body, full.FramePixel(x, y)).outside_m < 0.02;
            }
          }
          (*keep)[c] = inside >= kLeastInside * area;
        }
      },
      mask);
}

/// Without joints a part is a person's when it is not small, in itself and beside the largest.
void KeepLargeParts(double least_px, cv::Mat* mask) {
  constexpr double kLeastShare = 0.15;
  KeepParts(
      [&](const cv::Mat&, const cv::Mat& stats, std::vector<uint8_t>* keep) {
        int largest = 0;
        for (int c = 1; c < stats.rows; ++c) largest = std::max(largest, stats.at<int>(c, cv::CC_STAT_AREA));
        for (int c = 1; c < stats.rows; ++c) {
          const int area = stats.at<int>(c, cv::CC_STAT_AREA);
          (*keep)[c] = area >= least_px && area >= kLeastShare * largest;
        }
      },
      mask);
}

void FillHoles(double largest_px, cv::Mat* mask) {
  cv::Mat labels, stats, centroids;
  const int count = cv::connectedComponentsWithStats(*mask == 0, labels, stats, centroids, 4);
  std::vector<uint8_t> fill(count, 0);
  for (int c = 1; c < count; ++c) {
    const int* s = stats.ptr<int>(c);
    const bool at_border = s[cv::CC_STAT_LEFT] == 0 || s[cv::CC_STAT_TOP] == 0 ||
                           s[cv::CC_STAT_LEFT] + s[cv::CC_STAT_WIDTH] == mask->cols ||
                           s[cv::CC_STAT_TOP] + s[cv::CC_STAT_HEIGHT] == mask->rows;
    fill[c] = !at_border && s[cv::CC_STAT_AREA] <= largest_px;
  }
  for (int y = 0; y < mask->rows; ++y) {
    for (int x = 0; x < mask->cols; ++x) {
      if (fill[labels.at<int>(y, x)]) mask->at<uint8_t>(y, x) = 255;
    }
  }
}

/// Nats for a person from everything that is neither colour nor skeleton; empty when there is nothing.
cv::Mat Hints(const Image& rgb, const MaskHints& hints, const PixelBox& box, const MaskOptions& options) {
  constexpr double kMostNet = 3.0, kImpossible = 20.0, kUnchanged = 6.0;  // nats, more than any colour, grey levels
  const cv::Rect rect(box.x0, box.y0, box.width(), box.height());
  cv::Mat sum;
  if (hints.probability || hints.possible || (hints.previous_mask && options.temporal > 0))
    sum = cv::Mat::zeros(rect.size(), CV_32F);
  if (hints.probability) {
    cv::Mat p, against, logit;
    internal::View (*hints.probability)(rect).convertTo(p, CV_32F, 0.98 / 255, 0.01);
    against = 1 - p;
    cv::log(p, p), cv::log(against, against);
    logit = p - against;
    cv::min(cv::max(logit, -kMostNet), kMostNet, logit);
    sum += options.net_weight * logit;
  }
  if (hints.possible) cv::subtract(sum, kImpossible, sum, internal::View(*hints.possible)(rect) == 0);
  if (hints.previous_mask && hints.previous_rgb && options.temporal > 0) {
    cv::Mat step, channels[3];
    cv::absdiff(internal::View(rgb)(rect), internal::View(*hints.previous_rgb)(rect), step);
    cv::split(step, channels);
    cv::max(channels[0], channels[1], step), cv::max(step, channels[2], step);
    cv::dilate(step, step, cv::Mat());
    const cv::Mat was = internal::View(*hints.previous_mask)(rect), unchanged = step <= kUnchanged;
    cv::add(sum, options.temporal, sum, unchanged & was);
    cv::subtract(sum, options.temporal, sum, unchanged & ~was);
  }
  return sum;
}

/// Where people are when no joints say it: what a cut over the whole reduced image finds, with a margin.
PixelBox FindPeople(const Image& rgb, const MaskHints& hints, const CameraMaskModel& model, const MaskOptions& options) {
  const PixelBox all{0, 0, rgb.width, rgb.height};
  Patch full = internal::MakePatch(rgb, all, model.background, internal::ExposureGain(rgb, {}, model.background));
  full.hint = Hints(rgb, hints, all, options);
  const Patch reduced = internal::Reduced(full, options.coarse_side_px);
  cv::Mat mask = CutPatch(reduced, nullptr, model, options);
  KeepLargeParts(std::max(12.0, 2e-4 * mask.rows * mask.cols), &mask);
  const cv::Rect found = cv::boundingRect(mask);
  if (found.empty()) return {};
  const double margin = 0.1 * std::max(found.width, found.height) + 2, s = reduced.scale;
  return {std::max(0, int((found.x - margin) * s)), std::max(0, int((found.y - margin) * s)),
          std::min(rgb.width, int((found.x + found.width + margin) * s) + 1),
          std::min(rgb.height, int((found.y + found.height + margin) * s) + 1)};
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
    const internal::PixelCosts costs = ColourCosts(full, u, v, model, options);
    if (costs.background > costs.person) ++out->joints_supported;
  }
}

void CheckSizes(const Image& rgb, const MaskHints& hints, const CameraMaskModel& model) {
  const Image& colour = model.background.colour;
  MVS_CHECK(rgb.channels == 3 && rgb.width == colour.width && rgb.height == colour.height,
            "a frame of " << rgb.width << "x" << rgb.height << "x" << rgb.channels << " and a background of " << colour.width
                          << "x" << colour.height);
  for (const Image* hint : {hints.probability, hints.possible, hints.previous_rgb, hints.previous_mask}) {
    MVS_CHECK(!hint || (hint->width == rgb.width && hint->height == rgb.height),
              "a hint of " << hint->width << "x" << hint->height << " for a frame of " << rgb.width << "x" << rgb.height);
  }
}

/// Removes what cannot be a person and fills what is too small to be seen through.
void CleanUp(const MaskHints& hints, const Patch& full, const cv::Mat& lines, const MaskOptions& options, cv::Mat* mask) {
  if (hints.body) {
    KeepPartsOfBody(*hints.body, full, lines, mask);
    const double px_per_cm = internal::TypicalPxPerM(*hints.body) / 100;
    return FillHoles(options.hole_cm2 * px_per_cm * px_per_cm, mask);
  }
  KeepLargeParts(16, mask);
  FillHoles(options.hole_cm2 / 5000 * cv::countNonZero(*mask), mask);  // a person seen whole shows about 5000 cm^2
}

}  // namespace

BodyMask SegmentPeople(const Image& rgb, const MaskHints& hints, const CameraMaskModel& model, const MaskOptions& options) {
  CheckSizes(rgb, hints, model);
  BodyMask out;
  out.mask = Image(rgb.width, rgb.height, 1, 0);
  out.soft = out.mask;
  const PixelBox box = hints.body ? internal::BoxOfBody(*hints.body, rgb.width, rgb.height, options.reach_m + 0.05)
                                  : FindPeople(rgb, hints, model, options);
  if (box.empty()) return out;
  Patch full = internal::MakePatch(rgb, box, model.background, internal::ExposureGain(rgb, box, model.background));
  full.hint = Hints(rgb, hints, box, options);
  const Patch reduced = internal::Reduced(full, options.coarse_side_px);
  cv::Mat mask = CutPatch(reduced, hints.body, model, options);
  if (reduced.scale > 1) mask = RefineOutline(mask, full, reduced.scale, hints.body, model, options);
  const cv::Mat lines = BoneLines(hints.body, full);
  CleanUp(hints, full, lines, options, &mask);
  cv::Mat soft = mask;
  if (options.outline_px > 0) {
    for (int round = 0; round < options.outline_rounds; ++round) DecideByCoverage(full, lines, options, &mask, &soft);
    CleanUp(hints, full, lines, options, &mask);
    soft = internal::OnTheRightSide(soft, mask);
  }
  for (int y = 0; y < mask.rows; ++y) {
    std::copy_n(mask.ptr(y), mask.cols, out.mask.Pixel(box.x0, box.y0 + y));
    std::copy_n(soft.ptr(y), mask.cols, out.soft.Pixel(box.x0, box.y0 + y));
  }
  out.area_fraction = double(cv::countNonZero(mask)) / (double(rgb.width) * rgb.height);
  if (hints.body) CountJoints(*hints.body, full, model, options, &out);
  return out;
}

BodyMask SegmentBody(const Image& rgb, const ProjectedBody& body, const CameraMaskModel& model, const MaskOptions& options) {
  MaskHints hints;
  hints.body = &body;
  return SegmentPeople(rgb, hints, model, options);
}

}  // namespace mvstudio::dataset
