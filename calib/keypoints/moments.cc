#include "calib/keypoints/moments.h"

#include <algorithm>
#include <map>

#include "calib/keypoints/fit.h"
#include "core/error.h"
#include "triangulate/point/point.h"

namespace mvstudio::calib {

std::vector<NamedPoints> MomentsOf(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames,
                                   const std::vector<std::string>& joints, const KeypointRefineOptions& options) {
  constexpr size_t kMostFrames = 2000;
  std::vector<triangulate::DetectedFrame> used;
  const size_t count = std::min(frames.size(), kMostFrames);
  for (size_t i = 0; i < count; ++i) used.push_back(frames[i * frames.size() / count]);
  triangulate::AssociationOptions association;
  association.min_score = options.min_score, association.max_persons = options.max_persons;
  const std::vector<KeypointJoint> collected = CollectKeypoints(rig, used, association, {});
  std::map<std::pair<int, int>, NamedPoints> moments;  // frame, person
  for (const KeypointFit& fit : FitKeypoints(rig, collected, options.holdout_scale_px, 2, 1)) {
    const auto joint = static_cast<size_t>(fit.joint->joint_idx);
    if (fit.ok && joint < joints.size()) moments[{fit.joint->frame, fit.joint->person}][joints[joint]] = fit.x_in_world;
  }
  std::vector<NamedPoints> ordered;
  for (auto& [key, points] : moments) ordered.push_back(std::move(points));
  return ordered;
}

NamedPoints PointsOfMarks(const geometry::Rig& rig, const ScenePoints& marks) {
  std::vector<std::vector<triangulate::Observation>> seen(marks.names.size());
  for (const PointClick& click : marks.clicks) {
    const std::string& name = marks.cameras[static_cast<size_t>(click.camera_idx)];
    triangulate::Observation observation;
    observation.camera_idx = rig.Find(name), observation.px = click.px;
    if (observation.camera_idx < 0) throw UsageError("points are marked in camera " + name + ", which the calibration lacks");
    seen[static_cast<size_t>(click.point_idx)].push_back(observation);
  }
  const triangulate::PreparedRig prepared = triangulate::Prepare(rig);
  triangulate::PointOptions options;
  options.method = triangulate::PointMethod::kAllViews;
  NamedPoints points;
  for (size_t p = 0; p < seen.size(); ++p) {
    const triangulate::Point point = triangulate::TriangulatePoint(prepared, seen[p], options);
    if (point.status == Status::kOk) points[marks.names[p]] = point.x_in_world;
  }
  return points;
}

std::vector<KnownLength> KnownLengthsOf(const std::vector<StatedLength>& lengths, const std::vector<std::string>& joints) {
  const auto index = [&](const std::string& name) {
    return static_cast<int>(std::find(joints.begin(), joints.end(), name) - joints.begin());
  };
  std::vector<KnownLength> known;
  for (const StatedLength& length : lengths) known.push_back({{index(length.from), index(length.to)}, length.length_m});
  return known;
}

}  // namespace mvstudio::calib
