#include "avatar/io/lift/lift_samples.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "core/check.h"
#include "core/error.h"
#include "core/statistics.h"
#include "core/units.h"
#include "dataset/pose/cuts.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::avatar {
namespace {

using dataset::Coco19Pose;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kRoot = 2;
/// Each joint's neighbour towards the root, parents before children, and how freely it turns about that neighbour.
struct Link {
  int joint, parent;
  double freedom;
};
constexpr Link kLinks[] = {{0, 2, 1}, {6, 2, 0},   {12, 2, 0}, {1, 0, 0.5}, {3, 0, 0.3}, {9, 0, 0.3},
                           {4, 3, 1}, {10, 9, 1},  {7, 6, 1},  {13, 12, 1}, {5, 4, 1},   {11, 10, 1},
                           {8, 7, 1}, {14, 13, 1}, {15, 1, 0}, {17, 1, 0},  {16, 15, 0}, {18, 17, 0}};
constexpr std::pair<int, int> kMirror[] = {{3, 9}, {4, 10}, {5, 11}, {6, 12}, {7, 13}, {8, 14}, {15, 17}, {16, 18}};

double MeanLength(const Coco19Pose& pose, int a, int b, int a2, int b2) {
  double sum = 0;
  int count = 0;
  for (const auto& [i, j] : {std::pair{a, b}, std::pair{a2, b2}}) {
    if (!pose.valid[i] || !pose.valid[j]) continue;
    sum += (pose.x_in_world.col(i) - pose.x_in_world.col(j)).norm(), ++count;
  }
  return count > 0 ? sum / count : std::nan("");
}

bool CanBeLearned(const Coco19Pose& pose) {
  return pose.valid[kRoot] && std::count(pose.valid.begin(), pose.valid.end(), true) >= kMinLiftJoints;
}

Vector3d RandomDirection(Rng& rng) {
  const double z = rng.Uniform(-1, 1), angle = rng.Uniform(0, 2 * kPi), r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

/// Turns each joint about its parent together with all that hangs on it; bones keep their lengths.
Coco19Pose Turned(const Coco19Pose& pose, const std::array<Matrix3d, kLiftJoints>& turns) {
  Coco19Pose out = pose;
  std::array<Matrix3d, kLiftJoints> total;
  std::array<int, kLiftJoints> anchor{};  // nearest valid joint towards the root, itself included
  total.fill(Matrix3d::Identity());
  anchor.fill(kRoot);
  for (const Link& link : kLinks) {
    const int from = anchor[link.parent];
    total[link.joint] = total[link.parent] * turns[link.joint];
    anchor[link.joint] = pose.valid[link.joint] ? link.joint : from;
    if (!pose.valid[link.joint]) continue;
    out.x_in_world.col(link.joint) =
        out.x_in_world.col(from) + total[link.joint] * (pose.x_in_world.col(link.joint) - pose.x_in_world.col(from));
  }
  return out;
}

Coco19Pose Mirrored(const Coco19Pose& pose) {
  Coco19Pose out = pose;
  for (const auto& [left, right] : kMirror) {
    out.x_in_world.col(left).swap(out.x_in_world.col(right));
    std::swap(out.valid[left], out.valid[right]);
  }
  out.x_in_world.row(0) *= -1;
  return out;
}

std::array<Coco19Pose, kLiftWindow> RandomWindow(const LiftSequence& sequence, double jitter_rad, Rng& rng) {
  const int middle = sequence.middle[static_cast<size_t>(rng.Index(static_cast<int64_t>(sequence.middle.size())))];
  const int stride = static_cast<int>(1 + rng.Index(2)) * (rng.Index(2) == 0 ? 1 : -1);
  const bool mirror = rng.Index(2) == 0;
  std::array<Matrix3d, kLiftJoints> turns;
  turns.fill(Matrix3d::Identity());
  for (const Link& link : kLinks) {
    const Vector3d turn = jitter_rad * link.freedom * rng.Normal() * RandomDirection(rng);
    turns[link.joint] = geometry::RotationExp(turn).toRotationMatrix();
  }
  std::array<Coco19Pose, kLiftWindow> window;
  for (int f = 0; f < kLiftWindow; ++f) {
    const int i = middle + stride * (f - kLiftWindow / 2);
    if (i < 0 || i >= static_cast<int>(sequence.frames.size()) || !CanBeLearned(sequence.frames[i])) continue;
    window[f] = Turned(sequence.frames[i], turns);
    if (mirror) window[f] = Mirrored(window[f]);
  }
  return window;
}

/// The axes of a level camera, rows x, y, z, before errors of levelling.
Matrix3d RandomCamera(const LiftSampleOptions& o, Rng& rng) {
  const double yaw = rng.Uniform(0, 2 * kPi), pitch = DegToRad(rng.Uniform(o.min_pitch_deg, o.max_pitch_deg));
  Matrix3d cam_from_world;
  const Vector3d z(std::cos(yaw) * std::cos(pitch), std::sin(yaw) * std::cos(pitch), -std::sin(pitch));
  const Vector3d x = Vector3d(0, 0, -1).cross(z).normalized();
  cam_from_world << x.transpose(), z.cross(x).transpose(), z.transpose();
  return cam_from_world;
}

/// The detector: which joints it misses, how it errs, how sure it is.
std::array<LiftView, kLiftWindow> Detect(const std::array<Coco19Pose, kLiftWindow>& window, const Matrix3d& cam_from_world,
                                         const Vector3d& root_in_cam, double size_m, const LiftSampleOptions& o, Rng& rng) {
  const double angular = size_m / root_in_cam.z();
  const Vector3d root_in_world = window[kLiftWindow / 2].x_in_world.col(kRoot);
  const bool few_frames = rng.Uniform() < 0.2;
  std::array<LiftView, kLiftWindow> views;
  for (int j = 0; j < kLiftJoints; ++j) {
    const double quality = rng.Uniform();
    const bool missed = rng.Uniform() < o.drop;
    const double bias_x = o.bias * rng.Normal(), bias_y = o.bias * rng.Normal();
    for (int f = 0; f < kLiftWindow; ++f) {
      const double sigma = o.noise * (1.6 - 1.2 * quality), nx = sigma * rng.Normal(), ny = sigma * rng.Normal();
      const bool dropped = missed || rng.Uniform() < o.drop;
      if (!window[f].valid[j] || dropped) continue;
      const Vector3d x = cam_from_world * (window[f].x_in_world.col(j) - root_in_world) + root_in_cam;
      if (x.z() <= 0.1 * root_in_cam.z()) continue;
      views[f].ray_in_cam.col(j) << x.x() / x.z() + angular * (bias_x + nx), x.y() / x.z() + angular * (bias_y + ny), 1;
      views[f].score[j] = 0.3 + 0.7 * quality;
    }
  }
  for (int f = 0; f < kLiftWindow && few_frames; ++f) {
    if (f != kLiftWindow / 2 && rng.Index(2) == 0) views[f] = LiftView();
  }
  return views;
}

void Check(bool fine, const std::string& option, const std::string& range) {
  if (!fine) throw UsageError("option '" + option + "' must be " + range);
}

}  // namespace

void Validate(const LiftSampleOptions& o) {
  Check(o.pose_jitter_deg >= 0 && o.pose_jitter_deg <= 90, "pose-jitter-deg", "0 to 90");
  Check(o.min_distance >= 1 && o.min_distance <= o.max_distance, "min-distance", "1 to option 'max-distance'");
  Check(o.max_distance <= 1000, "max-distance", "at most 1000");
  Check(o.min_pitch_deg > -90 && o.min_pitch_deg <= o.max_pitch_deg, "min-pitch-deg",
        "above -90 and at most option 'max-pitch-deg'");
  Check(o.max_pitch_deg < 90, "max-pitch-deg", "below 90");
  Check(o.noise >= 0 && o.noise <= 0.2, "noise", "0 to 0.2");
  Check(o.bias >= 0 && o.bias <= 0.2, "bias", "0 to 0.2");
  Check(o.drop >= 0 && o.drop <= 0.5, "drop", "0 to 0.5");
}

double SizeOf(const Coco19Pose& pose) {
  return MeanLength(pose, 0, kRoot, 0, kRoot) + MeanLength(pose, 6, 7, 12, 13) + MeanLength(pose, 7, 8, 13, 14);
}

double MedianSize(const std::vector<Coco19Pose>& poses) {
  std::vector<double> sizes;
  for (const Coco19Pose& pose : poses) {
    const double size = SizeOf(pose);
    if (std::isfinite(size)) sizes.push_back(size);
  }
  return UpperMedian(std::move(sizes), 0);
}

std::vector<LiftSequence> LiftSequences(const dataset::PanopticDataset& data, const std::vector<int>& leave_out_frames) {
  const std::set<int> left_out(leave_out_frames.begin(), leave_out_frames.end());
  std::set<int> people;
  for (const auto& [frame, poses] : data.poses) {
    for (const auto& [person, pose] : poses) people.insert(person);
  }
  std::vector<LiftSequence> sequences;
  for (const int person : people) {
    LiftSequence s;
    s.name = data.sequence + ", person " + std::to_string(person);
    int next = 0;
    std::pair<int, const Coco19Pose*> last = {0, nullptr};
    for (const auto& [frame, poses] : data.poses) {
      constexpr int kFar = kLiftWindow * 2;  // longer gaps need not be known; no window reaches across
      const auto found = poses.find(person);
      const bool cut = last.second && found != poses.end() && dataset::IsCut(*last.second, found->second, frame - last.first);
      const int gap = s.frames.empty() ? 0 : cut ? kFar : std::min(frame - next, kFar);
      s.frames.insert(s.frames.end(), static_cast<size_t>(gap), Coco19Pose());
      next = frame + 1;
      if (found != poses.end()) last = {frame, &found->second};
      s.frames.push_back(found == poses.end() || left_out.count(frame) ? Coco19Pose() : found->second);
      if (CanBeLearned(s.frames.back())) s.middle.push_back(static_cast<int>(s.frames.size()) - 1);
    }
    s.size_m = MedianSize(s.frames);
    if (!s.middle.empty() && s.size_m > 0) sequences.push_back(std::move(s));
  }
  return sequences;
}

LiftSample TargetOf(const Coco19Pose& pose, const Matrix3d& view_from_world, double size_m) {
  LiftSample sample;
  sample.valid = pose.valid;
  for (int j = 0; j < kLiftJoints; ++j) {
    if (pose.valid[j]) {
      sample.target.col(j) = view_from_world * (pose.x_in_world.col(j) - pose.x_in_world.col(kRoot)) / size_m;
    }
  }
  return sample;
}

LiftSample RandomSample(const std::vector<LiftSequence>& sequences, const LiftSampleOptions& o, Rng& rng) {
  MVS_CHECK(!sequences.empty(), "no poses");
  for (int attempt = 0;; ++attempt) {
    MVS_CHECK(attempt < 1000, "no pose of the sequences can be seen by a random camera");
    const LiftSequence& sequence = sequences[static_cast<size_t>(rng.Index(static_cast<int64_t>(sequences.size())))];
    const auto window = RandomWindow(sequence, DegToRad(o.pose_jitter_deg), rng);
    const Matrix3d cam_from_world = RandomCamera(o, rng);
    const double distance = sequence.size_m * rng.Uniform(o.min_distance, o.max_distance);
    const auto views = Detect(window, cam_from_world, {0, 0, distance}, sequence.size_m, o, rng);
    const bool level = rng.Uniform() < 0.8;
    Vector3d up = cam_from_world.col(2);
    up += DegToRad(2) * Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
    LiftInput input = MakeLiftInput(views, level ? std::optional<Vector3d>(up) : std::nullopt);
    if (input.status != Status::kOk) continue;
    LiftSample sample = TargetOf(window[kLiftWindow / 2], input.cam_from_view.transpose() * cam_from_world, sequence.size_m);
    sample.input = std::move(input);
    return sample;
  }
}

}  // namespace mvstudio::avatar
