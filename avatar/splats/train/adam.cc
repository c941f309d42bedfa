#include "avatar/splats/train/adam.h"

#include <cmath>

#include "core/check.h"
#include "core/optimise/adam.h"

namespace mvstudio::splats {
namespace {

constexpr double kEpsilon = 1e-12;  // gradients are means over pixels, about 1e-6

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
    case Group::kBend:
      return rates.bend;
  }
  return 0;
}

/// Coefficients of higher degrees, those behind the first three of `width`, move a tenth as far.
void MoveArray(const std::vector<float>& gradient, int width, const AdamMove& move, std::vector<float>* first,
               std::vector<float>* second, std::vector<float>* values) {
  AdamMove higher = move;
  higher.rate *= 0.1f;
  for (size_t i = 0; i < values->size(); ++i) {
    const float g = std::isfinite(gradient[i]) ? gradient[i] : 0.f;
    const bool low = width == 1 || i % static_cast<size_t>(width) < 3;
    (*values)[i] -= MoveByAdam(g, low ? move : higher, &(*first)[i], &(*second)[i]);
  }
}

}  // namespace

AdamState MakeAdam(size_t n, int degree, bool bends) {
  return {ZeroParameters<float>(n, degree, bends), ZeroParameters<float>(n, degree, bends), 0};
}

void AdamStep(const Parameters<float>& gradient, const AdamRates& rates, double share, AdamState* state,
              Parameters<float>* values) {
  MVS_CHECK(gradient.size() == values->size() && state->first.size() == values->size(), "gradients of another cloud");
  MVS_CHECK(gradient.degree == values->degree && state->first.degree == values->degree, "gradients of another degree");
  MVS_CHECK(gradient.bends == values->bends && state->first.bends == values->bends, "gradients without the corrective");
  ++state->step;
  std::vector<const std::vector<float>*> gradients;
  std::vector<std::vector<float>*> first, second;
  ForEachGroup(gradient, [&](Group, int, const std::vector<float>& array) { gradients.push_back(&array); });
  ForEachGroup(state->first, [&](Group, int, std::vector<float>& array) { first.push_back(&array); });
  ForEachGroup(state->second, [&](Group, int, std::vector<float>& array) { second.push_back(&array); });
  size_t k = 0;
  ForEachGroup(*values, [&](Group group, int width, std::vector<float>& array) {
    const AdamMove move = AdamMoveOf(share * RateOf(group, rates), state->step, kEpsilon);
    MoveArray(*gradients[k], group == Group::kColour ? width : 1, move, first[k], second[k], &array);
    ++k;
  });
}

}  // namespace mvstudio::splats
