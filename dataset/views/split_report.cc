#include <algorithm>
#include <cmath>
#include <limits>

#include "core/statistics.h"
#include "dataset/views/crop.h"
#include "dataset/views/split.h"

namespace mvstudio::dataset {
namespace {

constexpr double kJumpM = 0.15;
constexpr double kJumpFactor = 5;
/// Bodies have mass: a step stands out of those around it by less, measured up to twofold; of a smaller one noise may make
/// that.
constexpr double kLeapFactor = 3, kLeapM = 0.03;
constexpr size_t kAround = 3;
constexpr size_t kMostTrainPoses = 4000, kMostTestPoses = 1000;  // compared; evenly thinned beyond
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegPerRad = 57.29577951308232;

double FiniteQuantile(std::vector<double> values, double share) {
  return NearestQuantile(FiniteValues(std::move(values)), share);
}

bool Comparable(const Coco19Pose& pose, int j) { return pose.valid[j] && pose.x_in_world.col(j).allFinite(); }

/// Mean distance of the joints that both have, in place; NaN when there are fewer than 5.
double StepLength(const Coco19Pose& a, const Coco19Pose& b) {
  double sum = 0;
  int count = 0;
  for (int j = 0; j < 19; ++j) {
    if (!Comparable(a, j) || !Comparable(b, j)) continue;
    sum += (a.x_in_world.col(j) - b.x_in_world.col(j)).norm(), ++count;
  }
  return count >= 5 ? sum / count : kNaN;
}

/// The same after the best shift and turn about the vertical.
double PoseDistance(const Coco19Pose& a, const Coco19Pose& b) {
  Eigen::Matrix<double, 3, 19> x, y;
  int count = 0;
  for (int j = 0; j < 19; ++j) {
    if (!Comparable(a, j) || !Comparable(b, j)) continue;
    x.col(count) = a.x_in_world.col(j), y.col(count) = b.x_in_world.col(j), ++count;
  }
  if (count < 5) return kNaN;
  const Eigen::Vector3d mean_x = x.leftCols(count).rowwise().mean(), mean_y = y.leftCols(count).rowwise().mean();
  double cosine = 0, sine = 0;
  for (int i = 0; i < count; ++i) {
    x.col(i) -= mean_x, y.col(i) -= mean_y;
    cosine += x(0, i) * y(0, i) + x(1, i) * y(1, i), sine += x(0, i) * y(1, i) - x(1, i) * y(0, i);
  }
  const double angle = std::atan2(sine, cosine), c = std::cos(angle), s = std::sin(angle);
  double sum = 0;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d rotated(c * x(0, i) - s * x(1, i), s * x(0, i) + c * x(1, i), x(2, i));
    sum += (rotated - y.col(i)).norm();
  }
  return sum / count;
}

/// Poses of all people in some frames.
std::vector<const Coco19Pose*> PosesOf(const PanopticDataset& dataset, const std::vector<int>& frames, size_t most) {
  std::vector<const Coco19Pose*> all;
  for (const int frame : frames) {
    const auto found = dataset.poses.find(frame);
    if (found == dataset.poses.end()) continue;
    for (const auto& [id, pose] : found->second) all.push_back(&pose);
  }
  std::vector<const Coco19Pose*> some;
  for (size_t i = 0; i < std::min(all.size(), most); ++i) some.push_back(all[i * all.size() / std::min(all.size(), most)]);
  return some;
}

/// For each pair of neighbouring frames that have the same person: `measure`, the median over people; NaN where there is none.
template <class Measure>
std::vector<double> Steps(const PanopticDataset& dataset, const Measure& measure) {
  std::vector<double> steps;
  for (size_t i = 1; i < dataset.frames.size(); ++i) {
    const auto before = dataset.poses.find(dataset.frames[i - 1]), after = dataset.poses.find(dataset.frames[i]);
    std::vector<double> people;
    if (before != dataset.poses.end() && after != dataset.poses.end()) {
      for (const auto& [id, pose] : before->second) {
        const auto same = after->second.find(id);
        if (same != after->second.end()) people.push_back(measure(pose, same->second));
      }
    }
    steps.push_back(FiniteQuantile(people, 0.5));
  }
  return steps;
}

Eigen::Vector3d MiddleOf(const PanopticDataset& dataset) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0;
  for (const auto& [frame, people] : dataset.poses) {
    for (const auto& [id, pose] : people) {
      const std::array<bool, 19> plausible = PlausibleJoints(pose);
      for (int j = 0; j < 19; ++j) {
        if (plausible[j]) sum += pose.x_in_world.col(j), ++count;
      }
    }
  }
  return count > 0 ? Eigen::Vector3d(sum / count) : sum;
}

void ReportCameras(const PanopticDataset& dataset, const Split& split, SplitReport* report) {
  const Eigen::Vector3d middle = MiddleOf(dataset);
  const auto direction = [&](const std::string& name) {
    return Eigen::Vector3d(dataset.rig.cameras[dataset.rig.Find(name)].CenterInWorld() - middle);
  };
  std::vector<double> angles;
  for (const std::string& name : split.test.cameras) {
    SplitReport::Camera camera{name, "", 181};
    const Eigen::Vector3d own = direction(name);
    for (const std::string& train : split.train.cameras) {
      const Eigen::Vector3d other = direction(train);
      const double angle = kDegPerRad * std::atan2(own.cross(other).norm(), own.dot(other));
      if (angle < camera.angle_deg) camera.angle_deg = angle, camera.nearest_train = train;
    }
    angles.push_back(camera.angle_deg);
    report->test_cameras.push_back(camera);
  }
  report->median_angle_deg = FiniteQuantile(angles, 0.5), report->max_angle_deg = FiniteQuantile(angles, 1);
}

}  // namespace

namespace {

/// Whether the joints jump before frame i + 1: far, or far for the motion right before and after.
bool Jumps(const std::vector<double>& steps, double usual, size_t i) {
  if (steps[i] > kJumpM && steps[i] > kJumpFactor * usual) return true;
  std::vector<double> around;
  for (size_t k = i - std::min(i, kAround); k < std::min(steps.size(), i + kAround + 1); ++k) {
    if (k != i && std::isfinite(steps[k])) around.push_back(steps[k]);
  }
  return around.size() >= kAround && steps[i] > kLeapM &&
         steps[i] > kLeapFactor * *std::max_element(around.begin(), around.end());
}

}  // namespace

std::vector<MotionBlock> FindMotionBlocks(const PanopticDataset& dataset) {
  std::vector<MotionBlock> blocks;
  const std::vector<double> steps = Steps(dataset, StepLength);
  const double usual = FiniteQuantile(steps, 0.5);
  for (size_t i = 0; i < dataset.frames.size(); ++i) {
    const bool cut = i == 0 || dataset.frames[i] != dataset.frames[i - 1] + 1 || Jumps(steps, usual, i - 1);
    if (cut) blocks.push_back({dataset.frames[i], dataset.frames[i]});
    blocks.back().last = dataset.frames[i];
  }
  return blocks;
}

SplitReport DescribeSplit(const PanopticDataset& dataset, const Split& split) {
  RequireSplitOf(split, dataset, "split");
  SplitReport report;
  ReportCameras(dataset, split, &report);
  const std::vector<const Coco19Pose*> train = PosesOf(dataset, split.train.frames, kMostTrainPoses);
  std::vector<double> novelty;
  for (const Coco19Pose* pose : PosesOf(dataset, split.test.frames, kMostTestPoses)) {
    double nearest = kNaN;
    for (const Coco19Pose* other : train) nearest = std::fmin(nearest, PoseDistance(*pose, *other));
    novelty.push_back(nearest);
  }
  report.median_novelty_m = FiniteQuantile(novelty, 0.5), report.p90_novelty_m = FiniteQuantile(novelty, 0.9);
  report.max_novelty_m = FiniteQuantile(novelty, 1);
  report.usual_step_m = FiniteQuantile(Steps(dataset, PoseDistance), 0.5);
  const auto images = [](const SplitPart& part) { return static_cast<int>(part.cameras.size() * part.frames.size()); };
  report.train_images = images(split.train), report.validation_images = images(split.validation);
  report.test_images = images(split.test);
  return report;
}

}  // namespace mvstudio::dataset
