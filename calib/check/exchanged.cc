#include "calib/check/check_steps.h"

namespace mvstudio::calib::internal {

CalibrateInput WithExchanged(CalibrateInput input, size_t a, size_t b) {
  std::swap(input.cameras[a].name, input.cameras[b].name);
  return input;
}

std::optional<std::pair<size_t, size_t>> FindExchanged(const CalibrateInput& seen, const RigCheck& check,
                                                       const std::function<double(const CalibrateInput&)>& cost_of) {
  constexpr double kLessCost = 0.5;  // it is robust: large residuals cost little more than small ones
  constexpr size_t kMostCameras = 12;
  if (seen.cameras.size() > kMostCameras) return std::nullopt;
  double least = kLessCost * check.cost;
  std::optional<std::pair<size_t, size_t>> found;
  for (size_t a = 0; a < seen.cameras.size(); ++a) {
    for (size_t b = a + 1; b < seen.cameras.size(); ++b) {
      const CameraInput &first = seen.cameras[a], &second = seen.cameras[b];
      if (first.width_px != second.width_px || first.height_px != second.height_px) continue;
      const double cost = cost_of(WithExchanged(seen, a, b));
      if (!(cost < least)) continue;
      least = cost, found = {a, b};
    }
  }
  return found;
}

}  // namespace mvstudio::calib::internal
