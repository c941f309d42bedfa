#include "stages/triangulate/joint_views.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "core/format.h"
#include "core/statistics.h"
#include "stages/input/frame_images.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

constexpr int kShownSidePx = 480;
constexpr size_t kMostBytes = size_t{64} << 10, kMostBytesTogether = size_t{1} << 20;
constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();

/// What a time step has to show: keypoints with a 3D joint, by camera.
struct Step {
  std::map<int, int> keypoints;
  std::vector<double> rms_px;
  int total() const {
    int sum = 0;
    for (const auto& [camera, count] : keypoints) sum += count;
    return sum;
  }
};

std::map<int, Step> StepsOf(const triangulate::TakeResult& take) {
  std::map<int, Step> steps;
  for (size_t i = 0; i < take.points.size(); ++i) {
    if (take.points[i].point.status != Status::kOk) continue;
    Step& step = steps[take.points[i].frame];
    step.rms_px.push_back(take.points[i].point.rms_px);
    for (const triangulate::Observation& seen : take.observations[i]) ++step.keypoints[seen.camera_idx];
  }
  return steps;
}

/// The rich steps' one of median error; -1 without any.
int TypicalStep(const std::map<int, Step>& steps, const std::function<int(const Step&)>& count) {
  int most = 0;
  for (const auto& [time_step, step] : steps) most = std::max(most, count(step));
  if (most == 0) return -1;
  std::vector<std::pair<double, int>> rich;
  for (const auto& [time_step, step] : steps) {
    if (count(step) >= 0.9 * most) rich.emplace_back(LinearQuantile(step.rms_px, 0.5), time_step);
  }
  const auto middle = rich.begin() + static_cast<std::ptrdiff_t>(rich.size() / 2);
  std::nth_element(rich.begin(), middle, rich.end());
  return middle->second;
}

const NamedPath* FootageOf(const TakeImages& images, const std::string& camera) {
  const auto found =
      std::find_if(images.cameras.begin(), images.cameras.end(), [&](const auto& c) { return c.name == camera; });
  return found == images.cameras.end() ? nullptr : &*found;
}

/// The camera's frame of a time step, -1 where it has none.
int64_t FrameOf(const TakeImages& images, const std::string& camera, int time_step) {
  if (!FootageOf(images, camera)) return -1;
  if (!images.timeline) return time_step;
  const dataset::CameraTimeline* times = images.timeline->Find(camera);
  const bool known = times && time_step >= 0 && static_cast<size_t>(time_step) < times->frame_at.size();
  return known ? times->frame_at[static_cast<size_t>(time_step)] : -1;
}

/// Steps whose images are quickly read in every camera; all of them where no camera's are.
std::map<int, Step> Readable(const std::map<int, Step>& steps, const TakeImages& images) {
  std::map<std::string, int64_t> last;
  for (const NamedPath& camera : images.cameras) last[camera.name] = LastCheapFrame(camera.path);
  std::map<int, Step> readable;
  for (const auto& [time_step, step] : steps) {
    const auto reached = [&, at = time_step](const NamedPath& c) { return FrameOf(images, c.name, at) <= last[c.name]; };
    if (std::all_of(images.cameras.begin(), images.cameras.end(), reached)) readable.emplace(time_step, step);
  }
  return readable.empty() ? steps : readable;
}

JointView ViewOf(const geometry::RigCamera& camera, int camera_idx, int time_step, const triangulate::TakeResult& take,
                 int num_joints) {
  JointView view;
  view.camera_idx = camera_idx, view.time_step = time_step;
  const geometry::Projector projector(camera.camera);
  for (size_t i = 0; i < take.points.size(); ++i) {
    const triangulate::TakePoint& entry = take.points[i];
    if (entry.frame != time_step || entry.person < 0 || entry.joint_idx < 0 || entry.joint_idx >= num_joints) continue;
    const size_t at =
        static_cast<size_t>(entry.person) * static_cast<size_t>(num_joints) + static_cast<size_t>(entry.joint_idx);
    if (view.projected_px.size() <= at) {
      view.projected_px.resize(at + 1, {kNowhere, kNowhere});
      view.keypoint_px.resize(at + 1, {kNowhere, kNowhere});
    }
    for (const triangulate::Observation& seen : take.observations[i]) {
      if (seen.camera_idx == camera_idx) view.keypoint_px[at] = seen.px;
    }
    if (entry.point.status != Status::kOk) continue;
    const geometry::Projection projected = projector.Project(camera.cam_from_world * entry.point.x_in_world);
    if (projected.status == Status::kOk) view.projected_px[at] = projected.px;
  }
  return view;
}

std::vector<double> DistancesPx(const JointView& view) {
  std::vector<double> distances;
  for (size_t i = 0; i < view.projected_px.size(); ++i)
    distances.push_back((view.keypoint_px[i] - view.projected_px[i]).norm());
  return FiniteValues(distances);
}

FrameImage BoxOf(const JointView& view, const geometry::Camera& camera) {
  std::vector<Eigen::Vector2d> points = view.projected_px;
  points.insert(points.end(), view.keypoint_px.begin(), view.keypoint_px.end());
  return BoxAround(points, camera);
}

std::string ImageOf(const JointView& view, const FrameImage& box, const geometry::RigCamera& camera, const TakeImages& images,
                    size_t most_bytes) {
  if (view.frame < 0) return {};
  const auto read = ReadFrames(FootageOf(images, camera.camera.name)->path, {view.frame});
  if (read.empty()) return {};
  const Image& image = read.begin()->second;
  const bool fits = image.width == camera.camera.width_px && image.height == camera.camera.height_px;
  return fits ? SmallImage(image, box, kShownSidePx, most_bytes).jpeg : "";
}

ordered_json JointPointsJson(const JointView& view) {
  ordered_json joints = ordered_json::array();
  const auto number = [](double px) { return FiniteOrNull(std::round(px * 100) / 100); };
  for (size_t i = 0; i < view.projected_px.size(); ++i) {
    joints.push_back({number(view.projected_px[i].x()), number(view.projected_px[i].y()), number(view.keypoint_px[i].x()),
                      number(view.keypoint_px[i].y())});
  }
  return joints;
}

ordered_json ShownViewJson(const ShownView& shown) {
  const JointView& view = shown.view;
  const std::vector<double> distances = DistancesPx(view);
  return {{"camera", shown.camera},
          {"instant", view.time_step},
          {"frame", view.frame < 0 ? ordered_json() : ordered_json(view.frame)},
          {"median_px", FiniteOrNull(LinearQuantile(distances, 0.5))},
          {"max_px", FiniteOrNull(LinearQuantile(distances, 1))},
          {"num_points", distances.size()},
          {"box_px", {shown.x, shown.y, shown.width, shown.height}},
          {"picture", shown.image.empty() ? ordered_json() : ordered_json(shown.image)},
          {"joints", JointPointsJson(view)}};
}

}  // namespace

std::vector<JointView> ChooseJointViews(const geometry::Rig& rig, const triangulate::TakeResult& take, int num_joints,
                                        const TakeImages& images) {
  const std::map<int, Step> steps = Readable(StepsOf(take), images);
  const int common = TypicalStep(steps, [](const Step& step) { return step.total(); });
  std::vector<JointView> views;
  for (int c = 0; c < static_cast<int>(rig.cameras.size()); ++c) {
    const auto seen = [c](const Step& step) {
      const auto found = step.keypoints.find(c);
      return found == step.keypoints.end() ? 0 : found->second;
    };
    const bool sees = common >= 0 && seen(steps.at(common)) > 0;
    const int time_step = sees ? common : TypicalStep(steps, seen);
    if (time_step < 0) continue;
    const geometry::RigCamera& camera = rig.cameras[static_cast<size_t>(c)];
    views.push_back(ViewOf(camera, c, time_step, take, num_joints));
    views.back().frame = FrameOf(images, camera.camera.name, time_step);
  }
  return views;
}

JointViewReport WriteJointViews(const geometry::Rig& rig, const triangulate::TakeResult& take,
                                const geometry::Skeleton& skeleton, const TakeImages& images, const std::string& out) {
  JointViewReport report{{}, skeleton.bones, skeleton.joints.size()};
  const std::vector<JointView> views = ChooseJointViews(rig, take, static_cast<int>(report.num_joints), images);
  const size_t most = std::min(kMostBytes, kMostBytesTogether / std::max<size_t>(1, views.size()));
  std::vector<std::string> drawn, names;
  for (const JointView& view : views) {
    const geometry::RigCamera& camera = rig.cameras[static_cast<size_t>(view.camera_idx)];
    const FrameImage box = BoxOf(view, camera.camera);
    drawn.push_back(ImageOf(view, box, camera, images, most));
    names.push_back(Format("%02d_%08lld.jpg", view.camera_idx, static_cast<long long>(view.frame)));
    report.views.push_back({view, camera.camera.name, box.x, box.y, box.width, box.height});
  }
  const std::vector<std::string> paths = WriteImages(drawn, names, out + "/" + kJointViewsFolder);
  for (size_t i = 0; i < views.size(); ++i) report.views[i].image = paths[i];
  return report;
}

CommandResult DescribeJointViews(const JointViewReport& report) {
  CommandResult result;
  ordered_json rows = ordered_json::array();
  for (const ShownView& shown : report.views) {
    rows.push_back(ShownViewJson(shown));
    if (!shown.image.empty()) result.outputs.push_back({shown.image, "joint-view"});
  }
  result.metrics["overlays"] = {{"bones", report.bones}, {"num_joints", report.num_joints}, {"views", rows}};
  return result;
}

}  // namespace mvstudio::stages
