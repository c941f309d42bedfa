#include "calib/lens/simpler_lens.h"

#include <algorithm>
#include <cmath>

#include "core/format.h"

namespace mvstudio::calib {
namespace {

using geometry::Camera;
using geometry::LensModel;

constexpr double kCentreShare = 0.02;  // of the diagonal
constexpr double kUsualFocal = 0.9;    // of the longer side: 58 degrees
constexpr double kFocalShare = 0.5;    // of the focal length

double CentreSigma(const Camera& camera) { return kCentreShare * std::hypot(camera.width_px, camera.height_px); }

double AssumedFocal(const Camera& camera) {
  const double usual = kUsualFocal * std::max(camera.width_px, camera.height_px);
  return geometry::IsWide(camera.model) ? (camera.fx() + camera.fy()) / 2 : usual;
}

}  // namespace

std::optional<LensStep> NextSimpler(const LensStep& step) {
  LensStep next = step;
  constexpr int kCoarsest = 8;
  if (step.model == LensModel::kSplined && step.spline.cols > kCoarsest) {
    const double rows_per_col = static_cast<double>(step.spline.rows) / step.spline.cols;
    next.spline.cols = std::max(kCoarsest, step.spline.cols * 2 / 3);
    next.spline.rows = std::max(5, static_cast<int>(std::lround(next.spline.cols * rows_per_col)));
    return next;
  }
  if (const auto simpler = geometry::TraitsOf(step.model).simpler) {
    next.model = *simpler;
    next.spline = {};
    return next;
  }
  if (step.assume_focal) return std::nullopt;
  (step.assume_centre ? next.assume_focal : next.assume_centre) = true;
  return next;
}

LensPrior PriorOf(const LensStep& step, const Camera& camera, double sigma_px) {
  LensPrior prior;
  if (!step.assume_centre) return prior;
  prior.mean = camera.params;
  prior.weight = Eigen::VectorXd::Zero(camera.params.size());
  prior.mean.segment<2>(2) << (camera.width_px - 1) / 2.0, (camera.height_px - 1) / 2.0;
  prior.weight.segment<2>(2).setConstant(std::pow(sigma_px / CentreSigma(camera), 2));
  if (!step.assume_focal) return prior;
  prior.mean.head<2>().setConstant(AssumedFocal(camera));
  prior.weight.head<2>().setConstant(std::pow(sigma_px / (kFocalShare * AssumedFocal(camera)), 2));
  return prior;
}

std::string ToString(const LensStep& step, const Camera& camera) {
  std::string text(geometry::ToString(step.model));
  if (step.assume_centre) text += Format(", its principal point assumed at the image's centre +- %.0f px", CentreSigma(camera));
  if (step.assume_focal)
    text += Format(" and its focal length at %.0f +- %.0f px", AssumedFocal(camera), kFocalShare * AssumedFocal(camera));
  return text;
}

}  // namespace mvstudio::calib
