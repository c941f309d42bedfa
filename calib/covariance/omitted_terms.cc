#include "calib/covariance/omitted_terms.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

constexpr double kDecentring = 6e-4, kRadial = 0.1, kThirdRadial = 0.06;
constexpr double kFirstAtCorner = 0.03, kAtCorner = 0.01;  // of the distance from the image's centre

struct Extension {
  LensModel model;
  std::vector<double> sigmas;  // of the added terms, which come last
};

/// Distance from the axis of the image's farthest corner on the plane z = 1 in cam, distortion left aside.
double CornerRadius(const geometry::Camera& camera) {
  const double x = std::max(camera.cx(), camera.width_px - camera.cx()) / camera.fx();
  const double y = std::max(camera.cy(), camera.height_px - camera.cy()) / camera.fy();
  return std::hypot(x, y);
}

/// Of k1, k2, p1, p2, k3 of this camera.
std::vector<double> BrownSigmas(const geometry::Camera& camera) {
  const double s = std::pow(CornerRadius(camera), 2);
  return {std::min(kRadial, kFirstAtCorner / s), std::min(kRadial, kAtCorner / (s * s)), kDecentring, kDecentring,
          std::min(kThirdRadial, kAtCorner / (s * s * s))};
}

/// The lens of which a model omits the last terms.
std::optional<Extension> ExtensionOf(const geometry::Camera& camera) {
  const std::vector<double> all = BrownSigmas(camera);
  const size_t own = static_cast<size_t>(camera.params.size() - 4);
  if (geometry::HasOpenCvOrder(camera.model) && own < all.size()) {
    return Extension{LensModel::kBrown5, {all.begin() + static_cast<std::ptrdiff_t>(own), all.end()}};
  }
  const auto decentred = geometry::IsWide(camera.model) ? geometry::WithDecentring(camera.model) : std::nullopt;
  if (!decentred) return std::nullopt;
  return Extension{*decentred, {kDecentring, kDecentring}};
}

/// `prior` for the parameters of the extended lens.
LensPrior Extended(const LensPrior& prior, const geometry::Camera& camera, const Extension& extension, double sigma_px) {
  const Eigen::Index before = camera.params.size() - static_cast<Eigen::Index>(extension.sigmas.size());
  LensPrior extended;
  extended.mean = camera.params;
  extended.weight = Eigen::VectorXd::Zero(camera.params.size());
  if (prior.weight.size() == before) extended.mean.head(before) = prior.mean, extended.weight.head(before) = prior.weight;
  for (size_t i = 0; i < extension.sigmas.size(); ++i)
    extended.weight[before + static_cast<Eigen::Index>(i)] = std::pow(sigma_px / extension.sigmas[i], 2);
  extended.num_omitted = static_cast<int>(extension.sigmas.size());
  return extended;
}

}  // namespace

WithOmitted AddOmittedTerms(const RigState& state, const BundleOptions& options, const std::vector<bool>& chosen,
                            double sigma_px) {
  WithOmitted result{state, options};
  result.options.lens_prior.resize(state.cameras.size());
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    const auto extension = chosen[c] ? ExtensionOf(state.cameras[c]) : std::nullopt;
    if (!extension) continue;
    geometry::Camera& camera = result.state.cameras[c];
    const Eigen::Index before = camera.params.size();
    camera.model = extension->model;
    camera.params.conservativeResize(before + static_cast<Eigen::Index>(extension->sigmas.size()));
    camera.params.tail(camera.params.size() - before).setZero();
    result.options.lens_prior[c] = Extended(result.options.lens_prior[c], camera, *extension, sigma_px);
  }
  return result;
}

std::vector<Eigen::Index> OmittedColumns(const RigColumns& columns, const BundleOptions& options) {
  std::set<Eigen::Index> omitted;
  for (size_t c = 0; c < std::min(columns.lens.size(), options.lens_prior.size()); ++c) {
    const LensPrior& prior = options.lens_prior[c];
    const Eigen::Index end = columns.lens[c] + prior.weight.size() - columns.first_param[c];
    for (Eigen::Index i = end - prior.num_omitted; columns.lens[c] >= 0 && i < end; ++i) omitted.insert(i);
  }
  return {omitted.begin(), omitted.end()};
}

Eigen::VectorXd OmittedShift(const Eigen::MatrixXd& inverse, const std::vector<Eigen::Index>& omitted,
                             const Eigen::VectorXd& gradient) {
  const Eigen::VectorXd mean = -inverse.transpose() * gradient;
  const Eigen::MatrixXd variance = inverse(omitted, Eigen::all);
  return inverse * variance.ldlt().solve(mean);
}

}  // namespace mvstudio::calib
