#include "avatar/run/lift/lift_samples.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "avatar/run/lift/pose_variation.h"
#include "core/check.h"
#include "core/error.h"
#include "core/statistics.h"
#include "core/units.h"
#include "dataset/pose/cuts.h"

namespace mvstudio::avatar {
namespace {

using dataset::Coco19Pose;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kRoot = 2;

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

std::array<Coco19Pose, kLiftWindow> RandomWindow(const LiftSequence& sequence, double jitter_rad, Rng& rng) {
  const int middle = sequence.middle[static_cast<size_t>(rng.Index(static_cast<int64_t>(sequence.middle.size())))];
  const int stride = static_cast<int>(1 + rng.Index(2)) * (rng.Index(2) == 0 ? 1 : -1);
  const bool mirror = rng.Index(2) == 0;
  PoseVariation variation;
  DrawTurns(jitter_rad, rng, &variation);
  std::array<Coco19Pose, kLiftWindow> window;
  for (int f = 0; f < kLiftWindow; ++f) {
    const int i = middle + stride * (f - kLiftWindow / 2);
    if (i < 0 || i >= static_cast<int>(sequence.frames.size()) || !CanBeLearned(sequence.frames[i])) continue;
    window[f] = Varied(sequence.frames[i], variation);
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
