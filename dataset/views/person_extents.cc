#include "dataset/views/person_extents.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/statistics.h"
#include "dataset/views/crop.h"

namespace mvstudio::dataset {

int MostSeenPerson(const PanopticDataset& dataset) {
  std::map<int, int> count;
  int best = -1;
  for (const auto& [frame, people] : dataset.poses) {
    for (const auto& [id, pose] : people) ++count[id];
  }
  for (const auto& [id, n] : count) {
    if (best < 0 || n > count[best]) best = id;
  }
  return best;
}

std::map<int, double> LargeExtents(const PanopticDataset& dataset) {
  std::map<int, std::vector<double>> extents;
  for (const auto& [frame, people] : dataset.poses) {
    for (const auto& [id, pose] : people) {
      for (const geometry::RigCamera& camera : dataset.rig.cameras) {
        const auto extent = MeasurePerson(pose, camera);
        if (extent) extents[id].push_back(extent->half_extent_m);
      }
    }
  }
  std::map<int, double> large;
  for (auto& [id, values] : extents) large[id] = LowerQuantile(std::move(values), 0.98);
  return large;
}

PartOfSplit PartOf(const Split& split, const std::string& camera, int frame) {
  const auto holds = [&](const SplitPart& part) {
    return std::binary_search(part.cameras.begin(), part.cameras.end(), camera) &&
           std::binary_search(part.frames.begin(), part.frames.end(), frame);
  };
  return holds(split.train)        ? PartOfSplit::kTrain
         : holds(split.validation) ? PartOfSplit::kValidation
         : holds(split.test)       ? PartOfSplit::kTest
                                   : PartOfSplit::kNone;
}

}  // namespace mvstudio::dataset
