#include "calib/lens/evidence.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

constexpr double kMinSigmaPx = 1e-3;  // exact data are judged as if they had this noise

/// True when every term is a power of image-plane coordinates, which Scaled can make up for.
bool HasPowersOnly(LensModel model) {
  const geometry::LensTraits& traits = geometry::TraitsOf(model);
  return std::all_of(traits.params, traits.params + traits.num_params, [](const auto& param) { return param.degree > 0; });
}

/// A lens with other focal lengths that sees boards parallel to the image as before, if they are so much farther away.
geometry::Camera Scaled(const geometry::Camera& camera, double factor) {
  geometry::Camera scaled = camera;
  scaled.params.head<2>() *= factor;
  const geometry::LensTraits& traits = geometry::TraitsOf(camera.model);
  for (int i = 0; i < traits.num_params; ++i) scaled.params[4 + i] *= std::pow(factor, traits.params[i].degree);
  return scaled;
}

double SumOfSquares(const MonoSolution& solution) {
  const auto residuals = BundleResiduals(solution.views, solution.state);
  double sum = 0;
  for (size_t v = 0; v < residuals.size(); ++v) {
    for (Eigen::Index i = 0; i < residuals[v].cols(); ++i) {
      const double weight = solution.views[v].weights[i];
      if (weight > 0) sum += weight * residuals[v].col(i).squaredNorm();
    }
  }
  return sum;
}

}  // namespace

std::optional<double> FocalEvidence(const MonoSolution& solution) {
  if (solution.status != Status::kOk && solution.status != Status::kNotConverged) return std::nullopt;
  const geometry::Camera& camera = solution.state.cameras[0];
  if (geometry::IsWide(camera.model) || !HasPowersOnly(camera.model)) return std::nullopt;
  BundleOptions poses;
  poses.refine_intrinsics = false;
  poses.reject_outliers = false;
  const double at_solution = SumOfSquares(solution), sigma = std::max(kMinSigmaPx, solution.bundle.sigma_px);
  double smallest = std::numeric_limits<double>::infinity();
  for (double factor : {0.5, 2.0}) {
    const MonoSolution other = RefineMono(Scaled(camera, factor), solution.views, poses);
    if (other.status != Status::kOk && other.status != Status::kNotConverged) continue;
    for (size_t v = 0; v < other.views.size(); ++v) {  // a view that lost its pose would count as explained
      if (other.views[v].weights.sum() != solution.views[v].weights.sum()) return std::nullopt;
    }
    smallest = std::min(smallest, (SumOfSquares(other) - at_solution) / (sigma * sigma));
  }
  return smallest;
}

std::optional<double> GainBeyondCost(const std::vector<double>& differences, double cost, double standard_errors) {
  double gain = 0, squares = 0;
  for (const double difference : differences) gain += difference, squares += difference * difference;
  if (!(gain > cost) || !(gain > standard_errors * std::sqrt(squares))) return std::nullopt;
  return gain - cost;
}

}  // namespace mvstudio::calib
