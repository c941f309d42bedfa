#include "dataset/exports/writers.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/statistics.h"
#include "dataset/colour/colour_match.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::exports {
namespace {

/// The joints, and every centimetre between them along the bones.
std::vector<Eigen::Vector3d> AlongBones(const dataset::Coco19Pose& pose) {
  constexpr double kStepM = 0.01;
  std::vector<Eigen::Vector3d> points;
  for (int j = 0; j < 19; ++j) {
    if (pose.valid[j]) points.emplace_back(pose.x_in_world.col(j));
  }
  for (const auto& [a, b] : geometry::Coco19().bones) {
    if (!pose.valid[a] || !pose.valid[b]) continue;
    const Eigen::Vector3d from = pose.x_in_world.col(a), to = pose.x_in_world.col(b);
    const int steps = std::clamp(static_cast<int>((to - from).norm() / kStepM), 1, 200);
    for (int k = 1; k < steps; ++k) points.emplace_back(from + (to - from) * (static_cast<double>(k) / steps));
  }
  return points;
}

std::vector<StartPoint> BonePoints(const Take& take, const People& people) {
  const std::vector<geometry::Projector> projectors = ProjectorsOf(take);
  std::vector<StartPoint> points;
  for (const auto& [id, pose] : people) {
    for (const Eigen::Vector3d& x : AlongBones(pose)) {
      StartPoint point{{x, {128, 128, 128}}, ViewsAround(take, projectors, x)};
      if (point.seen_by.size() >= 2) points.push_back(std::move(point));
    }
  }
  return points;
}

StartPoint Coloured(const dataset::ColourPoint& point) {
  StartPoint coloured;
  coloured.x_in_world = point.x_in_world;
  for (const auto& view : point.views) coloured.seen_by.push_back(static_cast<size_t>(view.camera_idx));
  for (int k = 0; k < 3; ++k) {
    std::vector<double> values;
    for (const auto& view : point.views) values.push_back(view.as_seen[k]);
    const double median = std::clamp(LinearQuantile(std::move(values), 0.5), 0.0, 1.0);
    coloured.rgb[static_cast<size_t>(k)] = static_cast<uint8_t>(std::lround(255 * median));
  }
  return coloured;
}

}  // namespace

void Job::Write(const std::string& path, const std::string& content) const {
  WriteFileAtomic(file.empty() ? folder + "/" + path : file, content);
  report->files.push_back(path);
}

geometry::Rig RigOf(const Take& take, const std::vector<size_t>& views) {
  geometry::Rig rig;
  for (const size_t i : views) {
    rig.cameras.push_back(take.views[i].camera);
    rig.cameras.back().params_covariance.reset();
    rig.cameras.back().cam_from_world_covariance.reset();
  }
  return rig;
}

std::vector<size_t> AllViews(const Take& take) {
  std::vector<size_t> all(take.views.size());
  std::iota(all.begin(), all.end(), size_t{0});
  return all;
}

std::vector<double> MatrixOf(const geometry::Camera& camera, double shift_px) {
  return {camera.fx(), 0, camera.cx() + shift_px, 0, camera.fy(), camera.cy() + shift_px, 0, 0, 1};
}

std::vector<double> RowsOf(const geometry::Rigid3& b_from_a) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = ToMatrix(b_from_a);
  return std::vector<double>(matrix.data(), matrix.data() + 16);
}

std::vector<geometry::Projector> ProjectorsOf(const Take& take) {
  std::vector<geometry::Projector> projectors;
  for (const View& view : take.views) projectors.emplace_back(view.camera.camera);
  return projectors;
}

std::vector<size_t> ViewsAround(const Take& take, const std::vector<geometry::Projector>& projectors,
                                const Eigen::Vector3d& x_in_world) {
  std::vector<size_t> views;
  for (size_t i = 0; i < take.views.size(); ++i) {
    const geometry::RigCamera& camera = take.views[i].camera;
    const geometry::Projection seen = projectors[i].Project(camera.cam_from_world * x_in_world);
    if (seen.status == Status::kOk && geometry::InImage(camera.camera, seen.px)) views.push_back(i);
  }
  return views;
}

std::vector<StartPoint> StartPoints(const Job& job, int frame) {
  const People& people = job.take.At(frame);
  if (people.empty() || job.options.hull_points <= 0) return {};
  dataset::ColourMatchOptions options;
  options.frames = 1;
  options.points = job.options.hull_points;
  options.min_overlap = 1;
  const auto image = [&](int camera, int f) { return job.images.LoadImage(static_cast<size_t>(camera), f); };
  const auto mask = [&](int camera, int f) { return job.images.LoadMask(static_cast<size_t>(camera), f); };
  const auto samples = dataset::SampleSurfaceColours(RigOf(job.take, AllViews(job.take)), {{frame, people}}, image, mask,
                                                     options, {nullptr, job.run.num_threads, job.run.seed});
  std::vector<StartPoint> points;
  for (const dataset::ColourPoint& point : samples) points.push_back(Coloured(point));
  if (points.empty()) points = BonePoints(job.take, people);
  job.report->points += static_cast<int>(points.size());
  return points;
}

void RequirePeople(const Job& job) {
  if (!job.take.PersonIds().empty()) return;
  throw FormatError(
      job.take.root, "hdPose3d_stage1_coco19",
      "the chosen frames hold nobody's joints, which is all that this format holds; choose other option 'frames'");
}

}  // namespace mvstudio::exports
