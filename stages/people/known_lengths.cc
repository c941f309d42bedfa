#include "stages/people/known_lengths.h"

#include <cmath>
#include <string>

namespace mvstudio::stages {
namespace {

std::vector<calib::KnownLength> Stated(const geometry::Skeleton& skeleton) {
  std::vector<calib::KnownLength> lengths;
  for (size_t b = 0; b < skeleton.lengths.size(); ++b) {
    const geometry::LengthRange& range = skeleton.lengths[b];
    if (range.min_m > 0 && std::isfinite(range.max_m))
      lengths.push_back({skeleton.bones[b], 0.5 * (range.min_m + range.max_m)});
  }
  return lengths;
}

}  // namespace

std::vector<calib::KnownLength> KnownLengthsOf(const geometry::Skeleton& skeleton, double person_height_m) {
  std::vector<calib::KnownLength> lengths = Stated(skeleton);
  if (!lengths.empty() || !skeleton.human) return lengths;
  constexpr struct {
    const char *from, *to;
    double share;
  } kSegments[] = {{"Hip", "Knee", 0.245}, {"Knee", "Ankle", 0.246}, {"Shoulder", "Elbow", 0.186}, {"Elbow", "Wrist", 0.146}};
  for (const auto& segment : kSegments) {
    for (const char* side : {"L", "R"}) {
      const int from = skeleton.Find(std::string(side) + segment.from), to = skeleton.Find(std::string(side) + segment.to);
      if (from >= 0 && to >= 0) lengths.push_back({{from, to}, segment.share * person_height_m});
    }
  }
  return lengths;
}

}  // namespace mvstudio::stages
