#include "avatar/run/lift/lift_take.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>

namespace mvstudio::avatar {
namespace {

using dataset::Coco19Pose;
using Truth = std::map<int, Coco19Pose>;

/// Joints in the axes of each frame's view, in sizes.
std::map<int, LiftJoints> Predict(const Lifter& lifter, const std::map<int, LiftInput>& inputs) {
  std::vector<int> frames;
  for (const auto& [frame, input] : inputs) {
    if (input.status == Status::kOk) frames.push_back(frame);
  }
  std::map<int, LiftJoints> result;
  if (frames.empty()) return result;
  const at::Tensor batch = at::empty({static_cast<int64_t>(frames.size()), kLiftInputs});
  float* out = batch.data_ptr<float>();
  for (const int frame : frames) out = std::copy_n(inputs.at(frame).values.begin(), kLiftInputs, out);
  const at::Tensor joints = Lift(lifter, batch).contiguous();
  const float* values = joints.data_ptr<float>();
  for (const int frame : frames) {
    LiftJoints& x = result[frame];
    for (int j = 0; j < kLiftJoints; ++j) {
      for (int k = 0; k < 3; ++k) x(k, j) = *values++;
    }
    x = (x.colwise() - Eigen::Vector3d(x.col(2))).eval();  // the root is the origin
  }
  return result;
}

Coco19Pose AllValid(const LiftJoints& x) {
  Coco19Pose pose;
  pose.x_in_world = x;
  pose.valid.fill(true);
  return pose;
}

LiftedFrame Place(const LiftInput& input, const LiftJoints& x_in_view, double focal_px) {
  const LiftPlacement place = PlaceInView(x_in_view, input.xy_in_view, input.score);
  LiftedFrame frame;
  frame.status = place.status;
  if (place.status != Status::kOk) return frame;
  frame.x_in_cam = input.cam_from_view * (x_in_view.colwise() + place.root_in_view);
  frame.rms_px = place.rms * focal_px;
  return frame;
}

/// Joints of the baselines: turned into the camera and put where they fit the image best.
std::map<int, LiftedFrame> PlaceAll(const std::map<int, LiftInput>& inputs, double size_m,
                                    const std::function<const LiftJoints&(const LiftInput&)>& pose) {
  std::map<int, LiftedFrame> frames;
  for (const auto& [frame, input] : inputs) {
    frames[frame].status = input.status;
    if (input.status == Status::kOk) frames[frame] = Place(input, size_m * pose(input), 1);
  }
  return frames;
}

double SquaredError(const std::vector<LiftPair>& pairs, int* coordinates) {
  double sum = 0;
  for (const LiftPair& pair : pairs) {
    for (int j = 0; j < kLiftJoints; ++j) {
      if (!pair.valid[j] || !pair.valid[2]) continue;
      sum += (pair.x.col(j) - pair.x.col(2) - pair.truth.col(j) + pair.truth.col(2)).squaredNorm(), *coordinates += 3;
    }
  }
  return sum;
}

/// Pairs of all cameras, for each of the three methods.
struct Pairs {
  std::vector<std::vector<LiftPair>> lifter, mean_pose, nearest;
};

void AddTake(const Lifter& lifter, const LiftBaselines& baselines, const std::map<int, LiftInput>& inputs, const Truth& truth,
             const geometry::Rigid3& cam_from_world, Pairs* pairs) {
  std::vector<Coco19Pose> poses;
  for (const auto& [frame, pose] : truth) poses.push_back(pose);
  const double known = MedianSize(poses), size_m = known > 0 ? known : lifter.size_m;
  pairs->lifter.push_back(PairsOf(LiftTake(lifter, inputs, size_m, 1), truth, cam_from_world));
  const auto mean = [&](const LiftInput&) -> const LiftJoints& { return baselines.mean_pose(); };
  const auto nearest = [&](const LiftInput& input) -> const LiftJoints& { return baselines.Nearest(input); };
  pairs->mean_pose.push_back(PairsOf(PlaceAll(inputs, size_m, mean), truth, cam_from_world));
  pairs->nearest.push_back(PairsOf(PlaceAll(inputs, size_m, nearest), truth, cam_from_world));
}

LiftComparison Compare(const Pairs& pairs) {
  LiftComparison c;
  c.lifter = ScoreLift(pairs.lifter, true);
  c.mean_pose = ScoreLift(pairs.mean_pose, true);
  c.nearest = ScoreLift(pairs.nearest, true);
  double sum = 0;
  int coordinates = 0;
  for (const std::vector<LiftPair>& camera : pairs.lifter) sum += SquaredError(camera, &coordinates);
  c.sigma_m = coordinates > 0 ? std::sqrt(sum / coordinates) : 0;
  return c;
}

}  // namespace

LiftSampler SamplerOf(const std::vector<LiftSequence>& sequences, const LiftSampleOptions& options, uint64_t seed) {
  return [sequences, options, seed](uint64_t index, float* input, float* target, float* weight) {
    Rng rng(Rng(seed).Next() ^ Rng(index + 1).Next());
    const LiftSample sample = RandomSample(sequences, options, rng);
    std::copy(sample.input.values.begin(), sample.input.values.end(), input);
    for (int j = 0; j < kLiftJoints; ++j) {
      for (int k = 0; k < 3; ++k) target[3 * j + k] = static_cast<float>(sample.target(k, j));
      weight[j] = sample.valid[j] ? 1.0f : 0.0f;
    }
  };
}

std::map<int, LiftedFrame> LiftTake(const Lifter& lifter, const std::map<int, LiftInput>& inputs, double size_m,
                                    double focal_px) {
  const std::map<int, LiftJoints> joints = Predict(lifter, inputs);
  std::vector<Coco19Pose> poses;
  for (const auto& [frame, x] : joints) poses.push_back(AllValid(x));
  const double lifted = MedianSize(poses), scale = lifted > 0 ? size_m / lifted : size_m;
  std::map<int, LiftedFrame> frames;
  for (const auto& [frame, input] : inputs) {
    frames[frame].status = input.status;
    if (input.status == Status::kOk) frames[frame] = Place(input, scale * joints.at(frame), focal_px);
  }
  return frames;
}

void SmoothTake(double sigma_frames, std::map<int, LiftedFrame>* frames) {
  if (!(sigma_frames > 0)) return;
  const std::map<int, LiftedFrame> given = *frames;
  const int reach = static_cast<int>(std::ceil(3 * sigma_frames));
  for (auto& [number, frame] : *frames) {
    if (frame.status != Status::kOk) continue;
    LiftJoints sum = LiftJoints::Zero();
    double weights = 0;
    for (auto it = given.lower_bound(number - reach); it != given.end() && it->first <= number + reach; ++it) {
      if (it->second.status != Status::kOk) continue;
      const double d = (it->first - number) / sigma_frames, weight = std::exp(-0.5 * d * d);
      sum += weight * it->second.x_in_cam, weights += weight;
    }
    frame.x_in_cam = sum / weights;
  }
}

dataset::Pose3d ToPose3d(const std::map<int, LiftedFrame>& frames, const geometry::Rigid3& cam_from_world, double sigma_m) {
  const geometry::Rigid3 world_from_cam = Inverse(cam_from_world);
  dataset::Pose3d pose;
  pose.skeleton = geometry::Coco19().name;
  for (const auto& [number, frame] : frames) {
    for (int j = 0; j < kLiftJoints; ++j) {
      dataset::JointRow row;
      row.frame = number, row.joint = geometry::Coco19().joints[static_cast<size_t>(j)], row.status = frame.status;
      row.num_views = 1;
      if (frame.status == Status::kOk) {
        row.x_in_world = world_from_cam * frame.x_in_cam.col(j), row.rms_px = frame.rms_px, row.sigma_m = sigma_m;
      }
      pose.rows.push_back(row);
    }
  }
  return pose;
}

std::vector<LiftPair> PairsOf(const std::map<int, LiftedFrame>& frames, const Truth& truth,
                              const geometry::Rigid3& cam_from_world) {
  std::vector<LiftPair> pairs;
  for (const auto& [number, frame] : frames) {
    const auto found = truth.find(number);
    if (frame.status != Status::kOk || found == truth.end()) continue;
    LiftPair pair;
    pair.frame = number, pair.x = frame.x_in_cam, pair.valid = found->second.valid;
    for (int j = 0; j < kLiftJoints; ++j) pair.truth.col(j) = cam_from_world * found->second.x_in_world.col(j);
    pairs.push_back(pair);
  }
  return pairs;
}

LiftComparison CompareOnHeldOut(const Lifter& lifter, const LiftBaselines& baselines,
                                const std::vector<const dataset::PanopticDataset*>& datasets,
                                const std::vector<std::vector<int>>& frames, double noise_px, uint64_t seed) {
  Pairs pairs;
  Rng rng(seed);
  for (size_t d = 0; d < datasets.size(); ++d) {
    std::map<int, Truth> people;
    for (const int frame : frames[d]) {
      const auto found = datasets[d]->poses.find(frame);
      if (found == datasets[d]->poses.end()) continue;
      for (const auto& [person, pose] : found->second) people[person][frame] = pose;
    }
    for (const geometry::RigCamera& camera : datasets[d]->rig.cameras) {
      for (const auto& [person, truth] : people) {
        const auto views = SimulatedViews(*datasets[d], person, camera, frames[d], noise_px, rng);
        const Eigen::Vector3d up = camera.cam_from_world.rotation * Eigen::Vector3d::UnitZ();
        AddTake(lifter, baselines, LiftInputs(views, 1, up), truth, camera.cam_from_world, &pairs);
      }
    }
  }
  return Compare(pairs);
}

LiftComparison CompareOnTake(const Lifter& lifter, const LiftBaselines& baselines, const std::map<int, LiftInput>& inputs,
                             const Truth& truth, const geometry::RigCamera& camera) {
  Pairs pairs;
  AddTake(lifter, baselines, inputs, truth, camera.cam_from_world, &pairs);
  return Compare(pairs);
}

}  // namespace mvstudio::avatar
