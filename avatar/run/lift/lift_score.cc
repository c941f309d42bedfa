#include "avatar/run/lift/lift_score.h"

#include <cmath>
#include <limits>

#include "geometry/rig/alignment.h"

namespace mvstudio::avatar {
namespace {

constexpr int kRoot = 2;

/// Sums over joints; divided at the end.
struct Sums {
  double mpjpe = 0, scaled = 0, procrustes = 0, root = 0, acceleration = 0, true_acceleration = 0;
  int joints = 0, accelerations = 0;
};

void AddPose(const LiftPair& pair, Sums* sums) {
  std::vector<int> used;
  for (int j = 0; j < kLiftJoints; ++j) {
    if (pair.valid[j]) used.push_back(j);
  }
  Eigen::Matrix3Xd x(3, used.size()), truth(3, used.size());
  for (size_t i = 0; i < used.size(); ++i) {
    x.col(static_cast<long>(i)) = pair.x.col(used[i]) - pair.x.col(kRoot);
    truth.col(static_cast<long>(i)) = pair.truth.col(used[i]) - pair.truth.col(kRoot);
  }
  const double square = x.squaredNorm(), scale = square > 0 ? std::max(0.0, x.cwiseProduct(truth).sum() / square) : 0;
  const geometry::Alignment best = geometry::AlignPoints(x, truth, true);
  const Eigen::Matrix3Xd aligned =
      (best.scale * best.b_from_a.rotation.toRotationMatrix() * x).colwise() + best.b_from_a.translation;
  sums->mpjpe += (x - truth).colwise().norm().sum();
  sums->scaled += (scale * x - truth).colwise().norm().sum();
  sums->procrustes += (aligned - truth).colwise().norm().sum();
  sums->joints += static_cast<int>(used.size());
}

Eigen::Vector3d Second(const LiftJoints& a, const LiftJoints& b, const LiftJoints& c, int joint) {
  return (a.col(joint) - a.col(kRoot)) - 2 * (b.col(joint) - b.col(kRoot)) + (c.col(joint) - c.col(kRoot));
}

void AddAccelerations(const std::vector<LiftPair>& pairs, Sums* sums) {
  for (size_t i = 1; i + 1 < pairs.size(); ++i) {
    const LiftPair &a = pairs[i - 1], &b = pairs[i], &c = pairs[i + 1];
    if (a.frame + 1 != b.frame || b.frame + 1 != c.frame) continue;
    for (int j = 0; j < kLiftJoints; ++j) {
      if (j == kRoot || !a.valid[j] || !b.valid[j] || !c.valid[j]) continue;
      sums->acceleration += Second(a.x, b.x, c.x, j).norm();
      sums->true_acceleration += Second(a.truth, b.truth, c.truth, j).norm();
      ++sums->accelerations;
    }
  }
}

bool CanBeScored(const LiftPair& pair) {
  int count = 0;
  for (const bool valid : pair.valid) count += valid ? 1 : 0;
  return pair.valid[kRoot] && count >= 3;
}

}  // namespace

LiftScore ScoreLift(const std::vector<std::vector<LiftPair>>& cameras, bool with_root) {
  Sums sums;
  LiftScore score;
  for (const std::vector<LiftPair>& all : cameras) {
    std::vector<LiftPair> pairs;
    for (const LiftPair& pair : all) {
      if (CanBeScored(pair)) pairs.push_back(pair);
    }
    for (const LiftPair& pair : pairs) {
      AddPose(pair, &sums);
      sums.root += (pair.x.col(kRoot) - pair.truth.col(kRoot)).norm();
    }
    AddAccelerations(pairs, &sums);
    score.frames += static_cast<int>(pairs.size());
  }
  const auto mean_mm = [](double sum, int count) {
    return count > 0 ? 1000 * sum / count : std::numeric_limits<double>::quiet_NaN();
  };
  score.mpjpe_mm = mean_mm(sums.mpjpe, sums.joints);
  score.scaled_mpjpe_mm = mean_mm(sums.scaled, sums.joints);
  score.procrustes_mpjpe_mm = mean_mm(sums.procrustes, sums.joints);
  score.root_mm = mean_mm(sums.root, with_root ? score.frames : 0);
  score.acceleration_mm = mean_mm(sums.acceleration, sums.accelerations);
  score.true_acceleration_mm = mean_mm(sums.true_acceleration, sums.accelerations);
  return score;
}

LiftBaselines::LiftBaselines(const std::vector<LiftSequence>& sequences, const LiftSampleOptions& options, int count,
                             uint64_t seed) {
  LiftSampleOptions exact = options;
  exact.noise = exact.bias = exact.drop = exact.pose_jitter_deg = 0;
  Rng rng(seed);
  Eigen::Matrix<double, 1, kLiftJoints> known = Eigen::Matrix<double, 1, kLiftJoints>::Zero();
  for (int i = 0; i < count; ++i) {
    samples_.push_back(RandomSample(sequences, exact, rng));
    const LiftSample& sample = samples_.back();
    for (int j = 0; j < kLiftJoints; ++j) {
      if (sample.valid[j]) mean_.col(j) += sample.target.col(j), known[j] += 1;
    }
  }
  for (int j = 0; j < kLiftJoints; ++j) mean_.col(j) /= std::max(1.0, known[j]);
}

const LiftJoints& LiftBaselines::Nearest(const LiftInput& input) const {
  const size_t middle = size_t{kLiftWindow / 2} * kLiftJoints * 3;
  double least = std::numeric_limits<double>::infinity();
  const LiftJoints* nearest = &mean_;
  for (const LiftSample& sample : samples_) {
    double sum = 0;
    int count = 0;
    for (size_t j = 0; j < size_t{kLiftJoints}; ++j) {
      const float *a = &input.values[middle + 3 * j], *b = &sample.input.values[middle + 3 * j];
      if (a[2] <= 0 || b[2] <= 0) continue;
      sum += (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]), ++count;
    }
    if (count < kMinLiftJoints || sum / count >= least) continue;
    least = sum / count, nearest = &sample.target;
  }
  return *nearest;
}

std::map<int, LiftView> SimulatedViews(const dataset::PanopticDataset& data, int person, const geometry::RigCamera& camera,
                                       const std::vector<int>& frames, double noise_px, Rng& rng) {
  const geometry::Projector projector(camera.camera);
  std::map<int, LiftView> views;
  for (const int frame : frames) {
    const auto poses = data.poses.find(frame);
    if (poses == data.poses.end() || !poses->second.count(person)) continue;
    const dataset::Coco19Pose& pose = poses->second.at(person);
    dataset::Person2d seen;
    for (int j = 0; j < kLiftJoints; ++j) {
      const geometry::Projection p = projector.Project(camera.cam_from_world * pose.x_in_world.col(j));
      const bool visible = pose.valid[j] && p.status == Status::kOk && InImage(camera.camera, p.px);
      const double nx = noise_px * rng.Normal(), ny = noise_px * rng.Normal();
      seen.keypoints.push_back({p.px.x() + nx, p.px.y() + ny, visible ? 1.0 : 0.0});
    }
    views[frame] = ViewOf(projector, seen, geometry::Coco19());
  }
  return views;
}

std::map<int, LiftInput> LiftInputs(const std::map<int, LiftView>& views, int stride,
                                    const std::optional<Eigen::Vector3d>& up_in_cam) {
  std::map<int, LiftInput> inputs;
  for (const auto& [frame, view] : views) {
    std::array<LiftView, kLiftWindow> window;
    for (int f = 0; f < kLiftWindow; ++f) {
      const auto found = views.find(frame + stride * (f - kLiftWindow / 2));
      if (found != views.end()) window[static_cast<size_t>(f)] = found->second;
    }
    inputs[frame] = MakeLiftInput(window, up_in_cam);
  }
  return inputs;
}

}  // namespace mvstudio::avatar
