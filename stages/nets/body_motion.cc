#include "stages/nets/body_motion.h"

#include <vector>

#include "avatar/splats/files/player_file.h"

namespace mvstudio::stages {

std::string BodyMotion(const body::PersonBody& person) {
  constexpr size_t kMostSteps = 120;
  // Posed before they are thinned by size: not more of them than the file may have.
  const size_t stride = person.seen.size() / (kMostSteps + 1) + 1;
  std::vector<Eigen::Matrix3Xf> vertices;
  std::vector<int> frames;
  size_t count = 0;
  for (const auto& [frame, pose] : person.seen) {
    if (count++ % stride != 0) continue;
    frames.push_back(frame);
    vertices.push_back(body::SkinVertices(person.body, body::ToBodyPose(person.body, pose)));
  }
  std::vector<splats::PlayerInstant> steps;
  for (size_t i = 0; i < frames.size(); ++i) steps.push_back({frames[i], &vertices[i]});
  splats::PlayerLimits limits;
  limits.instants = kMostSteps;
  return splats::PlayerBytes(splats::Cloud(), false, person.body, steps, limits);
}

}  // namespace mvstudio::stages
