#include "splats/train/adam.h"

#include <cmath>

#include "core/check.h"

namespace mvstudio::splats {
namespace {

constexpr double kBeta1 = 0.9, kBeta2 = 0.999;
constexpr float kEpsilon = 1e-12f;  // gradients are means over pixels, about 1e-6

double RateOf(Group group, const AdamRates& rates) {
  switch (group) {
    case Group::kPlace:
      return rates.place;
    case Group::kOffset:
      return rates.offset;
    case Group::kScale:
      return rates.log_scale;
    case Group::kRotation:
      return rates.rotation;
    case Group::kOpacity:
      return rates.opacity;
    case Group::kColour:
      return rates.colour;
  }
  return 0;
}

/// Rates with the corrections of both moments' beginnings.
struct Step {
  float rate, root;
};

void MoveArray(const std::vector<float>& gradient, int width, bool higher_degrees_less, const Step& step,
               std::vector<float>* first, std::vector<float>* second, std::vector<float>* values) {
  for (size_t i = 0; i < values->size(); ++i) {
    const float g = std::isfinite(gradient[i]) ? gradient[i] : 0.f;
    float &m = (*first)[i], &v = (*second)[i];
    m = static_cast<float>(kBeta1) * m + static_cast<float>(1 - kBeta1) * g;
    v = static_cast<float>(kBeta2) * v + static_cast<float>(1 - kBeta2) * g * g;
    const float rate = higher_degrees_less && i % static_cast<size_t>(width) >= 3 ? 0.1f * step.rate : step.rate;
    (*values)[i] -= rate * m / (std::sqrt(v) * step.root + kEpsilon);
  }
}

}  // namespace

AdamState MakeAdam(size_t n, int degree) { return {ZeroParameters<float>(n, degree), ZeroParameters<float>(n, degree), 0}; }

void AdamStep(const Parameters<float>& gradient, const AdamRates& rates, double share, AdamState* state,
              Parameters<float>* values) {
  MVS_CHECK(gradient.size() == values->size() && state->first.size() == values->size(), "gradients of another cloud");
  MVS_CHECK(gradient.degree == values->degree && state->first.degree == values->degree, "gradients of another degree");
  ++state->step;
  const auto t = static_cast<double>(state->step);
  std::vector<const std::vector<float>*> gradients;
  std::vector<std::vector<float>*> first, second;
  ForEachGroup(gradient, [&](Group, int, const std::vector<float>& array) { gradients.push_back(&array); });
  ForEachGroup(state->first, [&](Group, int, std::vector<float>& array) { first.push_back(&array); });
  ForEachGroup(state->second, [&](Group, int, std::vector<float>& array) { second.push_back(&array); });
  size_t k = 0;
  ForEachGroup(*values, [&](Group group, int width, std::vector<float>& array) {
    const Step step{static_cast<float>(share * RateOf(group, rates) / (1 - std::pow(kBeta1, t))),
                    static_cast<float>(1 / std::sqrt(1 - std::pow(kBeta2, t)))};
    MoveArray(*gradients[k], width, group == Group::kColour, step, first[k], second[k], &array);
    ++k;
  });
}

}  // namespace mvstudio::splats
