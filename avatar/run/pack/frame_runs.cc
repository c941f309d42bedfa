#include "avatar/run/pack/frame_runs.h"

#include <algorithm>

#include "avatar/data/pack.h"
#include "core/statistics.h"
#include "dataset/pose/cuts.h"

namespace mvstudio::avatar {

int UsualStep(const std::vector<int>& frames) {
  std::vector<int> steps;
  for (size_t i = 1; i < frames.size(); ++i) steps.push_back(frames[i] - frames[i - 1]);
  return UpperMedian(std::move(steps), 1);
}

std::vector<int> FramesOfPerson(const dataset::PanopticDataset& data, int person) {
  std::vector<int> frames;
  for (const auto& [frame, people] : data.poses) {
    if (people.count(person)) frames.push_back(frame);
  }
  return frames;
}

int FramesWithout(const dataset::PanopticDataset& data, int person) {
  return static_cast<int>(data.poses.size() - FramesOfPerson(data, person).size());
}

std::vector<int> CutsOf(const dataset::PanopticDataset& data, int person) {
  std::map<int, dataset::Coco19Pose> poses;
  for (const auto& [frame, people] : data.poses) {
    const auto found = people.find(person);
    if (found != people.end()) poses[frame] = found->second;
  }
  return dataset::FindCuts(poses);
}

void SetTime(const dataset::PanopticDataset& data, int person, std::vector<int> frames, int frame_step, AvatarPack* pack) {
  std::sort(frames.begin(), frames.end());
  pack->frame_step = frame_step > 0 ? frame_step : std::max(1, UsualStep(frames));
  const std::vector<int> cuts = CutsOf(data, person);
  pack->cuts.assign(cuts.begin(), cuts.end());
}

}  // namespace mvstudio::avatar
