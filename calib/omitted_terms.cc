#include "calib/omitted_terms.h"

#include <cmath>
#include <optional>

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

constexpr double kDecentring = 6e-4, kSecondTerm = 0.1;

struct Extension {
  LensModel model;
  std::vector<double> sigmas;  // of the added terms, which come last
};

/// The lens of which a model leaves out the last terms.
std::optional<Extension> ExtensionOf(LensModel model) {
  switch (model) {
    case LensModel::kPinhole: return Extension{LensModel::kPinholeP, {kDecentring, kDecentring}};
    case LensModel::kBrown1: return Extension{LensModel::kBrown4, {kSecondTerm, kDecentring, kDecentring}};
    case LensModel::kBrown2: return Extension{LensModel::kBrown4, {kDecentring, kDecentring}};
    case LensModel::kKannalaBrandt4: return Extension{LensModel::kKannalaBrandt4P, {kDecentring, kDecentring}};
    case LensModel::kUcm: return Extension{LensModel::kUcmP, {kDecentring, kDecentring}};
    case LensModel::kEucm: return Extension{LensModel::kEucmP, {kDecentring, kDecentring}};
    case LensModel::kDoubleSphere: return Extension{LensModel::kDoubleSphereP, {kDecentring, kDecentring}};
    default: return std::nullopt;
  }
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
  return extended;
}

}  // namespace

WithOmitted AddOmittedTerms(const RigState& state, const BundleOptions& options, const std::vector<bool>& chosen, double sigma_px) {
  WithOmitted result{state, options};
  result.options.lens_prior.resize(state.cameras.size());
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    const auto extension = chosen[c] ? ExtensionOf(state.cameras[c].model) : std::nullopt;
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

}  // namespace mvstudio::calib
