#include "calib/keypoints/split.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/units.h"

namespace mvstudio::calib {
namespace {

constexpr int kMinSharedJoints = 12;  // of a camera with another: more than its pose has numbers
constexpr int kMinFrames = 4;
constexpr size_t kMinGap = 2;

/// Cameras that share joints with others, as one group; names of those that do not.
std::vector<std::string> Unconnected(const geometry::Rig& rig, const std::vector<KeypointJoint>& joints) {
  const size_t n = rig.cameras.size();
  Eigen::MatrixXi shared = Eigen::MatrixXi::Zero(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  for (const KeypointJoint& joint : joints)
    for (const auto& a : joint.seen)
      for (const auto& b : joint.seen) shared(a.camera_idx, b.camera_idx) += 1;
  std::vector<bool> reached(n, false);
  std::vector<Eigen::Index> queue;
  Eigen::Index start = 0;
  for (Eigen::Index c = 1; c < shared.rows(); ++c)
    if (shared(c, c) > shared(start, start)) start = c;
  reached[static_cast<size_t>(start)] = true, queue.push_back(start);
  while (!queue.empty()) {
    const Eigen::Index at = queue.back();
    queue.pop_back();
    for (Eigen::Index c = 0; c < shared.rows(); ++c) {
      if (reached[static_cast<size_t>(c)] || shared(at, c) < kMinSharedJoints) continue;
      reached[static_cast<size_t>(c)] = true, queue.push_back(c);
    }
  }
  std::vector<std::string> names;
  for (size_t c = 0; c < n; ++c)
    if (!reached[c]) names.push_back(rig.cameras[c].camera.name);
  return names;
}

}  // namespace

Eigen::Vector3d MeanCentre(const geometry::Rig& rig) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const geometry::RigCamera& camera : rig.cameras)
    mean += camera.CenterInWorld() / static_cast<double>(rig.cameras.size());
  return mean;
}

KeypointSplit SplitKeypoints(const std::vector<KeypointJoint>& joints, const std::optional<FrameChoice>& train,
                             const std::optional<FrameChoice>& test) {
  MVS_CHECK(train || test, "frames to split by");
  KeypointSplit split;
  for (const KeypointJoint& joint : joints) {
    const bool in_test = test ? test->Contains(joint.frame) : !train->Contains(joint.frame);
    const bool in_train = train ? train->Contains(joint.frame) : !in_test;
    if (in_train && in_test)
      throw UsageError("option 'train-frames' and option 'test-frames' share frame " + std::to_string(joint.frame));
    if (in_train) split.train.push_back(joint);
    if (in_test) split.test.push_back(joint);
  }
  return split;
}

std::vector<int> CutWithGaps(const std::vector<int>& frames, int num_parts, int gap_frames) {
  const size_t n = frames.size(), parts = static_cast<size_t>(num_parts), most = n / parts / 10;
  std::vector<int> part(n);
  for (size_t i = 0; i < n; ++i) part[i] = static_cast<int>(i * parts / n);
  for (size_t cut = 1; cut < n; ++cut) {
    if (part[cut] <= 0 || part[cut] == part[cut - 1] || part[cut - 1] < 0) continue;
    size_t left = cut, right = cut;  // time steps [left, right) are left out
    while (right - left < most && (right - left < kMinGap || frames[right] - frames[left - 1] <= gap_frames))
      right - left == 2 * (cut - left) ? --left : ++right;
    std::fill(part.begin() + static_cast<std::ptrdiff_t>(left), part.begin() + static_cast<std::ptrdiff_t>(right), -1);
    cut = std::max(cut, right);
  }
  return part;
}

KeypointSplit HalveKeypoints(const std::vector<KeypointJoint>& joints, int train_half, int gap_frames) {
  const std::vector<int> frames = FramesOf(joints), part = CutWithGaps(frames, 2, gap_frames);
  KeypointSplit split;
  for (const KeypointJoint& joint : joints) {
    const auto at = std::lower_bound(frames.begin(), frames.end(), joint.frame) - frames.begin();
    const int half = part[static_cast<size_t>(at)];
    if (half >= 0) (half == train_half ? split.train : split.test).push_back(joint);
  }
  return split;
}

std::vector<KeypointJoint> Limited(const std::vector<KeypointJoint>& joints, int max_frames) {
  constexpr double kPointsPerFrame = 30;
  const double share = kPointsPerFrame * max_frames / static_cast<double>(std::max<size_t>(joints.size(), 1));
  const auto by_points = static_cast<int>(std::min(1.0, share) * static_cast<double>(FramesOf(joints).size()));
  return Thinned(joints, std::max(max_frames, by_points));
}

std::string WhyTooFew(const geometry::Rig& rig, const std::vector<KeypointJoint>& train) {
  const auto num_train = FramesOf(train).size();
  if (num_train < kMinFrames)
    return "two cameras see the same points at once in " + std::to_string(num_train) +
           " of the frames to adjust to; at least " + std::to_string(kMinFrames) + " are needed";
  const std::vector<std::string> alone = Unconnected(rig, train);
  if (!alone.empty()) return "cameras without enough points that others see too: " + Join(alone, ", ");
  return "";
}

namespace {

/// The first camera whose pose a covariance leaves uncertain by a tenth of the rig or 0.1 rad, and by how much.
struct LooseCamera {
  std::string name;
  double place_m = 0, turn_rad = 0;
};

std::optional<LooseCamera> FirstLoose(const geometry::Rig& rig, const std::vector<int>& begin, const Eigen::MatrixXd& joint) {
  constexpr double kMaxOfSpread = 0.1, kMaxRad = 0.1;
  const Eigen::Vector3d mean = MeanCentre(rig);
  double spread = 0;
  for (const geometry::RigCamera& camera : rig.cameras) spread = std::max(spread, (camera.CenterInWorld() - mean).norm());
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const Eigen::Index row = begin[c + 1] - 6;
    const Eigen::Matrix<double, 6, 6> pose = joint.block<6, 6>(row, row);
    const double place = std::sqrt(CentreCovariance(rig.cameras[c].cam_from_world, pose).trace());
    const double turn = std::sqrt(pose.topLeftCorner<3, 3>().trace());
    if (!(place < kMaxOfSpread * spread && turn < kMaxRad)) return LooseCamera{rig.cameras[c].camera.name, place, turn};
  }
  return std::nullopt;
}

}  // namespace

std::string WhyLoose(const geometry::Rig& rig, const KeypointCovariance& covariance, bool views_agree) {
  if (covariance.status != Status::kOk) return covariance.message;
  auto loose = FirstLoose(rig, covariance.begin, covariance.from_geometry);
  if (!loose && views_agree) loose = FirstLoose(rig, covariance.begin, covariance.from_joints);
  if (!loose) return "";
  return Format("the points leave camera %s uncertain by %.0f mm and %.1f deg: they must be seen in more of the space",
                loose->name.c_str(), 1e3 * loose->place_m, RadToDeg(loose->turn_rad));
}

std::string WhyUnsteady(const geometry::Rig& rig, const KeypointCovariance& covariance) {
  const auto loose = FirstLoose(rig, covariance.begin, covariance.from_joints);
  if (!loose) return "";
  return Format("camera %s comes out differently from each part of the take, by %.0f mm and %.1f deg: the views do not agree",
                loose->name.c_str(), 1e3 * loose->place_m, RadToDeg(loose->turn_rad));
}

}  // namespace mvstudio::calib
